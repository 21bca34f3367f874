"""What a report shows of a run: plots of truth against estimate, bands of states, tables of figures.

Reads a run directory as it is; a signal that was not recorded leaves its curve out, not the plot.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dbc import loader_database
from hil.judgement import timing_of
from hil.report.plot import Curve, Mark, Plot
from hil.rundir import RunDirectory
from hil.timing import Spread, Timing
from hil.verdict import WHEELS, RunVerdict, first_lift_off

WHEEL_SIGNALS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
NO_PREDICTION_S = 10.2  # RollOver.TimeToLiftOff at the top of its range: none within the horizon
ROLL_STATES = {0: "stable", 1: "attention", 2: "warning", 3: "imminent", 4: "lifted"}
LIMIT_CAUSES = {0: "no limit", 1: "precaution", 2: "roll-over prevention", 3: "safe values"}
ECU_STATES = {0: "init", 1: "running", 2: "degraded", 3: "fault"}
DEGREES = 180.0 / np.pi


@dataclass(frozen=True, slots=True)
class Band:
    """A state over time: stretches with a label and a severity 0 (quiet) to 3."""

    name: str
    stretches: tuple[tuple[float, float, str, int], ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """A row of a table: what, and its value as text."""

    name: str
    value: str


def marks(verdict: RunVerdict | None) -> list[Mark]:
    """The moments every plot shows."""
    if verdict is None:
        return []
    found = []
    if verdict.warned_s is not None:
        found.append(Mark(verdict.warned_s, f"first warning {verdict.warned_s:.2f} s", "warned"))
    if verdict.lift_off_s is not None and verdict.lifting_wheel is not None:
        found.append(
            Mark(
                verdict.lift_off_s,
                f"{WHEELS[verdict.lifting_wheel]} lifts {verdict.lift_off_s:.2f} s",
                "lifted",
            )
        )
    if verdict.rolled_over_s is not None:
        found.append(Mark(verdict.rolled_over_s, f"on its side {verdict.rolled_over_s:.2f} s", "lifted"))
    return found


class Signals:
    """Curves out of one run, from the truth or from the ECU's and the machine's frames."""

    def __init__(self, run: RunDirectory) -> None:
        self._run = run

    def truth(
        self, name: str, label: str, style: str, *, index: int | None = None, scale: float = 1.0
    ) -> list[Curve]:
        """The plant's own value."""
        truth = self._run.truth
        if name not in truth:
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
        """A signal as it went over the bus, in the DBC's unit times `scale`; gaps where it was not valid."""
        columns = self._run.messages.get(message)
        if columns is None or signal not in columns.signals:
            return []
        value = np.asarray(columns.signals[signal], float) * scale
        if valid is not None:
            value = np.where(np.asarray(columns.signals[valid], float) > 0, value, np.nan)
        if keep is not None:
            value = np.where(keep(value), value, np.nan)
        return [Curve(label, np.asarray(columns.time_s, float), value, style, steps)] if value.size else []


