"""Planted errors of an ECU: the real cycle behind bent inputs and outputs. Pure.

An error sits inside the ECU, behind the check of CRC and counter: frames are signed again, so that only their values are wrong.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from bus.frame import Frame
from dbc.database import Database, MessageCodec
from hil.faults.rawbits import RawSignal, signed_again
from hil.lockstep import EcuSide, EcuTick

Bend = Callable[[RawSignal, int], int]
"""What becomes of the number of a signal, as raw integer."""


@dataclass(frozen=True, slots=True)
class EcuError:
    """One error. heard, sent: signals (`Message.Signal`) whose numbers are bent on the way in or out.

    deaf: messages that the ECU does not take; mute: messages that it does not send; late_ticks: by which its answers come late.
    """

    sentence: str
    heard: Mapping[str, Bend] | None = None
    sent: Mapping[str, Bend] | None = None
    deaf: tuple[str, ...] = ()
    mute: tuple[str, ...] = ()
    late_ticks: int = 0


def negated(raw: RawSignal, number: int) -> int:
    """The other sign of the physical value."""
    lowest, highest = raw.signal.raw_range
    # value = scale · number + offset, so that -value has the number -number - 2 offset / scale
    mirrored = -number - round(2 * raw.signal.offset / raw.signal.scale)
    # codes outside the range mean *not available* or *error*; an ECU with a wrong sign still sends those
    return min(max(mirrored, lowest), highest) if lowest <= number <= highest else number


def scaled(factor: float) -> Bend:
    """So many times the physical value."""

    def bend(raw: RawSignal, number: int) -> int:
        signal = raw.signal
        lowest, highest = signal.raw_range
        if not lowest <= number <= highest:
            return number
        value = (number * signal.scale + signal.offset) * factor
        # a value beyond the signal's range would become one of those codes
        return min(max(round((value - signal.offset) / signal.scale), lowest), highest)

    return bend


def always(number: int) -> Bend:
    """This raw number, whatever it was."""
    return lambda _raw, _number: number


_LOADS: Final = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
ERRORS: Final[Mapping[str, EcuError]] = {
    "lateral sign": EcuError("takes the lateral acceleration with the wrong sign", heard={"BodyAcceleration.Lateral": negated}),
    "articulation sign": EcuError("takes the articulation angle with the wrong sign", heard={"Articulation.ArticulationAngle": negated}),
    "half pressure": EcuError("reads half the lift pressure, so half the payload", heard={"LiftPressure.LiftCylinderPressure": scaled(0.5)}),
    "deaf to the arm": EcuError("takes no LinkageAngles", deaf=("LinkageAngles",)),
    "loads 20 % high": EcuError("sends normal forces 20 % too large", sent={f"NormalForces.{wheel}": scaled(1.2) for wheel in _LOADS}),
    "loads exchanged sides": EcuError("sends a load-transfer ratio of the other side", sent={"RollOver.LoadTransferRatio": negated, "RollOver.PredictedLoadTransferRatio": negated}),
    "never warns": EcuError(
        "never warns of a roll-over",
        sent={
            "RollOver.State": always(0), "Warnings.Level": always(0), "Warnings.RollOverPredicted": always(0),
            "Warnings.RollOverNow": always(0), "Warnings.WheelLifted": always(0),
        },
    ),
    "always warns": EcuError("always warns of a roll-over", sent={"RollOver.State": always(2), "RollOver.Valid": always(1), "Warnings.RollOverNow": always(1)}),
    "never limits": EcuError(
        "never limits the machine",
        sent={
            "Limits.Speed": always(500), "Limits.ArticulationRate": always(500), "Limits.Cause": always(0),
            **{f"Limits.{wheel}Torque": always(250) for wheel in _LOADS},
        },
    ),
    "limits at once": EcuError("limits the speed to 5 km/h all the time", sent={"Limits.Speed": always(50), "Limits.Cause": always(1)}),
    "always running": EcuError("says running whatever happens", sent={"EcuStatus.State": always(1)}),
    "never running": EcuError("says degraded whatever happens", sent={"EcuStatus.State": always(2)}),
    "echo stands": EcuError("echoes the same sample for ever", sent={"EcuStatus.EchoSequence": always(7)}),
    "limits mute": EcuError("sends no Limits", mute=("Limits",)),
    "status mute": EcuError("sends no EcuStatus", mute=("EcuStatus",)),
    "200 ms late": EcuError("answers 200 ms late", late_ticks=20),
}  # fmt: skip
"""Errors by name, about what an ECU of this machine can do wrong."""


@dataclass(slots=True)
class _Answer:
    frames: Sequence[Frame]
    findings: Sequence[object]


class BentEcu:
    """An ECU with one error."""

    def __init__(self, ecu: EcuSide, error: EcuError, database: Database) -> None:
        self._ecu, self._error = ecu, error
        self._deaf = {database.by_name[name].can_id for name in error.deaf}
        self._mute = {database.by_name[name].can_id for name in error.mute}
        self._heard = _bends(error.heard or {}, database)
        self._sent = _bends(error.sent or {}, database)
        self._waiting: list[Sequence[Frame]] = [()] * error.late_ticks

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]:
        """What lockstep asks of an ECU."""
        if frame.can_id in self._deaf:
            return ()
        # bent before the cycle's own check, and signed again, so that the check finds nothing
        return self._ecu.receive(_bent(frame, self._heard), now_ns)

    def tick(self, now_ns: int) -> EcuTick:
        """What lockstep asks of an ECU."""
        answer = self._ecu.tick(now_ns)
        frames = [_bent(frame, self._sent) for frame in answer.frames if frame.can_id not in self._mute]
        # a queue of so many ticks: filled with nothing at the start, as a slow ECU is silent at first
        self._waiting.append(frames)
        return _Answer(self._waiting.pop(0), answer.findings)


def _bends(
    signals: Mapping[str, Bend], database: Database
) -> dict[int, tuple[MessageCodec, list[tuple[RawSignal, Bend]]]]:
    """By identifier: the message, and what is bent in it."""
    found: dict[int, tuple[MessageCodec, list[tuple[RawSignal, Bend]]]] = {}
    for name, bend in signals.items():
        message, _, signal = name.partition(".")
        codec = database.by_name[message]
        found.setdefault(codec.can_id, (codec, []))[1].append((RawSignal(codec, signal), bend))
    return found


def _bent(frame: Frame, bends: Mapping[int, tuple[MessageCodec, list[tuple[RawSignal, Bend]]]]) -> Frame:
    """The frame with other numbers and a CRC that fits."""
    if frame.can_id not in bends:
        return frame
    codec, each = bends[frame.can_id]
    # the scenario's own fault has shortened it; the cycle refuses it anyway
    if len(frame.data) != codec.length:
        return frame
    data = frame.data
    for raw, bend in each:
        data = raw.write(data, bend(raw, raw.to_number(raw.read(data))))
    return frame._replace(data=signed_again(codec, data))
