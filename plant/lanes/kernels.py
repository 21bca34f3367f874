"""The equations of motion for LANES machines at once: the text of `plant.physics` and `plant.replay`, read by `bus.lanes`.

All arrays are (count, LANES). Machines differ in state, commands, parameters, and the parameters of effects; which effects are on is the same in all. A machine
whose cylinders may be overloaded is reported and not advanced, because the relief valves take a page of text that is seldom needed.
"""

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bus.lanes.kernel import Fixed, Joined, Lanes, Same, is_readable, kernel, values_of
from plant.effects.dispatch import PARAMETERS as EFFECT_PARAMETERS
from plant.effects.dispatch import SWITCHES
from plant.effects.effect import HOOKS, MOST_PARAMETERS
from plant.effects.registry import modules
from plant.observer import MEASURES, observe
from plant.physics import state as s
from plant.physics.dynamics import advance, open_valves
from plant.physics.kinematics import Places
from plant.physics.multibody import Tree
from plant.physics.parameters import P_WHEELS, PARAMETERS, W_RADIUS
from plant.physics.workspace import Workspace, new_workspace
from plant.replay import MEASURED, command_of, draw
from plant.truth import Truth

Array = NDArray[np.float64]

SETTINGS: Final = 6
STEP, INTERVAL, SHARE, DEMANDED = range(4)
"""Places in the settings of a kernel: step and interval of the rows [s], share of the difference of speed to correct, and, from
DEMANDED on, for each driven joint whether its demand was recorded (1) or its rate (0)."""


def _values(work: Any) -> Any:
    """A workspace whose arrays hold values of lanes."""
    tree, places, *others = work
    return Workspace(Tree(*map(values_of, tree)), Places(*map(values_of, places)), *map(values_of, others))


WORK: Final = Fixed(lambda: _values(new_workspace()), lambda work: [*work.tree, *work.places, *work[2:]])
NO_EFFECTS: Final = Fixed(lambda: None)
EFFECTS: Final = Joined(SWITCHES, EFFECT_PARAMETERS)

STATE: Final = Lanes(s.STATES, written=True)
P: Final = Lanes(PARAMETERS)

_OF_HOOK: Final = {
    "joints": (P, WORK),
    "before_tyre": (P, Fixed(lambda: 0), WORK),
    "after_tyre": (P, Fixed(lambda: 0), WORK),
    "bodies": (P, WORK),
    "states": (P, WORK),
}
"""Arguments of each hook of an effect behind its parameters, its first state and the plant's state."""


def unreadable(found: Mapping[str, ModuleType]) -> list[Callable[..., None]]:
    """The hooks of effects, by name, whose text has something that lanes cannot do: a machine on which one of them acts is computed alone."""
    hooks = [(module, hook) for module in found.values() for hook in HOOKS if hasattr(module, hook)]
    head = (Lanes(MOST_PARAMETERS), Fixed(lambda: s.EXTRA), STATE)
    return [
        getattr(module, hook)
        for module, hook in hooks
        if not is_readable(getattr(module, hook), (*head, *_OF_HOOK[hook]))
    ]


RARE: Final = (
    open_valves,
    # those of the library can all be read, which a test holds
    *unreadable({n: m for n, m in modules().items() if not m.__name__.startswith("plant.")}),
)
PLAIN_STATE: Final = Lanes(s.EXTRA, written=True, seen=s.STATES)
COMMAND: Final = Lanes(s.COMMANDS)


def one_step(
    state: Array, command: Array, p: Array, settings: Array, work: Workspace, active: Array | None
) -> None:
    """One step."""
    advance(state, command, p, settings[STEP], 1, False, work, active)


def one_row(
    row: Array, state: Array, command: Array, p: Array, measures: Array, work: Workspace, active: Array | None
) -> None:
    """The record of a state."""
    observe(row, state, command, p, work, active, measures)


def one_command(command: Array, state: Array, now: Array, after: Array, p: Array, settings: Array) -> None:
    """The command that makes a machine do what was measured until the next row."""
    demanded = settings[DEMANDED] != 0.0, settings[DEMANDED + 1] != 0.0, settings[DEMANDED + 2] != 0.0
    command_of(command, state, now, after, settings[INTERVAL], settings[STEP], p, demanded)


def one_draw(state: Array, after: Array, p: Array, settings: Array) -> None:
    """The correction of the speed at the next row."""
    draw(state, after, p[P_WHEELS + W_RADIUS], settings[SHARE])


_ROW = Lanes(Truth.size, written=True)
_STEP_TAIL = (COMMAND, P, Same(SETTINGS), WORK)
_ROW_TAIL = (COMMAND, P, Lanes(MEASURES), WORK)

step_plain = kernel("step_plain", one_step, (PLAIN_STATE, *_STEP_TAIL, NO_EFFECTS), rare=RARE)
row_plain = kernel(
    "row_plain", one_row, (_ROW, Lanes(s.EXTRA, seen=s.STATES), *_ROW_TAIL, NO_EFFECTS), rare=RARE
)
step_effects = kernel("step_effects", one_step, (STATE, *_STEP_TAIL, EFFECTS), rare=RARE)
row_effects = kernel("row_effects", one_row, (_ROW, Lanes(s.STATES), *_ROW_TAIL, EFFECTS), rare=RARE)
_MEASURED = Lanes(MEASURED)
command_lanes = kernel(
    "command_lanes",
    one_command,
    (Lanes(s.COMMANDS, written=True), Lanes(s.STATES), _MEASURED, _MEASURED, P, Same(SETTINGS)),
)
draw_lanes = kernel("draw_lanes", one_draw, (STATE, _MEASURED, P, Same(SETTINGS)))
