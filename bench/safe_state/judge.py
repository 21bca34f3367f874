"""Whether an outcome keeps what is declared."""

from bench.safe_state.events import BROKEN, CUT, Outcome
from hil.ending import Ending


def judged(event: str, outcome: Outcome) -> list[str]:
    """What is not as declared; [] if everything is."""
    wrong: list[str] = []
    if event in (*CUT, *BROKEN):
        # an age is seen at the next tick, and a busy host's tick is late
        bound = outcome.declared_s + outcome.late_s
        if outcome.safe_after_s is None or not outcome.safe_after_s <= bound:
            wrong.append(
                f"safe limits after {outcome.safe_after_s} s, declared {outcome.declared_s} s, late {outcome.late_s} s"
            )
    elif outcome.unforced_s is not None:
        wrong.append(f"the machine was on safe limits {outcome.unforced_s} s after {event}")
    if event in BROKEN and (outcome.frames or outcome.exit_code != Ending.MISUSED):
        wrong.append(f"{outcome.frames} frames were sent, exit code {outcome.exit_code}")
    if event == "full disk" and outcome.exit_code != Ending.FAILED:
        wrong.append(f"the recorder ended with exit code {outcome.exit_code}")
    return wrong
