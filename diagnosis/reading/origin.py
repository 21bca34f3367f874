"""Which machine the recordings are of, as their run.json say, and the baseline that this makes of a model of machines."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bus.user_error import UserError
from diagnosis.models import Choice


class OtherMachine(UserError, ValueError):
    """Recordings of machines that do not go together, or not with the model."""


@dataclass(frozen=True, slots=True)
class Base:
    """Name or file of a baseline, None for the model's own; told: what it is and who says so, empty where there is nothing to choose."""

    given: Path | None
    told: str = ""


def base_of(choice: Choice, given: Path | None, machines: Mapping[str, str]) -> Base:
    """What --with gives, else the machine that the recordings say they are of. machines: by recording; raises OtherMachine."""
    if choice.own_machine is None:
        return Base(given, f"{given}, as --with says" if given is not None else "")
    if choice.build_from is None:
        _refuse_others(choice, Path(choice.own_machine), machines)
        return Base(given, f"{given}, as --with says" if given is not None else "")
    if given is not None:
        _refuse_others(choice, given, machines)
        return Base(given, f"machine {given}, as --with says")
    if not machines:
        return Base(
            None,
            f"machine {choice.own_machine}, the model's own; the recordings do not say which they are of, --with MACHINE does",
        )
    (recording, machine), *others = machines.items()
    for other, another in others:
        if another != machine:
            raise OtherMachine(
                f"run.json of {recording} says machine {machine}, that of {other} {another}: diagnose them apart, or by --each"
            )
    if machine != choice.own_machine and _family(machine) is None:
        raise OtherMachine(
            f"run.json of {recording} says machine {machine}, which is not here; --with MACHINE says what it was"
        )
    also = f" and of {len(others)} more" if others else ""
    own = machine == choice.own_machine
    return Base(None if own else Path(machine), f"machine {machine}, as run.json of {recording}{also} says")


def _refuse_others(choice: Choice, machine: Path, machines: Mapping[str, str]) -> None:
    """Recordings of another family than a machine's say nothing about it. A file that has moved is of no known family."""
    wanted = _family(machine)
    for recording, other in machines.items():
        family = _family(other)
        if None not in (wanted, family) and family != wanted:
            raise OtherMachine(
                f"run.json of {recording} says machine {other} (family {family}), the baseline is {machine} (family {wanted}): "
                f"{choice.name} judges a run against its own machine"
            )


def _family(machine: str | Path) -> str | None:
    """The family of a machine; None where it cannot be read."""
    from configuration import ConfigurationError
    from plant.sheets.machine import family_of

    try:
        return family_of(machine)
    except ConfigurationError:
        return None
