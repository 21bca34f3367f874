"""Sideways shift of the contact patch."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import heading, twist
from plant.physics.state import T_LATERAL, T_NORMAL, T_WRENCH, WHEEL
from plant.physics.workspace import Workspace


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """The load moves with the patch, to the side to which the road pushes the tyre."""
    out, n = work.tyres[wheel], work.normal
    _, _, _, sx, sy, sz = heading(work, wheel)
    shifted = q[0] * out[T_NORMAL] * out[T_LATERAL]
    mx, my, mz = (
        shifted * (sy * n[2] - sz * n[1]),
        shifted * (sz * n[0] - sx * n[2]),
        shifted * (sx * n[1] - sy * n[0]),
    )
    twist(work, WHEEL + wheel, mx, my, mz)
    out[T_WRENCH] += mx
    out[T_WRENCH + 1] += my
    out[T_WRENCH + 2] += mz


EFFECT = Effect(
    name="lateral_deflection",
    sentence="The tyres deflect sideways, so that the contacts of the outer ones move towards the middle.",
    equation="M_x = N F_y c_y",
    parameters=(
        Parameter(
            "compliance_mm_per_kN",
            "mm/kN",
            2.5,
            0.0,
            20.0,
            "c_y of one tyre: 2.5 is a stiffness of 0.4 MN/m",
            si=1e-6,
        ),
    ),
    acts_on="load transfer, lift-off",
    signature="Lift-off comes earlier than for rigid tyres; the surplus grows with the square of the lateral acceleration.",
    excited_by="hard turns up to lift-off",
    confusable=(Confusable("mass_split", "an error of the height is linear in the lateral acceleration"),),
    source="shift of the patch by the carcass; stiffness of MF 6.1 property files scaled to the load",
)
