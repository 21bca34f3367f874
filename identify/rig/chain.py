"""The chain from the log of a rig to a tyre: prepare the runs, fit all together, compare models, list undetermined parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.rig.load import LoadLine, load_line
from identify.rig.log import RigLog
from identify.rig.preparing import Trace, Unusable, prepared, slower
from identify.rig.relaxation import StepLength, step_lengths
from identify.signals.rejection import added
from identify.tyre.estimate import Estimate, estimate
from identify.tyre.rig_problem import RigProblem

BASE = ("PCX1", "PDX1", "PEX1", "PKX1")
OF_BRAKING = ("PEX4",)
OF_LOAD = ("PDX2", "PKX3", "PEX2")
OF_LOADS = ("PEX3", "PKX2")  # with three or more loads
OF_PRESSURE = ("PPX1", "PPX3")
OF_PRESSURES = ("PPX2", "PPX4")  # with three or more pressures
VALIDATION = "validation"
STAGE_SLOWER = 5  # times fewer samples in a stage than in the joint fit, which corrects it
DOUBTFUL = 0.05  # error of a simulation over the force, above which a run does not fit the tyre


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A log prepared for a fit."""

    log: RigLog
    traces: Sequence[Trace]
    loads: LoadLine
    unusable: Sequence[str]  # one sentence per run that cannot be used
    warnings: Sequence[str]

    @property
    def rejected(self) -> Mapping[str, int]:
        """Raw samples by reason."""
        return added(*(t.rejected for t in self.traces))

    @property
    def fitted(self) -> list[Trace]:
        return [t for t in self.traces if t.kind != VALIDATION]

    @property
    def validation(self) -> list[Trace]:
        return [t for t in self.traces if t.kind == VALIDATION]


def prepare(log: RigLog) -> Prepared:
    """All runs that can be used. Raises Unusable if none can, or if the load cannot be found."""
    try:
        loads = load_line(log.calibration, log.nominal)
    except ValueError as error:
        raise Unusable(f"{log.name}: {error}") from error
    traces: list[Trace] = []
    unusable: list[str] = []
    for run in log.runs:
        try:
            traces.append(prepared(run, loads.load(run.piston_pressure)))
        except Unusable as error:
            unusable.append(str(error))
    if not any(t.kind != VALIDATION for t in traces):
        raise Unusable("; ".join(unusable) or f"{log.name}: has no runs")
    warnings = [w for t in traces for w in t.warnings]
    if loads.excess > 3.0:
        warnings.append(
            f"the piston's calibration scatters {loads.excess:.1f} times more than its readings should: is one of them wrong?"
        )
    return Prepared(
        log=log, traces=traces, loads=loads, unusable=unusable, warnings=[*warnings, *_odd_scales(traces)]
    )


def _odd_scales(traces: Sequence[Trace]) -> list[str]:
    """Warnings about runs whose scale factor differs from that of the others: another gear, or slip at their start."""
    ordered = sorted(t.scale for t in traces)
    middle = ordered[len(ordered) // 2]
    return [
        f"{t.name}: its scale factor is {t.scale / middle - 1.0:+.1%} beside that of the others: another gear, or slip at the start?"
        for t in traces
        if abs(t.scale / middle - 1.0) > 0.01
    ]


def parameters_for(traces: Sequence[Trace]) -> tuple[str, ...]:
    """Parameters of the tyre that the loads, pressures and directions of these runs can determine."""
    main = [t for t in traces if t.kind in ("drive", "brake")]
    loads = {round(t.piston_pressure) for t in main}
    pressures = {round(t.inflation) for t in main}
    kinds = {t.kind for t in main}
    return (
        *BASE,
        *(OF_BRAKING if {"drive", "brake"} <= kinds else ()),
        *(OF_LOAD if len(loads) > 1 else ()),
        *(OF_LOADS if len(loads) > 3 else ()),
        *(OF_PRESSURE if len(pressures) > 1 else ()),
        *(OF_PRESSURES if len(pressures) > 2 else ()),
    )


def problem_of(ready: Prepared, tyre: Sequence[str] | None = None, **choices: object) -> RigProblem:
    """The joint problem of all runs that are fitted; choices: other fields of RigProblem."""
    given: dict[str, object] = {
        "traces": ready.fitted,
        "nominal": ready.log.nominal,
        "loads": ready.loads,
        "tyre": tuple(tyre) if tyre is not None else parameters_for(ready.fitted),
        "gain_sd": ready.log.gain_sd,
        "shortest": ready.log.shortest_relaxation,
    }
    return RigProblem(**{**given, **choices})  # type: ignore[arg-type]


def stages(ready: Prepared) -> list[tuple[tuple[str, ...], list[Trace]]]:
    """Parameters and runs of each stage of the thesis' fit: nominal; all loads at nominal pressure; all pressures."""
    main = [t for t in ready.fitted if t.kind in ("drive", "brake")] or ready.fitted
    pressure = min((t.inflation for t in main), key=lambda p: abs(p - ready.log.nominal.pressure))
    at_pressure = [t for t in main if t.inflation == pressure]
    piston = min(t.piston_pressure for t in at_pressure)
    sets = [[t for t in at_pressure if t.piston_pressure == piston], at_pressure, main]
    found: list[tuple[tuple[str, ...], list[Trace]]] = []
    for traces in sets:
        tyre = parameters_for(traces) if found else BASE
        if not found or tyre != found[-1][0]:
            found.append((tyre, traces))
    return found


def staged(ready: Prepared) -> list[Estimate]:
    """The estimates of all stages, simulated, each from the one before; the last is where the joint fit begins.

    From a fixed start, or from the nominal runs alone, the joint fit of a third of the tyres ended beside the optimum: its coloured noise
    is that of the residuals at its start, and a start that misses the other loads calls a wrong curve noise.
    """
    start: dict[str, float] = {}
    out = []
    for tyre, traces in stages(ready):
        few = [slower(t, STAGE_SLOWER) for t in traces]
        out.append(
            estimate(problem_of(ready, tyre, traces=few, predictor=False), start, rounds=2, white=True)
        )
        start |= out[-1].values
    return out


def first_stage(ready: Prepared) -> dict[str, float]:
    """Where the joint fit begins: the last of `staged`, by name."""
    return dict(staged(ready)[-1].values)


def fitted(ready: Prepared, before: Sequence[Estimate] = ()) -> Estimate:
    """The joint estimate of all unknowns. before: the staged estimates, where they were made already."""
    return estimate(problem_of(ready), dict(before[-1].values) if before else first_stage(ready))


def lengths(ready: Prepared) -> list[StepLength]:
    """Relaxation lengths of all steps of all runs of steps."""
    return [
        s
        for t in ready.fitted
        if t.kind == "steps"
        for s in step_lengths(t, ready.loads.load(t.piston_pressure))
    ]


def inconsistent_runs(ready: Prepared, found: Estimate) -> list[str]:
    """Warnings about runs that the fitted tyre, simulated from their slip, does not reproduce: a wrong fit, or another tyre."""
    problem = problem_of(ready, predictor=False)
    out = []
    for trace, part in zip(problem.traces, problem.parts(dict(found.values)), strict=True):
        size = float(np.sqrt(np.mean(trace.force[part.kept] ** 2)))
        error = float(np.sqrt(np.mean(part.residual[part.kept] ** 2)))
        if error > DOUBTFUL * size + 3.0 * trace.force_sd:
            out.append(
                f"{trace.name}: the fitted tyre errs by {error:.0f} N of {size:.0f} N: another tyre, load or pressure than described?"
            )
    return out
