"""Question: why does the front pair's error follow the articulation (thesis 4.5.3)?

Held turns of 20 degrees to both sides at four speeds. The *offset* is half the difference of the errors
of front left and front right [N]; with the arm of the pivot force missing (E-15) it is -F_R Y_cog/(b1 + b2).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ecu.estimators.parameters import GRAVITY
from ecu.estimators.printed.normal_force import printed_arms
from plant.unit.scenario import Scenario, Start
from plant.unit.script import Script
from studies.thesis.drive import Array, Truths, centres, drive_case, driven, estimated, line, repaired
from studies.thesis.questions import Answer, Row
from studies.thesis.split import SHEET, SPLITS, Split, parameters_of

SPEEDS = (1.0, 2.0, 3.0, 4.0)  # [m/s]
ANGLE = math.radians(20.0)
HELD = 0.95  # of the angle: the turn counts as held
# Each side twice: an offset that drifts with time would not change its sign.
TURNS = (1, -1, 1, -1)  # left, right
REPAIRS: Mapping[str, Mapping[str, float]] = {
    "pivot arm alone (E-15)": {"pivot_arm": 1.0},
    "pivot arm and centripetal acceleration (E-18)": {"pivot_arm": 1.0, "centripetal": 1.0},
}
PAYLOAD = 3204.0  # thesis, table 2 [kg]


@dataclass(frozen=True, slots=True)
class Offsets:
    """Mean over the held turns [N]: offset of the front and of the rear pair, turned left and right."""

    front_left: float
    front_right: float
    rear_left: float
    rear_right: float

    @property
    def odd(self) -> float:
        """The part of the front offset that changes sign with the articulation [N]."""
        return (self.front_left - self.front_right) / 2.0


@dataclass(frozen=True, slots=True)
class Run:
    """One drive: its truth, the errors of both forms (n, 4) [N], and their offsets."""

    truth: Truths
    errors: Mapping[str, Array]
    offsets: Mapping[str, Offsets]


def zigzag(speed: float, payload: float = 0.0) -> Scenario:
    """Turns of 20 degrees, each taken in 2 s and held for 3 s, at constant speed."""
    points, now = [(1.0, 0.0)], 1.0
    for side in TURNS:
        points += [(now + 2.0, side * ANGLE), (now + 5.0, side * ANGLE)]
        now += 6.0
    return drive_case(
        now,
        start=Start(speed=speed),
        script=Script(speed=line((0.0, speed)), articulation_angle=line(*points)),
        payload=payload,
    )


def measure(speed: float, split: Split = SHEET, payload: float = 0.0) -> Run:
    """Drive once and estimate in both forms."""
    truth = driven(zigzag(speed, payload), split)
    forces = {form: estimated(truth, split, form)["normal_force"] for form in ("printed", "corrected")}
    forces |= {form: repaired(truth, split, **made) for form, made in REPAIRS.items()}
    errors = {form: force - truth["normal_force"] for form, force in forces.items()}
    angle = truth["articulation_angle"]
    return Run(truth, errors, {form: offsets(error, angle) for form, error in errors.items()})


def offsets(error: Array, angle: Array) -> Offsets:
    """Offsets of errors (n, 4) over the held turns."""
    left, right = angle > HELD * ANGLE, angle < -HELD * ANGLE
    front, rear = (error[:, 0] - error[:, 1]) / 2.0, (error[:, 2] - error[:, 3]) / 2.0
    return Offsets(
        float(front[left].mean()),
        float(front[right].mean()),
        float(rear[left].mean()),
        float(rear[right].mean()),
    )


def missing_arm(truth: Truths, split: Split) -> Array:
    """-F_R Y_cog/(b1 + b2) [N]: the offset that E-15 alone makes, to first order, from the true rear load."""
    p = parameters_of(split)
    # what the joint carries of the rear: the load of the rear wheels without their axle, which swings below it
    pivot = truth["normal_force"][:, 2:].sum(axis=1) - p.axle.mass * GRAVITY
    lever = []
    for angle, centre in zip(truth["articulation_angle"], centres(truth, split, p.rear), strict=True):
        arms = printed_arms(centre, angle, p.geometry)
        lever.append(-centre.y / (arms.b1 + arms.b2))
    return pivot * np.array(lever)


def slope(run: Run, split: Split = SHEET) -> float:
    """Of the printed form's offset over what the missing arm explains; 1 where nothing else is wrong."""
    error, explained = run.errors["printed"], missing_arm(run.truth, split)
    offset = (error[:, 0] - error[:, 1]) / 2.0
    # regression through the origin: no arm, no offset
    return float(explained @ offset / (explained @ explained))


