"""A drive of the plant, and the estimates computed from its signals.

As in the thesis' tests against its simulation (4.5.1) the estimators get the simulation's own signals at 100 Hz: no
noise, no bus. What the same estimators do on noisy, delayed frames is in docs/results/normal_force.md.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.models.printed_forms import Corrections, estimate
from ecu.core import Form
from ecu.estimators.columns import estimate_columns
from ecu.estimators.loads.cog import front_unit, machine_centre
from ecu.estimators.parameters import Body
from ecu.estimators.quantities import Centre
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.tyres.wheels import radius
from plant.effects.effect import ActiveEffect
from plant.physics.surface import Surface
from plant.sheets.machine import Machine
from plant.truth import Truth, columns_of
from plant.unit.profile import Profile
from plant.unit.scenario import Scenario, Start, load_scenario
from plant.unit.script import Script
from plant.unit.unit import TICK_NS, TICK_S, PlantUnit
from studies.thesis.split import Split, machine_of, parameters_of

Array = NDArray[np.float64]
Truths = Mapping[str, Array]

SEED = 4
"""Of the noise of the sensors that the simulated driver steers by."""


def drive_case(
    duration_s: float,
    *,
    start: Start,
    script: Script,
    payload: float = 0.0,
    surface: Surface | None = None,
) -> Scenario:
    """A drive of the L60 class machine, which nothing limits."""
    # for what a drive does not set: sensors, equipment, ground
    base = load_scenario("standstill")
    return replace(
        base,
        duration_s=duration_s,
        payload_mass=payload,
        start=start,
        script=script,
        surface=surface or base.surface,
        seed=SEED,
    )


def line(*points: tuple[float, float]) -> Profile:
    """Straight lines between (time [s], value)."""
    return Profile(points)


def driven(case: Scenario, split: Split, *effects: ActiveEffect) -> Truths:
    """The truth of the drive, one row per 10 ms."""
    return driven_by(replace(machine_of(split), effects=effects), case)


def driven_by(machine: Machine, case: Scenario) -> Truths:
    """The truth of this machine's drive."""
    # no ECU at all: the thesis' simulation had none, and limits would change the drive
    unit = PlantUnit(machine, case, seed=case.seed, obey_limits=False)
    rows: list[Array] = []
    while not unit.finished:
        unit.tick(len(rows) * TICK_NS)
        rows.append(unit.truth.row)
    return columns_of(np.array(rows).reshape(-1, Truth.size))


def inputs_of(truth: Truths) -> Array:
    """Rows of `Inputs`: the simulation's own signals, all usable."""
    rows = np.ones((len(truth["time_s"]), len(Inputs._fields)))
    at = {name: place for place, name in enumerate(Inputs._fields)}
    rows[:, at["dt"]] = TICK_S
    rows[:, at["rate_limit"]] = np.inf  # nothing limits the drives
    rows[:, at["demand_usable"]] = 0.0  # no joystick: the thesis' equations use measured rates alone
    for name in (
        "articulation_angle",
        "articulation_rate",
        "pitch",
        "roll",
        "lift_pressure",
        "tilt_pressure",
    ):
        rows[:, at[name]] = truth[name]
    for name in ("lift_arm_angle", "tilt_angle"):
        rows[:, at[name]] = truth[name]
    for name in ("wheel_speed", "wheel_torque"):
        rows[:, at[f"{name}_1"] : at[f"{name}_1"] + 4] = truth[name]
    # consecutive places: the three axes of a sensor stand side by side in `Inputs`
    rows[:, at["specific_force_x"] : at["specific_force_x"] + 3] = truth["imu_specific_force"]
    rows[:, at["roll_rate"] : at["roll_rate"] + 3] = truth["angular_velocity"]
    return rows


def estimated(truth: Truths, split: Split, form: Form, *, outlook: bool = False) -> Mapping[str, Array]:
    """Estimates by name; normal forces also together, (n, 4), as `normal_force`."""
    columns = estimate_columns(inputs_of(truth), parameters_of(split), form=form, prediction=outlook)
    named = dict(zip(Estimates._fields, columns.T, strict=True))
    return {**named, "normal_force": columns[:, :4]}


def centres(truth: Truths, split: Split, rear: Body) -> list[Centre]:
    """Centre of gravity at every moment; rear: the rear unit, with its axle or without."""
    p = parameters_of(split)
    moments = zip(
        truth["articulation_angle"].tolist(),
        truth["lift_arm_angle"].tolist(),
        truth["tilt_angle"].tolist(),
        truth["payload_mass"].tolist(),
        strict=True,
    )
    return [
        machine_centre(angle, front_unit(arm, tilt, load, p.front, p.arm, p.bucket), rear)
        for angle, arm, tilt, load in moments
    ]


def repaired(truth: Truths, split: Split, **corrections: float) -> Array:
    """Normal forces (n, 4) [N] of the printed form with some of its corrections made (`Corrections`), 1 is the whole."""
    p = parameters_of(split)
    # mean wheel speed times one radius: the printed equations know no slip
    speed = truth["wheel_speed"].mean(axis=1) * radius(p.wheel.nominal_load, 1.0, p.wheel)
    rates = truth["articulation_rate"], truth["angular_velocity"][:, 2]
    angles = [truth[name] for name in ("articulation_angle", "roll", "pitch", "lift_arm_angle", "tilt_angle")]
    # central differences: the simulation's signals have no noise that they would amplify
    changes = [np.gradient(values, TICK_S) for values in (*rates, speed)]
    motion = np.column_stack((*angles, *rates, changes[0], changes[1], speed, changes[2]))
    rows = np.hstack((motion, truth["longitudinal_force"], truth["lateral_force"]))
    normal, side, torque = np.empty((len(rows), 4)), np.empty(len(rows)), np.empty(len(rows))
    # in place: the compiled loop fills the three arrays
    estimate(rows, Corrections(**corrections), float(truth["payload_mass"][0]), p, normal, side, torque)
    return normal
