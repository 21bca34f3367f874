"""The ECU's inputs: the machine's frames, checked one by one, gathered once per cycle.

A frame is used when its protection holds. A signal is plausible when it is available, inside the
range the machine can reach, no further from the one before than the machine can move in a frame,
and not reported as faulty by its sensor; it does not stand still to the bit while most others move, and the
wheels of an axle turn with it (`ecu.coherence`). An implausible or stale message keeps its last good values,
marked unusable; nothing else is touched by it. Which signals there are is read from the signal table
(`ecu.estimators.signals`).
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

from bus.frame import Frame
from dbc.binding import Binding
from dbc.database import Database, MessageCodec
from dbc.protection import Checker
from dbc.protection import Finding as Check
from ecu.bus_signals import Received, Usable, rows
from ecu.calibration import Calibration
from ecu.coherence import LIGHT, AxleSides
from ecu.estimators.parameters import GRAVITY
from ecu.estimators.signals import Inputs
from ecu.findings import Finding, Implausible, ProtectionFailed
from ecu.rules import InputRules
from ecu.watched import Beside

FROZEN: Final = "stands still to the bit while others move"
EXCHANGED: Final = "left and right are exchanged, by the yaw rate"
REPORTED: Final = "its sensor reports a fault"
OUTSIDE: Final = "outside"
MOVED: Final = "moved"
WEIGHTLESS: Final = "a machine on the ground feels its weight"
FAULTY: Final = 2
"""Sensor states from here on (error, not available) make a signal unusable."""


class Group(enum.IntEnum):
    """Input groups; values are the bits of EcuStatus.StaleInputs. DEMAND and STEERING have none."""

    ARTICULATION = 0
    WHEEL_SPEEDS = 1
    WHEEL_TORQUES = 2
    ACCELERATION = 3
    RATES = 4
    SLOPE = 5
    PRESSURES = 6
    LINKAGE = 7
    DEMAND = 8
    STEERING = 9


GROUP_OF: Final[Mapping[str, Group]] = {
    "Articulation": Group.ARTICULATION,
    "WheelSpeedsFront": Group.WHEEL_SPEEDS,
    "WheelSpeedsRear": Group.WHEEL_SPEEDS,
    "WheelTorquesFront": Group.WHEEL_TORQUES,
    "WheelTorquesRear": Group.WHEEL_TORQUES,
    "BodyAcceleration": Group.ACCELERATION,
    "BodyRates": Group.RATES,
    "SlopeSensor": Group.SLOPE,
    "LiftPressure": Group.PRESSURES,
    "TiltPressure": Group.PRESSURES,
    "LinkageAngles": Group.LINKAGE,
    "DriverDemand": Group.DEMAND,
    "SteeringPressures": Group.STEERING,
}
OUTSIDE_ESTIMATES: Final = frozenset((Group.DEMAND, Group.STEERING))
"""Groups without which every estimate is still made."""
"""The messages that the ECU uses; every row of the signal table names one of them."""


class Echoed(NamedTuple):
    """Inputs that the estimators do not need: the ECU sends them back."""

    sequence: Annotated[float, Received("Articulation", "SampleSequence", "1", sensed=False)]


@dataclass(frozen=True, slots=True)
class Field:
    """One input signal with this machine's bounds of plausibility, SI."""

    name: str  # the input's, in `Inputs` or `Echoed`
    row: Received
    limit: float  # largest plausible magnitude
    step: float  # largest plausible change between two frames


@dataclass(frozen=True, slots=True)
class Source:
    """One message of the machine."""

    message: str
    group: Group
    fields: tuple[Field, ...]

    @property
    def states(self) -> dict[str, tuple[str, ...]]:
        """State signal of a sensor -> the inputs that it vouches for."""
        found: dict[str, tuple[str, ...]] = {}
        for field in self.fields:
            if field.row.state:
                found[field.row.state] = (*found.get(field.row.state, ()), field.name)
        return found


