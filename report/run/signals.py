"""Selects the signals of a run for the report: truth against estimate, demand against limit, states.

A signal that was not recorded leaves out its curve, not the plot, so that the plots of several runs stay side by side.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dbc import loader_database
from hil.rundir import RunDirectory
from hil.verdict import WHEELS, RunVerdict
from report.kit.bands import Band, intervals
from report.kit.plot import Curve, Mark, Plot

WHEEL_SIGNALS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
NO_PREDICTION_S = 10.2  # RollOver.TimeToLiftOff at the top of its range: none within the horizon
SHOWN_AHEAD_S = 3.0  # of the true time to lift-off: longer than the ECU looks ahead
DEGREES = 180.0 / np.pi
NORMAL_95 = 1.96  # half of a 95 % interval, in standard deviations
FLAG = {0: ("", 0), 1: ("set", 2)}
STATES = (
    (
        "Roll-over state",
        "RollOver",
        "State",
        {0: ("stable", 0), 1: ("attention", 1), 2: ("warning", 2), 3: ("imminent", 3), 4: ("lifted", 3)},
    ),
    (
        "Limits",
        "Limits",
        "Cause",
        {0: ("no limit", 0), 1: ("precaution", 1), 2: ("roll-over prevention", 2), 3: ("safe values", 3)},
    ),
    (
        "ECU",
        "EcuStatus",
        "State",
        {0: ("init", 1), 1: ("running", 0), 2: ("degraded", 2), 3: ("fault", 3)},
    ),
)


@dataclass(frozen=True, slots=True)
class Group:
    """Plots that belong together, under a heading."""

    title: str
    plots: tuple[Plot, ...]


def marks(verdict: RunVerdict | None) -> list[Mark]:
    """The moments that every plot marks, in the order of time."""
    if verdict is None:
        return []
    found = []
    if verdict.warned_s is not None:
        at = verdict.warned_s
        found.append(Mark(at, "warning", f"first warning at {at:.2f} s", "warned"))
    if verdict.lift_off_s is not None and verdict.lifting_wheel is not None:
        at, wheel = verdict.lift_off_s, WHEELS[verdict.lifting_wheel]
        found.append(Mark(at, "lift-off", f"{wheel} wheel lifts at {at:.2f} s", "lifted"))
    if verdict.rolled_over_s is not None:
        at = verdict.rolled_over_s
        found.append(Mark(at, "45° roll", f"rolled over, 45° of roll at {at:.2f} s", "lifted"))
    return sorted(found, key=lambda mark: mark.time_s)


def window_of(run: RunDirectory) -> tuple[float, float]:
    """First and last moment of the truth [s]; before and after, the ECU runs without a machine."""
    time = run.truth["time_s"] if "time_s" in run.truth else np.empty(0)
    return (float(time[0]), float(time[-1])) if time.size else (-np.inf, np.inf)


class Signals:
    """Curves out of one run, from the truth or from the frames on the bus."""

    def __init__(self, run: RunDirectory) -> None:
        self._run = run
        self._window = window_of(run)

    def truth(
        self, name: str, label: str, style: str, *, index: int | None = None, scale: float = 1.0
    ) -> list[Curve]:
        """The plant's own value."""
        truth = self._run.truth
        if name not in truth or "time_s" not in truth:
            return []
        column = truth[name] if index is None else truth[name][:, index]
        return [Curve(label, np.asarray(truth["time_s"], float), np.asarray(column, float) * scale, style)]

    def frame(
        self,
        message: str,
        signal: str,
        label: str,
        style: str,
        *,
        valid: str | None = None,
        scale: float = 1.0,
        steps: bool = False,
        keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
    ) -> list[Curve]:
        """A signal of the bus, in the DBC's unit times `scale`; gaps where it was not valid."""
        columns = self._run.messages.get(message)
        if columns is None or signal not in columns.signals:
            return []
        value = np.asarray(columns.signals[signal], float) * scale
        if valid is not None:
            value = np.where(np.asarray(columns.signals[valid], float) > 0, value, np.nan)
        if keep is not None:
            value = np.where(keep(value), value, np.nan)
        time = np.asarray(columns.time_s, float)
        within = (time >= self._window[0]) & (time <= self._window[1])
        return [Curve(label, time[within], value[within], style, steps)] if within.any() else []

    def interval(self, message: str, signal: str, valid: str) -> list[Curve]:
        """Both ends of the 95 % interval of an estimate, by the standard deviation that the bus carries; [] where it carries none."""
        estimate = self.frame(message, signal, "95 % interval", "interval", valid=valid)
        codec, deviation = loader_database().uncertainties[f"{message}.{signal}"]
        columns = self._run.messages.get(codec.name)
        if not estimate or columns is None or not columns.time_s.size:
            return []
        most = math.inf if deviation.maximum is None else deviation.maximum + abs(deviation.scale) / 2
        sent = np.asarray(columns.signals[deviation.name], float)
        half = np.where(sent <= most, NORMAL_95 * sent, np.nan)
        # held between its frames, which come more seldom than those of the estimate
        (middle,) = estimate
        newest = np.searchsorted(np.asarray(columns.time_s, float), middle.time_s, side="right") - 1
        half = np.where(newest >= 0, half[newest], np.nan)
        upper = replace(middle, value=middle.value + half)
        return [upper, replace(middle, value=middle.value - half, silent=True)]

    def flag(self, message: str, signal: str) -> str | None:
        """The flag's name; none where the run never sets it, as before the flag existed."""
        columns = self._run.messages.get(message)
        return signal if columns is not None and np.any(columns.signals.get(signal, 0)) else None

    def limit(self, signal: str, label: str, *, either_way: bool = False) -> list[Curve]:
        """A limit, where it is below the top of its range; either_way: drawn for both signs."""
        # the top of the range means "no limit"; 0.999, because decoded floats are not exact
        top = 0.999 * (loader_database().by_name["Limits"].by_signal[signal].maximum or math.inf)
        found = self.frame("Limits", signal, label, "limit", steps=True, keep=lambda v: v < top)
        return [*found, *(replace(c, value=-c.value, silent=True) for c in found if either_way)]