def plots(run: RunDirectory, verdict: RunVerdict | None, until_s: float) -> list[Plot]:
    """The plots of one run, all over the same time."""
    s = Signals(run)
    events = marks(verdict)

    def plot(
        title: str, unit: str, *curves: list[Curve], low: float | None = None, high: float | None = None
    ) -> Plot:
        merged = [curve for group in curves for curve in group]
        return Plot(title=title, unit=unit, curves=merged, marks=events, low=low, high=high, until_s=until_s)

    loads = [
        plot(
            f"Normal force, {wheel}",
            "kN",
            s.truth("normal_force", "true", "truth", index=i, scale=1e-3),
            s.frame("NormalForces", signal, "estimated", "estimate", valid=f"{signal}Valid"),
            low=0.0,
        )
        for i, (wheel, signal) in enumerate(zip(WHEELS, WHEEL_SIGNALS, strict=True))
    ]
    return [
        *loads,
        plot(
            "Load-transfer ratio",
            "",
            s.truth("load_transfer_ratio", "true", "truth"),
            s.frame("RollOver", "LoadTransferRatio", "estimated", "estimate", valid="Valid"),
            s.frame("RollOver", "PredictedLoadTransferRatio", "predicted", "predicted", valid="Valid"),
            low=-1.0,
            high=1.0,
        ),
        plot(
            "Lift-off margin and predicted time to lift-off",
            "1, s",
            s.frame("RollOver", "LiftOffMargin", "margin [1]", "estimate", valid="Valid"),
            s.frame(
                "RollOver",
                "TimeToLiftOff",
                "time to lift-off [s]",
                "predicted",
                valid="Valid",
                keep=lambda v: v < NO_PREDICTION_S,
            ),
            low=0.0,
            high=1.0,
        ),
        plot(
            "Articulation angle",
            "°",
            s.truth("articulation_angle", "true", "truth", scale=DEGREES),
            s.frame("Articulation", "ArticulationAngle", "sensor", "estimate"),
        ),
        plot(
            "Articulation rate",
            "°/s",
            s.frame("DriverDemand", "ArticulationRateDemand", "driver's demand", "demand", steps=True),
            s.truth("articulation_rate", "true", "truth", scale=DEGREES),
            s.frame("Limits", "ArticulationRate", "limit", "limit", steps=True),
        ),
        plot(
            "Speed",
            "km/h",
            s.truth("speed", "true", "truth", scale=3.6),
            s.frame("BodyMotion", "Speed", "estimated", "estimate", scale=3.6),
            s.frame("Limits", "Speed", "limit", "limit", steps=True),
            low=0.0,
        ),
        plot(
            "Roll and pitch angle",
            "°",
            s.truth("roll", "roll, true", "truth", scale=DEGREES),
            s.frame("SlopeSensor", "RollAngle", "roll, sensor", "estimate"),
            s.truth("pitch", "pitch, true", "predicted", scale=DEGREES),
            low=-2.0,
            high=2.0,
        ),
        plot(
            "Torque of the front left wheel",
            "kN m",
            s.truth("wheel_torque", "true", "truth", index=0, scale=1e-3),
            s.frame("Limits", "FrontLeftTorque", "limit", "limit", steps=True),
        ),
        plot(
            "Torque at the articulation joint",
            "kN m",
            s.truth("joint_torque", "true", "truth", scale=1e-3),
            s.frame("TurningTorque", "JointTorque", "estimated", "estimate", valid="TorqueValid"),
        ),
    ]


def bands(run: RunDirectory) -> list[Band]:
    """States over time: roll-over, cause of the limits, state of the ECU, and each warning that was ever raised."""
    found = []
    for name, message, signal, words in (
        ("Roll-over state", "RollOver", "State", ROLL_STATES),
        ("Limits", "Limits", "Cause", LIMIT_CAUSES),
        ("ECU", "EcuStatus", "State", ECU_STATES),
    ):
        if (columns := run.messages.get(message)) is not None:
            found.append(Band(name, stretches(columns.time_s, columns.signals[signal], words)))
    if (warnings := run.messages.get("Warnings")) is not None:
        layout = loader_database().by_name["Warnings"].by_signal
        for signal, values in warnings.signals.items():
            if signal not in ("Crc", "AliveCounter", "Level") and np.any(np.asarray(values) > 0):
                found.append(
                    Band(
                        spaced(signal), stretches(warnings.time_s, values, {0: "", 1: layout[signal].comment})
                    )
                )
    return found


def severity(value: int, words: Mapping[int, str]) -> int:
    """Of a state by its number; a flag that is set counts as 2, a value without a word as quiet."""
    if value not in words:
        return 0
    return min(value, 3) if len(words) > 2 else 2 * value


def stretches(
    time_s: ArrayLike, value: ArrayLike, words: Mapping[int, str]
) -> tuple[tuple[float, float, str, int], ...]:
    """Unbroken stretches of one value: start, end [s], its word, its severity (0..3, by its number)."""
    time, values = np.asarray(time_s, float), np.asarray(value, float)
    if time.size == 0:
        return ()
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    ends = np.concatenate((time[starts[1:]], time[-1:]))
    return tuple(
        (
            float(time[i]),
            float(end),
            words.get(int(values[i]), "not available"),
            severity(int(values[i]), words),
        )
        for i, end in zip(starts, ends, strict=True)
    )


def spaced(name: str) -> str:
    """RollOverPredicted -> Roll over predicted."""
    words = "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()
    return words[:1].upper() + words[1:]


def load_errors(run: RunDirectory) -> list[tuple[str, float, float]]:
    """Per wheel: RMS of estimate minus truth [N], and that as a share of the wheel's standing load.

    Up to the first lift-off: after it the estimate is the pull that would hold the wheel down, the truth is zero.
    """
    columns = run.messages.get("NormalForces")
    if columns is None or "normal_force" not in run.truth:
        return []
    time, force = run.truth["time_s"], run.truth["normal_force"]
    lift = first_lift_off(time, force)
    end = lift[0] if lift else np.inf
    rows = []
    for i, (wheel, signal) in enumerate(zip(WHEELS, WHEEL_SIGNALS, strict=True)):
        usable = (np.asarray(columns.signals[f"{signal}Valid"]) > 0) & (columns.time_s <= min(end, time[-1]))
        if not usable.any():
            continue
        true = np.interp(columns.time_s[usable], time, force[:, i])
        error = np.asarray(columns.signals[signal], float)[usable] * 1e3 - true
        rms = float(np.sqrt(np.mean(error**2)))
        rows.append((wheel, rms, rms / float(force[0, i])))
    return rows


