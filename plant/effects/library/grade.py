"""A slope of the road."""

import math
from collections.abc import Mapping

from plant.effects.effect import Array, Confusable, Effect, degrees
from plant.physics.parameters import P_NORMAL
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Tilt the road, in addition to the scenario's own slopes."""
    grade = math.atan2(-p[P_NORMAL], p[P_NORMAL + 2]) + q["grade_deg"]
    bank = math.asin(-p[P_NORMAL + 1]) + q["bank_deg"]
    p[P_NORMAL] = -math.sin(grade) * math.cos(bank)
    p[P_NORMAL + 1] = -math.sin(bank)
    p[P_NORMAL + 2] = math.cos(grade) * math.cos(bank)


EFFECT = Effect(
    name="grade",
    sentence="The road is not level.",
    equation="F_x = -m g sin(grade), M_x = m g h sin(bank)",
    parameters=(
        degrees("grade_deg", 3.0, -30.0, 30.0, "uphill along the world's x axis"),
        degrees("bank_deg", 0.0, -30.0, 30.0, "left side higher"),
    ),
    acts_on="longitudinal force, normal forces, acceleration readings",
    signature="Gravity shows in the accelerometer but not in the wheels' acceleration; its sign follows the heading.",
    excited_by="driving the same road in both directions",
    confusable=(
        Confusable("rolling_resistance", "resistance acts against the motion in both directions"),
        Confusable("accelerometer_bias", "a bias stays when the heading is reversed"),
    ),
    source="equilibrium on a plane",
)
