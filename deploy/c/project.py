"""The folder that `loaderhil export-c` writes: generated files and the runtime that is the same for every machine."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from bus.user_error import UserError
from dbc import loader_database
from deploy.c.calibration import calibration_files
from deploy.c.ecu_tables import table_files
from deploy.c.estimators import estimator_files
from deploy.c.names_tables import name_files
from deploy.c.service_tables import service_files
from ecu.calibration import Calibration

RUNTIME: Final = Path(__file__).resolve().parent / "runtime"
_OFFERING: Final = ("services/", "linux/", "library/services.c")
MARK: Final = "Written by `loaderhil export-c`"


class FolderInUseError(UserError, ValueError):
    """The folder holds files of somebody else."""


def project_files(calibration: Calibration, sections: Mapping[str, object] | None = None) -> dict[str, str]:
    """File name -> text. sections: the table of the calibration's file; without it there are no services on the bus, nor programs that have them."""
    names = (file.relative_to(RUNTIME).as_posix() for file in sorted(RUNTIME.rglob("*")) if file.is_file())
    fixed = {
        name: (RUNTIME / name).read_text(encoding="utf-8")
        for name in names
        if sections is not None or not name.startswith(_OFFERING)
    }
    files = fixed | estimator_files() | calibration_files(calibration)
    files |= table_files(calibration, loader_database())
    if sections is None:
        return files
    return (
        files
        | name_files(calibration, loader_database())
        | service_files(calibration, sections, loader_database())
    )


def write_project(
    folder: Path, calibration: Calibration, sections: Mapping[str, object] | None = None
) -> list[Path]:
    """Write all files; FolderInUseError where one of them exists and is not of an earlier export. sections: as `project_files`."""
    files = project_files(calibration, sections)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        known = (folder / "estimators.c").is_file() and MARK in (folder / "estimators.c").read_text(
            "utf-8", "replace"
        )
        taken = sorted(name for name in files if (folder / name).exists())
        if taken and not known:
            raise FolderInUseError(
                f"{folder}: {taken[0]} is there and was not written by an earlier export: choose another folder"
            )
        for name, text in files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise FolderInUseError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return [folder / name for name in files]
