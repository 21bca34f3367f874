"""Where the axles are along the frames."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import P_OSCILLATION_X, W_CENTRE
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Move the front wheels along the front frame, the rear axle's pivot along the rear frame."""
    for block in wheel_blocks(p)[:2]:
        block[W_CENTRE] += q["front_mm"]
    p[P_OSCILLATION_X] -= q["rear_mm"]


EFFECT = Effect(
    name="axle_position",
    sentence="The joint is not in the middle between the axles, or not where assumed.",
    equation="omega = (V sin(delta) + l_r ddelta/dt)/(l_f + l_r cos(delta)), l -> l + d",
    parameters=(
        Parameter("front_mm", "mm", 150.0, -600.0, 600.0, "d: further ahead of the joint", si=1e-3),
        Parameter("rear_mm", "mm", -150.0, -600.0, 600.0, "d: further behind the joint", si=1e-3),
    ),
    acts_on="yaw rate, wheel speeds, normal forces",
    signature="Yaw rate at zero speed while steering; wheel speeds differ with the articulation rate.",
    excited_by="steering at standstill",
    confusable=(Confusable("gyro_bias", "a bias is there without steering"),),
    source="kinematics of an articulated vehicle with unequal halves",
)
