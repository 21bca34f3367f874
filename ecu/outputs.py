"""The ECU's frames: which value goes into which signal, and when.

Estimates go where the signal table (`ecu.estimators.signals`) sends them; what the cycle adds is listed here.
"""

from collections.abc import Mapping
from typing import Final

from bus.frame import Frame
from dbc.database import Database
from dbc.packing import Signals
from dbc.schedule import FrameSchedule
from ecu.bus_signals import Sent, rows
from ecu.codes import CODE_VALUES
from ecu.estimators.signals import Estimates

ECU = "EstimatorEcu"
TICK_NS: Final = 10_000_000
MOST_TICKS: Final = 10
"""A longer pause between two cycles counts as one of so many ticks: across it a predicted angle or speed says nothing."""
LAST: Final = "EstimateUncertainty"
"""Its frames are placed after all others: those keep the ticks that they have in recordings made without it."""
REASON_SIGNALS: Final = (
    "RollOverPredicted", "RollOverNow", "WheelLifted", "WheelSpin", "WheelLock", "AxleOverload",
    "ArticulationNearStop", "SteepSlope", "PayloadHigh", "InputStale", "InputImplausible",
    "ProtectionError", "CycleOverrun", "EstimateInvalid",
)  # fmt: skip

CYCLE_VALUES: Final[Mapping[str, Signals]] = {
    "RollOver": {"State": ("1", "roll-over state")},
    "Warnings": {"Level": ("1", "warning level")}
    | {reason: ("1", f"reason {reason}") for reason in REASON_SIGNALS},
    "Limits": {
        "FrontLeftTorque": ("N.m", "limit front torque"),
        "FrontRightTorque": ("N.m", "limit front torque"),
        "RearLeftTorque": ("N.m", "limit rear torque"),
        "RearRightTorque": ("N.m", "limit rear torque"),
        "Speed": ("m/s", "limit speed"),
        "ArticulationRate": ("rad/s", "limit rate"),
        "Cause": ("1", "limit cause"),
    },
    "LinkageLimits": {
        "LiftUpRate": ("rad/s", "limit lift up rate"),
        "LiftDownRate": ("rad/s", "limit lift down rate"),
        "TiltBackRate": ("rad/s", "limit tilt back rate"),
        "TiltForwardRate": ("rad/s", "limit tilt forward rate"),
        "Cause": ("1", "linkage limit cause"),
    },
    "EcuStatus": {
        "EchoSequence": ("1", "echo"),
        "ExecutionTime": ("s", "execution time"),
        "Overruns": ("1", "overruns"),
        "State": ("1", "state"),
        "StaleInputs": ("1", "stale inputs"),
    },
    "StabilityControl": {
        "RopEngineControlActive": ("1", "prevention limits torque"),
        "RopBrakeControlActive": ("1", "prevention limits speed"),
    },
    **CODE_VALUES,
}
"""What the cycle itself sends: message -> signal -> (SI unit, name of the value)."""


def messages() -> dict[str, Signals]:
    """Every message of the ECU: message -> signal -> (SI unit, name of the value).

    The estimates and their validity flags come from the signal table; the value of a flag is named "<entry> valid".
    """
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for name, row in rows(Estimates, Sent):
        signals = found.setdefault(row.message, {})
        signals[row.signal] = (row.unit, name)
        if row.flag:
            signals[row.flag] = ("1", f"{row.validity} valid")
    for message, more in CYCLE_VALUES.items():
        found.setdefault(message, {}).update(more)
    return {name: found[name] for name in sorted(found, key=lambda name: name == LAST)}


class Outputs:
    """Makes the ECU's frames."""

    def __init__(self, database: Database) -> None:
        self._schedule = FrameSchedule(database, ECU, messages(), tick_ns=TICK_NS)

    def frames(self, tick: int, values: Mapping[str, float]) -> list[Frame]:
        """The frames due at tick number `tick`; `values` by the names above, SI."""
        return self._schedule.frames(tick, values)
