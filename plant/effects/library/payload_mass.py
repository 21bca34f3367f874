"""Payload other than reported."""

from collections.abc import Mapping

import numpy as np

from plant.effects.blocks import body_block
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import B_BUCKET, joined
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Add load of the payload's shape to the bucket."""
    load, mass = machine.payload, q["extra_kg"]
    share = mass / load.reference_mass
    added = np.array(
        [mass, load.x, 0.0, load.z, load.ixx * share, load.iyy * share, load.izz * share, 0.0, 0.0, 0.0]
    )
    bucket = body_block(p, B_BUCKET)
    bucket[:] = joined(bucket, added)


EFFECT = Effect(
    name="payload_mass",
    sentence="There is more or less in the bucket than assumed.",
    equation="m_l -> m_l + d",
    parameters=(Parameter("extra_kg", "kg", 600.0, -800.0, 6000.0, "d; less than there is in the bucket"),),
    acts_on="normal forces, lift pressure, acceleration",
    signature="Lift pressure and front loads offset at standstill; less acceleration per torque.",
    excited_by="lifting, accelerating",
    confusable=(
        Confusable("pile_entry", "a pile's force is gone with the pile"),
        Confusable("lift_arm_inertia", "inertia shows only while the arm accelerates"),
        Confusable("grade", "a slope does not show in the lift pressure"),
    ),
    source="statics",
)
