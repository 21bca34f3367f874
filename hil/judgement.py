"""Judges a run directory: reads columns and signals from its files and passes them to the pure verdict functions."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dbc.columns import Columns
from hil.gateway.hops import hops
from hil.rundir import RunDirectory, RunError
from hil.timing.measured import REACTION, Spread, Ticks, Timing, explain_reactions, explain_ticks, reactions
from hil.timing.waits import Rows, longest_of
from hil.verdict import WARNING_MIN_S, RunVerdict, flickers, judge, lasting, roll_over_warning

PROCESSES = ("plant", "ecu")
NODES = {"Machine": "plant", "EstimatorEcu": "ecu"}
"""Node of the DBC -> process of the bench."""
RECORDERS = ("recorder", "ecu-recorder", "recorder/child", "ecu-recorder/child", "attend")
"""Processes that only listen. Frames are stamped before they arrive there, so their waits for a processor delay nothing."""
WAY, WAITS = "way_", "waits_"


def judge_run(run: RunDirectory) -> RunVerdict:
    """The verdict on roll-over: the plant's truth against the ECU's warnings. RunError without truth."""
    if not len(run.truth):
        raise RunError(f"{run.path}: nothing to judge by, {'; '.join(run.problems) or 'the truth is empty'}")
    truth = run.truth
    needed = ("normal_force", "roll", "load_transfer_ratio")
    if missing := [name for name in needed if np.isnan(truth[name]).any()]:
        raise RunError(f"{run.path}: nothing to judge by, the plant does not give {', '.join(missing)}")
    return judge(
        time_s=truth["time_s"],
        normal_force=truth["normal_force"],
        roll=truth["roll"],
        load_transfer_ratio=truth["load_transfer_ratio"],
        warned_s=first_warning(run.messages),
        standing=run.record.standing_load_n or truth["normal_force"][0],  # older runs do not say it
    )


def first_warning(messages: Mapping[str, Columns]) -> float | None:
    """When the ECU first warned of roll-over [s on the run's clock], by either of its two messages."""
    moments = [lasting(*signal, WARNING_MIN_S) for signal in warning_signals(messages)]
    return min((begins[0] for begins in moments if begins), default=None)


def warning_flickers(messages: Mapping[str, Columns]) -> int:
    """Warnings of roll-over too short to count."""
    return sum(flickers(*signal, WARNING_MIN_S) for signal in warning_signals(messages))


def warning_signals(
    messages: Mapping[str, Columns],
) -> list[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """(times [s], whether it warns) of RollOver.State, and of the roll-over reasons in Warnings."""
    signals = []
    if (state := messages.get("RollOver")) is not None:
        signals.append((state.time_s, roll_over_warning(state.signals["State"], state.signals["Valid"])))
    if (flags := messages.get("Warnings")) is not None:
        raised = (flags.signals["RollOverPredicted"] > 0) | (flags.signals["RollOverNow"] > 0)
        signals.append((flags.time_s, np.asarray(raised, bool)))
    return signals


def timing_of(run: RunDirectory) -> Timing:
    """The timing of a real-time run, from timing.npz, the echoes in the log and the processes' counters."""
    counts, vitals = run.record.statistics, run.record.vitals
    lives = [life for life in vitals.lives if life.process not in RECORDERS] if vitals else []
    sample_s, took_ns = _reactions(run)
    timing = Timing(
        lateness={
            name: Spread.of(column)
            for name in PROCESSES
            if (column := _column(run, f"{name}_lateness_ns")).size
        },
        execution={
            name: Spread.of(column)
            for name in PROCESSES
            if (column := _column(run, f"{name}_execution_ns")).size
        },
        reaction=Spread.of(took_ns),
        overruns={
            name: count
            for name, count in (
                ("plant", int(counts.get("plant_missed", 0))),
                ("ecu", _ecu_overruns(run)),
            )
            if name not in run.record.foreign  # the ticks of a foreign node cannot be observed
        },
        dropped=sum(int(counts.get(f"{name}_dropped", 0)) for name in (*PROCESSES, "gateway", *RECORDERS)),
        stolen=vitals.stolen if vitals else float("nan"),
        waited=_largest((life.process, life.waited) for life in lives),
        worst_stolen=vitals.worst_stolen if vitals else float("nan"),
        worst_waited=_largest((life.process, life.worst_waited) for life in lives),
        hops={name: Spread.of(durations) for name, durations in hops(_way(run)).items()},
    )
    waits = waits_of(run)
    return _explained(timing, run, waits, sample_s, took_ns) if waits else timing


def waits_of(run: RunDirectory) -> dict[str, Rows]:
    """Process -> its waits for a processor, for the processes that can make a frame late; see `hil.timing.waits`."""
    named = {name.removeprefix(WAITS): name for name in run.timing if name.startswith(WAITS)}
    return {process: run.timing[name] for process, name in named.items() if process not in RECORDERS}


def waits_of_senders(run: RunDirectory) -> dict[str, dict[str, Rows]]:
    """Node -> waits of its own process and of hubs and gateway: the other node's process cannot delay its frames."""
    waits = waits_of(run)
    return {
        node: {name: rows for name, rows in waits.items() if name == process or name not in PROCESSES}
        for node, process in NODES.items()
    }


def _explained(
    timing: Timing,
    run: RunDirectory,
    waits: Mapping[str, Rows],
    sample_s: NDArray[np.float64],
    took_ns: NDArray[np.int64],
) -> Timing:
    """The timing with the delays that waits explain: a tick by waits of its own process, a reaction by those of all but the plant."""
    if not _column(run, "plant_due_ns").size:
        return timing
    due = run.timing["plant_due_ns"]
    own, explained = timing, {}
    for name in timing.lateness:
        ticks = Ticks(*(run.timing[f"{name}_{what}_ns"] for what in ("due", "lateness", "execution")))
        # only its own waits: another process that waited cannot delay the tick itself
        found = explain_ticks(ticks, {of: rows for of, rows in waits.items() if of == name})
        during = (ticks.due_ns >= due[0]) & (ticks.due_ns <= due[-1])  # as those that were counted
        # skipped ticks that no gap in the recorded ticks shows, such as those after the last one, stay unexplained
        unknown = max(timing.overruns[name] - int(found.skipped[during].sum()), 0)
        left = unknown + int(found.skipped[during & ~found.by_wait].sum())
        own = replace(
            own,
            lateness={**own.lateness, name: Spread.of(found.lateness_ns)},
            execution={**own.execution, name: Spread.of(found.execution_ns)},
            overruns={**own.overruns, name: min(left, timing.overruns[name])},
        )
        explained[name] = found.longest
    if "time_s" in run.truth and (known := min(due.size, run.truth["time_s"].size)):
        # reactions are on the run's clock, waits on the monotonic one: converted by the due times of the plant's ticks
        sample_ns = np.rint(np.interp(sample_s, run.truth["time_s"][:known], due[:known])).astype(np.int64)
        # a reaction begins when the plant sends its sample: its waits before that are not in it
        others = {name: rows for name, rows in waits.items() if name != "plant"}
        own_ns, explained[REACTION] = explain_reactions(sample_ns, took_ns, others)
        own = replace(own, reaction=Spread.of(own_ns))
    return replace(
        timing,
        own=own,
        explained={name: wait for name, wait in explained.items() if wait is not None},
        longest_wait=longest_of({name: rows[rows[:, 1] >= due[0]] for name, rows in waits.items()}),
        zero_ns=int(due[0]),
    )


def _largest(shares: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Process -> largest share; a process that was restarted counts by its worst life."""
    found: dict[str, float] = {}
    for name, share in shares:
        found[name] = max(share, found.get(name, 0.0))
    return found


def _ecu_overruns(run: RunDirectory) -> int:
    """Ticks that the ECU skipped after time zero; before it, the ECU waits for a plant that still compiles."""
    status = run.messages.get("EcuStatus")
    if status is None:
        return 0
    during = status.signals["Overruns"][status.time_s >= 0]
    return int(during[-1] - during[0]) if during.size else 0


def _column(run: RunDirectory, name: str) -> NDArray[np.float64]:
    return np.asarray(run.timing[name], float) if name in run.timing else np.empty(0)


def _way(run: RunDirectory) -> dict[str, NDArray[np.int64]]:
    """The stamps of every reaction, by hop in the order of the path."""
    return {name.removeprefix(WAY): run.timing[name] for name in run.timing if name.startswith(WAY)}


def _reactions(run: RunDirectory) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    samples, answers = run.messages.get("Articulation"), run.messages.get("EcuStatus")
    if samples is None or answers is None:
        return np.empty(0), np.empty(0, np.int64)
    return reactions(
        samples.time_s, samples.signals["SampleSequence"], answers.time_s, answers.signals["EchoSequence"]
    )
