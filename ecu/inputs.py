"""What the ECU hears: the machine's frames, checked one by one, gathered once per cycle.

A frame is used when its protection holds. A signal is plausible when it is available, inside the
range the machine can reach, no further from the one before than the machine can move in a frame,
and not reported as faulty by its sensor; it does not stand still to the bit while most others move, and the
wheels of an axle turn with it (`ecu.coherence`). An implausible or stale message keeps its last good values,
marked unusable; nothing else is touched by it. Signal names of the DBC end here.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from bus.frame import Frame
from dbc.binding import Binding
from dbc.database import Database, MessageCodec
from dbc.protection import Checker
from dbc.protection import Finding as Check
from ecu.calibration import Calibration, InputRules
from ecu.coherence import AxleSides
from ecu.estimators.parameters import GRAVITY
from ecu.estimators.signals import Inputs
from ecu.findings import Finding, Implausible, ProtectionFailed

FROZEN: Final = "stands still to the bit while others move"
EXCHANGED: Final = "left and right are exchanged, says the yaw rate"
FAULTY: Final = 2
"""Sensor states from here on (error, not available) make a signal unusable."""


class Group(enum.IntEnum):
    """Input groups; values are the bits of EcuStatus.StaleInputs. DEMAND has none."""

    ARTICULATION = 0
    WHEEL_SPEEDS = 1
    WHEEL_TORQUES = 2
    ACCELERATION = 3
    RATES = 4
    SLOPE = 5
    PRESSURES = 6
    LINKAGE = 7
    DEMAND = 8


@dataclass(frozen=True, slots=True)
class Field:
    """One signal: its SI unit, where its value goes, and what is plausible (SI; step per frame).

    sensed: by a sensor with noise, so that it never stands still for long.
    """

    unit: str
    target: str
    limit: float
    step: float = math.inf
    sensed: bool = True


@dataclass(frozen=True, slots=True)
class Source:
    """One message of the machine."""

    message: str
    group: Group
    fields: Mapping[str, Field]
    states: Mapping[str, tuple[str, ...]]  # state signal -> targets it vouches for


def _pair(
    message: str, group: Group, unit: str, targets: tuple[str, str], limit: float, step: float
) -> Source:
    left, right = targets
    return Source(
        message,
        group,
        {"Left": Field(unit, left, limit, step), "Right": Field(unit, right, limit, step)},
        {"LeftState": (left,), "RightState": (right,)},
    )


def sources(r: InputRules) -> tuple[Source, ...]:
    """What is heard and what of it is plausible."""
    speed, torque = r.wheel_speed, r.wheel_torque
    spin, free = r.wheel_speed_step, math.inf
    speeds, torques = Group.WHEEL_SPEEDS, Group.WHEEL_TORQUES
    return (
        Source(
            "Articulation",
            Group.ARTICULATION,
            {
                "ArticulationAngle": Field("rad", "articulation_angle", r.articulation, r.articulation_step),
                "ArticulationRate": Field("rad/s", "articulation_rate", r.articulation_rate),
                "SampleSequence": Field("1", "sequence", math.inf, sensed=False),
            },
            {"State": ("articulation_angle", "articulation_rate")},
        ),
        _pair("WheelSpeedsFront", speeds, "rad/s", ("wheel_speed_1", "wheel_speed_2"), speed, spin),
        _pair("WheelSpeedsRear", speeds, "rad/s", ("wheel_speed_3", "wheel_speed_4"), speed, spin),
        _pair("WheelTorquesFront", torques, "N.m", ("wheel_torque_1", "wheel_torque_2"), torque, free),
        _pair("WheelTorquesRear", torques, "N.m", ("wheel_torque_3", "wheel_torque_4"), torque, free),
        Source(
            "BodyAcceleration",
            Group.ACCELERATION,
            {
                "Longitudinal": Field("m/s2", "specific_force_x", r.acceleration),
                "Lateral": Field("m/s2", "specific_force_y", r.acceleration),
                "Vertical": Field("m/s2", "specific_force_z", r.acceleration),
            },
            {"State": ("specific_force_x", "specific_force_y", "specific_force_z")},
        ),
        Source(
            "BodyRates",
            Group.RATES,
            {
                "RollRate": Field("rad/s", "roll_rate", r.rate),
                "PitchRate": Field("rad/s", "pitch_rate", r.rate),
                "YawRate": Field("rad/s", "yaw_rate", r.rate),
            },
            {"State": ("roll_rate", "pitch_rate", "yaw_rate")},
        ),
        Source(
            "SlopeSensor",
            Group.SLOPE,
            {
                "PitchAngle": Field("rad", "pitch", r.slope, r.slope_step),
                "RollAngle": Field("rad", "roll", r.slope, r.slope_step),
            },
            {},
        ),
        Source(
            "LiftPressure",
            Group.PRESSURES,
            {"LiftCylinderPressure": Field("Pa", "lift_pressure", r.pressure)},
            {},
        ),
        Source(
            "TiltPressure",
            Group.PRESSURES,
            {"TiltCylinderPressure": Field("Pa", "tilt_pressure", r.pressure)},
            {},
        ),
        Source(
            "LinkageAngles",
            Group.LINKAGE,
            {
                "LiftArmAngle": Field("rad", "lift_arm_angle", r.arm, r.linkage_step),
                "TiltAngle": Field("rad", "tilt_angle", r.tilt, r.linkage_step),
            },
            {"State": ("lift_arm_angle", "tilt_angle")},
        ),
        Source(
            "DriverDemand",
            Group.DEMAND,
            {
                "ArticulationRateDemand": Field(
                    "rad/s", "articulation_rate_demand", r.articulation_rate, sensed=False
                )
            },
            {},
        ),
    )


class _Listener:
    """One message: its last good values, when they came, and which targets are implausible now."""

    def __init__(self, source: Source, codec: MessageCodec) -> None:
        units = {name: field.unit for name, field in source.fields.items()} | dict.fromkeys(
            source.states, "1"
        )
        self.source = source
        self.codec = codec
        self.heard_ns: int | None = None
        self.targets = frozenset(field.target for field in source.fields.values())
        self.unusable: frozenset[str] = frozenset()
        self._binding = Binding(codec, units)
        self._checker = Checker(codec) if codec.e2e_data_id is not None else None
        self._fields = tuple(source.fields.items())
        self._states = tuple(source.states.values())
        self._previous: tuple[float, ...] | None = None
        self._same = [0] * len(self._fields)  # frames in a row with the value of the one before

    def standing(self, frames: float) -> tuple[int, int]:
        """How many of its sensed signals have stood still for so many frames, and of how many."""
        sensed = [same for (_, field), same in zip(self._fields, self._same, strict=True) if field.sensed]
        return sum(same >= frames for same in sensed), len(sensed)

    def fresh(self, now_ns: int, stale_cycles: float) -> bool:
        """Whether a good frame came within the permitted time."""
        return self.heard_ns is not None and now_ns - self.heard_ns <= stale_cycles * self.codec.cycle_ns

    def receive(self, frame: Frame, now_ns: int, values: dict[str, float], among: "Hearing") -> list[Finding]:
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
        numbers = self._binding.decode(frame.data)
        signals, states = numbers[: len(self._fields)], numbers[len(self._fields) :]
        bad = self._faulty(states) if states and max(states) >= FAULTY else {}
        if among.exchanged(name, signals, now_ns):
            bad = dict.fromkeys(self.targets, EXCHANGED) | bad
        for i, ((signal, field), value, before) in enumerate(
            zip(self._fields, signals, self._previous or signals, strict=True)
        ):
            self._same[i] = self._same[i] + 1 if value == before else 0
            reason = bad.get(field.target) or _doubt(field, value, before)
            if not reason and field.sensed and among.frozen(self._same[i]):
                reason = FROZEN
            if not reason:
                values[field.target] = float(value)  # an int would compile the estimators anew
                continue
            bad[field.target] = reason
            if field.target not in self.unusable:
                found.append(Implausible(name, signal, value, reason, now_ns))
        self._previous = signals
        self.unusable = frozenset(bad)
        return found

    def _faulty(self, states: tuple[float, ...]) -> dict[str, str]:
        """The targets whose sensor does not vouch for them, and why."""
        told = zip(states, self._states, strict=True)
        return {
            t: "its sensor reports a fault" for state, targets in told if state >= FAULTY for t in targets
        }


def _doubt(field: Field, value: float, before: float) -> str:
    """Why a value is not plausible, '' if it is; `before` is that of the previous frame, good or bad."""
    if abs(value) <= field.limit and not abs(value - before) > field.step:
        return ""
    if math.isnan(value):
        return "not available"
    if abs(value) > field.limit:
        return f"outside +-{field.limit:.4g} {field.unit}"
    return f"moved {value - before:.4g} {field.unit} in one frame, at most {field.step:.4g} is possible"


@dataclass(frozen=True, slots=True)
class Heard:
    """The inputs of one cycle.

    unusable: targets not to be relied on; stale: groups without a fresh frame; implausible: groups with a bad signal.
    """

    values: Mapping[str, float]
    unusable: frozenset[str]
    stale: frozenset[Group]
    implausible: frozenset[Group]

    def all_usable(self, *targets: str) -> bool:
        """Whether every one of `targets` is."""
        return self.unusable.isdisjoint(targets)


class Hearing:
    """Every message the ECU uses; others are not looked at."""

    def __init__(self, calibration: Calibration, database: Database) -> None:
        rules = self._rules = calibration.inputs
        self._listeners = [_Listener(source, database.by_name[source.message]) for source in sources(rules)]
        self._by_id = {listener.codec.can_id: listener for listener in self._listeners}
        self._by_name = {listener.source.message: listener for listener in self._listeners}
        self._values: dict[str, float] = {
            field.target: 0.0 for listener in self._listeners for field in listener.source.fields.values()
        } | {"specific_force_z": GRAVITY}
        geometry, radius = calibration.parameters.geometry, calibration.parameters.wheel.unloaded_radius
        tracks = {"WheelSpeedsFront": geometry.front_track, "WheelSpeedsRear": geometry.rear_track}
        self._axles = {
            name: AxleSides(radius / track, rules.turning, rules.exchanged_frames)
            for name, track in tracks.items()
        }

    def receive(self, frame: Frame, now_ns: int) -> list[Finding]:
        """Use one frame, if the ECU uses it at all and it is sound."""
        listener = self._by_id.get(frame.can_id)
        return listener.receive(frame, now_ns, self._values, self) if listener else []

    def frozen(self, same: int) -> bool:
        """Whether a sensed signal that was the same in so many frames is frozen: most others moved a moment ago."""
        frames = self._rules.frozen_frames
        if not frames or same < frames:
            return False
        # A quarter: of the slowest message, half as many frames come, and all begin to stand still one after the other.
        told = (each.standing(frames / 4) for each in self._listeners)
        still, sensed = map(sum, zip(*told, strict=True))
        return 2 * still < sensed

    def exchanged(self, message: str, signals: tuple[float, ...], now_ns: int) -> bool:
        """Whether a message is one of wheel speeds and has left and right exchanged."""
        axle = self._axles.get(message)
        if axle is None:
            return False
        for told in ("BodyRates", "Articulation", "BodyAcceleration"):
            listener = self._by_name[told]
            if listener.unusable or not listener.fresh(now_ns, self._rules.stale_cycles):
                return axle.exchanged
        if abs(self._values["specific_force_y"]) > self._rules.carried:
            return axle.exchanged
        left, right = signals
        front = message == "WheelSpeedsFront"
        return axle.look(
            left, right, self._values["yaw_rate"] + (self._values["articulation_rate"] if front else 0.0)
        )

    def gather(self, now_ns: int) -> Heard:
        """What can be relied on at this cycle."""
        unusable: set[str] = set()
        stale: set[Group] = set()
        implausible: set[Group] = set()
        for listener in self._listeners:
            if not listener.fresh(now_ns, self._rules.stale_cycles):
                stale.add(listener.source.group)
                unusable |= listener.targets
            elif listener.unusable:
                implausible.add(listener.source.group)
                unusable |= listener.unusable
        return Heard(dict(self._values), frozenset(unusable), frozenset(stale), frozenset(implausible))


FLAGS: Final[Mapping[str, tuple[str, ...]]] = {
    "demand_usable": ("articulation_rate_demand",),
    **{f"wheel_{n}_usable": (f"wheel_speed_{n}",) for n in (1, 2, 3, 4)},
    "torque_usable": tuple(f"wheel_torque_{n}" for n in (1, 2, 3, 4)),
    "acceleration_usable": ("specific_force_x", "specific_force_y", "specific_force_z"),
    "rates_usable": ("roll_rate", "pitch_rate", "yaw_rate"),
    "slope_usable": ("pitch", "roll"),
    "pressure_usable": ("lift_pressure", "tilt_pressure"),
}
"""The estimators' flags: each is set while all of its targets are usable."""
_MEASURED: Final = Inputs._fields[1 : -1 - len(FLAGS)]
assert Inputs._fields == ("dt", *_MEASURED, *FLAGS, "rate_limit")


def estimator_inputs(heard: Heard, dt: float, rate_limit: float) -> Inputs:
    """The estimators' inputs: values, and flags for what may be relied on. dt [s]; rate_limit [rad/s]."""
    flags = (1.0 if heard.unusable.isdisjoint(targets) else 0.0 for targets in FLAGS.values())
    return Inputs._make((dt, *map(heard.values.__getitem__, _MEASURED), *flags, rate_limit))
