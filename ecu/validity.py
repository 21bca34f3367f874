"""Which estimate depends on which inputs: a table, and the flags that go into the frames.

Three conditions are derived from the inputs: *motion* is known from the inertial sensor with the gyro,
or else from the rear wheels with the slope sensor; *speed* from any wheel; *mass* from pressures and pose.
"""

from collections.abc import Mapping
from typing import Final

from ecu.inputs import Heard

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


def conditions(heard: Heard) -> dict[str, bool]:
    """The conditions of the table, from the inputs."""
    wheels = {f"wheel_{n}": heard.usable[f"wheel_speed_{n}"] for n in WHEELS}
    inertial = heard.all_usable(
        "specific_force_x", "specific_force_y", "specific_force_z", "roll_rate", "pitch_rate", "yaw_rate"
    )
    from_wheels = wheels["wheel_3"] and wheels["wheel_4"] and heard.all_usable("pitch", "roll")
    return {
        **wheels,
        "articulation": heard.all_usable("articulation_angle", "articulation_rate"),
        "mass": heard.all_usable("lift_pressure", "tilt_pressure", "lift_arm_angle", "tilt_angle"),
        "motion": inertial or from_wheels,
        "speed": any(wheels.values()),
        "torque": heard.all_usable(*(f"wheel_torque_{n}" for n in WHEELS)),
    }


def valid(heard: Heard) -> dict[str, bool]:
    """Which estimates may be called valid."""
    known = conditions(heard)
    return {estimate: all(known[need] for need in needs) for estimate, needs in NEEDS.items()}


NOTHING: Final[Mapping[str, bool]] = dict.fromkeys(NEEDS, False)
"""Before the first estimate."""
