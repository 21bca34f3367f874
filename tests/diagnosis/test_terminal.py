"""The result of a diagnosis on the terminal."""

import io
from dataclasses import replace

from rich.console import Console

from diagnosis.terminal import render
from discrepancy.examine import examine
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Findings
from tests.discrepancy.toys import record, tank


def test_it_names_the_effect_its_size_and_ruled_out_effects() -> None:
    out = io.StringIO()
    render(examine(tank(), [record(2, leak=0.08)], Settings()), Console(file=out, width=160))
    text = out.getvalue()
    for expected in ("explained", "leak = 0.0", "closes", "ruled out", "level delay"):
        assert expected in text


def test_reasons_longer_than_the_terminal_are_wrapped_not_cut() -> None:
    out = io.StringIO()
    reason = "no effect and no function of the known signals improves the prediction of held-out data " * 2
    result = Findings(model="tank", recordings=["r"], status="nothing missing", reasons=[reason.strip()])
    render(result, Console(file=out, width=60, soft_wrap=True))
    words = [w for line in out.getvalue().splitlines() for w in line.strip("│ ").split()]
    assert " ".join(words).count("held-out data") == 2


def test_names_are_whole_in_a_terminal_of_80_columns() -> None:
    """Three of four wheels' sensors read alike where the ends of their names were cut off."""
    result = examine(tank(), [record(1)], Settings(open_ended=False))
    long = [
        replace(c, effect=f"wheel_speed_front_{side} scale", verdict="could not be judged")
        for c, side in zip(result.candidates, ("left", "right"), strict=False)
    ]
    out = io.StringIO()
    render(replace(result, candidates=long), Console(file=out, width=80))
    for candidate in long:
        assert any(line.startswith(candidate.effect) for line in out.getvalue().splitlines())
