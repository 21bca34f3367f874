"""Compares tyre models on runs to which none of them was fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identify.rig.chain import Prepared, first_stage, parameters_for, problem_of
from identify.rig.preparing import Trace
from identify.tyre.brush import brush_force, fit_brush
from identify.tyre.estimate import Estimate, estimate
from identify.tyre.rig_problem import LENGTH_NAME, RigProblem
from identify.tyre.transient import CARCASS, CONSTANT

Array = NDArray[np.float64]

INSTANT = 1e-3  # relaxation length [m] of a tyre without one


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """The error of one model on held-out runs."""

    model: str
    rms: float  # root mean square of the error [N]
    share: float  # over the root mean square of the force


def simulated(problem: RigProblem, trace: Trace, values: dict[str, float]) -> Array:
    """Force (n,) [N] that a model simulates for a run; zero and scale factor come from the free rolling at its start only."""
    tare = float(np.nanmedian(trace.force[: round(1.0 / trace.step)]))
    single = replace(problem, traces=[trace], predictor=False)
    own = {u.name: u.start for u in single.unknowns} | {
        n: v for n, v in values.items() if not n.startswith(("tare ", "scale "))
    }
    force = single.predicted(trace, {**own, f"tare {trace.name}": 0.0})
    return force + (tare - float(np.median(force[: round(1.0 / trace.step)])))


def compared(ready: Prepared) -> list[Compared]:
    """Magic Formula with three laws of relaxation and the brush, fitted to one half of the repeats, judged on the other."""
    main = [t for t in ready.fitted if t.kind in ("drive", "brake")]
    groups: dict[tuple[str, int, int], list[Trace]] = {}
    for t in main:
        groups.setdefault((t.kind, round(t.piston_pressure), round(t.inflation)), []).append(t)
    held = [runs[-1] for runs in groups.values() if len(runs) > 1]
    if not held:
        return []
    train = [t for t in ready.fitted if t not in held]
    tyre = parameters_for(train)
    carcass = problem_of(ready, tyre, traces=train, law=CARCASS)
    constant = problem_of(ready, tyre, traces=train, law=CONSTANT, predictor=False)
    instant = problem_of(
        ready, tyre, traces=train, law=CONSTANT, fixed={LENGTH_NAME: INSTANT}, predictor=False
    )
    size = float(np.sqrt(np.mean(np.concatenate([t.force[t.kept] for t in held]) ** 2)))
    start = first_stage(ready)
    out, best = [], None
    for name, problem in (
        ("Magic Formula, relaxation by the carcass", carcass),
        ("Magic Formula, constant relaxation", constant),
        ("Magic Formula, no relaxation", instant),
    ):
        found = estimate(
            problem, start, rounds=1
        )  # white noise: an autoregression would explain the slow errors of a wrong model
        best = best or found
        rms = _rms([simulated(problem, t, dict(found.values)) for t in held], held)
        out.append(Compared(model=name, rms=rms, share=rms / size))
    assert best is not None
    rms = _brush(ready, carcass, best, train, held)
    return [*out, Compared(model="brush, per load and pressure", rms=rms, share=rms / size)]


def _rms(predicted: Sequence[Array], held: Sequence[Trace]) -> float:
    return float(
        np.sqrt(
            np.mean(
                np.concatenate([(p - t.force)[t.kept] for p, t in zip(predicted, held, strict=True)]) ** 2
            )
        )
    )


def transient_slip(trace: Trace, length: float) -> Array:
    """Slip behind a constant relaxation length (n,): what a stationary curve is compared with."""
    decay = np.exp(-np.abs(trace.speed) * trace.step / length)
    out, state = np.empty(trace.slip.size), 0.0
    slip = np.nan_to_num(trace.slip)
    for k in range(out.size):
        state = slip[k] + (state - slip[k]) * decay[k]
        out[k] = state
    return out


def _brush(
    ready: Prepared, problem: RigProblem, found: Estimate, train: Sequence[Trace], held: Sequence[Trace]
) -> float:
    """The brush is fitted to slips that the same relaxation has passed, so that the curve alone is judged."""
    predicted = []
    for t in held:
        same = [
            o
            for o in train
            if o.kind in ("drive", "brake")
            and o.piston_pressure == t.piston_pressure
            and o.inflation == t.inflation
        ]
        load = ready.loads.load(t.piston_pressure)
        kappa, force = [], []
        for o in same:
            s = transient_slip(o, 0.3)
            good = o.kept & (s > -0.9)
            kappa.append(s[good])
            force.append(o.force[good] - float(np.nanmedian(o.force[:100])))
        brush = fit_brush(np.concatenate(kappa), np.concatenate(force), load)
        s = np.maximum(transient_slip(t, 0.3), -0.9)
        predicted.append(
            brush_force(s, load, brush.friction, brush.slip_stiffness)[0] + float(np.nanmedian(t.force[:100]))
        )
    return _rms(predicted, held)
