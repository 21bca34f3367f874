"""`loaderhil standards`: table, page, exit codes, wrong names."""

import pytest
import typer
from typer.testing import CliRunner

from hil.ending import Ending
from hil.results import ending_of
from studies.standards import command
from studies.standards.check import Bound, Check, Clause
from studies.standards.page import figure, row
from studies.standards.table import by_name, candidate_of


def run(*arguments):
    app = typer.Typer()
    command.register(app)
    return CliRunner().invoke(app, list(arguments))


def test_every_name_has_its_test():
    assert [by_name(name).name for name in command.NAMES] == list(command.NAMES)


def test_it_writes_a_page_and_prints_what_was_measured(tmp_path):
    done = run("tipping", "--out", str(tmp_path))
    assert done.exit_code == Ending.PASSED
    assert "rated operating capacity" in done.output
    page = (tmp_path / "standards.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 1
    assert "ISO 14397-1" in page


def test_a_broken_bound_is_an_exit_code(tmp_path):
    done = run("tipping", "--set", "machine.payload.reference_mass_kg=4500", "--out", str(tmp_path))
    assert done.exit_code == Ending.FAILED
    assert "FAILED" in done.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("tiping",), "no standard named 'tiping'"),
        (("tipping", "--machine", "l61"), "no machine named 'l61'"),
        (("tipping", "--set", "surface.friction=0.3"), "begin with machine. or equipment."),
        (("tipping", "--set", "machine.payload.mass=1"), "payload.mass"),
    ],
)
def test_an_error_is_reported_in_one_line(words, message, tmp_path):
    problem = run(*words, "--out", str(tmp_path)).exception
    assert message in str(problem)
    assert "\n" not in str(problem)


CLAUSE = Clause(source="A", detail="b", verified=False)


def test_verdicts_and_ending():
    kept, broken, missing = (
        Check(what="", unit="m", measured=value, bound=Bound("at most", 2.0, CLAUSE))
        for value in (2.0, 2.1, float("nan"))
    )
    informs = Check(what="", unit="m", measured=9.0)
    assert ending_of(check.result for check in [kept, informs]) is Ending.PASSED
    assert ending_of(check.result for check in [kept, missing]) is Ending.INCONCLUSIVE
    assert ending_of(check.result for check in [kept, missing, broken]) is Ending.FAILED
    least = Check(what="", unit="m", measured=1.9, bound=Bound("at least", 2.0, CLAUSE))
    assert ending_of(check.result for check in [least]) is Ending.FAILED


def test_an_unverified_formula_is_marked_wherever_it_is_shown():
    check = Check(what="", unit="m", measured=1.0, bound=Bound("at most", 2.0, CLAUSE))
    assert row(check, short=True)[-1] == "A *"
    assert "unverified" in row(check, short=False)[-1]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (7132.4, "7 132 m"),
        (1e-13, "0 m"),
        (9.3041, "9.304 m"),
        (float("nan"), "not reached"),
        (float("inf"), "no rest"),
    ],
)
def test_figures_are_readable(value, shown):
    assert figure(value, "m") == shown


def test_a_machine_comes_with_what_its_family_is_fitted_with():
    assert candidate_of("compact", None, []).equipment.name == "compact"
    assert candidate_of("compact", "l60", []).equipment.name == "l60"
