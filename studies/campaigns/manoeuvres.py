"""Drives that could lift a wheel, drawn at random: what the driver does, on what ground, with what load.

A drive begins straight. Its kind says what comes then: a lever moved in a turn, steering one way and the other, a turn in reverse,
a step of the ground under one side with steering after it, or a turn on a slope.
"""

import dataclasses
import json
import math
import random
from dataclasses import dataclass
from typing import Final

from plant.sheets.changes import Changes
from plant.unit.scenario import Scenario, load_scenario

BASE: Final = "abrupt_articulation"
KMH: Final = 1 / 3.6
TURN_AT_S: Final = 1.0
STEP_AT_S: Final = 1.2
"""When the front axle comes to a step of the ground."""
AFTER_S: Final = 2.5
"""Watched after the last thing that the driver does: a machine that tips has lifted its wheel long before."""
AXLE_AHEAD_M: Final = 1.5
"""Of the front axle before the joint, where the machine's place is."""
KINDS: Final = ("levers", "counter-steer", "reverse", "kerb", "drop", "slope")
DRY: Final = 0.75


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """One drive. calibration_seed: None is the calibration of the machine's family."""

    kind: str
    speed_kmh: float
    payload_kg: float
    arm_deg: float
    angle_deg: float  # of the first turn, left +
    rate_deg_s: float
    seed: int  # of the sensors' noise
    calibration_seed: int | None = None
    lift_percent: float = 0.0
    tilt_percent: float = 0.0
    ramp_s: float = 0.01  # in which the lever comes to its place
    held_s: float = 0.0
    left_m: float = 0.0  # step of the ground
    right_m: float = 0.0
    grade_percent: float = 0.0
    bank_deg: float = 0.0
    friction: float = DRY


def drawn(count: int, seed: int) -> list[Manoeuvre]:
    """So many drives, the kinds in turn; a half of them with a wrong calibration."""
    draw = random.Random(seed)
    # in turn and not drawn: every kind has its share also in a short campaign
    return [manoeuvre(KINDS[k % len(KINDS)], draw) for k in range(count)]


def manoeuvre(kind: str, draw: random.Random) -> Manoeuvre:
    """A drive of this kind."""
    side = draw.choice((-1.0, 1.0))
    raised = draw.random() < 0.5
    common = Manoeuvre(
        kind=kind,
        speed_kmh=round(draw.uniform(6.0, 24.0), 1),
        # empty and rated load as often as anything between: extremes are where wheels lift
        payload_kg=round(draw.choice((0.0, draw.uniform(500.0, 3204.0), 3204.0))),
        arm_deg=round(draw.uniform(0.0, 46.0) if raised else draw.uniform(-40.0, -10.0), 1),
        angle_deg=round(side * draw.uniform(12.0, 38.0), 1),
        rate_deg_s=round(draw.uniform(14.0, 27.0), 1),
        seed=draw.randrange(2**31),
        calibration_seed=draw.choice((None, draw.randrange(2**31))),
        friction=round(draw.choice((DRY, draw.uniform(0.4, 0.85))), 2),
    )
    if kind == "levers":
        lift, tilt = draw.choice(((-100.0, 0.0), (100.0, 0.0), (-100.0, -100.0), (0.0, -100.0), (0.0, 100.0)))
        return dataclasses.replace(
            common,
            lift_percent=lift,
            tilt_percent=tilt,
            ramp_s=draw.choice((0.01, 0.2, 0.5)),
            held_s=round(draw.uniform(0.3, 2.0), 2),
        )
    if kind == "reverse":
        return dataclasses.replace(common, speed_kmh=-min(common.speed_kmh, 18.0))
    if kind in ("kerb", "drop"):
        height = round((1.0 if kind == "kerb" else -1.0) * draw.uniform(0.05, 0.20), 3)
        left, right = draw.choice(((height, 0.0), (0.0, height)))
        # driven more slowly: a driver sees the step
        speed = min(common.speed_kmh, 14.0)
        return dataclasses.replace(common, left_m=left, right_m=right, speed_kmh=speed)
    if kind == "slope":
        grade, bank = round(draw.uniform(-18.0, 18.0), 1), round(draw.uniform(-9.0, 9.0), 1)
        return dataclasses.replace(common, grade_percent=grade, bank_deg=bank)
    return common


def straight(m: Manoeuvre) -> Manoeuvre:
    """The same ground and load, with neither steering nor lever."""
    return dataclasses.replace(m, angle_deg=0.0, lift_percent=0.0, tilt_percent=0.0)


def even(m: Manoeuvre) -> Manoeuvre:
    """The same driver and load, without the step."""
    return dataclasses.replace(m, left_m=0.0, right_m=0.0)


def scenario_of(m: Manoeuvre) -> Scenario:
    """The drive as a scenario."""
    # 0.4 s after the step: the machine is still rocking when the turn begins
    steer_s = STEP_AT_S + 0.4 if m.kind in ("kerb", "drop") else TURN_AT_S
    turn_s = abs(m.angle_deg) / m.rate_deg_s
    points = [(0.0, 0.0), (steer_s, 0.0), (steer_s + turn_s, m.angle_deg)]
    last_s = steer_s + turn_s
    if m.kind in ("counter-steer", "kerb", "drop"):
        last_s += 2.0 * turn_s + 0.3
        points += [(steer_s + turn_s + 0.3, m.angle_deg), (last_s, -m.angle_deg)]
    words = [
        f"payload_kg={m.payload_kg}",
        f"seed={m.seed}",
        f"start.speed_kmh={m.speed_kmh}",
        f"start.lift_arm_deg={m.arm_deg}",
        f"driver.speed_kmh.points=[[0.0, {m.speed_kmh}]]",
        f"driver.articulation_deg.points={json.dumps(points)}",
        f"surface.friction={m.friction}",
        f"surface.grade_percent={m.grade_percent}",
        f"surface.bank_deg={m.bank_deg}",
    ]
    for lever, percent in (("lift", m.lift_percent), ("tilt", m.tilt_percent)):
        if percent:
            begin = last_s + 0.5
            held = ((begin, 0.0), (begin + m.ramp_s, percent), (begin + m.ramp_s + m.held_s, percent))
            end = (begin + m.ramp_s + m.held_s + m.ramp_s, 0.0)
            words.append(f"driver.{lever}_percent.points={json.dumps([*held, end])}")
    if m.lift_percent or m.tilt_percent:
        last_s += 0.5 + 2.0 * m.ramp_s + m.held_s
    if m.left_m or m.right_m:
        # measured along the ground, so that the axle is there at STEP_AT_S at any speed
        at = AXLE_AHEAD_M + m.speed_kmh * KMH * STEP_AT_S
        step = {"distance_m": at, "length_m": 0.4, "left_m": m.left_m, "right_m": m.right_m}
        words += [f"effects.kerb.{key}={value}" for key, value in step.items()]
    # up to the next tenth: a round number in the scenario that a reader repeats
    words.append(f"duration_s={math.ceil(10.0 * (last_s + AFTER_S)) / 10.0}")
    return load_scenario(BASE, Changes.of(words))
