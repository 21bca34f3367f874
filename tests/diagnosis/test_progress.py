"""A diagnosis shows that it lives."""

import io
import re
import threading

from rich.console import Console

from diagnosis.progress import repeated, shown_progress


def shown_while(step: str) -> list[str]:
    """What is shown while one step lasts, three times or more."""
    shown: list[str] = []
    third = threading.Event()

    def show(text: str) -> None:
        shown.append(text)
        if len(shown) == 3:
            third.set()

    with repeated(show, 0.01) as progress:
        progress(step)
        assert third.wait(30.0)
    count = len(shown)
    assert threading.active_count() == len([t for t in threading.enumerate() if t.name != "progress"])
    assert len(shown) == count
    return shown


def test_a_long_step_is_shown_again_until_it_ends() -> None:
    first, *again = shown_while("fitting")
    assert first == "fitting"
    assert set(again) == {"fitting (still)"}


def test_steps_that_follow_quickly_are_shown_once_each() -> None:
    shown: list[str] = []
    with repeated(shown.append, 1000.0) as progress:
        for step in ("reading", "screening", "fitting"):
            progress(step)
    assert shown == ["reading", "screening", "fitting"]


def test_without_a_terminal_every_step_is_a_line_with_its_time(capsys) -> None:  # type: ignore[no-untyped-def]
    with shown_progress(Console(file=io.StringIO()), 1000.0) as progress:
        progress("reading")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(" s  reading")


def test_on_a_terminal_results_stay_and_steps_do_not() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=200)
    with shown_progress(console, 1000.0) as progress:
        progress("reading")
        progress("leak [x]: evidence 37 (threshold 18)")
        progress("fitting")
    out = console.file
    assert isinstance(out, io.StringIO)
    # the spinner draws when it likes, also in front of a line that stays: a line that stays begins with its time
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue())
    kept = [line for line in re.split(r"[\r\n]", plain) if re.match(r" *\d+\.\d s  ", line)]
    assert len(kept) == 1
    assert kept[0].rstrip().endswith("leak [x]: evidence 37 (threshold 18)")


def test_a_long_text_is_shown_whole_once_and_then_by_its_beginning() -> None:
    result = "without any effect: 4 of 16 channels beyond their error budgets; wheel_speed_rear_right is simulated to 0.25 rad/s"
    first, *again = shown_while(result)
    assert first == result
    assert set(again) == {"without any effect: 4 of 16 channels beyond their error bud… (still)"}