def sources(rules: InputRules) -> tuple[Source, ...]:
    """The messages that the ECU uses, with their signals from the signal table."""

    def field(name: str, row: Received) -> Field:
        limit, step = (getattr(rules, rule) if rule else math.inf for rule in (row.limit, row.step))
        return Field(name, row, limit, step)

    table = [field(name, row) for names in (Inputs, Echoed, Beside) for name, row in rows(names, Received)]
    return tuple(
        Source(message, group, tuple(each for each in table if each.row.message == message))
        for message, group in GROUP_OF.items()
    )


TRACKS: Final[Mapping[str, str]] = {"WheelSpeedsFront": "front_track", "WheelSpeedsRear": "rear_track"}
"""Messages whose two signals may be exchanged, and the track between their wheels in the machine's geometry."""
JUDGED_TOGETHER: Final = frozenset(("BodyAcceleration", *TRACKS))
"""Messages whose signals can contradict one another."""
_NONE: Final[frozenset[str]] = frozenset()


class _Listener:
    """One message: when its last good frame came, and which of its inputs are implausible now."""

    def __init__(self, source: Source, codec: MessageCodec, frozen_frames: float) -> None:
        states = source.states
        units = {field.row.signal: field.row.unit for field in source.fields} | dict.fromkeys(states, "1")
        self.source = source
        self.codec = codec
        self.heard_ns: int | None = None
        self.new = False  # since the last cycle
        self.names = frozenset(field.name for field in source.fields)
        self.unusable: frozenset[str] = frozenset()
        self.stepped: frozenset[str] = frozenset()  # of these, those whose value came and was too far away
        self._binding = Binding(codec, units)
        self._checker = Checker(codec) if codec.protection is not None else None
        self._fields = source.fields
        # By column, because the loop over them runs for every signal of every frame.
        self._names = [field.name for field in source.fields]
        self._limits = [field.limit for field in source.fields]
        self._steps = [field.step for field in source.fields]
        self._still = [
            frozen_frames if frozen_frames and field.row.sensed else math.inf for field in source.fields
        ]
        self._judged_together = source.message in JUDGED_TOGETHER
        self._states = tuple(states.values())
        self._previous: tuple[float, ...] | None = None
        self._same = [0] * len(self._fields)  # frames in a row with the value of the one before

    def standing(self, frames: float) -> tuple[int, int]:
        """How many of its sensed signals have stood still for so many frames, and of how many."""
        sensed = [same for field, same in zip(self._fields, self._same, strict=True) if field.row.sensed]
        return sum(same >= frames for same in sensed), len(sensed)

    def fresh(self, now_ns: int, stale_cycles: float) -> bool:
        """Whether a good frame came within the permitted time."""
        return self.heard_ns is not None and now_ns - self.heard_ns <= stale_cycles * self.codec.cycle_ns

    def receive(
        self, frame: Frame, now_ns: int, values: dict[str, float], among: "InputReceiver"
    ) -> list[Finding]:
        """Check a frame and put its plausible values into `values`; among: the other messages, which may contradict it."""
        found: list[Finding] = []
        name = self.source.message
        if self._checker is not None:
            check = self._checker.check(frame.data, now_ns)
            if check not in (Check.OK, Check.INITIAL):
                found.append(ProtectionFailed(name, check, now_ns))
            if not check.usable:
                return found
        elif len(frame.data) < self.codec.length:
            return [ProtectionFailed(name, Check.WRONG_LENGTH, now_ns)]
        self.heard_ns = now_ns
        self.new = True
        numbers = self._binding.decode(frame.data)
        signals, states = numbers[: len(self._fields)], numbers[len(self._fields) :]
        bad = self._faulty(states) if states and max(states) >= FAULTY else {}
        if self._judged_together and (reason := among.contradiction(name, signals, now_ns)):
            bad = dict.fromkeys(self.names, reason) | bad
        previous, same, sound = self._previous or signals, self._same, not bad
        for i, (key, limit, step, still, value, before) in enumerate(
            zip(self._names, self._limits, self._steps, self._still, signals, previous, strict=True)
        ):
            same[i] = unchanged = same[i] + 1 if value == before else 0
            # false for a value that is not a number; after one, any value within the limit is plausible
            plausible = abs(value) <= limit and not abs(value - before) > step
            if plausible and sound and unchanged < still:  # nearly every sample needs no reason
                values[key] = float(value)  # an int would compile the estimators anew
                continue
            field = self._fields[i]
            reason = bad.get(key) or ("" if plausible else doubt(field, value, before))
            if not reason and unchanged >= still and among.mostly_moving():
                reason = FROZEN
            if not reason:
                values[key] = float(value)
                continue
            bad[key] = reason
            if key not in self.unusable:
                found.append(Implausible(name, field.row.signal, float(value), reason, now_ns))
        self._previous = signals
        self.unusable = frozenset(bad) if bad else _NONE
        self.stepped = (
            frozenset(n for n, why in bad.items() if why.startswith((MOVED, OUTSIDE))) if bad else _NONE
        )
        return found

    def _faulty(self, states: tuple[float, ...]) -> dict[str, str]:
        """The inputs whose sensor does not vouch for them, and the reason."""
        reported = zip(states, self._states, strict=True)
        return {name: REPORTED for state, names in reported if state >= FAULTY for name in names}


