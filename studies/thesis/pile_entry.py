"""Question: which pressure shows the loads while the bucket is in the pile (thesis 4.5.7, 5.3.5)?

Two entries into the same pile, empty bucket level at the ground: in one the arm lifts afterwards, in the other the bucket rolls back.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ecu.estimators.loads.cog import rotated
from ecu.estimators.loads.payload import residual
from ecu.estimators.parameters import Parameters
from ecu.estimators.signals import Inputs
from plant.effects import effects
from plant.effects.effect import ActiveEffect
from plant.unit.scenario import Scenario, Start
from plant.unit.script import Script
from studies.thesis.drive import Array, Truths, drive_case, driven, estimated, inputs_of, line, repaired
from studies.thesis.questions import Answer, Row
from studies.thesis.split import SHEET, SPLITS, Split, parameters_of

LIFTING, ROLLING = "arm lifts", "bucket rolls back"
TITLES = {LIFTING: "in the pile the arm lifts", ROLLING: "in the pile the bucket rolls back"}
REACHED_S = 2.2  # the edge is in the pile, and the jolt of the first touch is over
MOVES_S = 3.8  # arm or bucket begins to move
END_S = 6.0
PILE = {"distance_m": 7.5, "most_N": 45e3, "weight_share": 0.3}
WHOLE = {"pivot_arm": 1.0, "centripetal": 1.0, "trunnion": 1.0}
FORMS = ("printed", "lift pressure", "tilt pressure", "corrected")


def pile() -> ActiveEffect:
    """A pile that resists with up to 45 kN and weighs on the bucket with 30 % of what it bears."""
    return effects()["pile_entry"].of(**PILE)


def entry(case: str) -> Scenario:
    """Into the pile at 1.6 m/s, bucket level at the ground; then arm or bucket moves."""
    lift = line((MOVES_S, 0.0), (4.0, 0.4), (END_S, 0.4)) if case == LIFTING else None
    tilt = line((MOVES_S, 0.0), (4.0, 0.14), (END_S, 0.14)) if case == ROLLING else None
    script = Script(speed=line((0.0, 1.6)), lift=lift, tilt=tilt)
    start = Start(speed=1.6, lift_arm_angle=math.radians(-44.0), tilt_angle=0.0)
    return drive_case(END_S, start=start, script=script)


@dataclass(frozen=True, slots=True)
class Run:
    """One entry: truth, and the load of the front axle by form (n,) [N]."""

    truth: Truths
    front: Mapping[str, Array]

    @property
    def true(self) -> Array:
        """Load of the front axle [N]."""
        return np.asarray(self.truth["normal_force"][:, :2].sum(axis=1))

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Moments with the edge in the pile, its first touch left out."""
        return np.asarray(self.truth["time_s"] > REACHED_S)

    def rms(self, form: str) -> float:
        """Error of the front axle's load in the pile [N]."""
        error = (self.front[form] - self.true)[self.inside]
        return float(np.sqrt(np.mean(error**2)))

    def alike(self, pressure: str) -> float:
        """Correlation of a pressure with the front axle's load."""
        return float(np.corrcoef(self.truth[pressure][self.inside], self.true[self.inside])[0, 1])


def measure(case: str, split: Split = SHEET) -> Run:
    """Drive once; printed (payload known), with a vertical force from one pressure, corrected (both pressures and traction)."""
    truth = driven(entry(case), split, pile())
    # all corrections but the pile's force: what the pressures add is then visible by itself
    base = repaired(truth, split, **WHOLE)[:, :2].sum(axis=1)
    changes = {name: from_one(truth, name, parameters_of(split)) for name in ("lift", "tilt")}
    front = {
        "printed": repaired(truth, split)[:, :2].sum(axis=1),
        **{f"{name} pressure": base + change for name, change in changes.items()},
        "corrected": estimated(truth, split, "corrected")["normal_force"][:, :2].sum(axis=1),
    }
    return Run(truth, front)


def from_one(truth: Truths, which: str, p: Parameters) -> Array:
    """Change of the front axle's load [N] if one pressure is read as a vertical force on the cutting edge.

    which: 'lift' takes the moment about the arm's pivot, the tilt pressure as it was before; 'tilt' the one about the pin.
    """
    rows = inputs_of(truth)
    if which == "lift":
        # what one sensor alone can know: the weight in the bucket from before the pile
        rows[:, Inputs._fields.index("tilt_pressure")] = truth["tilt_pressure"][0]
    found = []
    for row in rows.tolist():
        i = Inputs(*row)
        r = residual(i, i.specific_force_x, i.specific_force_z, p)
        px, _ = rotated(p.arm.length, 0.0, i.lift_arm_angle)
        ex, _ = rotated(p.digging.edge_forward, p.digging.edge_above, i.tilt_angle - p.bucket.carried)
        # the moment divided by the horizontal arm of the edge: about the arm's pivot, or about the bucket's pin
        upward = -(r.weight + r.place) / (px + ex) if which == "lift" else -r.place / ex
        # moment about the rear axle over the wheelbase: the share of the force that the front axle carries
        found.append(-(p.arm.pivot_x + px + ex + p.geometry.rear_length) * upward)
    return np.array(found) / (p.geometry.front_length + p.geometry.rear_length)


