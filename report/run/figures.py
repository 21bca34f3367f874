"""Computes the figures of a run for the report's tables: events, estimation errors, traffic, conditions, timing."""

import shlex
from dataclasses import dataclass

import numpy as np

from bus.frame import Frame
from bus.wire import wire_bits
from dbc import loader_database
from hil.rundir import RunDirectory
from hil.timing.deadlines import COUNTER_MODULUS
from hil.timing.measured import (
    LATEST_START,
    LONGEST_EXECUTION,
    LONGEST_REACTION,
    PERIOD_NS,
    Spread,
    Timing,
    longest_wait_text,
    reaction_ns,
)
from hil.timing.vitals import Vitals
from hil.verdict import WHEELS, RunVerdict, first_lift_off
from plant.unit.scenario import list_scenarios
from report.kit.histogram import Histogram, milliseconds
from report.run import signals
from report.run.signals import DEGREES, WHEEL_SIGNALS, warning_bands

BIT_RATE = 500_000
SHOWN = {"plant": "plant", "ecu": "ECU", "gateway": "gateway"}
PERIOD_MS = PERIOD_NS * 1e-6
Figures = dict[str, str]
"""Name of a figure -> its value as text, in the order of the table."""


@dataclass(frozen=True, slots=True)
class LoadError:
    """Error of the estimated normal force of one wheel."""

    wheel: str
    rms: float  # [N]
    mean: float  # estimate minus truth [N]
    share: float  # RMS over the standing load of the wheel


@dataclass(frozen=True, slots=True)
class Traffic:
    """Traffic of one message."""

    name: str
    sender: str
    cycle_ms: float | None  # of the DBC
    frames: int
    period_ms: float  # mean of the recording
    load: float  # share of the bit rate, stuff bits not counted
    lost: int | None  # frames missing by the alive counter; None for a message without one


def what_happened(verdict: RunVerdict | None) -> Figures:
    """The figures at the top of the report: warning, lift-off, roll-over, smallest load."""
    if verdict is None:
        return {}
    wheel = WHEELS[verdict.lifting_wheel] if verdict.lifting_wheel is not None else ""
    lift = f"{verdict.lift_off_s:.2f} s, {wheel} wheel" if verdict.lift_off_s is not None else "none"
    rolled = f"{verdict.rolled_over_s:.2f} s" if verdict.rolled_over_s is not None else "no"
    return {
        "First warning": f"{verdict.warned_s:.2f} s" if verdict.warned_s is not None else "none",
        "First lift-off": lift,
        "Warning ahead of lift-off": lead_text(verdict),
        "Rolled over (45°)": rolled,
        "Smallest wheel load": f"{100 * verdict.margin:.0f} % of standing",
        "Largest roll angle": f"{verdict.largest_roll * DEGREES:.1f}°",
        "Largest load-transfer ratio": f"{verdict.largest_load_transfer:.2f}",
    }


def lead_text(verdict: RunVerdict) -> str:
    """How long before lift-off the warning came."""
    lead = verdict.lead_s
    if lead is None:
        return "never warned" if verdict.lifted else "–"
    return f"{abs(lead):.2f} s {'before' if lead > 0 else 'after'} lift-off"


def load_errors(run: RunDirectory) -> list[LoadError]:
    """Errors per wheel up to the first lift-off; [] without truth or estimate."""
    # after a lift-off the estimate is the pull that would hold the wheel down, and the truth is zero
    columns = run.messages.get("NormalForces")
    if columns is None or "normal_force" not in run.truth or not run.truth["time_s"].size:
        return []
    time, force = run.truth["time_s"], run.truth["normal_force"]
    lift = first_lift_off(time, force)
    end = min(lift[0] if lift else np.inf, time[-1])
    rows = []
    for i, (wheel, signal) in enumerate(zip(WHEELS, WHEEL_SIGNALS, strict=True)):
        usable = (np.asarray(columns.signals[f"{signal}Valid"]) > 0) & (columns.time_s <= end)
        if not usable.any():
            continue
        true = np.interp(columns.time_s[usable], time, force[:, i])
        error = np.asarray(columns.signals[signal], float)[usable] * 1e3 - true
        rms = float(np.sqrt(np.mean(error**2)))
        rows.append(LoadError(wheel, rms, float(np.mean(error)), rms / float(force[0, i])))
    return rows


