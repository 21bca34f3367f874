"""Torsion of the frames."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import P_WHEELS, W_CENTRE
from plant.physics.state import G_HEIGHT, T_NORMAL
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Seen from the rear frame, the twisted front axle leaves the ground on one side and meets it on the other.

    The front frame's own roll by the torsion is left out.
    """
    if wheel < 2:
        work.ground[wheel, G_HEIGHT] -= state[x] * p[P_WHEELS + W_CENTRE + 1] * (1.0 if wheel == 0 else -1.0)


@uncounted
def states(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """The twist follows the roll moment of the front wheels."""
    moment = p[P_WHEELS + W_CENTRE + 1] * (work.tyres[0, T_NORMAL] - work.tyres[1, T_NORMAL])
    work.rate[x] = (moment * q[0] - state[x]) / q[1]


EFFECT = Effect(
    name="frame_torsion",
    sentence="The frames twist between the axles, so that the machine rolls further.",
    equation="phi_f - phi_r = c_t t/2 (N_1 - N_2)",
    parameters=(
        Parameter(
            "compliance_mrad_per_kN_m",
            "mrad/(kN m)",
            1.0,
            0.0,
            10.0,
            "c_t: 0.2 to 1, a stiffness of 1e6 to 5e6 N m/rad",
            si=1e-6,
        ),
        Parameter("time_constant_ms", "ms", 30.0, 5.0, 500.0, "of the twist", si=1e-3, shape=True),
    ),
    acts_on="roll, front normal forces",
    signature="The rear frame rolls more than the tyres allow, in proportion to the difference of the front loads.",
    excited_by="loaded lift at full articulation, one wheel on a kerb",
    confusable=(
        Confusable("pivot_friction", "friction shows a loop over the twist"),
        Confusable("roll_inertia", "inertia shows only in transients"),
    ),
    source="series torsion spring between the axles",
    own_states=1,
)
