"""Thresholds and times of the ECU that are no physics: limits, warnings, alarms, plausibility of inputs. SI."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitRules:
    """How the limits answer to the margin, SI."""

    front_torque: float  # no limit [N m]
    rear_torque: float
    torque_full_margin: float  # full torque from this predicted margin on
    torque_least_margin: float  # least torque at and below this one
    torque_least_share: float
    engage_margin: float  # prevention begins below
    release_margin: float  # and ends above
    creep_speed: float  # the speed is never limited below this by prevention
    safe_torque: float  # values when the roll-over state is unknown
    safe_speed: float
    safe_rate: float
    safe_lift_rate: float
    safe_tilt_rate: float
    speed_fall: float  # how fast the speed limit may fall [m/s2]
    speed_rise: float
    rate_rise: float  # how fast the rate limit may rise [rad/s2]
    linkage_rise: float  # ... and those of lift arm and bucket
    torque_rise: float  # [N m/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningRules:
    """Thresholds of the warnings, SI."""

    attention_margin: float
    warning_margin: float
    imminent_margin: float
    margin_hysteresis: float  # a threshold of these three lies higher by this while its alarm is on
    imminent_time: float
    spin_slip: float
    lock_slip: float
    lock_speed: float
    axle_rating: float
    stop_distance: float
    slope: float
    payload: float
    payload_arm: float
    payload_speed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRules:
    """How long a condition has to hold or to be gone before the driver sees it [s]."""

    short_delay: float  # roll-over
    usual_delay: float  # every other condition found from estimates
    least_on: float  # an alarm stays on at least this long
    off_delay: float  # and until its condition has been gone this long


@dataclass(frozen=True, slots=True, kw_only=True)
class InputRules:
    """When an input is stale or implausible, SI; steps are per frame."""

    stale_cycles: float
    articulation: float
    articulation_rate: float
    wheel_speed: float
    wheel_torque: float
    acceleration: float
    rate: float
    slope: float
    pressure: float
    arm: float
    tilt: float
    articulation_step: float
    wheel_speed_step: float
    linkage_step: float
    slope_step: float
    frozen_frames: float  # identical values in a row that a sensor with noise does not send; 0: not judged
    exchanged_frames: float  # in a row in which left and right wheels turn the wrong way round; 0: not judged
    turning: float  # least yaw rate of an axle to judge that by
    carried: (
        float  # largest lateral specific force to judge it at: no wheel is near to lifting and spinning free
    )
    start_up: float  # inputs may be missing this long after the start [s]
    recovery: float  # after a fault every input has to be good for this long [s]
    least_specific_force: float  # a machine on the ground feels more [m/s2]
