"""A tyre from points of settled slip and force; the error of the effective radius and of the force's scale are unknowns with priors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.autoregression import Whitener
from identify.field.chain import FieldResult, Points
from identify.tyre.curve import steady
from identify.tyre.estimate import Estimate, Noise, estimate
from identify.tyre.parameters import INDEX, NAMES, START, TYPICAL, WIDE, Nominal, curve, vector
from identify.tyre.rig_problem import Part, Unknown

Array = NDArray[np.float64]

SMALL_SLIP = 0.1  # up to this largest slip the data determine only the stiffness
HUBER = 3.0  # standard deviations beyond which a residual counts in proportion, not squared
SHIFT = "slip zero"  # an error of the effective radius acts as a shift of all slips


@dataclass(frozen=True, slots=True, kw_only=True)
class PointProblem:
    """Points, unknown parameters of the tyre, values of the others; scale: standard deviation of each point's residual (n,) [N]."""

    points: Points
    nominal: Nominal
    tyre: Sequence[str]
    scale: Array
    fixed: Mapping[str, float] = field(default_factory=dict)
    gain_sd: float = 0.005
    shift_sd: float = 0.01

    @property
    def unknowns(self) -> list[Unknown]:
        out = [
            Unknown(
                name=n,
                start=float(np.clip(self.fixed.get(n, START.get(n, 0.0)), *WIDE[n])),
                lower=WIDE[n][0],
                upper=WIDE[n][1],
                typical=TYPICAL[n],
            )
            for n in self.tyre
        ]
        out.append(
            Unknown(
                name="gain",
                start=1.0,
                lower=0.8,
                upper=1.2,
                typical=0.01,
                prior=1.0,
                prior_sd=max(self.gain_sd, 1e-6),
            )
        )
        out.append(
            Unknown(name=SHIFT, start=0.0, lower=-0.1, upper=0.1, typical=2e-3, prior_sd=self.shift_sd)
        )
        out.append(Unknown(name="tare", start=0.0, lower=-5e3, upper=5e3, typical=50.0, prior_sd=50.0))
        return out

    def held_at(self, values: Mapping[str, float]) -> "PointProblem":
        """Itself: settled slip needs no predictor."""
        return self

    def parts(self, values: Mapping[str, float]) -> list[Part]:
        index = {name: i for i, name in enumerate(values)}
        p = vector(
            {**{n: v for n, v in self.fixed.items() if n in INDEX}, **{n: values[n] for n in self.tyre}}
        )
        gain = values["gain"]
        load = self.points.load / gain  # both forces have the scale of one transducer
        n = load.size
        made = [curve(p, self.nominal, float(one), self.nominal.pressure) for one in load]
        curves = np.stack([m[0] for m in made])
        kappa = self.points.slip + values[SHIFT] * (1.0 + self.points.slip)
        force, by = np.empty(n), np.empty((n, 7))
        steady(curves, kappa, force, by)
        columns = {
            name: gain * np.einsum("ij,ij->i", by, np.stack([m[1][:, INDEX[name]] for m in made]))
            for name in self.tyre
        }
        columns["gain"] = force - np.einsum("ij,ij->i", by, np.stack([m[2] for m in made])) * load
        columns[SHIFT] = gain * by[:, 5] * (1.0 + self.points.slip)
        columns["tare"] = np.ones(n)
        J = np.stack(list(columns.values()), axis=1) / self.scale[:, None]
        residual = (gain * force + values["tare"] - self.points.force) / self.scale
        return [
            Part(
                residual,
                J,
                np.eye(len(columns)),
                np.array([index[c] for c in columns], np.intp),
                np.ones(n, bool),
            )
        ]


