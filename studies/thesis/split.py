"""Mass splits to try, since the thesis prints neither the split nor the height of its machine's centre of gravity.

Machine and estimators are changed alike: in the thesis both had the same numbers as well (5.3.1).
"""

import math
from dataclasses import dataclass, replace

from ecu.calibration import load_calibration
from ecu.estimators.parameters import Body, Parameters
from hil.ecu_side import CALIBRATION
from plant.sheets.machine import Machine, load_machine

MACHINE = "l60"


@dataclass(frozen=True, slots=True)
class Split:
    """A change of the sheet's masses."""

    forward: float = 0.0  # mass moved from the rear to the front frame [kg]
    higher: float = 0.0  # raise of the rear frame's centre of gravity [m]


SHEET = Split()
SPLITS = tuple(Split(forward, higher) for forward in (0.0, -885.0, 885.0) for higher in (0.0, -0.18, 0.12))
"""885 kg: 30 % of front frame, arm and bucket, whose masses are estimates. Height of the rear frame's
centre: 1.10 to 1.40 m (docs/explanation/machine-sheet.md). The sheet's own machine is the first."""


def machine_of(split: Split) -> Machine:
    """The plant's machine."""
    machine = load_machine(MACHINE)
    front, rear = machine.front_frame, machine.rear_frame
    return replace(
        machine,
        front_frame=replace(front, mass=front.mass + split.forward),
        rear_frame=replace(rear, mass=rear.mass - split.forward, z=rear.z + split.higher),
    )


def parameters_of(split: Split) -> Parameters:
    """The estimators' parameters for that machine; without latency, because signals of a simulation are not delayed, and
    with a slope that no acceleration leans: the estimators would take off the true one what only a sensor adds (ADR 44)."""
    known = load_calibration(CALIBRATION).parameters
    frame = load_machine(MACHINE).front_frame
    rear = known.rear
    return known._replace(
        front=_added(known.front, split.forward, frame.x, frame.z),
        rear=rear._replace(mass=rear.mass - split.forward, z=rear.z + split.higher),
        contact=known.contact._replace(latency=0.0),
        sensors=known.sensors._replace(slope_levelling=math.inf),
    )


def _added(body: Body, mass: float, x: float, z: float) -> Body:
    """The lumped body with a point mass added (or removed); inertias by the parallel axis theorem."""
    total = body.mass + mass
    reduced = body.mass * mass / total
    dx, dz = x - body.x, z - body.z
    return Body(
        total,
        body.x + mass * dx / total,
        body.z + mass * dz / total,
        body.roll_inertia + reduced * dz * dz,
        body.pitch_inertia + reduced * (dx * dx + dz * dz),
        body.yaw_inertia + reduced * dx * dx,
    )
