"""Calls the compiled functions of the effects that are switched on.

The callers are generated, one line per effect and hook, from the effects that were found, and kept in a
file so that their machine code is cached. Their first argument, the vector `active`, holds whether any effect that is
on has each hook (JOINTS and so on), then a switch for each effect, then the parameters of each, MOST_PARAMETERS per effect.
"""

import importlib.util
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from configuration import ConfigurationError
from plant.compiled import CODE, DIGEST
from plant.effects.effect import HOOKS, MOST_PARAMETERS, ActiveEffect, Effect
from plant.effects.registry import modules, python_hook
from plant.physics.state import EXTRA, EXTRAS
from plant.physics.workspace import Workspace

Array = NDArray[np.float64]

ARGUMENTS = {
    "joints": "state, p, work",
    "before_tyre": "state, p, work",
    "after_tyre": "state, p, work",
    "bodies": "state, p, work",
    "states": "state, p, work",
}
OF_WHEELS: Final = ("before_tyre", "after_tyre")
"""Hooks of an effect that are called for each wheel."""


JOINTS: Final = HOOKS.index("joints")
BEFORE_TYRE: Final = HOOKS.index("before_tyre")
AFTER_TYRE: Final = HOOKS.index("after_tyre")
BODIES: Final = HOOKS.index("bodies")
STATES: Final = HOOKS.index("states")
"""Places in `active`: not zero where the hook has to be called. Who calls looks first, because a call for nothing costs as
much as a small effect."""


def _first_states(found: dict[str, ModuleType]) -> dict[str, int]:
    """Index of each effect's first own state."""
    first, out = EXTRA, {}
    for name, module in found.items():
        out[name] = first
        first += module.EFFECT.own_states
    if first > EXTRA + EXTRAS:
        raise ConfigurationError(
            f"the effects have {first - EXTRA} states of their own together, more than {EXTRAS}"
        )
    return out


def source(found: dict[str, ModuleType]) -> str:
    """Text of the module that calls the effects."""
    lines = ["from plant.compiled import inlined"]
    lines += [f"import {module.__name__} as effect_{i}" for i, module in enumerate(found.values())]
    first = _first_states(found)
    for hook in HOOKS:
        lines += [
            "",
            "",
            "@inlined",
            f"def {hook}(active, {ARGUMENTS[hook]}) -> None:",
            f'    """Every effect\'s {hook}."""',
        ]
        for i, (name, module) in enumerate(found.items()):
            if hasattr(module, hook):
                begin = _parameters_at(i, len(found))
                q = f"active[{begin} : {begin + MOST_PARAMETERS}]"
                lines.append(f"    if active[{len(HOOKS) + i}] != 0.0:")
                if hook in OF_WHEELS:  # one look at the switch for all wheels
                    lines += [
                        "        for wheel in range(4):",
                        f"            effect_{i}.{hook}({q}, {first[name]}, state, p, wheel, work)",
                    ]
                else:
                    lines.append(f"        effect_{i}.{hook}({q}, {first[name]}, {ARGUMENTS[hook]})")
    return "\n".join(lines) + "\n"


def _parameters_at(effect: int, count: int) -> int:
    """Place of an effect's first parameter in `active`; count: of all effects."""
    return len(HOOKS) + count + MOST_PARAMETERS * effect


def _generated() -> ModuleType:
    """The generated module: its file is kept with the machine code of the sources it was made from."""
    name = f"loaderhil_effects_{DIGEST}"
    path = CODE / f"{name}.py"
    found = modules()  # what the generated module imports is loaded, the user's files too
    if not path.is_file():
        fresh = path.with_suffix(f".{os.getpid()}")
        fresh.write_text(source(found), encoding="utf-8")
        fresh.replace(path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None  # for a file that ends in .py
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SWITCHES: Final = _parameters_at(0, len(modules()))
"""How many numbers at the head of `active` say what has to be called."""
PARAMETERS: Final = MOST_PARAMETERS * len(modules())
"""How many numbers behind them are parameters."""

_module = _generated()
joints = _module.joints
before_tyre = _module.before_tyre
after_tyre = _module.after_tyre
bodies = _module.bodies
states = _module.states


def compiled_hooks(effect: Effect) -> list[str]:
    """The names of the compiled functions of an effect."""
    return [hook for hook in HOOKS if hasattr(modules()[effect.name], hook)]


def active_vector(chosen: Sequence[ActiveEffect]) -> Array | None:
    """The vector `active` of the compiled callers; None where no chosen effect has a compiled function."""
    if not any(compiled_hooks(item.effect) for item in chosen):
        return None
    names = list(modules())
    active = np.zeros(_parameters_at(len(names), len(names)))
    for item in chosen:
        i = names.index(item.effect.name)
        begin = _parameters_at(i, len(names))
        active[len(HOOKS) + i] = 1.0
        for hook in compiled_hooks(item.effect):
            active[HOOKS.index(hook)] = 1.0
        active[begin : begin + len(item.values)] = item.values
    return active


def start(chosen: Sequence[ActiveEffect], state: Array, p: Array, work: Workspace) -> bool:
    """Set the own states of the chosen effects for a plant that rests at `state`; whether any changed."""
    before = state[EXTRA : EXTRA + EXTRAS].copy()
    first = _first_states(modules())
    for item in chosen:
        begin = python_hook(item.effect, "start")
        if begin is not None:
            begin(item.named, first[item.effect.name], state, p, work)
    return not np.allclose(before, state[EXTRA : EXTRA + EXTRAS], rtol=1e-9, atol=1e-12)
