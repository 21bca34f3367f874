"""Question: why does the estimator see the roll-over late (thesis 4.5.6, 5.3.4)?

As there: an abrupt articulation at speed, to the left. *Late* is the time from the true lift-off of the inner front wheel to
the moment an estimate of its load comes to zero (each for 50 ms); negative is ahead.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hil.verdict import LIFT_MIN_S, WHEELS, lasting
from plant.unit.scenario import Scenario, Start
from plant.unit.script import KMH, Script
from studies.campaigns import roll_over as campaign
from studies.thesis import late_causes
from studies.thesis.abrupt_turn import ANGLE, RATE, ROLLED, SPEED_KMH, TURN_S, Seen, seen
from studies.thesis.drive import Array, Truths, drive_case, driven, estimated, line, repaired
from studies.thesis.questions import Answer, Row
from studies.thesis.split import SHEET, SPLITS, Split

REPAIRS: Mapping[str, Mapping[str, float]] = {
    "pivot arm alone (E-15)": {"pivot_arm": 1.0},
    "centripetal acceleration alone (E-18)": {"centripetal": 1.0},
    "both": {"pivot_arm": 1.0, "centripetal": 1.0},
}


@dataclass(frozen=True, slots=True)
class Run:
    """One turn: truth, estimates of the normal forces (n, 4) [N] by form, what they see, and the prediction."""

    truth: Truths
    forces: Mapping[str, Array]
    lift_off: Seen
    seen: Mapping[str, Seen]
    foreseen: float

    def late(self, form: str) -> float:
        """Seconds after the true lift-off; infinite: never."""
        return self.seen[form].time - self.lift_off.time

    @property
    def rolls_over(self) -> bool:
        return bool(np.abs(self.truth["roll"]).max() > ROLLED)


def abrupt(speed_kmh: float = SPEED_KMH, side: float = 1.0) -> Scenario:
    """Full joystick at speed; side: 1 left, -1 right."""
    speed = speed_kmh * KMH
    turn = line((TURN_S, 0.0), (TURN_S + ANGLE / RATE, side * ANGLE))
    script = Script(speed=line((0.0, speed)), articulation_angle=turn)
    return drive_case(8.0, start=Start(speed=speed), script=script)


def measure(split: Split = SHEET, side: float = 1.0) -> Run:
    """Drive once; all forms, and the outlook of the corrected one."""
    truth = driven(abrupt(side=side), split)
    corrected = estimated(truth, split, "corrected", outlook=True)
    # the same drive with one signal taken away: what it contributes is the difference
    level = {**truth, "roll": np.zeros_like(truth["roll"])}
    forces = {
        "printed": estimated(truth, split, "printed")["normal_force"],
        "printed, roll angle unknown": estimated(level, split, "printed")["normal_force"],
        **{name: repaired(truth, split, **made) for name, made in REPAIRS.items()},
        "corrected": corrected["normal_force"],
    }
    time = truth["time_s"]
    # for as long as a lift-off has to last, so that both are moments of one kind
    foreseen = lasting(time, corrected["predicted_margin"] <= 0.0, LIFT_MIN_S)
    return Run(
        truth,
        forces,
        seen(time, truth["normal_force"]),
        {form: seen(time, force) for form, force in forces.items()},
        foreseen[0] if foreseen else math.inf,
    )


def answer() -> Answer:
    """Left and right with the sheet's masses, over the bus, the splits, and why it is later than in theory."""
    suspects = late_causes.causes()
    run, mirrored = measure(), measure(side=-1.0)
    many = [measure(split) for split in SPLITS]
    # once more through sensors and bus: the estimates above have neither noise nor delay
    warned, _ = campaign.drive(abrupt(), "corrected", limits=False)
    ahead = _ahead(run)
    text = (
        f"At {SPEED_KMH:g} km/h the joystick is thrown to the left; {run.lift_off.time - TURN_S:.2f} s later the {_wheel(run.lift_off)} wheel lifts and the machine goes over. The printed "
        f"estimator reports the same wheel {run.late('printed'):.2f} s late; the thesis says less than a second. To the right everything is mirrored ({_wheel(mirrored.lift_off)}, {mirrored.late('printed'):.2f} s).",
        f"The acceleration of 2.5 is the derivative of the speed, turned into the direction of travel: at constant speed it is nothing, however narrow the turn (E-18). "
        f"The printed estimator therefore learns of the roll-over through the roll angle alone, when the machine already tips; without that angle it {_sees(run, 'printed, roll angle unknown')}. "
        f"With the missing pivot arm alone it {_sees(run, 'pivot arm alone (E-15)')}, since the false offset of the articulation used to push the right way; with the "
        f"centripetal acceleration alone it {_sees(run, 'centripetal acceleration alone (E-18)')}, and with both it {_sees(run, 'both')}.",
        f"The corrected estimator sees lift-off {-run.late('corrected'):.2f} s ahead of the tyre, which has to be unloaded first, and its outlook from the articulation rate foresees it "
        f"{ahead:.2f} s ahead. Over the bus, with noisy and late sensors and alarms that must not flicker, the warning comes {warned.lead_s:.2f} s ahead. "
        "[The roll-over grid](../results/rollover_grid.md) has the same for 240 turns.",
        f"Over the mass splits shown the printed estimator is {_range([r.late('printed') for r in many])} s late, the corrected one {_range([-r.late('corrected') for r in many])} s ahead and its outlook "
        f"{_range([_ahead(r) for r in many])} s; {sum(r.rolls_over for r in many)} of {len(many)} machines go over at this speed, and the first wheel is {_wheels(many)} in all of them.",
        late_causes.paragraph(suspects),
    )  # fmt: skip
    changed = [
        Row(f"{what}: seen after the plant's [s]", "–", f"{each.late:+.2f}", "–")
        for what, each in late_causes.lines(suspects)
    ]
    by_friction = {friction: each.late for friction, each in suspects.frictions.items()}
    draw = partial(_draw, run=run, many=many, by_friction=by_friction, theory=late_causes.THEORY)
    return Answer(text, (*_rows(run, warned.lead_s), *changed), draw)


