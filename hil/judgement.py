"""From the files of a run to its verdicts: which column and which signal answers which question."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from dbc.columns import Columns
from hil.gateway.hops import hops
from hil.rundir import RunDirectory, RunError
from hil.timing import Spread, Timing, reaction_ns
from hil.verdict import WARNING_MIN_S, RunVerdict, flickers, judge, lasting, roll_over_warning

PROCESSES = ("plant", "ecu")
RECORDERS = ("recorder", "ecu-recorder", "recorder/child", "ecu-recorder/child")
"""Frames are stamped before they come to them: what they wait for a processor makes nothing late."""
WAY = "way_"


def judge_run(run: RunDirectory) -> RunVerdict:
    """Roll-over in a run: truth against the ECU's warnings."""
    if not len(run.truth):
        raise RunError(f"{run.path}: nothing to judge by, {'; '.join(run.problems) or 'the truth is empty'}")
    truth = run.truth
    return judge(
        time_s=truth["time_s"],
        normal_force=truth["normal_force"],
        roll=truth["roll"],
        load_transfer_ratio=truth["load_transfer_ratio"],
        warned_s=first_warning(run.messages),
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
    """The timing of a real-time run, from timing.npz, the log's echoes and the processes' counters."""
    counts, vitals = run.record.statistics, run.record.vitals
    lives = [life for life in vitals.lives if life.process not in RECORDERS] if vitals else []
    return Timing(
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
        reaction=Spread.of(_reactions(run)),
        overruns={"plant": int(counts.get("plant_missed", 0)), "ecu": _ecu_overruns(run)},
        dropped=sum(int(counts.get(f"{name}_dropped", 0)) for name in (*PROCESSES, "gateway", *RECORDERS)),
        stolen=vitals.stolen if vitals else float("nan"),
        waited=_largest((life.process, life.waited) for life in lives),
        worst_stolen=vitals.worst_stolen if vitals else float("nan"),
        worst_waited=_largest((life.process, life.worst_waited) for life in lives),
        hops={name: Spread.of(durations) for name, durations in hops(_way(run)).items()},
    )


def _largest(shares: Iterable[tuple[str, float]]) -> dict[str, float]:
    """By process; one that was started again counts by its worst life."""
    found: dict[str, float] = {}
    for name, share in shares:
        found[name] = max(share, found.get(name, 0.0))
    return found


def _ecu_overruns(run: RunDirectory) -> int:
    """Ticks the ECU skipped while the plant was there; before, it waits for a machine that still compiles."""
    status = run.messages.get("EcuStatus")
    if status is None:
        return 0
    during = status.signals["Overruns"][status.time_s >= 0]
    return int(during[-1] - during[0]) if during.size else 0


def _column(run: RunDirectory, name: str) -> NDArray[np.float64]:
    return np.asarray(run.timing[name], float) if name in run.timing else np.empty(0)


def _way(run: RunDirectory) -> dict[str, NDArray[np.int64]]:
    """The stamps of every reaction in the order of its way."""
    return {name.removeprefix(WAY): run.timing[name] for name in run.timing if name.startswith(WAY)}


def _reactions(run: RunDirectory) -> NDArray[np.int64]:
    samples, answers = run.messages.get("Articulation"), run.messages.get("EcuStatus")
    if samples is None or answers is None:
        return np.empty(0, np.int64)
    return reaction_ns(
        samples.time_s, samples.signals["SampleSequence"], answers.time_s, answers.signals["EchoSequence"]
    )
