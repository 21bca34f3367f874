"""Chooses the baseline of a diagnosis: --with, else the machine that the run.json of the recordings names."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bus.user_error import UserError
from diagnosis.models import Choice


class OtherMachine(UserError, ValueError):
    """The recordings are of different machines, or of a machine that the model does not describe."""


@dataclass(frozen=True, slots=True)
class Base:
    """The baseline of a diagnosis."""

    given: Path | None  # its name or file; None: the model's own
    description: str = ""  # the baseline and its source, for the reader; empty for models without a choice


def base_of(choice: Choice, given: Path | None, machines: Mapping[str, str]) -> Base:
    """The baseline of --with, else of the machine that the recordings name. machines: by recording. Raises OtherMachine."""
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
            f"machine {choice.own_machine}, the model's own; the recordings do not name their machine (--with MACHINE names it)",
        )
    (recording, machine), *others = machines.items()
    for other, another in others:
        if another != machine:
            raise OtherMachine(
                f"run.json of {recording} says machine {machine}, that of {other} {another}: diagnose them separately, or with --each"
            )
    if machine != choice.own_machine and _family(machine) is None:
        raise OtherMachine(
            f"run.json of {recording} says machine {machine}, for which there is no machine file; --with MACHINE names one"
        )
    also = f" and of {len(others)} more" if others else ""
    own = machine == choice.own_machine
    return Base(None if own else Path(machine), f"machine {machine}, as run.json of {recording}{also} says")


def _refuse_others(choice: Choice, machine: Path, machines: Mapping[str, str]) -> None:
    """Raises OtherMachine for recordings of another family than the baseline's. A machine whose file has moved is let pass, as its family is unknown."""
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
