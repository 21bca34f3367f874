"""Which files define an effect: those of the library, and those of the user's own folder. Imports nothing of the plant but its errors."""

import os
from pathlib import Path

from configuration import ConfigurationError

LIBRARY = Path(__file__).resolve().parent / "library"
VARIABLE = "LOADERHIL_EFFECTS"
"""Environment variable with a folder of further effects, one file each."""


def effect_files() -> list[Path]:
    """The files that each define an effect, the library's first, each group by name."""
    own = sorted(path for path in LIBRARY.glob("*.py") if path.stem != "__init__")
    folder = os.environ.get(VARIABLE)
    if not folder:
        return own
    if not Path(folder).is_dir():
        raise ConfigurationError(f"{VARIABLE}={folder}: there is no such folder")
    return own + sorted(Path(folder).resolve().glob("*.py"))


def module_name(path: Path) -> str:
    """The name under which the module of an effect is imported."""
    return f"plant.effects.library.{path.stem}" if path.parent == LIBRARY else f"loaderhil_effect_{path.stem}"