def warnings_raised(run: RunDirectory) -> list[tuple[str, str, float, float]]:
    """Each warning that was raised: name, meaning, first time [s], total duration [s]."""
    rows = []
    for band in warning_bands(run):
        raised = [s for s in band.intervals if s.severity]
        rows.append((band.name, band.meaning, raised[0].start_s, sum(s.end_s - s.start_s for s in raised)))
    return sorted(rows, key=lambda row: row[2])


def traffic(run: RunDirectory) -> list[Traffic]:
    """Every message of the bus, in the order of the database."""
    rows = []
    # in the order of the database, which is by sender and rate, not in the order of arrival
    for name, codec in loader_database().by_name.items():
        columns = run.messages.get(name)
        if columns is None or not len(columns.time_s):
            continue
        count = len(columns.time_s)
        span = float(columns.time_s[-1] - columns.time_s[0])
        # of the whole run: one missing frame changes it little, and the deadlines are judged elsewhere
        period = span / (count - 1) if count > 1 and span > 0 else float("nan")
        counter = columns.signals.get("AliveCounter")
        bits = wire_bits(Frame(codec.can_id, bytes(codec.length)))
        rows.append(
            Traffic(
                name=name,
                sender=", ".join(codec.senders),
                cycle_ms=codec.cycle_ns * 1e-6 if codec.cycle_ns else None,
                frames=count,
                period_ms=period * 1e3,
                load=bits / BIT_RATE / period,
                lost=None if counter is None else _skipped(np.asarray(counter, np.int64)),
            )
        )
    return rows


def _skipped(counter: np.ndarray[tuple[int], np.dtype[np.int64]]) -> int:
    """Number of counts that an alive counter skipped; a counter that stands still skipped none."""
    # a step of a whole turn or more looks like a smaller one: a lower bound of the lost frames
    step = np.diff(counter) % COUNTER_MODULUS
    return int(np.maximum(step - 1, 0).sum())


def conditions(run: RunDirectory) -> Figures:
    """Scenario, machine, options and versions of a run."""
    r = run.record
    where = "lockstep, on a virtual clock" if r.mode == "lockstep" else "processes on a hub, in real time"
    return {
        "Scenario": r.scenario,
        "Machine": r.machine,
        "Payload": f"{r.payload_kg:.0f} kg",
        **({"Changed": ", ".join(r.changes)} if r.changes else {}),
        "Estimators": r.form,
        "ECU's core": r.ecu_core,
        "ECU's limits": "on" if r.limits else "off: the ECU only warns",
        "Sensors": "tested against each other" if r.detect_faults else "not tested against each other",
        "Mode": where,
        "Seed of the sensor noise": str(r.seed),
        "Simulated time": f"{r.duration_s:.2f} s",
        "Outcome": r.outcome + (f": {r.reason}" if r.reason else ""),
        "Started": r.started.replace("T", " ").replace("+00:00", " UTC"),
        "Folder": str(run.path),
        "Run it again": command(run),
    } | {f"Version of {name}": version for name, version in r.versions.items()}


def command(run: RunDirectory) -> str:
    """The command line that repeats the run."""
    r = run.record
    # a scenario of the user is named by its file
    known = {summary.name for summary in list_scenarios()}
    words = ["loaderhil", "run", r.scenario if r.scenario in known else f"{r.scenario}.toml"]
    if not r.limits:
        words.append("--no-limits")
    if not r.detect_faults:
        words.append("--no-detect-faults")
    if r.mode == "realtime":
        words.append("--realtime")
    if r.form != "corrected":
        words += ["--form", r.form]
    if r.ecu_core != "python":
        words += ["--ecu-core", r.ecu_core]
    for change in r.changes:
        words += ["--set", change]
    return shlex.join([*words, "--payload-kg", f"{r.payload_kg:g}", "--seed", str(r.seed)])


