"""A shaft between the axles."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import JOINT_RATE, WHEEL
from plant.physics.workspace import Workspace


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """The faster axle drives the slower one through the wound-up shaft; open differentials share equally."""
    wheels = JOINT_RATE + WHEEL
    difference = 0.5 * (state[wheels] + state[wheels + 1] - state[wheels + 2] - state[wheels + 3])
    torque = q[0] * state[x] + q[1] * difference
    work.rate[x] = difference
    for wheel in range(4):
        work.tree.effort[WHEEL + wheel] += (-0.5 if wheel < 2 else 0.5) * torque


EFFECT = Effect(
    name="driveline_torsion",
    sentence="The axles are coupled by a shaft that winds up when they want to turn at different speeds.",
    equation="T = k_d dphi + c_d ddphi/dt, omega_f = omega_r",
    parameters=(
        Parameter("stiffness_N_m_per_rad", "N m/rad", 2.0e5, 0.0, 1e7, "k_d, seen at the wheels"),
        Parameter(
            "damping_N_m_s_per_rad", "N m s/rad", 950.0, 0.0, 1e5, "c_d, seen at the wheels", shape=True
        ),
    ),
    acts_on="slip front against rear, wheel speeds",
    signature="Slips of opposite sign front and rear in turns; front and rear wheel speeds move together.",
    excited_by="zigzag, unequal tyres",
    confusable=(Confusable("tyre_wear", "worn tyres give the same slip in turns and straight ahead"),),
    source="two inertias and a shaft",
    own_states=1,
)
