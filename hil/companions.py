"""Files that belong to a machine file by their names: MACHINE.equipment.toml and MACHINE.calibration.toml beside MACHINE.toml."""

from pathlib import Path

EQUIPMENT = ".equipment.toml"
CALIBRATION = ".calibration.toml"


def named(machine: Path, kind: str) -> Path:
    """The name such a file has."""
    return machine.with_name(machine.name.removesuffix(".toml") + kind)


def companion(machine: Path, kind: str) -> Path | None:
    """The file beside a machine file, None where there is none."""
    file = named(machine, kind)
    return file if machine.suffix == ".toml" and file.is_file() else None
