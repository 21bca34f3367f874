"""Relaxation length of each step of the cylinder's speed: by the transient model driven with the measured slip, and by (99) beside it.

(99) takes the step of slip for an ideal one and measures the wheel's distance. It finds a longer length, the more so the slower the
slip settles: E-08 and section 4.4 of the equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from discrepancy.estimation.normal_equations import inverse
from identify.rig.preparing import Trace, steps
from identify.tyre.transient import COLUMNS, CONSTANT, LAW, START, response

Array = NDArray[np.float64]

BEFORE_S, AFTER_S = 0.3, 4.5  # of a step
LINEAR_SLIP = 0.5  # no step is analysed beyond: SCP is for small slip


def _normal(jacobian: object) -> Array:
    J = np.asarray(jacobian, float)
    return np.asarray(J.T @ J, float)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepLength:
    """Relaxation lengths [m] of one step. slip: mean of the levels before and after; load: [N]."""

    run: str
    time: float
    slip: float
    load: float
    length: float
    length_sd: float
    by_wheel_distance: float  # (99) as printed: from zero force, over the wheel's distance
    by_road_distance: float  # (99) with the force before the step and the road's distance


def step_lengths(trace: Trace, load: float) -> list[StepLength]:
    """One for each step whose force moves beyond its noise."""
    found = []
    for at in steps(trace.speed):
        a, b = at - round(BEFORE_S / trace.step), at + round(AFTER_S / trace.step)
        if a < 0 or b > trace.speed.size or not trace.kept[a:b].mean() > 0.9:
            continue
        one = _analysed(trace, a, b, load)
        if one is not None:
            found.append(one)
    return found


def _analysed(trace: Trace, a: int, b: int, load: float) -> StepLength | None:
    part = slice(a, b)
    kept, force = trace.kept[part], np.where(trace.kept[part], trace.force[part], 0.0)
    n = round(BEFORE_S / trace.step)
    before, after = float(np.mean(trace.slip[a : a + n])), float(np.mean(trace.slip[b - 3 * n : b]))
    first, last = float(np.mean(force[:n][kept[:n]])), float(np.mean(force[-3 * n :][kept[-3 * n :]]))
    if (
        abs(last - first) < 10.0 * trace.force_sd
        or max(abs(before), abs(after)) > LINEAR_SLIP
        or abs(after - before) < 1e-3
    ):
        return None
    stiffness = max((last - first) / (after - before), 1.0)
    length, sd = _transient(trace, part, force, kept, stiffness, before, first - stiffness * before)
    road = _distance(trace.speed[part], trace.step)
    wheel = _distance(trace.wheel[part], trace.step)
    start = n  # the step itself
    return StepLength(
        run=trace.name,
        time=float(trace.time[a + n]),
        slip=0.5 * (before + after),
        load=load,
        length=length,
        length_sd=sd,
        by_wheel_distance=_exponential(wheel[start:] - wheel[start], force[start:], kept[start:], 0.0, last),
        by_road_distance=_exponential(
            road[start:] - road[start], force[start:], kept[start:], float(force[start]), last
        ),
    )


def _distance(speed: Array, step: float) -> Array:
    """Distance travelled since the first sample (n,) [m], by the trapezoidal rule."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)))


def _transient(
    trace: Trace,
    part: slice,
    force: Array,
    kept: NDArray[np.bool_],
    stiffness: float,
    before: float,
    zero: float,
) -> tuple[float, float]:
    """Length of greatest likelihood and its standard deviation, the tyre linear around the step."""
    speed, wheel = trace.speed[part], trace.wheel[part]
    n = speed.size
    kappa, out, by = np.empty(n), np.empty(n), np.empty((n, COLUMNS))
    measured = np.where(kept, force, np.nan)
    size = np.array([1e-1, 1e4, 1e2, 1e-3])
    gains = np.zeros(n)

    def evaluate(x: Array, held: bool = True) -> None:
        curve = np.array([x[1] * size[1], 1.0, 1e12, 0.0, 0.0, 0.0, x[2] * size[2]])
        response(
            CONSTANT, float(x[0] * size[0]), 0.0, curve, speed, wheel, trace.step, float(x[3] * size[3]), measured, 1.0, 0.0,
            trace.sliding_sd[part], trace.force_sd, held, gains, kappa, out, by,
        )  # fmt: skip

    start = np.array([0.4, stiffness, zero, before]) / size
    evaluate(start, held=False)  # the predictor's gains, which the fit then holds

    def residual(x: Array) -> Array:
        evaluate(x)
        return np.where(kept, out - force, 0.0) / trace.force_sd

    def jacobian(x: Array) -> Array:
        evaluate(x)
        return np.where(kept[:, None], by[:, [LAW, 0, 6, START]] * size, 0.0) / trace.force_sd

    found = least_squares(
        residual, start, jacobian,
        bounds=(np.array([0.005, 1.0, -np.inf, -np.inf]) / size, np.array([20.0, 1e8, np.inf, np.inf]) / size), loss="soft_l1",
    )  # fmt: skip
    variance = max(1.0, 2.0 * found.cost / max(int(kept.sum()) - 4, 1))
    covariance = inverse(_normal(found.jac)) * variance
    return float(found.x[0] * size[0]), float(np.sqrt(covariance[0, 0]) * size[0])


def _exponential(x: Array, force: Array, kept: NDArray[np.bool_], start: float, end: float) -> float:
    """Length [m] by which start + (end - start)(1 - exp(-x/length)) fits best."""

    def residual(p: Array) -> Array:
        return np.where(kept, start + (end - start) * (1.0 - np.exp(-x / p[0])) - force, 0.0)

    found = least_squares(residual, [0.5], bounds=([1e-3], [50.0]), x_scale=[0.1])
    return float(found.x[0])


def table(found: Sequence[StepLength]) -> list[tuple[str, ...]]:
    """Rows for people: run, slip, load, the three lengths."""
    return [
        (
            s.run,
            f"{s.slip:.4f}",
            f"{s.load / 1e3:.1f}",
            f"{s.length:.3f} ± {1.96 * s.length_sd:.3f}",
            f"{s.by_wheel_distance:.3f}",
            f"{s.by_road_distance:.3f}",
        )
        for s in found
    ]
