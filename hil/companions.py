"""Finds the files that belong to a machine file by their names: MACHINE.equipment.toml and MACHINE.calibration.toml."""

from pathlib import Path

EQUIPMENT = ".equipment.toml"
CALIBRATION = ".calibration.toml"


def named(machine: Path, kind: str) -> Path:
    """The path that such a file of a machine has, whether it exists or not."""
    return machine.with_name(machine.name.removesuffix(".toml") + kind)


def companion(machine: Path, kind: str) -> Path | None:
    """The existing file beside a machine file; None if there is none."""
    file = named(machine, kind)
    return file if machine.suffix == ".toml" and file.is_file() else None