def timing_figures(timing: Timing) -> Figures:
    """Loop timing of a real-time run."""
    rows = {f"Lateness of the {SHOWN[who]}'s tick": spread_text(s) for who, s in timing.lateness.items()}
    rows |= {f"Execution of the {SHOWN[who]}'s tick": spread_text(s) for who, s in timing.execution.items()}
    rows["Reaction, sample to answer"] = spread_text(timing.reaction)
    rows |= {f"– {name}": spread_text(spread) for name, spread in timing.hops.items()}
    rows |= {f"Ticks the {SHOWN[who]} skipped": str(count) for who, count in timing.overruns.items()}
    rows["Frames lost"] = str(timing.dropped)
    rows["Processor time taken by other guests"] = f"{100 * timing.stolen:.2f} %"
    rows["Longest time that the host kept a process waiting"] = longest_wait_text(timing)
    return rows | {
        f"Time the {SHOWN.get(who, who)} waited for a processor": f"{100 * share:.1f} %"
        for who, share in timing.waited.items()
    }


def memory_figures(vitals: Vitals | None) -> Figures:
    """Resident memory of each process of a real-time run at start and end; of a restarted process its last life."""
    return {
        f"Memory of the {SHOWN.get(life.process, life.process)}, start / end": (
            f"{life.start_bytes / 2**20:.1f} / {life.end_bytes / 2**20:.1f} MiB"
        )
        for life in (vitals.lives if vitals else ())
    }


def spread_text(spread: Spread) -> str:
    """Median, 99th percentile and largest in milliseconds."""
    if spread.count == 0:
        return "not measured"
    return f"{spread.median * 1e-6:.2f} / {spread.p99 * 1e-6:.2f} / {spread.largest * 1e-6:.2f} ms"


def histograms(run: RunDirectory) -> list[Histogram]:
    """Lateness and execution of both processes, and the reaction across the bus."""
    shown = []
    for what, share in (("lateness", LATEST_START), ("execution", LONGEST_EXECUTION)):
        for who in ("plant", "ecu"):
            column = f"{who}_{what}_ns"
            values = milliseconds(run.timing[column]) if column in run.timing else np.empty(0)
            title = "Lateness of the" if what == "lateness" else "Execution time of the"
            shown.append(Histogram(f"{title} {SHOWN[who]}'s tick", values, share * PERIOD_MS))
    return [*shown, Histogram("Reaction, sample to answer", _reactions(run), LONGEST_REACTION * PERIOD_MS)]


def _reactions(run: RunDirectory) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    samples, answers = run.messages.get("Articulation"), run.messages.get("EcuStatus")
    if samples is None or answers is None:
        return milliseconds(())
    return milliseconds(
        reaction_ns(
            samples.time_s,
            samples.signals["SampleSequence"],
            answers.time_s,
            answers.signals["EchoSequence"],
        )
    )


def findings(run: RunDirectory) -> Figures:
    """Findings of plant and ECU about their inputs, with their counts."""
    counts = run.record.statistics
    return {
        f"{SHOWN[who]}: {signals.spaced(name).lower()}": str(count)
        for who in ("plant", "ecu")
        for key, count in counts.items()
        if key.startswith(f"{who}_finding_") and (name := key.removeprefix(f"{who}_finding_"))
    }


def trouble_codes(run: RunDirectory) -> list[tuple[str, str, str, str]]:
    """The ECU's trouble codes by name: suspect parameter, failure mode, when first shown as active [s], occurrences.

    Read from the recorded bus, where one code per frame is shown in turn.
    """
    shown = run.messages.get("ActiveFaults")
    if shown is None:
        return []
    layout = loader_database().by_name["ActiveFaults"].by_signal
    offset = layout["Spn"].offset
    found: dict[tuple[int, int], tuple[float, int]] = {}
    signals = (shown.signals[name] for name in ("Spn", "Fmi", "OccurrenceCount"))
    for time_s, spn, mode, count in zip(shown.time_s, *signals, strict=True):
        if spn > offset:
            first_s, most = found.get((int(spn), int(mode)), (float(time_s), 0))
            found[int(spn), int(mode)] = first_s, max(most, int(count))
    names, modes = layout["Spn"].choices, layout["Fmi"].choices
    return [
        (
            names.get(int(spn - offset), str(spn)),
            modes.get(mode, str(mode)).replace("_", " "),
            f"{first_s:.1f}",
            str(most),
        )
        for (spn, mode), (first_s, most) in found.items()
    ]
