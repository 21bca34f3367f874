"""Finds the effects: the modules beside this one, and the user's own."""

import importlib.util
import os
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

from plant.checked import ConfigurationError
from plant.effects.effect import Effect

FOLDER = Path(__file__).resolve().parent
MACHINERY = {"__init__", "blocks", "dispatch", "effect", "faults", "handbook", "library", "ports"}
VARIABLE = "LOADERHIL_EFFECTS"
"""Environment variable with a folder of further effects, one file each."""


def effect_files() -> list[Path]:
    """The files that each define an effect, the library's first, each group by name."""
    own = sorted(path for path in FOLDER.glob("*.py") if path.stem not in MACHINERY)
    folder = os.environ.get(VARIABLE)
    if not folder:
        return own
    if not Path(folder).is_dir():
        raise ConfigurationError(f"{VARIABLE}={folder}: there is no such folder")
    return own + sorted(Path(folder).resolve().glob("*.py"))


def module_name(path: Path) -> str:
    """The name under which the module of an effect is imported."""
    return f"plant.effects.{path.stem}" if path.parent == FOLDER else f"loaderhil_effect_{path.stem}"


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
    if path.parent == FOLDER:
        return importlib.import_module(name)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigurationError(f"{path}: cannot be loaded as a Python file")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
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
