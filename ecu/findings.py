"""What the cycle finds: values for the shell to log, never exceptions."""

from dataclasses import dataclass

from dbc.protection import Finding as Check
from ecu.codes import Mode
from ecu.states import Event, State


@dataclass(frozen=True, slots=True)
class ProtectionFailed:
    """A frame whose length, counter or CRC is wrong, or before which frames were lost."""

    message: str
    what: Check
    at_ns: int


@dataclass(frozen=True, slots=True)
class Implausible:
    """A message that turned implausible: which signal, its SI value, and why."""

    message: str
    signal: str
    value: float
    reason: str
    at_ns: int


@dataclass(frozen=True, slots=True)
class Stale:
    """An input group that has had no usable frame for too long."""

    group: str
    at_ns: int


@dataclass(frozen=True, slots=True)
class FaultFound:
    """A fault of a sensor that the detection found: the inputs of which one is faulty, and the failure mode."""

    signals: tuple[str, ...]
    mode: Mode
    at_ns: int


@dataclass(frozen=True, slots=True)
class StateChanged:
    """The cycle moved to another state."""

    before: State
    after: State
    event: Event
    at_ns: int


@dataclass(frozen=True, slots=True)
class EstimatorFailed:
    """The estimators could not be computed from this cycle's inputs."""

    error: str
    at_ns: int


Finding = EstimatorFailed | FaultFound | ProtectionFailed | Implausible | Stale | StateChanged
