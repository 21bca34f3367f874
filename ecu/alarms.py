"""Roll-over state and warnings with their reasons, from the estimates and what may be believed of them."""

import enum
from collections.abc import Mapping
from typing import Final

from ecu.calibration import WarningRules
from ecu.estimators.estimate import Estimates
from ecu.estimators.rollover import NEVER
from ecu.inputs import Heard
from ecu.validity import WHEELS


class RollOver(enum.IntEnum):
    """Values are those of RollOver.State in the DBC."""

    STABLE = 0
    ATTENTION = 1
    WARNING = 2
    IMMINENT = 3
    LIFTED = 4
    NOT_AVAILABLE = 7


class Level(enum.IntEnum):
    """Values are those of Warnings.Level in the DBC."""

    NONE = 0
    INFORMATION = 1
    CAUTION = 2
    WARNING = 3
    STOP = 4


LEVELS: Final[Mapping[str, Level]] = {
    "RollOverPredicted": Level.WARNING,
    "RollOverNow": Level.STOP,
    "WheelLifted": Level.STOP,
    "WheelSpin": Level.INFORMATION,
    "WheelLock": Level.INFORMATION,
    "AxleOverload": Level.CAUTION,
    "ArticulationNearStop": Level.INFORMATION,
    "SteepSlope": Level.CAUTION,
    "PayloadHigh": Level.CAUTION,
    "InputStale": Level.CAUTION,
    "InputImplausible": Level.CAUTION,
    "ProtectionError": Level.INFORMATION,
    "CycleOverrun": Level.INFORMATION,
    "EstimateInvalid": Level.CAUTION,
}
"""Every reason of the DBC's Warnings message, and how loud it is."""


def roll_over_state(e: Estimates, valid: bool, rules: WarningRules) -> RollOver:
    """How close the machine is to lifting a wheel, now and over the prediction horizon."""
    if not valid:
        return RollOver.NOT_AVAILABLE
    margin = min(e.lift_off_margin, e.predicted_margin)
    if e.lift_off_margin <= 0.0:
        return RollOver.LIFTED
    if e.time_to_lift_off <= rules.imminent_time or margin < rules.imminent_margin:
        return RollOver.IMMINENT
    if e.time_to_lift_off < NEVER or margin < rules.warning_margin:
        return RollOver.WARNING
    return RollOver.ATTENTION if margin < rules.attention_margin else RollOver.STABLE


def reasons(
    e: Estimates,
    heard: Heard,
    valid: Mapping[str, bool],
    articulation_stop: float,
    rules: WarningRules,
) -> dict[str, bool]:
    """The reasons that follow from estimates and inputs; the cycle adds its own."""
    normal = (e.normal_1, e.normal_2, e.normal_3, e.normal_4)
    slips = (e.slip_1, e.slip_2, e.slip_3, e.slip_4)
    believed = [slip for slip, n in zip(slips, WHEELS, strict=True) if valid[f"slip_{n}"]]
    v = heard.values
    moving = valid["speed"] and abs(e.speed) > rules.lock_speed
    return {
        "RollOverPredicted": valid["roll_over"] and e.time_to_lift_off < NEVER,
        "RollOverNow": valid["roll_over"] and e.lift_off_margin < rules.imminent_margin,
        "WheelLifted": valid["normal"] and min(normal) <= 0.0,
        "WheelSpin": max(believed, default=0.0) > rules.spin_slip,
        "WheelLock": moving and min(believed, default=0.0) < rules.lock_slip,
        "AxleOverload": valid["normal"]
        and max(normal[0] + normal[1], normal[2] + normal[3]) > rules.axle_rating,
        "ArticulationNearStop": heard.usable["articulation_angle"]
        and abs(v["articulation_angle"]) > articulation_stop - rules.stop_distance,
        "SteepSlope": heard.all_usable("pitch", "roll")
        and max(abs(v["pitch"]), abs(v["roll"])) > rules.slope,
        "PayloadHigh": valid["payload"]
        and valid["speed"]
        and e.payload > rules.payload
        and v["lift_arm_angle"] > rules.payload_arm
        and abs(e.speed) > rules.payload_speed,
        "InputStale": bool(heard.stale),
        "InputImplausible": bool(heard.implausible),
        "EstimateInvalid": not all(valid.values()),
    }


def level(raised: Mapping[str, bool]) -> Level:
    """The loudest of the reasons that are set."""
    return max((LEVELS[reason] for reason, on in raised.items() if on), default=Level.NONE)