def answer() -> Answer:
    """Both entries with the sheet's masses, and the splits."""
    runs = {case: measure(case) for case in TITLES}
    many = {case: [measure(case, split) for split in SPLITS] for case in TITLES}
    lifting, rolling = runs[LIFTING], runs[ROLLING]
    worst = max(run.rms("corrected") for found in many.values() for run in found)
    text = (
        f"An empty bucket goes level into a pile that resists with up to {PILE['most_N'] / 1e3:.0f} kN and weighs on its edge with {100 * PILE['weight_share']:.0f} % of that; the front axle's load rises from "
        f"{lifting.true[0] / 1e3:.0f} to {lifting.true.max() / 1e3:.0f} kN. The printed estimator has no such force and stays where it was, {_both(runs, 'printed')} off in the pile (RMS of the axle, arm lifting and bucket rolling back); the thesis says it *can not predict the load distribution*.",
        f"Which pressure looks like the load depends on what the driver does next, in one and the same pile. While the arm lifts, the lift pressure follows the load with a correlation of {lifting.alike('lift_pressure'):.2f} and the tilt pressure with "
        f"{lifting.alike('tilt_pressure'):.2f}; while the bucket rolls back it is {rolling.alike('lift_pressure'):.2f} and {rolling.alike('tilt_pressure'):.2f}. So P_LP fits one of the thesis' recordings and P_TP another. Neither can be right alone: each pressure is one "
        "moment, about the arm's pivot or the bucket's pin, and the force has two components. Read as a vertical force on the edge, the lift pressure alone is "
        f"{_both(runs, 'lift pressure')} off, worse than nothing, since most of it is the push of the pile and not its weight; the tilt pressure, whose pin is level with the edge, {_both(runs, 'tilt pressure')}.",
        f"**Both together**, with the angles and the payload from before the pile, give both components, and the balance of the machine takes them as a fifth contact (2.4.6): the corrected estimator is {_both(runs, 'corrected')} off. Where the tilt cylinder's head side runs empty, the traction that the "
        "motion does not explain stands in for it (`ecu.estimators.loads.payload`).",
        f"Over the mass splits the corrected estimator is at most {_kn(worst)} off in either entry, the printed one at least {_kn(min(run.rms('printed') for found in many.values() for run in found))}: pressures and arms do not depend on how the frames share the mass.",
    )  # fmt: skip
    return Answer(text, _rows(runs), partial(_draw, runs=runs, many=many))


def _kn(force: float) -> str:
    return f"{force / 1e3:.1f} kN"


def _both(runs: Mapping[str, Run], form: str) -> str:
    return " and ".join(_kn(run.rms(form)) for run in runs.values())


def _rows(runs: Mapping[str, Run]) -> tuple[Row, ...]:
    rows = []
    for case, run in runs.items():
        fits = max(("lift_pressure", "tilt_pressure"), key=run.alike)
        rows += [
            Row(f"front axle, RMS in the pile, {case}", "cannot be predicted", _kn(run.rms("printed")), _kn(run.rms("corrected"))),
            Row("the same from the lift pressure alone", "–", "–", _kn(run.rms("lift pressure"))),
            Row("the same from the tilt pressure alone", "–", "–", _kn(run.rms("tilt pressure"))),
            Row("pressure that looks like the load", "P_LP in one, P_TP in another", f"{fits.replace('_', ' ')} ({run.alike(fits):.2f})", "both needed"),
        ]  # fmt: skip
    return tuple(rows)


def _draw(file: Path, runs: Mapping[str, Run], many: Mapping[str, list[Run]]) -> None:
    from studies.thesis import picture

    looks = {
        "printed": (picture.PRINTED, "-"),
        "lift pressure": ("#9c6b98", ":"),
        "tilt pressure": (picture.REPAIRED, ":"),
        "corrected": (picture.CORRECTED, "--"),
    }
    with picture.panels(file, 2, 2, (11, 6), sharex=True, sharey="row") as (figure, axes):
        for (case, run), (loads, pressures) in zip(runs.items(), axes.T, strict=True):
            time = run.truth["time_s"]
            loads.plot(time, run.true / 1e3, color=picture.TRUE, label="plant")
            for form, (colour, style) in looks.items():
                label = f"{form} alone, as a vertical force" if "pressure" in form else form
                loads.plot(time, run.front[form] / 1e3, style, color=colour, label=label)
            for form in ("printed", "corrected"):
                errors = np.array([other.front[form] - other.true for other in many[case]])
                picture.band(loads, time, (run.true + errors) / 1e3, looks[form][0])
            loads.set(
                title=f"{TITLES[case]} (from {MOVES_S:g} s)", ylabel="front axle's load [kN]", ylim=(0, 140)
            )
            pressures.plot(
                time, run.truth["lift_pressure"] / 1e6, color="#9c6b98", label="lift pressure P_LP"
            )
            pressures.plot(
                time, run.truth["tilt_pressure"] / 1e6, color=picture.REPAIRED, label="tilt pressure P_TP"
            )
            pressures.set(xlabel="time [s]", ylabel="pressure, head side [MPa]", xlim=(1.0, END_S))
        picture.key(figure, axes[:, 0], 4)
