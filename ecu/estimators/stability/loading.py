"""What differs between the rows of one machine: lists of whole machines would be copied for longer than a prediction takes."""

from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.parameters import Body
from ecu.estimators.quantities import NormalForces
from ecu.estimators.stability.rollover import LoadedMachine


class Loading(NamedTuple):
    """The part of a `LoadedMachine` that its load and pose decide; fields as there."""

    front: Body
    standing: NormalForces
    pitch_frequency: float
    payload: float


@inlined
def loading_of(m: LoadedMachine) -> Loading:
    """The loading of a machine."""
    return Loading(m.front, m.standing, m.pitch_frequency, m.payload)


@inlined
def reloaded(m: LoadedMachine, by: Loading) -> LoadedMachine:
    """The machine with another loading."""
    return LoadedMachine(
        by.front, m.rear, m.rear_unit, m.axle, m.wheel, m.geometry, m.prediction, by.standing, by.pitch_frequency,
        m.frame, m.arm, m.bucket, by.payload, m.drive,
    )  # fmt: skip


@compiled
def divides(m: LoadedMachine, by: Loading) -> bool:
    """Whether no prediction and no turn of this machine divides by zero what a bound would hide.

    Every other division by zero shows in the result: lanes do not check their divisors one by one.
    """
    w, g, n = m.wheel, m.geometry, by.standing
    rules = min(m.prediction.cushion, m.prediction.step, m.drive.cushion)
    tyre = min(
        w.low_speed, w.lateral_peak, w.nominal_load, w.front_stiffening, w.rear_stiffening, w.radial_linear
    )
    loads = min(abs(n.front_left), abs(n.front_right), abs(n.rear_left), abs(n.rear_right))
    masses = by.front.mass + m.rear.mass
    return min(rules, tyre, loads, masses, g.front_track, g.rear_track) > 0.0 and w.radial_quadratic >= 0.0
