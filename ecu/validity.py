"""Which estimate depends on which inputs: a table, and the flags that go into the frames.

Three conditions are derived from the inputs: *motion* is known from the inertial sensor with the gyro,
or else from the rear wheels with the slope sensor; *speed* from any wheel; *mass* from pressures and pose.
"""

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Final

from ecu.bus_signals import Sent, rows
from ecu.estimators.signals import Estimates

WHEELS: Final = (1, 2, 3, 4)

NEEDS: Final[Mapping[str, tuple[str, ...]]] = {
    "normal": ("articulation", "mass", "motion"),
    "roll_over": ("articulation", "mass", "motion", "speed"),
    "joint_torque": ("articulation", "mass", "motion"),
    "yaw_moment": ("articulation", "mass", "motion", "torque"),
    "payload": ("mass",),
    "speed": ("speed",),
    **{f"slip_{n}": ("articulation", "mass", "motion", "speed", f"wheel_{n}") for n in WHEELS},
    **{f"force_{n}": ("articulation", "mass", "motion", "torque", f"wheel_{n}") for n in WHEELS},
}


def conditions(usable: Callable[..., bool]) -> dict[str, bool]:
    """The conditions of the table; usable(*targets): whether all of these inputs may be relied on."""
    wheels = {f"wheel_{n}": usable(f"wheel_speed_{n}") for n in WHEELS}
    inertial = usable(
        "specific_force_x", "specific_force_y", "specific_force_z", "roll_rate", "pitch_rate", "yaw_rate"
    )
    from_wheels = wheels["wheel_3"] and wheels["wheel_4"] and usable("pitch", "roll")
    return {
        **wheels,
        "articulation": usable("articulation_angle", "articulation_rate"),
        "mass": usable("lift_pressure", "tilt_pressure", "lift_arm_angle", "tilt_angle"),
        "motion": inertial or from_wheels,
        "speed": any(wheels.values()),
        "torque": usable(*(f"wheel_torque_{n}" for n in WHEELS)),
    }


@lru_cache(maxsize=256)
def valid_without(unusable: frozenset[str]) -> Mapping[str, bool]:
    """Which estimates may be called valid while these inputs are unusable; kept, because they seldom change."""
    known = conditions(lambda *targets: unusable.isdisjoint(targets))
    return {estimate: all(known[need] for need in needs) for estimate, needs in NEEDS.items()}


NOTHING: Final[Mapping[str, bool]] = dict.fromkeys(NEEDS, False)
"""Before the first estimate."""

DEVIATIONS: Final[Mapping[str, str]] = {
    name: row.deviation_of for name, row in rows(Estimates, Sent) if row.deviation_of
}
"""Standard deviation -> the entry of the table whose estimate it belongs to."""


def unknown_deviations(estimates: Estimates, valid: Mapping[str, bool]) -> dict[str, float]:
    """NaN for each standard deviation that means nothing: its estimate is not valid, or the equations give none (0)."""
    return {
        name: math.nan for name, of in DEVIATIONS.items() if not valid[of] or getattr(estimates, name) <= 0.0
    }
