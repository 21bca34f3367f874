"""Runs one choice in lockstep and writes its run directory."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bus.rows import Frames
from dbc.recordings.writer import CandumpWriter
from hil import rundir
from hil.compose import Choice, lockstep, truth_columns
from hil.ending import Ending
from hil.faults.record import Injected, injected, write_faults
from hil.lockstep import CutOffError, Recording
from hil.rundir import Outcome, RunError, RunRecord

BUS_CHANNEL = "loader"
REFERENCE_CHANNEL = "reference"
_OUTCOMES: dict[Ending, Outcome] = {
    Ending.PASSED: "finished",
    Ending.INTERRUPTED: "interrupted",
    Ending.FAILED: "failed",
}


@dataclass(frozen=True, slots=True)
class RunResult:
    """The end of a run."""

    ending: Ending
    reason: str  # '' for a run that finished
    record: RunRecord  # as written


def run_lockstep(choice: Choice, out: Path, progress: Callable[[float], None] | None = None) -> RunResult:
    """Run `choice` on the virtual clock and leave the run directory `out`; `progress` receives simulated seconds."""
    rundir.refuse_if_foreign(out)
    scenario, injector = choice.load(), choice.injector()
    record = choice.record(scenario, "lockstep")
    bench = lockstep(
        scenario,
        form=choice.form,
        limits=choice.limits,
        injector=injector,
        calibration=choice.calibration,
        detect_faults=choice.detect_faults,
        core=choice.core,
        fmu=choice.fmu,
    )
    rundir.begin(out, record)
    ending, reason = Ending.PASSED, ""
    try:
        bench.run(progress)
    except KeyboardInterrupt:
        ending, reason = Ending.INTERRUPTED, "interrupted"
    except CutOffError as error:
        ending, reason = Ending.FAILED, str(error)
    recording = bench.recording
    if injector is not None:
        injector.finish(bench.now_ns)
    lost = write_recording(out, recording, injected(injector.events) if injector is not None else None)
    if lost:
        ending, reason = Ending.FAILED, "; ".join([*([reason] if ending is Ending.FAILED else []), *lost])
    record = replace(
        record,
        outcome=_OUTCOMES[ending],
        reason=reason if ending is Ending.FAILED else "",
        duration_s=float(recording.truth[-1].time_s) if recording.truth else 0.0,
        statistics=_statistics(recording),
    )
    rundir.write_record(out, record)
    return RunResult(ending, reason, record)


def write_recording(out: Path, recording: Recording, faults: Sequence[Injected] | None = None) -> list[str]:
    """Write the files of a lockstep run; returns a sentence for each that could not be written."""
    parts: tuple[Callable[[], None], ...] = (
        *([lambda: write_faults(out, faults)] if faults is not None else []),
        lambda: rundir.write_table(out / rundir.TRUTH, truth_columns(recording.truth)),
        lambda: _write_log(out / rundir.BUS, recording.bus, BUS_CHANNEL),
        lambda: _write_log(out / rundir.REFERENCE, recording.reference, REFERENCE_CHANNEL),
    )
    lost = []
    # one after the other: a full disk may still take the smaller files
    for write in parts:
        try:
            write()
        except RunError as error:
            lost.append(str(error))
    return lost


def _write_log(file: Path, frames: Frames, channel: str) -> None:
    with rundir.writing(file), CandumpWriter(file) as writer:
        writer.write_all(frames, channel)


def _statistics(recording: Recording) -> dict[str, float | int | str]:
    counts: dict[str, float | int | str] = {"ticks": len(recording.truth), "frames": len(recording.bus)}
    for side, findings in (("plant", recording.plant_findings), ("ecu", recording.ecu_findings)):
        counts |= {f"{side}_finding_{name}": count for name, count in sorted(_kinds(findings).items())}
    return counts


def _kinds(findings: Iterable[object]) -> Counter[str]:
    return Counter(type(finding).__name__ for finding in findings)
