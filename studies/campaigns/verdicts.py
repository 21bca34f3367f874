"""The aims of the campaigns as test cases, for scripts and build servers; the tables hold the figures behind them."""

from collections.abc import Sequence

import numpy as np

from hil.results import Case, Suite
from hil.verdict import Result as Verdict
from studies.campaigns.batch import Result


def accuracy(name: str, result: Result, target: float) -> Case:
    """Whether the normal forces of a drive are as accurate as aimed at. target: largest RMS over the load that a wheel carries standing."""
    # the worst wheel decides: a mean over four hides the one that is about to lift
    worst = float(np.max(np.array(result["rms"]) / result["standing"]))
    # a wheel without one valid frame has no error, and NaN is within nothing
    verdict = (
        Verdict.INCONCLUSIVE if np.isnan(worst) else Verdict.PASSED if worst <= target else Verdict.FAILED
    )
    reason = f"{100 * worst:.1f} % of the standing load at the worst wheel, {100 * result['valid']:.1f} % of the frames valid"
    return Case(name=f"{name}: normal forces within {100 * target:.0f} % RMS", result=verdict, reason=reason)


def roll_over(grid: str, results: Sequence[Result], least_margin: float) -> Suite:
    """Whether every lift-off of a grid of turns is announced and prevented, and no turn is warned of without need.

    least_margin: share of the standing load that every wheel keeps in a turn without need of a warning.
    """
    lifting = [r for r in results if r["lift_off_s"] is not None]
    calm = [r for r in results if r["lift_off_s"] is None and r["margin"] > least_margin]
    late = sum(r["lead_s"] is None or r["lead_s"] <= 0.0 for r in lifting)
    return Suite(
        name=grid,
        cases=(
            _none("a warning ahead of every lift-off", late, len(lifting), "turns that lift are warned of late or never"),
            _none(
                "no false alarm", sum(bool(r["false_alarm"]) for r in calm), len(calm),
                f"turns in which every wheel keeps more than {100 * least_margin:.0f} % are warned of",
            ),
            _none(
                "no wheel lifts with the limits on", sum(bool(r["limited_lifts"]) for r in lifting), len(lifting),
                "turns still lift a wheel",
            ),
        ),
    )  # fmt: skip


def _none(question: str, broken: int, among: int, what: str) -> Case:
    if not among:
        return Case(name=question, result=Verdict.INCONCLUSIVE, reason="no such turn in the grid")
    return Case(
        name=question,
        result=Verdict.FAILED if broken else Verdict.PASSED,
        reason=f"{broken} of {among} {what}",
    )