def doubt(field: Field, value: float, before: float) -> str:
    """Why a value is not plausible; `before` is that of the previous frame, good or bad."""
    if math.isnan(value):
        return "not available"
    if abs(value) > field.limit:
        return f"{OUTSIDE} +-{field.limit:.4g} {field.row.unit}"
    return f"{MOVED} {value - before:.4g} {field.row.unit} in one frame, at most {field.step:.4g} is possible"


@dataclass(frozen=True, slots=True)
class CycleInputs:
    """The inputs of one cycle."""

    values: Mapping[str, float]  # the last good value of every input, SI
    unusable: frozenset[str]  # inputs that must not be relied on
    stale: frozenset[Group]  # groups without a fresh frame
    implausible: frozenset[Group]  # groups with an implausible signal
    heard: frozenset[str] = frozenset()  # messages with a good frame since the cycle before
    stepped: frozenset[str] = frozenset()  # unusable inputs whose value came and was too far from the last
    doubted: frozenset[str] = frozenset()  # inputs that the detection holds for faulty, replaced ones too
    silent: frozenset[str] = frozenset()  # "message_NAME" of messages that have fallen silent

    def all_usable(self, *names: str) -> bool:
        """Whether every one of these inputs can be relied on."""
        return self.unusable.isdisjoint(names)


