"""What the printed estimators carry from cycle to cycle."""

from typing import NamedTuple


class PrintedState(NamedTuple):
    """`PRINTED_INITIAL` before the first cycle; wheels are 1 FL, 2 FR, 3 RL, 4 RR."""

    cycles: float  # since the start
    payload: float  # [kg]
    wheel_speed_1: float  # [rad/s]
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_acceleration_1: float  # filtered [rad/s2]
    wheel_acceleration_2: float
    wheel_acceleration_3: float
    wheel_acceleration_4: float
    deflection_1: float  # of the contact point [m]
    deflection_2: float
    deflection_3: float
    deflection_4: float
    pitch_lean: float  # what accelerations add to the inclination sensor's reading [rad]
    roll_lean: float


PRINTED_INITIAL = PrintedState(*([0.0] * len(PrintedState._fields)))