def groups(run: RunDirectory, verdict: RunVerdict | None) -> list[Group]:
    """All plots of one run; the same ones for every run."""
    s = Signals(run)
    return [
        Group("Wheel loads", _wheel_loads(s)),
        Group("Roll-over", _roll_over(s, verdict)),
        Group("Steering", _steering(s)),
        Group("Speed and drive", _drive(s)),
    ]


def _plot(title: str, unit: str, *curves: list[Curve], always: tuple[float, ...] = ()) -> Plot:
    return Plot(title=title, unit=unit, curves=[c for group in curves for c in group], always=always)


def _wheel_loads(s: Signals) -> tuple[Plot, ...]:
    return tuple(
        _plot(
            f"Normal force, {wheel}",
            "kN",
            s.truth("normal_force", "true", "truth", index=i, scale=1e-3),
            s.interval("NormalForces", signal, f"{signal}Valid"),
            s.frame("NormalForces", signal, "estimated", "estimate", valid=f"{signal}Valid"),
            always=(0.0,),
        )
        for i, (wheel, signal) in enumerate(zip(WHEELS, WHEEL_SIGNALS, strict=True))
    )


def _roll_over(s: Signals, verdict: RunVerdict | None) -> tuple[Plot, ...]:
    return (
        _plot(
            "Load-transfer ratio of the four wheels, positive: right side heavier",
            "1",
            s.truth("load_transfer_ratio", "true", "truth"),
            s.interval("RollOver", "LoadTransferRatio", "Valid"),
            s.frame("RollOver", "LoadTransferRatio", "estimated", "estimate", valid="Valid"),
            s.frame("RollOver", "PredictedLoadTransferRatio", "predicted", "predicted", valid="Valid"),
            always=(-1.0, 1.0),
        ),
        _plot(
            "Load-transfer ratio of the front pair; 1 or -1: a front wheel has lifted",
            "1",
            _true_front_transfer(s),
            s.frame(
                "Warnings",
                "FrontLoadTransferRatio",
                "estimated",
                "estimate",
                valid="FrontLoadTransferRatioValid",
            ),
            always=(-1.0, 1.0),
        ),
        _plot(
            "Lift-off margin: smallest wheel load over its standing load",
            "1",
            _true_margin(s),
            s.frame("RollOver", "LiftOffMargin", "estimated", "estimate", valid="Valid"),
            always=(0.0, 1.0),
        ),
        _plot(
            "Time to lift-off",
            "s",
            _true_time_to_lift_off(verdict),
            s.frame(
                "RollOver",
                "TimeToLiftOff",
                "predicted",
                "predicted",
                valid="Valid",
                keep=lambda v: v < NO_PREDICTION_S,
            ),
            always=(0.0, 1.0),
        ),
        _plot(
            "Roll and pitch angle, positive: left side up, nose down",
            "°",
            s.truth("roll", "roll, true", "truth", scale=DEGREES),
            s.frame("SlopeSensor", "RollAngle", "roll, sensor", "estimate"),
            s.truth("pitch", "pitch, true", "demand", scale=DEGREES),
            always=(-2.0, 2.0),
        ),
    )


def _true_margin(s: Signals) -> list[Curve]:
    wheels = [c for i in range(4) for c in s.truth("normal_force", "true", "truth", index=i)]
    # the margin is relative to the standing load: a run that starts with a lifted wheel has none
    if not wheels or any(c.value.size == 0 or not c.value[0] > 0 for c in wheels):
        return []
    return [replace(wheels[0], value=np.min([c.value / c.value[0] for c in wheels], axis=0))]


