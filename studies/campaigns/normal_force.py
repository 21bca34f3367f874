"""Accuracy of the ECU's normal forces against the plant's truth, in every drive case and in both forms.

Each case runs once per form with the limits off, so that both forms see the same drive. The error of a frame is its value minus the true
force at the time when the frame arrived; it includes the age of the sample, computation and transmission. Frames marked invalid, and all
frames after the first lift-off, are left out: after lift-off the estimate is the (negative) force that would hold the wheel down.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ecu.calibration import load_calibration
from ecu.core import Form
from hil.compose import Choice, calibration_of, lockstep
from hil.ecu_side import FORMS
from hil.lockstep import Recording
from hil.results import Suite
from hil.verdict import WHEELS, first_lift_off
from plant.unit.scenario import list_scenarios
from studies.campaigns.ablation import VARIANTS, estimated, inputs_of
from studies.campaigns.batch import Result, header, markdown_table, results_of
from studies.campaigns.memory import columns_of
from studies.campaigns.verdicts import accuracy

COMMAND = "loaderhil campaign normal-force"
FILE = "normal_force.md"
WHEEL_SIGNALS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
KN = 1e3
CACHE = Path("out/campaign/normal-force")
PILE_AND_LOCK = frozenset({"pile_entry", "wheel_lock"})
# A pile carries a part of the weight, which no sensor reads, and a locked wheel's slip says nothing of its force.
INSIDE, OUTSIDE = 0.08, 0.03
"""Targets of the RMS of every wheel over its static load: in the drive cases with a pile or locked wheels, and in all others."""


@dataclass(frozen=True, slots=True)
class Case:
    """One drive case with one form of the estimators."""

    scenario: str
    form: Form


@dataclass(frozen=True, slots=True)
class Series:
    """The estimates of a run: arrival (n,) [s], normal force (n, 4) [N], valid (n, 4)."""

    time_s: NDArray[np.float64]  # arrival at the machine, not the time of the sample: age counts as error
    force: NDArray[np.float64]
    valid: NDArray[np.bool_]  # as the ECU marks each wheel


def run_case(case: Case) -> Result:
    """RMS error per wheel [N], standing load per wheel [N], share of frames that were valid, frames used."""
    # as the command line loads it: machine, equipment and calibration belong together
    scenario = Choice(scenario=case.scenario).load()
    recording = lockstep(scenario, form=case.form, limits=False, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.normal_force for truth in recording.truth])
    result = errors_of(estimates_of(recording), time, force) | {"seed": scenario.seed}
    if case.form == "corrected":
        result["ablation"] = ablation(recording, time, force, calibration_of(scenario))
    return result


def ablation(
    recording: Recording, time_s: NDArray[np.float64], force: NDArray[np.float64], name: str
) -> dict[str, float]:
    """Per variant of the estimate: RMS error of the worst wheel over what it carries standing."""
    calibration = load_calibration(name)
    times, inputs = inputs_of(recording.bus, calibration)
    worst = {}
    # the same recorded frames for every variant: differences come from the estimator, not from another noise
    for variant, (arrival, estimate) in estimated(inputs, calibration.parameters, times).items():
        # recomputed without the ECU's checks, so nothing marks a value invalid
        series = Series(arrival, estimate, np.ones(estimate.shape, bool))
        result = errors_of(series, time_s, force)
        worst[variant] = float(np.max(np.array(result["rms"]) / result["standing"]))
    return worst


def estimates_of(recording: Recording) -> Series:
    """The NormalForces frames of a run."""
    columns = columns_of(recording.bus)["NormalForces"]
    force = np.stack([columns.signals[name] for name in WHEEL_SIGNALS], axis=-1) * KN
    valid = np.stack([columns.signals[f"{name}Valid"] for name in WHEEL_SIGNALS], axis=-1)
    return Series(columns.time_s, force, valid > 0)


def errors_of(series: Series, time_s: NDArray[np.float64], force: NDArray[np.float64]) -> Result:
    """Errors of the estimates against the truth (time_s (n,), force (n, 4) [N])."""
    lift = first_lift_off(time_s, force)
    end = lift[0] if lift else float(time_s[-1])
    # a lifted wheel has no force, and the estimate is then the pull that would hold it down: no common meaning
    judged = series.time_s <= end
    rms = []
    for wheel in range(4):
        used = judged & series.valid[:, wheel]
        # frames arrive between the ticks of the plant, at which the truth is recorded
        true = np.interp(series.time_s[used], time_s, force[:, wheel])
        error = series.force[used, wheel] - true
        rms.append(float(np.sqrt(np.mean(error**2))) if used.any() else float("nan"))
    return {
        "rms": rms,
        "standing": force[0].tolist(),  # every case starts in equilibrium
        "valid": float(np.mean(series.valid[judged])) if judged.any() else 0.0,
        "until": end,
        "lifts": lift is not None,
    }


def run_campaign(out: Path, jobs: int | None = None) -> tuple[Path, list[Suite]]:
    """Run every case and write the table; returns it, and whether the corrected form is as accurate as aimed at."""
    cases = [Case(summary.name, form) for summary in list_scenarios() for form in FORMS]
    results = results_of(cases, run_case, cache=CACHE, jobs=jobs, title="drive cases")
    file = out / FILE
    out.mkdir(parents=True, exist_ok=True)
    file.write_text(table(cases, results))
    # the printed form is what the campaign compares with; nothing is aimed at with it
    aimed = [(c, r) for c, r in zip(cases, results, strict=True) if c.form == "corrected"]
    return file, [
        Suite(name="normal force", cases=tuple(accuracy(c.scenario, r, target_of(c)) for c, r in aimed))
    ]


def table(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """The document."""
    rows = [_row(case, result) for case, result in zip(cases, results, strict=True)]
    text = header("Normal force: estimate against plant truth", COMMAND, "seeds of the scenarios")
    return (
        text
        + INTRODUCTION
        + markdown_table(("drive case", "form", *WHEELS, "valid", "target", "met"), rows)
        + _note(cases, results)
        + ABLATION
        + ablation_table(cases, results)
    )


INTRODUCTION = """
RMS of estimate minus truth, per wheel, in N and in % of the load that the wheel carries standing in the same
case. *Corrected*: the estimators' equations with their errata repaired; *printed*: as the thesis prints them.
Both forms see the same drive (limits off) and the same noisy, quantised, delayed sensors; an estimate is compared
with the truth of the moment its frame arrives. *valid*: share of frames that the ECU marks valid; others do not count.
*target*: for every wheel, in % of its standing load.

