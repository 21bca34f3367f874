"""What a run is spoilt with: a fault of each class, a planted ECU error, or an effect of the machine."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Final

from bus.user_error import UserError
from plant.effects.registry import find_effect
from testbench.verify.errors import ERRORS, EcuError


class MutantError(UserError, ValueError):
    """No mutant has such a name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One way to spoil a run. kind: fault, ECU error or effect."""

    kind: str
    name: str
    sentence: str
    fault: Mapping[str, object] | None = None
    error: EcuError | None = None
    changes: tuple[str, ...] = ()


FAULTS: Final[Sequence[Mapping[str, object]]] = (
    {"kind": "drop", "message": "BodyRates"},
    {"kind": "drop", "message": "WheelSpeeds"},
    {"kind": "drop", "message": "Limits"},
    {"kind": "drop", "message": "Articulation", "probability": 0.3},
    {"kind": "repeat", "message": "BodyRates", "probability": 0.5},
    {"kind": "delay", "message": "Articulation", "delay_ms": 100.0},
    {"kind": "jitter", "message": "BodyAcceleration", "jitter_ms": 40.0},
    {"kind": "reorder", "message": "BodyRates", "probability": 0.5},
    {"kind": "corrupt", "message": "BodyAcceleration"},
    {"kind": "corrupt", "message": "LiftPressure", "valid_crc": True},
    {"kind": "freeze", "message": "Articulation", "signal": "ArticulationAngle"},
    {"kind": "freeze", "message": "LiftPressure", "signal": "LiftCylinderPressure"},
    {"kind": "offset", "message": "Articulation", "signal": "ArticulationAngle", "offset": 5.0},
    {"kind": "offset", "message": "BodyAcceleration", "signal": "Lateral", "offset": 2.0},
    {"kind": "offset", "message": "LiftPressure", "signal": "LiftCylinderPressure", "offset": 3000.0},
    {"kind": "spike", "message": "BodyRates", "signal": "RollRate", "height": 50.0},
    {"kind": "swap", "message": "WheelSpeedsFront", "signals": ["Left", "Right"]},
    {"kind": "babble", "from": "plant", "interval_us": 200.0},
    {"kind": "bus_off", "node": "ecu"},
    {"kind": "kill", "process": "ecu"},
)
"""One or more of each of the bench's fault classes, large enough to matter."""


def mutants(only: Sequence[str], effects: Sequence[str], at_s: float) -> tuple[Mutant, ...]:
    """All faults and ECU errors whose name or kind fits a pattern of `only`, and the effects. MutantError for a pattern of none.

    at_s: when a fault begins [s].
    """
    every = list(_every(effects, at_s))
    for pattern in only:
        # a pattern with a typing error would verify nothing and pass
        if not any(_fits(each, pattern) for each in every):
            raise MutantError(
                f"--only {pattern}: no mutant of that name; there are {', '.join(m.name for m in every)}"
            )
    return tuple(each for each in every if not only or any(_fits(each, pattern) for pattern in only))


def _fits(mutant: Mutant, pattern: str) -> bool:
    return fnmatchcase(mutant.name, pattern) or fnmatchcase(mutant.kind, pattern)


def _every(effects: Sequence[str], at_s: float) -> Iterator[Mutant]:
    for fault in FAULTS:
        words = [
            f"{value}" for key, value in fault.items() if key not in ("kind",) and not isinstance(value, bool)
        ]
        name = " ".join([str(fault["kind"]), *words])
        yield Mutant(kind="fault", name=name, sentence=f"from {at_s:g} s on", fault={**fault, "at_s": at_s})
    for name, error in ERRORS.items():
        yield Mutant(kind="ECU error", name=name, sentence=error.sentence, error=error)
    for name in effects:
        effect = find_effect(name)
        yield Mutant(
            kind="effect", name=name, sentence=effect.sentence, changes=(f"machine.effects.{name}={{}}",)
        )