def parameters_for(points: Points) -> tuple[str, ...]:
    """Parameters that the points determine: only the stiffness at small slips, else the whole curve; changes with load where loads differ."""
    names = ["PKX1"]
    if float(np.max(np.abs(points.slip))) > SMALL_SLIP:
        names = ["PCX1", "PDX1", "PEX1", "PKX1"]
    if np.ptp(points.load) > 0.2 * float(np.mean(points.load)):
        names += ["PKX3"] if len(names) == 1 else ["PDX2", "PKX3"]
    return tuple(names)


def fit_points(result: FieldResult, *, friction: float = 0.75) -> tuple[PointProblem, Estimate]:
    """The tyre of maximum likelihood. friction: assumed where the slips are too small to determine it."""
    points = result.points
    names = parameters_for(points)
    force_sd, slip_sd = _pooled(points)

    def problem_with(scale: Array) -> PointProblem:
        return PointProblem(
            points=points,
            nominal=result.log.nominal,
            tyre=names,
            scale=scale,
            fixed={"PCX1": 1.4, "PDX1": friction, "PEX1": 0.0},
            gain_sd=result.log.gain_sd,
        )

    # first weights: 8 is a plausible slip stiffness per load, until the fit gives the slope itself
    problem = problem_with(np.hypot(force_sd, 8.0 * points.load * slip_sd))
    found = estimate(problem, noise=_plain(problem, None))
    # the slope of the curve where a point lies weighs the error of its slip
    for _ in range(3):
        [part] = problem.parts(dict(found.values))
        slope = np.abs(part.by[:, len(names) + 1]) * problem.scale
        expected = np.hypot(force_sd, slope * slip_sd)
        # the scatter about the curve sets the size of all; the fit has bent towards the points
        free = np.sqrt(points.slip.size / max(points.slip.size - len(found.names), 1))
        # (1.4826 x median of |e| is the standard deviation of Gaussian errors, and outliers do not move it)
        size = 1.4826 * free * float(np.median(np.abs(part.residual * problem.scale / expected)))
        problem = problem_with(expected * max(size, 0.2))
        weights = _plain(problem, problem.parts(dict(found.values))[0].residual)
        found = estimate(problem, found.values, noise=weights)
    return problem, replace(found, inflation=_together(found, problem))


def _pooled(points: Points) -> tuple[Array, Array]:
    """Standard deviations of force and slip of each point (n,), each from all of them.

    One window has a few independent values: weighed by its own scatter, the windows that scatter least by chance would count most.
    """
    sliding = float(np.median(points.slip_sd * np.abs(points.speed) / (1.0 + np.abs(points.slip))))
    force = max(30.0, float(np.median(points.force_sd)))
    return (
        np.maximum(force, 0.5 * points.force_sd),
        sliding * (1.0 + np.abs(points.slip)) / np.abs(points.speed),
    )


def _together(found: Estimate, problem: PointProblem) -> float:
    """Variance of the means of events over that of independent points, 1 at least: points of an event share errors of the clock and of the radius."""
    [part] = problem.parts(dict(found.values))
    residual = part.residual * found.noise.weights[0]
    events = [residual[problem.points.event == e] for e in np.unique(problem.points.event)]
    free = max(1.0 - len(problem.tyre) / max(len(events), 1), 0.3)  # the curve bends towards events too
    shared = float(np.mean([e.size * np.mean(e) ** 2 for e in events])) / free
    return max(1.0, shared / max(1e-9, found.sse / max(found.rows - len(found.names), 1)))


def _plain(problem: PointProblem, residual: Array | None) -> Noise:
    """Independent points, Huber's weights."""
    n = problem.points.slip.size
    weight = np.ones(n)
    if residual is not None:
        size = max(1.0, 1.4826 * float(np.median(np.abs(residual))))
        weight = np.sqrt(np.minimum(1.0, HUBER * size / np.maximum(np.abs(residual), 1e-12)))
    return Noise([Whitener(np.zeros((0, 1, 1)), np.eye(1))], [weight])


__all__ = ["NAMES", "SHIFT", "PointProblem", "fit_points", "parameters_for"]
