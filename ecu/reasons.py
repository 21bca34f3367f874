"""Conditions of the warnings: roll-over states and reasons, from the estimates and their validity.

Conditions are found here cycle by cycle; `ecu.alarms` decides when an alarm is raised and dropped.
"""

import enum
from collections.abc import Mapping
from typing import Final, NamedTuple

from ecu.alarms import Alarm, Times, below
from ecu.estimators.signals import NEVER, Estimates
from ecu.inputs import CycleInputs
from ecu.rules import AlarmRules, WarningRules
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


class Delay(enum.Enum):
    """How long a condition has to hold before it is shown."""

    NONE = "one cycle is enough"
    SHORT = "the machine is about to go over"
    USUAL = "a driver cannot act on less"


class Reason(NamedTuple):
    """The level of a reason, and how long it has to hold before it is shown."""

    level: Level
    delay: Delay


REASONS: Final[Mapping[str, Reason]] = {
    "RollOverPredicted": Reason(Level.WARNING, Delay.SHORT),
    "RollOverNow": Reason(Level.STOP, Delay.SHORT),
    "WheelLifted": Reason(Level.STOP, Delay.SHORT),
    "WheelSpin": Reason(Level.INFORMATION, Delay.USUAL),
    "WheelLock": Reason(Level.INFORMATION, Delay.USUAL),
    "AxleOverload": Reason(Level.CAUTION, Delay.USUAL),
    "ArticulationNearStop": Reason(Level.INFORMATION, Delay.USUAL),
    "SteepSlope": Reason(Level.CAUTION, Delay.USUAL),
    "PayloadHigh": Reason(Level.CAUTION, Delay.USUAL),
    "InputStale": Reason(Level.CAUTION, Delay.NONE),
    "InputImplausible": Reason(Level.CAUTION, Delay.NONE),
    "ProtectionError": Reason(Level.INFORMATION, Delay.NONE),
    "CycleOverrun": Reason(Level.INFORMATION, Delay.NONE),
    "EstimateInvalid": Reason(Level.CAUTION, Delay.NONE),
}
"""Every reason of the DBC's Warnings message."""
PREVENTION: Final = "prevention"
"""Not a reason but an alarm all the same: the limits act at once and do not let go for an instant."""

STATES: Final = (RollOver.ATTENTION, RollOver.WARNING, RollOver.IMMINENT, RollOver.LIFTED)
"""Roll-over states that are alarms, the lesser first."""


def times(rules: AlarmRules) -> dict[str, Times]:
    """The delays of every reason, of every roll-over state, and of the prevention."""
    on = {Delay.NONE: 0, Delay.SHORT: _ns(rules.short_delay), Delay.USUAL: _ns(rules.usual_delay)}
    delays = {name: reason.delay for name, reason in REASONS.items()}
    delays |= {state.name: Delay.SHORT for state in STATES} | {PREVENTION: Delay.NONE}
    least_on, off = _ns(rules.least_on), _ns(rules.off_delay)
    return {
        name: Times(on_delay_ns=on[delay], least_on_ns=least_on, off_delay_ns=off)
        for name, delay in delays.items()
    }


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


def roll_over_conditions(
    e: Estimates, valid: bool, alarms: Mapping[str, Alarm], rules: WarningRules
) -> dict[str, bool]:
    """Which roll-over states hold in this cycle; a state that is on has a threshold higher by the hysteresis."""
    margin = min(e.lift_off_margin, e.predicted_margin)

    def under(state: RollOver, value: float, threshold: float) -> bool:
        alarm = alarms.get(state.name)
        return below(value, threshold, rules.margin_hysteresis, alarm is not None and alarm.on)

    lifted = e.lift_off_margin <= 0.0 or under(RollOver.LIFTED, e.lift_off_margin, 0.0)
    soon = e.time_to_lift_off <= rules.imminent_time
    imminent = lifted or soon or under(RollOver.IMMINENT, margin, rules.imminent_margin)
    some_time = e.time_to_lift_off < NEVER
    warning = imminent or some_time or under(RollOver.WARNING, margin, rules.warning_margin)
    attention = warning or under(RollOver.ATTENTION, margin, rules.attention_margin)
    found = (attention, warning, imminent, lifted)
    return {state.name: valid and holds for state, holds in zip(STATES, found, strict=True)}


def roll_over_state(alarms: Mapping[str, Alarm], valid: bool) -> RollOver:
    """The gravest state whose alarm is on."""
    if not valid:
        return RollOver.NOT_AVAILABLE
    return max((state for state in STATES if alarms[state.name].on), default=RollOver.STABLE)


def conditions(
    e: Estimates,
    received: CycleInputs,
    valid: Mapping[str, bool],
    articulation_stop: float,
    rules: WarningRules,
) -> dict[str, bool]:
    """The reasons that hold by estimates and inputs; the cycle adds what it knows itself."""
    normal = (e.normal_1, e.normal_2, e.normal_3, e.normal_4)
    slips = (e.slip_1, e.slip_2, e.slip_3, e.slip_4)
    believed = [slip for slip, n in zip(slips, WHEELS, strict=True) if valid[f"slip_{n}"]]
    v = received.values
    moving = valid["speed"] and abs(e.speed) > rules.lock_speed
    return {
        "RollOverPredicted": valid["roll_over"] and e.time_to_lift_off < NEVER,
        "RollOverNow": valid["roll_over"] and e.lift_off_margin < rules.imminent_margin,
        "WheelLifted": valid["normal"] and min(normal) <= 0.0,
        "WheelSpin": max(believed, default=0.0) > rules.spin_slip,
        "WheelLock": moving and min(believed, default=0.0) < rules.lock_slip,
        "AxleOverload": valid["normal"]
        and max(normal[0] + normal[1], normal[2] + normal[3]) > rules.axle_rating,
        "ArticulationNearStop": received.all_usable("articulation_angle")
        and abs(v["articulation_angle"]) > articulation_stop - rules.stop_distance,
        "SteepSlope": received.all_usable("pitch", "roll")
        and max(abs(e.slope_pitch), abs(e.slope_roll)) > rules.slope,
        "PayloadHigh": valid["payload"]
        and valid["speed"]
        and e.payload > rules.payload
        and v["lift_arm_angle"] > rules.payload_arm
        and abs(e.speed) > rules.payload_speed,
        "InputStale": bool(received.stale),
        "InputImplausible": bool(received.implausible),
        "EstimateInvalid": not all(valid.values()),
    }


def level(raised: Mapping[str, bool]) -> Level:
    """The highest level among the reasons that are on."""
    return max((REASONS[reason].level for reason, on in raised.items() if on), default=Level.NONE)
