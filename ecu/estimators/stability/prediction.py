"""What will happen to the wheels' loads within the horizon, for warnings and limits.

The prediction propagates articulation, speed, the slide of the tyres and the roll of the machine on its front
tyres over a horizon, so that a warning does not wait for the tilt that the thesis' estimator has to
see first (thesis 2.4.5, results 4.5.6). ISO 8855, joint origin, rear frame axes.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.signals import NEVER
from ecu.estimators.stability.levers import Levers, moved
from ecu.estimators.stability.rocking import restoring_matrix
from ecu.estimators.stability.rollover import LoadedMachine, load_transfer_ratio
from ecu.estimators.stability.start import within
from ecu.estimators.stability.step import Course, PredictionState, course_from, loaded, moved_on, rates_of

OVERTURNED = -10.0
"""Margin at which a prediction ends in any case: the wheel would have to be held down by ten times its standing load. Four are what a
side force of 1 g and a payload take from a wheel; beyond, the equations of a standing machine say nothing."""


class Prediction(NamedTuple):
    """What happens within the horizon, up to the moment when the margin is used up."""

    time_to_lift_off: float  # [s]; NEVER if no wheel lifts
    margin: float  # the smallest over the time looked at; OVERTURNED or more
    wheel: float  # the wheel of that margin (1..4)
    load_transfer_ratio: float  # at the end of that time; as far from 0 as OVERTURNED at most


@compiled
def steps_of(machine: LoadedMachine) -> int:
    """Steps of a prediction, its first moment included."""
    return int(machine.prediction.horizon / machine.prediction.step + 0.5) + 1


@compiled
def predict(start: PredictionState, hold: float, floor: float, machine: LoadedMachine) -> Prediction:
    """Margin and time to lift-off if the demanded rates last `hold` seconds and then end.

    It looks no further than the moment when the margin falls to `floor`, or to OVERTURNED; 0 is lift-off.

    The articulation rate follows the demand as the steering can and fades before the stop; so do lift arm and bucket. The
    longitudinal acceleration fades; the tyres slip sideways and give what their grip allows; the loads follow
    the quasi-static ones as a machine that rocks on its tyres does (`rocking`), overshoot included. The ground
    keeps its slope while the machine turns on it.
    """
    rates, arm_moves = rates_of(machine.prediction, machine.drive), moved(start.levers)
    c = course_from(start, machine.standing, machine.bucket.carried)
    restoring = restoring_matrix(c.joint, machine)
    lift_off, end = NEVER, max(floor, OVERTURNED)
    for k in range(steps_of(machine)):
        c = loaded(c, k == 0, k * rates.step < hold, arm_moves, start, restoring, rates, machine)
        if c.worst <= end:
            if c.worst <= 0.0:
                lift_off = k * rates.step
            break
        c = moved_on(c, rates, machine.geometry.articulation_stop)
    return predicted(c, lift_off)


@compiled
def predicted(c: Course, lift_off: float) -> Prediction:
    """The prediction that ended here; lift_off: [s] or NEVER."""
    ratio = within(load_transfer_ratio(c.forces), -OVERTURNED)
    return Prediction(lift_off, max(c.worst, OVERTURNED), c.lifting, ratio)


@compiled
def with_demand(start: PredictionState, rate: float) -> PredictionState:
    """The same state with another demanded articulation rate [rad/s]."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, rate, start.speed, start.acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_left, start.front_right, start.rear_load, start.left_rate, start.right_rate, start.levers,
    )  # fmt: skip


@compiled
def with_acceleration(start: PredictionState, acceleration: float) -> PredictionState:
    """The same state with another acceleration along the rear frame [m/s2]; a prediction lets it fade."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, start.demanded_rate, start.speed, acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_left, start.front_right, start.rear_load, start.left_rate, start.right_rate, start.levers,
    )  # fmt: skip


@compiled
def with_levers(start: PredictionState, levers: Levers) -> PredictionState:
    """The same state with other demands on lift arm and bucket."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, start.demanded_rate, start.speed, start.acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_left, start.front_right, start.rear_load, start.left_rate, start.right_rate, levers,
    )  # fmt: skip