def _ahead(run: Run) -> float:
    return run.lift_off.time - run.foreseen


def _wheel(seen: Seen) -> str:
    return "no" if seen.wheel is None else WHEELS[seen.wheel]


def _wheels(runs: list[Run]) -> str:
    return " or ".join(sorted({_wheel(run.lift_off) for run in runs}))


def _sees(run: Run, form: str) -> str:
    late = run.late(form)
    if math.isinf(late):
        return "never sees it"
    return f"is {late:.2f} s late" if late > 0.0 else f"is {-late:.2f} s ahead"


def _range(values: list[float]) -> str:
    known = [value for value in values if math.isfinite(value)]
    never = len(values) - len(known)
    return f"{min(known):.2f} to {max(known):.2f}" + (f" (never in {never})" if never else "")


def _rows(run: Run, lead: float | None) -> tuple[Row, ...]:
    def late(form: str) -> str:
        value = run.late(form)
        return f"{value:+.2f}" if math.isfinite(value) else "never"

    return (
        Row("wheel that lifts first (plant: " + _wheel(run.lift_off) + ")", "front left", _wheel(run.seen["printed"]), _wheel(run.seen["corrected"])),
        Row("lift-off seen after the plant's [s]", "late, less than 1", late("printed"), late("corrected")),
        Row("the same, roll angle unknown [s]", "–", late("printed, roll angle unknown"), "–"),
        *(Row(f"printed with {name} [s]", "–", late(name), "–") for name in REPAIRS),
        Row("foreseen before the plant's [s]", "future work", "–", f"{_ahead(run):.2f}"),
        Row("warned over the bus before the plant's [s]", "–", "–", "never" if lead is None else f"{lead:.2f}"),
    )  # fmt: skip


def _draw(
    file: Path, run: Run, many: list[Run], by_friction: Mapping[float, float], theory: tuple[float, float]
) -> None:
    from studies.thesis import picture

    time, lift = run.truth["time_s"], run.lift_off.time
    wheel = run.lift_off.wheel or 0
    with picture.panels(file, 1, 3, (14, 4), width_ratios=(2.2, 1, 1)) as (figure, (left, right, last)):
        last.plot(list(by_friction), list(by_friction.values()), "o-", color=picture.PRINTED)
        last.axhspan(*theory, color="#888888", alpha=picture.BAND, label="two bodies in the plane")
        last.set(
            title="by friction",
            xlabel="friction of the ground",
            ylabel="printed, after the true lift-off [s]",
        )
        left.plot(time - lift, run.truth["normal_force"][:, wheel] / 1e3, color=picture.TRUE, label="plant")
        for form, colour, style in (
            ("printed", picture.PRINTED, "-"),
            ("both", picture.REPAIRED, "-"),
            ("corrected", picture.CORRECTED, "--"),
        ):
            label = "printed with pivot arm and centripetal acceleration" if form == "both" else form
            left.plot(time - lift, run.forces[form][:, wheel] / 1e3, style, color=colour, label=label)
        left.axvline(
            run.foreseen - lift,
            color=picture.CORRECTED,
            linestyle=":",
            label="foreseen by the corrected outlook",
        )
        left.set(
            title=f"{_wheel(run.lift_off)} wheel, joystick to the left at {SPEED_KMH:g} km/h",
            xlabel="time from lift-off [s]",
            ylabel="normal force [kN]",
            xlim=(-2.2, 1.4),
            ylim=(-25, 45),
        )
        left.axhline(0.0, color="#888888", linewidth=0.8)
        forward = [split.forward for split in SPLITS]
        for form, colour in (("printed", picture.PRINTED), ("corrected", picture.CORRECTED)):
            late = [value if math.isfinite(value := r.late(form)) else np.nan for r in many]
            right.plot(forward, late, "o", color=colour)
        right.plot(forward, [-_ahead(r) for r in many], "v", color=picture.CORRECTED, label="foreseen")
        right.axhline(0.0, color="#888888", linewidth=0.8)
        right.axhline(1.0, color="#888888", linestyle=":", label="thesis: less than 1 s late")
        right.set(
            title="by mass split",
            xlabel="mass moved forward [kg]",
            ylabel="after the true lift-off [s]",
            xticks=(-885, 0, 885),
        )
        picture.key(figure, [left, right, last], 4)