def answer() -> Answer:
    """All speeds with the sheet's masses, loaded once, and the splits."""
    runs = {speed: measure(speed) for speed in SPEEDS}
    loaded = measure(SPEEDS[0], payload=PAYLOAD)
    spread = {
        form: np.array([[measure(v, split).offsets[form].odd for v in SPEEDS] for split in SPLITS])
        for form in ("printed", "corrected")
    }
    slow = runs[SPEEDS[0]].offsets["printed"]
    text = (
        f"Turned 20° left at {SPEEDS[0]:g} m/s the printed estimator puts {_kn(-slow.front_left)} too little on the front left wheel and as "
        f"much too much on the front right, and the other way round turned right ({_kn(slow.front_right)}); the rear pair is off by "
        f"{_kn(abs(slow.rear_left))}. Half the difference of the front errors follows −F_R Y_cog/(b₁+b₂), the moment that (80) leaves out, with a slope of "
        f"{slope(runs[SPEEDS[0]]):.2f}. The corrected estimator is off by {_worst(runs, 'corrected'):.0f} N at most.",
        f"The thesis finds the offset equal at all its speeds. In the plant that holds at a walk: from {SPEEDS[0]:g} to {SPEEDS[1]:g} m/s it falls by "
        f"{100 * (1 - _odd(runs, SPEEDS[1]) / _odd(runs, SPEEDS[0])):.0f} %, as the second omission, the centripetal acceleration, "
        "grows with the square of the speed and loads the other side; near 3.5 m/s the two cancel on the front wheels, and the rear pair, "
        f"which only the second one reaches, is then off by {_kn(abs(runs[4.0].offsets['printed'].rear_left))} (4 m/s). So the thesis' zigzag was slow.",
        f"The band is the range over mass splits: 885 kg either way between the frames, the rear frame's centre 1.10 to 1.40 m high. At {SPEEDS[0]:g} m/s the "
        f"printed offset lies between {_kn(-spread['printed'][:, 0].max())} and {_kn(-spread['printed'][:, 0].min())} in all of them: "
        "its sign and size do not depend on the unknown split.",
    )  # fmt: skip
    return Answer(text, _rows(runs, loaded), partial(_draw, runs=runs, spread=spread))


def _kn(force: float) -> str:
    return f"{force / 1e3:.1f} kN"


def _odd(runs: Mapping[float, Run], speed: float) -> float:
    return runs[speed].offsets["printed"].odd


def _worst(runs: Mapping[float, Run], form: str) -> float:
    found = [run.offsets[form] for run in runs.values()]
    return max(max(abs(o.front_left), abs(o.front_right)) for o in found)


def _rows(runs: Mapping[float, Run], loaded: Run) -> tuple[Row, ...]:
    def cell(run: Run, form: str, *, front: bool = True) -> str:
        o = run.offsets[form]
        left, right = (o.front_left, o.front_right) if front else (o.rear_left, o.rear_right)
        return f"{left / 1e3:+.2f} / {right / 1e3:+.2f}"

    def line_of(what: str, thesis: str, run: Run, *, front: bool = True) -> Row:
        return Row(what, thesis, cell(run, "printed", front=front), cell(run, "corrected", front=front))

    sign = "changes sign with the direction"
    return (
        *(line_of(f"front offset, left / right turn, {v:g} m/s [kN]", sign, run) for v, run in runs.items()),
        line_of(f"the same with {PAYLOAD:.0f} kg, {SPEEDS[0]:g} m/s [kN]", "not simulated", loaded),
        line_of(f"rear offset, left / right turn, {SPEEDS[0]:g} m/s [kN]", "none", runs[SPEEDS[0]], front=False),
        *(Row(f"printed with {form}, {v:g} m/s [kN]", "–", cell(runs[v], form), "–") for form in REPAIRS for v in (SPEEDS[0], SPEEDS[-1])),
    )  # fmt: skip


def _draw(file: Path, runs: Mapping[float, Run], spread: Mapping[str, Array]) -> None:
    from studies.thesis import picture

    run = runs[SPEEDS[0]]
    with picture.panels(file, 1, 3, (11, 3.6), width_ratios=(1.5, 1.5, 1)) as (figure, (left, right, over)):
        time = run.truth["time_s"]
        for axes, wheel, name in ((left, 0, "front left"), (right, 1, "front right")):
            axes.plot(time, run.truth["normal_force"][:, wheel] / 1e3, color=picture.TRUE, label="plant")
            for form, colour in (("printed", picture.PRINTED), ("corrected", picture.CORRECTED)):
                force = run.truth["normal_force"] + run.errors[form]
                axes.plot(
                    time,
                    force[:, wheel] / 1e3,
                    color=colour,
                    label=form,
                    linestyle="--" if form == "corrected" else "-",
                )
            axes.set(title=f"{name}, {SPEEDS[0]:g} m/s, ±20°", xlabel="time [s]", ylabel="normal force [kN]")
        low, high = left.get_ylim()
        right.set_ylim(low, high)
        for form, colour in (("printed", picture.PRINTED), ("corrected", picture.CORRECTED)):
            picture.band(over, np.array(SPEEDS), spread[form] / 1e3, colour)
            over.plot(SPEEDS, spread[form][0] / 1e3, color=colour, marker="o")
        over.set(
            title="offset in a left turn", xlabel="speed [m/s]", ylabel="front offset [kN]", xticks=SPEEDS
        )
        picture.key(figure, [left], 3)