"""


ABLATION = """
## What brings how much

RMS of the worst wheel in % of its standing load, corrected form, on the same recorded drives with one source taken away.

"""


def ablation_table(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """One row per variant, one column per drive case."""
    shown = [
        (case.scenario.replace("_", " "), result["ablation"])
        for case, result in zip(cases, results, strict=True)
        if "ablation" in result
    ]
    rows = [[name, *(f"{100 * worst[name]:.1f}" for _, worst in shown)] for name in VARIANTS]
    return markdown_table(("", *(name for name, _ in shown)), rows)


def _row(case: Case, result: dict[str, Any]) -> list[str]:
    cells = [
        f"{rms:.0f} ({100 * rms / standing:.1f} %)"
        for rms, standing in zip(result["rms"], result["standing"], strict=True)
    ]
    name = case.scenario.replace("_", " ") + (" ¹" if result["lifts"] else "")
    target = target_of(case)
    # the worst wheel decides: a mean over four hides the one that is about to lift
    met = max(np.array(result["rms"]) / result["standing"]) <= target
    outcome = [f"{100 * result['valid']:.1f} %", f"{100 * target:.0f} %", "yes" if met else "no"]
    return [name, case.form, *cells, *outcome]


def target_of(case: Case) -> float:
    """Largest RMS over the standing load that is aimed at."""
    return INSIDE if case.scenario in PILE_AND_LOCK else OUTSIDE


def _note(cases: Sequence[Case], results: Sequence[Result]) -> str:
    ends = {
        case.scenario: result["until"] for case, result in zip(cases, results, strict=True) if result["lifts"]
    }
    if not ends:
        return ""
    named = ", ".join(f"{name.replace('_', ' ')} {end:.2f} s" for name, end in ends.items())
    return f"\n¹ up to the first lift-off: {named}.\n"
