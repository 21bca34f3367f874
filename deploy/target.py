"""The paths in a deployed ECU's settings, as its services on the target will find them."""

from pathlib import Path

from deploy.settings import KEY, ServiceSettings
from deploy.words import UnitTextError, executable, unseen


def check_paths(settings: ServiceSettings, root: Path) -> None:
    """Raises ConfigurationError for a file that a service cannot see, or that is not below `root`, the root of the target."""
    for key, path in settings.paths.items():
        if trouble := unseen(path):
            raise settings.error(key, f"= {path!r} {trouble}")
        place = root / path.lstrip("/")
        # a unit that fails at its machine is found later than a file that is missing here; a key may be brought there later
        if key != KEY and not place.is_file():
            raise settings.error(key, f"= {path!r}: there is no file {place}; put it there first")


def check_program(program: Path, option: str = "--program") -> str:
    """The path of a program on the target, as units have it. Raises UnitTextError."""
    try:
        executable(str(program))
    except UnitTextError as error:
        raise UnitTextError(f"{option} {error}") from error
    return str(program)