def _true_front_transfer(s: Signals) -> list[Curve]:
    wheels = [c for i in range(2) for c in s.truth("normal_force", "true", "truth", index=i)]
    if not wheels:
        return []
    left, right = (c.value for c in wheels)
    # no ratio while both front wheels are in the air
    pair = np.where(left + right > 0.0, left + right, np.nan)
    return [replace(wheels[0], value=(right - left) / pair)]


def _true_time_to_lift_off(verdict: RunVerdict | None) -> list[Curve]:
    """The line on which a perfect prediction would lie."""
    if verdict is None or verdict.lift_off_s is None:
        return []
    # a straight line of slope -1 down to zero at lift-off
    ends = np.array((max(verdict.lift_off_s - SHOWN_AHEAD_S, 0.0), verdict.lift_off_s))
    return [Curve("true", ends, verdict.lift_off_s - ends, "truth")]


def _steering(s: Signals) -> tuple[Plot, ...]:
    return (
        _plot(
            "Articulation angle, positive: left",
            "°",
            s.truth("articulation_angle", "true", "truth", scale=DEGREES),
            s.frame("Articulation", "ArticulationAngle", "sensor", "estimate"),
            always=(-1.0, 1.0),
        ),
        _plot(
            "Articulation rate",
            "°/s",
            s.frame("DriverDemand", "ArticulationRateDemand", "driver's demand", "demand", steps=True),
            s.truth("articulation_rate", "true", "truth", scale=DEGREES),
            s.limit("ArticulationRate", "limit, either way", either_way=True),
        ),
        _plot(
            "Torque at the articulation joint, rear frame on front frame",
            "kN m",
            s.truth("joint_torque", "true", "truth", scale=1e-3),
            s.frame("TurningTorque", "JointTorque", "estimated", "estimate", valid="TorqueValid"),
            always=(-1.0, 1.0),
        ),
        _plot(
            "Yaw moment of the tyre forces",
            "kN m",
            s.truth("yaw_moment", "true", "truth", scale=1e-3),
            s.frame("TurningTorque", "YawMoment", "estimated", "estimate", valid="MomentValid"),
            always=(-1.0, 1.0),
        ),
    )


def _drive(s: Signals) -> tuple[Plot, ...]:
    def axle(name: str, left: int) -> Plot:
        side = WHEEL_SIGNALS[left].removesuffix("Left")
        return _plot(
            f"Wheel torque, {name} axle",
            "kN m",
            s.truth("wheel_torque", "left, true", "truth", index=left, scale=1e-3),
            s.truth("wheel_torque", "right, true", "demand", index=left + 1, scale=1e-3),
            s.limit(f"{side}LeftTorque", "limit of drive torque, left", either_way=True),
            s.limit(f"{side}RightTorque", "right", either_way=True),
        )

    return (
        _plot(
            "Speed",
            "km/h",
            s.truth("speed", "true", "truth", scale=3.6),
            s.frame(
                "BodyMotion",
                "Speed",
                "estimated",
                "estimate",
                scale=3.6,
                valid=s.flag("BodyMotion", "SpeedValid"),
            ),
            s.limit("Speed", "limit"),
            always=(0.0, 5.0),
        ),
        _plot(
            "Payload",
            "kg",
            s.truth("payload_mass", "true", "truth"),
            s.interval("BodyMotion", "PayloadMass", "PayloadValid"),
            s.frame("BodyMotion", "PayloadMass", "estimated", "estimate", valid="PayloadValid"),
            always=(0.0, 1000.0),
        ),
        axle("front", 0),
        axle("rear", 2),
    )


def state_bands(run: RunDirectory) -> list[Band]:
    """Roll-over state, cause of the limits, state of the ECU, and each warning that was ever raised."""
    found = []
    for name, message, signal, words in STATES:
        if (columns := run.messages.get(message)) is not None:
            found.append(
                Band(name, intervals(columns.time_s, columns.signals[signal], words, window_of(run)))
            )
    return [band for band in found if band.intervals] + warning_bands(run)


def warning_bands(run: RunDirectory) -> list[Band]:
    """The warnings that were ever raised, each with the DBC's sentence on it."""
    warnings = run.messages.get("Warnings")
    if warnings is None:
        return []
    layout = loader_database().by_name["Warnings"].by_signal
    found = [
        Band(
            spaced(signal),
            intervals(warnings.time_s, values, FLAG, window_of(run)),
            layout[signal].comment or "",
        )
        for signal, values in warnings.signals.items()
        # a reason is one bit; beside them the frame carries the ratio of the front pair
        if signal in layout and layout[signal].length == 1 and not signal.endswith("Valid")
    ]
    return [band for band in found if any(s.severity for s in band.intervals)]


def spaced(name: str) -> str:
    """RollOverPredicted -> Roll over predicted."""
    words = "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()
    return words[:1].upper() + words[1:]