def key_figures(run: RunDirectory, verdict: RunVerdict | None) -> list[Figure]:
    """What a reader wants to know first."""
    if verdict is None:
        return []
    wheel = WHEELS[verdict.lifting_wheel] if verdict.lifting_wheel is not None else ""
    lead = verdict.lead_s
    if lead is None:
        lead_text = "never warned" if verdict.lifted else "–"
    else:
        lead_text = f"{abs(lead):.2f} s {'before' if lead > 0 else 'after'} lift-off"
    return [
        Figure(
            "First lift-off",
            f"{verdict.lift_off_s:.2f} s, {wheel} wheel" if verdict.lift_off_s is not None else "none",
        ),
        Figure("First warning", f"{verdict.warned_s:.2f} s" if verdict.warned_s is not None else "none"),
        Figure("Warning ahead of lift-off", lead_text),
        Figure(
            "On its side", f"{verdict.rolled_over_s:.2f} s" if verdict.rolled_over_s is not None else "no"
        ),
        Figure("Smallest wheel load", f"{100 * verdict.margin:.0f} % of standing"),
        Figure("Largest roll angle", f"{verdict.largest_roll * DEGREES:.1f}°"),
        Figure("Largest load-transfer ratio", f"{verdict.largest_load_transfer:.2f}"),
    ]


def conditions(run: RunDirectory) -> list[Figure]:
    """What was run, on what, with which versions."""
    r = run.record
    mode = (
        "in lockstep on a virtual clock" if r.mode == "lockstep" else "as processes on the hub, in real time"
    )
    return [
        Figure("Scenario", r.scenario),
        Figure("Machine", r.machine),
        Figure("Payload", f"{r.payload_kg:.0f} kg"),
        Figure("Estimators", r.form),
        Figure("ECU's limits", "obeyed" if r.limits else "ignored by the machine"),
        Figure("Mode", mode),
        Figure("Seed", str(r.seed)),
        Figure("Simulated time", f"{r.duration_s:.2f} s"),
        Figure("Outcome", r.outcome + (f": {r.reason}" if r.reason else "")),
        Figure("Started", r.started),
        *(Figure(name, version) for name, version in r.versions.items()),
    ]


def spread_text(spread: Spread) -> str:
    """Median, 99th percentile and largest in milliseconds."""
    if spread.count == 0:
        return "not measured"
    return f"{spread.median * 1e-6:.2f} / {spread.p99 * 1e-6:.2f} / {spread.largest * 1e-6:.2f} ms"


def timing_figures(timing: Timing) -> list[Figure]:
    """Loop timing of a real-time run."""
    rows = [
        Figure(f"Lateness of the {name}'s tick", spread_text(spread))
        for name, spread in timing.lateness.items()
    ]
    rows += [
        Figure(f"Execution of the {name}'s tick", spread_text(spread))
        for name, spread in timing.execution.items()
    ]
    rows.append(Figure("Reaction, sample to answer", spread_text(timing.reaction)))
    rows += [Figure(f"Ticks the {name} skipped", str(count)) for name, count in timing.overruns.items()]
    rows.append(Figure("Frames lost", str(timing.dropped)))
    rows.append(Figure("Processor time stolen by other guests", f"{100 * timing.stolen:.2f} %"))
    return rows


def timing_if_any(run: RunDirectory) -> Timing | None:
    """The timing of a real-time run; None in lockstep, where there is none."""
    return timing_of(run) if run.record.mode == "realtime" else None


def traffic(run: RunDirectory) -> list[tuple[str, int, float, float | None]]:
    """Per message: frames, mean period [ms], the DBC's cycle time [ms]."""
    rows = []
    for name, columns in sorted(run.messages.items()):
        codec = loader_database().by_name.get(name)
        count = len(columns.time_s)
        mean = (
            float((columns.time_s[-1] - columns.time_s[0]) / (count - 1) * 1e3) if count > 1 else float("nan")
        )
        rows.append((name, count, mean, codec.cycle_ns * 1e-6 if codec and codec.cycle_ns else None))
    return rows
