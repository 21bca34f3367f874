"""Loads the effects, the library's and the user's own, and finds what their modules define."""

import importlib.util
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from configuration import ConfigurationError
from plant.effects.effect import PYTHON_HOOKS, Effect
from plant.effects.files import LIBRARY, effect_files, module_name

MOVED = {
    "plant.state": "plant.physics.state",
    "plant.workspace": "plant.physics.workspace",
    "plant.parameters": "plant.physics.parameters",
    "plant.tyre": "plant.physics.tyre",
    "plant.machine": "plant.sheets.machine",
    "plant.sensors": "plant.unit.sensor_parameters",
}
"""New names of modules that effect files of users imported before version 0.2."""


@cache
def modules() -> dict[str, ModuleType]:
    """Module of every effect by the effect's name; a broken file of the user gives one clear error."""
    found: dict[str, ModuleType] = {}
    for path in effect_files():
        module = _load(path)
        item = getattr(module, "EFFECT", None)
        if not isinstance(item, Effect):
            raise ConfigurationError(f"{path}: defines no EFFECT of type plant.effects.Effect")
        if item.name in found:
            raise ConfigurationError(f"{path}: an effect named {item.name!r} exists already")
        found[item.name] = module
    return found


def _load(path: Path) -> ModuleType:
    name = module_name(path)
    if path.parent == LIBRARY:
        return importlib.import_module(name)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigurationError(f"{path}: cannot be loaded as a Python file")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except ModuleNotFoundError as error:
        del sys.modules[name]
        new = MOVED.get(str(error.name))
        hint = f"; it is now named {new}" if new else ""
        raise ConfigurationError(f"{path}: {error}{hint}") from error
    except Exception as error:
        del sys.modules[name]
        raise ConfigurationError(f"{path}: {type(error).__name__}: {error}") from error
    return module


def effects() -> dict[str, Effect]:
    """Every effect by name."""
    return {name: module.EFFECT for name, module in modules().items()}


def find_effect(name: str) -> Effect:
    """One effect by name."""
    known = effects()
    if name not in known:
        raise ConfigurationError(f"no effect named {name!r}; known: {', '.join(sorted(known))}")
    return known[name]


def python_hook(effect: Effect, name: str) -> Callable[..., Any] | None:
    """The function `name`, one of PYTHON_HOOKS, of the effect's module; None where the module has none."""
    assert name in PYTHON_HOOKS
    found: Callable[..., Any] | None = getattr(modules()[effect.name], name, None)
    return found