class InputReceiver:
    """All messages that the ECU uses, and the last good value of every input. Other messages are ignored."""

    def __init__(self, calibration: Calibration, database: Database) -> None:
        rules = self._rules = calibration.inputs
        self._listeners = [
            _Listener(source, database.by_name[source.message], rules.frozen_frames)
            for source in sources(rules)
        ]
        self._by_id = {listener.codec.can_id: listener for listener in self._listeners}
        self._by_name = {listener.source.message: listener for listener in self._listeners}
        self._values: dict[str, float] = {
            field.name: 0.0 for listener in self._listeners for field in listener.source.fields
        } | {"specific_force_z": GRAVITY}
        geometry, radius = calibration.parameters.geometry, calibration.parameters.wheel.unloaded_radius
        self._axles = {
            name: AxleSides(radius / getattr(geometry, track), rules.turning, rules.exchanged_frames)
            for name, track in TRACKS.items()
        }

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Use one frame, if the ECU uses it at all and it is sound."""
        listener = self._by_id.get(frame.can_id)
        return listener.receive(frame, now_ns, self._values, self) if listener else []

    def mostly_moving(self) -> bool:
        """Whether most sensed signals have moved lately: one that stands still is then frozen, and the machine does not stand."""
        # A quarter of the frames: the slowest message sends half as many, and signals freeze one after the other.
        counts = (each.standing(self._rules.frozen_frames / 4) for each in self._listeners)
        still, sensed = map(sum, zip(*counts, strict=True))
        return 2 * still < sensed

    def contradiction(self, message: str, signals: tuple[float, ...], now_ns: int) -> str:
        """Why the signals of this message cannot be right together, '' if they can."""
        if message == "BodyAcceleration" and math.hypot(*signals) < self._rules.least_specific_force:
            return WEIGHTLESS
        return EXCHANGED if self.exchanged(message, signals, now_ns) else ""

    def exchanged(self, message: str, signals: tuple[float, ...], now_ns: int) -> bool:
        """Whether a message is one of wheel speeds and has left and right exchanged."""
        axle = self._axles.get(message)
        if axle is None:
            return False
        for needed in ("BodyRates", "Articulation", "BodyAcceleration"):
            listener = self._by_name[needed]
            if listener.unusable or not listener.fresh(now_ns, self._rules.stale_cycles):
                return axle.exchanged
        aside, up = self._values["specific_force_y"], self._values["specific_force_z"]
        if abs(aside) > self._rules.carried or up < LIGHT * GRAVITY:
            return axle.pause()
        left, right = signals
        front = message == "WheelSpeedsFront"
        return axle.look(
            left, right, self._values["yaw_rate"] + (self._values["articulation_rate"] if front else 0.0)
        )

    def gather(self, now_ns: int) -> CycleInputs:
        """The inputs of the cycle at `now_ns`, and which of them can be relied on."""
        unusable: set[str] = set()
        stale: set[Group] = set()
        implausible: set[Group] = set()
        silent: set[str] = set()
        heard: set[str] = set()
        stepped: set[str] = set()
        for listener in self._listeners:
            if listener.new:
                heard.add(listener.source.message)
                listener.new = False
            if not listener.fresh(now_ns, self._rules.stale_cycles):
                stale.add(listener.source.group)
                unusable |= listener.names
                if listener.heard_ns is not None:
                    silent.add(f"message_{listener.source.message}")
            elif listener.unusable:
                implausible.add(listener.source.group)
                unusable |= listener.unusable
                stepped |= listener.stepped
        return CycleInputs(
            dict(self._values),
            frozenset(unusable),
            frozenset(stale),
            frozenset(implausible),
            frozenset(heard),
            frozenset(stepped),
            silent=frozenset(silent),
        )


FLAGS: Final = tuple((name, flag.inputs) for name, flag in rows(Inputs, Usable))
"""The estimators' flags, each with the inputs that it vouches for."""
_RECEIVED: Final = tuple(name for name, _ in rows(Inputs, Received))
_LEVERS: Final = ("lift_up_limit", "lift_down_limit", "tilt_back_limit", "tilt_forward_limit")
if Inputs._fields != ("dt", *_RECEIVED, *(name for name, _ in FLAGS), "rate_limit", *_LEVERS):
    raise TypeError("the rows of Inputs stand in the order dt, received signals, flags, limits")
NO_LIMITS: Final = (math.inf,) * len(_LEVERS)


def estimator_inputs(
    received: CycleInputs, dt: float, rate_limit: float, lever_limits: tuple[float, ...] = NO_LIMITS
) -> Inputs:
    """The estimators' inputs: values, and flags for those that can be relied on.

    dt [s]; rate_limit: of the articulation [rad/s]; lever_limits: arm up, arm down, bucket back, bucket forward [rad/s].
    """
    flags = (1.0 if received.unusable.isdisjoint(names) else 0.0 for _, names in FLAGS)
    return Inputs._make((dt, *map(received.values.__getitem__, _RECEIVED), *flags, rate_limit, *lever_limits))
