"""What the tool says to do next: the commands work as printed, and nothing is advised that the findings do not ask for."""

import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from diagnosis.advice import advice
from diagnosis.page.sentences import headline
from discrepancy.signals.findings import BaselineValue, Estimate, Findings, Separation
from discrepancy.signals.recording import Complaint
from loaderhil import cli
from tests.diagnosis.cases import Call, columns, finding, loaderhil, model_file, unseen, write_csv
from tests.discrepancy.toys import record

__all__ = ["loaderhil"]
NOTHING = Findings(model="tank", recordings=["a.csv"], status="nothing missing", reasons=[])
BLIND = unseen("leak", "a typical one would hardly be noticed here; needs a high level")


def test_nothing_is_advised_where_nothing_is_left_to_do() -> None:
    assert advice(NOTHING, "tank.py", Path("out")) == []


def test_each_thing_to_do_has_its_step_and_what_is_wrong_comes_first() -> None:
    way = Separation(effect="slope", manoeuvre="stand on level ground", expected_difference=None)
    late = replace(
        finding("level delay", "sensor", {"level.delay": 0.2}, group=["slope"]),
        place="sensor of level",
        sentence="level comes late",
        separate_by=[way],
    )
    result = replace(
        NOTHING,
        status="explained",
        findings=[late, finding("drag", "physics", {"drag": 1.0}, named=False)],
        candidates=[BLIND],
        complaints=[Complaint("b.csv", "", "is empty", fatal=True), Complaint("a.csv", "level", "2 of 9 are no numbers")],
    )  # fmt: skip
    steps = advice(result, "tank.py", Path("out"))
    for step, words in zip(
        steps,
        (
            "diagnose again: b.csv.",
            "Check the sensor of level: level comes late, level.delay = 0.2",
            "Do not take drag as the cause",
            "stand on level ground",
            "--apply FILE.toml",
            "record a high level (leak)",
        ),
        strict=True,
    ):
        assert words in step
    assert not any("--apply" in step for step in advice(result, "tank.py", Path("out"), applied=True))


def test_what_holds_of_several_best_proxies_is_said_once() -> None:
    proxies = [finding(name, "physics", {name: 1.0}, named=False) for name in ("drag", "slope", "bias")]
    where = replace(proxies[1].where, channels={"height": 1.0})
    proxies[1] = replace(proxies[1], sse_reduction=9.0, where=where)
    [said] = [
        s
        for s in advice(replace(NOTHING, status="unknown", findings=proxies), "tank.py", None)
        if "Do not take" in s
    ]
    assert "drag, slope, bias" in said
    assert "shows: height" in said


def test_recordings_that_do_not_fit_together_may_be_judged_each_by_itself() -> None:
    unknown = replace(NOTHING, status="unknown", recordings=["a.csv", "b.csv"])
    assert "`--each`" in advice(unknown, "tank.py", None)[0]
    assert advice(replace(unknown, recordings=["a.csv"]), "tank.py", None) == []


def test_the_command_that_is_advised_for_an_equation_works_as_printed(
    loaderhil: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    odd = write_csv(tmp_path / "odd.csv", columns(record(5, square=0.02, noise=0.005)))
    model, folder = model_file(tmp_path, "level scale", "level bias"), tmp_path / "first result"
    first = loaderhil("diagnose", odd, "--model", model, folder=folder)
    [command] = re.findall("`(loaderhil effects add [^`]*)`", first.out)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", shlex.split(command.replace("NAME", "drain")))
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert not ended.value.code
    again = loaderhil("diagnose", odd, "--model", "drain.py")
    assert again.result is not None
    assert again.result.named == ["drain"]
    assert again.code == 0


def test_a_value_or_an_effect_is_asked_on_the_first_screen_and_in_the_next_steps() -> None:
    size = Estimate(name="area", value=1.0, low=0.99, high=1.01, unit="m^2", baseline=1.3)
    value = BaselineValue(estimate=size, prior_sd=0.026, away=11.5, sure=False, or_effects=["level scale"])
    result = replace(
        NOTHING,
        status="explained in part",
        findings=[finding("leak", "physics", {"leak": 0.05})],
        baseline_values=[value],
    )
    assert (
        "Measure the baseline's area by itself: if it is what was assumed, look for level scale."
        in advice(result, "tank", None)
    )
    assert headline(result).endswith(
        "Either the baseline's area is wrong, or level scale acts: these recordings cannot distinguish them."
    )
    assert "Either" not in headline(replace(result, baseline_values=[]))


@pytest.mark.parametrize(
    ("baseline", "at_bound", "count"), [(None, "lower", 1), (None, None, 0), (0.0, "upper", 0)]
)
def test_a_shape_at_the_end_of_its_range_asks_for_a_wider_one(
    baseline: float | None, at_bound: str | None, count: int
) -> None:
    """The bound of a size is physics: a share is at most 1. That of a shape may only say where to look."""
    slow = finding("slow voltage", "physics", {"tau": 150.0})
    end = replace(slow.parameters[0], unit="s", baseline=baseline, at_bound=at_bound)
    result = replace(NOTHING, status="explained", findings=[replace(slow, parameters=[end])])
    steps = [step for step in advice(result, "cell.py", None) if "Widen the range of tau" in step]
    assert len(steps) == count
    assert all("(`lower`)" in step and "150 s" in step for step in steps)
