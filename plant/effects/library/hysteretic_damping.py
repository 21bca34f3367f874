"""Damping by the hysteresis of the rubber."""

from collections.abc import Mapping

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import pressed
from plant.physics.parameters import W_ADDED_LOAD, W_DAMPING, W_NOMINAL_LOAD, W_QFZ1, W_QFZ2, W_RADIUS
from plant.physics.state import T_DEFLECTION
from plant.physics.workspace import Workspace

TIMES = (1.0 / 6.283185, 1.0 / 31.415927)  # of the two elements [s]: 1 and 5 Hz
SHARE = 1.40  # stiffness of either element over loss factor times the tyre's: level within 4 % from 1 to 5 Hz


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Two springs in series with a damper each, beside the tyre's spring."""
    block = work.local[wheel]
    deflection = max(pressed(state, p, work, wheel), 0.0)
    radius = block[W_RADIUS]
    stiffness = block[W_NOMINAL_LOAD] / radius * (block[W_QFZ1] + 2.0 * block[W_QFZ2] * deflection / radius)
    block[W_DAMPING] *= q[1]
    for i in range(2):
        own = x + 2 * wheel + i
        behind = deflection - state[own]
        block[W_ADDED_LOAD] += SHARE * q[0] * stiffness * behind
        work.rate[own] = behind / TIMES[i]


def start(q: Mapping[str, float], x: int, state: Array, p: Array, work: Workspace) -> None:
    """At rest the elements are without force."""
    for wheel in range(4):
        state[x + 2 * wheel : x + 2 * wheel + 2] = max(work.tyres[wheel, T_DEFLECTION], 0.0)


EFFECT = Effect(
    name="hysteretic_damping",
    sentence="The rubber loses the same share of energy in every cycle, whatever its frequency.",
    equation="c = eta k/omega, by two Maxwell elements at 1 and 5 Hz",
    parameters=(
        Parameter("loss_factor", "1", 0.15, 0.0, 0.6, "eta: 0.1 to 0.2"),
        Parameter("viscous_share", "1", 0.0, 0.0, 1.0, "what is kept of the machine file's damper", off=1.0),
    ),
    acts_on="normal forces",
    signature="Ringing of every frequency dies away after the same number of cycles.",
    excited_by="drop test, bumps",
    confusable=(Confusable("vertical_damping", "viscous damping grows with the frequency"),),
    source="structural damping",
    own_states=8,
)
