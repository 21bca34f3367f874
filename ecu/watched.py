"""The signals that are watched, in the order of every array of the detection, and the message that each comes in."""

from typing import Annotated, Final, NamedTuple

from ecu.bus_signals import Received, rows
from ecu.estimators.signals import Inputs


class Beside(NamedTuple):
    """Sensed signals that the estimators do not need: they check the others, and are checked."""

    slope_pitch_rate: Annotated[float, Received("SlopeSensor", "PitchRate", "rad/s", "rate")]
    steering_pressure_left: Annotated[
        float, Received("SteeringPressures", "LeftLine", "Pa", "pressure", state="LeftLineState")
    ]
    steering_pressure_right: Annotated[
        float, Received("SteeringPressures", "RightLine", "Pa", "pressure", state="RightLineState")
    ]


_ROWS: Final = [
    (name, row) for table in (Inputs, Beside) for name, row in rows(table, Received) if row.sensed
]
NAMES: Final = tuple(name for name, _ in _ROWS)
"""Every sensed signal: those of the estimators' inputs in their order, then those beside them."""
MESSAGES: Final = tuple(row.message for _, row in _ROWS)
"""The message of each."""
COUNT: Final = len(NAMES)

PLACE: Final = {name: place for place, name in enumerate(NAMES)}
ANGLE, RATE = PLACE["articulation_angle"], PLACE["articulation_rate"]
WHEEL, TORQUE = PLACE["wheel_speed_1"], PLACE["wheel_torque_1"]
"""Of the first wheel; the others follow."""
FORCE = PLACE["specific_force_x"]
ROLL_RATE, PITCH_RATE, YAW_RATE = PLACE["roll_rate"], PLACE["pitch_rate"], PLACE["yaw_rate"]
PITCH, ROLL, SLOPE_RATE = PLACE["pitch"], PLACE["roll"], PLACE["slope_pitch_rate"]
LIFT, TILT = PLACE["lift_pressure"], PLACE["tilt_pressure"]
ARM, BUCKET = PLACE["lift_arm_angle"], PLACE["tilt_angle"]
LEFT_LINE, RIGHT_LINE = PLACE["steering_pressure_left"], PLACE["steering_pressure_right"]
