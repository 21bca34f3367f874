"""What no effect of the library explains: innovations regressed on functions of the known signals, with units.

Each function may act at each port of the model (a force, a yaw moment) or directly on an output; through a port
it is simulated, so that it reaches the outputs through the model's own dynamics. Terms are chosen one by one
(orthogonal matching pursuit) under the same penalty and held-out test as the library; among terms that cannot be
told apart the simplest is written down and the others are named with it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from discrepancy.acting import Candidate, Simulated, candidates
from discrepancy.fit import Fit, WindowStates, differences
from discrepancy.functions import Function
from discrepancy.model import Model, Window
from discrepancy.noise import Noise
from discrepancy.normal import inverse
from discrepancy.problem import Problem
from discrepancy.quantities import quantity
from discrepancy.recording import Array
from discrepancy.screen import Projector, inflation_of, penalty, stretches
from discrepancy.state import Settings, State
from discrepancy.trials import folds
from discrepancy.units import parse_unit

MOST_TERMS = 3
WIDTHS = np.geomspace(0.125, 4.0, 11)  # times its first, at which the width of a chosen play is tried
WIDTH_FOUND = 0.01  # of its logarithm


@dataclass(frozen=True, slots=True)
class OpenTerm:
    """coefficient * function, acting at a place; sd of the coefficient; unit of the coefficient."""

    place: str
    place_unit: str
    function: Function
    coefficient: float
    sd: float
    unit: str
    equally_good: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class OpenEnded:
    """Terms found (none: nothing depends on the known signals), their gain, and the gain on held-out rows.

    beside: by how much every fitted parameter would move if the terms were taken into the fit, and its
    standard deviation there.
    """

    terms: tuple[OpenTerm, ...]
    gain: float
    needed: float
    held_out_gains: Mapping[str, float]  # by channel
    tried: int
    beside: Mapping[str, tuple[float, float]]

    @property
    def held_out_gain(self) -> float:
        return sum(self.held_out_gains.values())

    def equation(self) -> str:
        """All terms by place, as text."""
        places = dict.fromkeys(term.place for term in self.terms)
        return "; ".join(
            f"{place} += "
            + " + ".join(
                f"({quantity(t.coefficient, t.unit)}) {t.function.text}".removesuffix(" 1")
                for t in self.terms
                if t.place == place
            )
            for place in places
        )


def explore(problem: Problem, state: State, settings: Settings) -> OpenEnded:
    """Search the innovations of a state for what the known signals could still explain."""
    simulated = Simulated(problem, state)
    made = candidates(problem, state, simulated)
    noise, fitted = state.noise, state.fit
    whole = np.bincount(noise.row_channel, fitted.residual**2, len(problem.channels))
    blocks = stretches(noise)
    projector = Projector(problem, noise, fitted)
    white = np.stack([noise.whiten(c.raw) for c in made], axis=1)
    X = projector.off(white)
    size, before = np.sum(X**2, axis=0), np.sum(white**2, axis=0)
    visible = size > 1e-6 * np.maximum(before, 1e-30)
    needed = penalty(1, len(made), settings.alpha)
    chosen: list[int] = []
    equally: list[tuple[str, ...]] = []
    left, gain = fitted.residual, 0.0
    while len(chosen) < MOST_TERMS:
        free = X - X[:, chosen] @ np.linalg.lstsq(X[:, chosen], X, rcond=None)[0] if chosen else X
        power = np.sum(free**2, axis=0)
        usable = visible & (power > 1e-6 * np.maximum(size, 1e-30))
        with np.errstate(divide="ignore", invalid="ignore"):
            plain = np.where(usable, (free.T @ left) ** 2 / np.where(usable, power, 1.0), 0.0)
        best = int(np.argmax(plain))
        inflation = inflation_of(free[:, [best]], left, blocks)
        if plain[best] / inflation < needed:
            break
        close = np.flatnonzero(plain > plain[best] - settings.same).tolist()
        rivals: list[int] = [i for i in close if i not in chosen]
        simplest = min(rivals, key=lambda i: (made[i].function.complexity, -plain[i]))
        fitting = _fitting(simulated, made[simplest], partial(_gained, noise, projector, X[:, chosen], left))
        if fitting is not None:
            made[simplest] = fitting
            white[:, simplest] = noise.whiten(fitting.raw)
            X[:, simplest] = projector.off(white[:, [simplest]])[:, 0]
        confirmed = _held_out(problem, state, white[:, [*chosen, simplest]], settings)
        taken = np.bincount(noise.row_channel, confirmed, len(problem.channels)) / np.maximum(whole, 1e-300)
        if float(np.sum(confirmed)) < settings.held_out + gain * settings.confirmed:
            break
        if float(np.max(taken)) < problem.model.least_explained:
            break
        equally.append(tuple(_place(made[i]) for i in rivals if i != simplest))
        chosen.append(simplest)
        c = np.linalg.lstsq(X[:, chosen], fitted.residual, rcond=None)[0]
        left = fitted.residual - X[:, chosen] @ c
        gain = float(np.sum(fitted.residual**2) - np.sum(left**2))
    if not chosen:
        return OpenEnded((), 0.0, needed, {}, len(made), {})
    confirmed = _held_out(problem, state, white[:, chosen], settings)
    return OpenEnded(
        tuple(_terms(made, chosen, equally, X, fitted.residual)),
        gain,
        needed,
        {name: float(np.sum(confirmed[noise.row_channel == i])) for i, name in enumerate(problem.channels)},
        len(made),
        _beside(fitted, projector.states.off(white[:, chosen]), X[:, chosen]),
    )


def _gained(noise: Noise, projector: Projector, chosen: Array, left: Array, candidate: Candidate) -> float:
    """What a candidate takes off the squared errors beside the terms chosen so far."""
    free = projector.off(noise.whiten(candidate.raw)[:, None])[:, 0]
    free = free - chosen @ np.linalg.lstsq(chosen, free, rcond=None)[0]
    return float(free @ left) ** 2 / max(float(free @ free), 1e-300)


def _fitting(
    simulated: Simulated, candidate: Candidate, gained: Callable[[Candidate], float]
) -> Candidate | None:
    """A play at the width at which it gains most; None for functions without one."""
    wide = candidate.function.wide
    if wide is None:
        return None

    def at(width: float) -> Candidate | None:
        shape = simulated.shape(wide.having(width))
        return None if shape is None else simulated.at(candidate.place, shape)

    def loss(log_width: float) -> float:
        made = at(float(np.exp(log_width)))
        return 0.0 if made is None else -gained(made)

    middle = float(np.log(wide.width))
    grid = middle + np.log(WIDTHS)
    best = int(np.argmin([loss(w) for w in grid]))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    found = minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": WIDTH_FOUND})
    fitted = at(float(np.exp(found.x)))
    return fitted if fitted is not None and gained(fitted) > gained(candidate) else None


def _beside(fitted: Fit, terms: Array, projected: Array) -> dict[str, tuple[float, float]]:
    """Bias of the parameters by the omitted terms, which comes off again, and their standard deviations with them."""
    c = np.linalg.lstsq(projected, fitted.residual, rcond=None)[0]
    J = fitted.columns
    moved = -fitted.covariance @ (J.T @ (terms @ c))
    Q = np.linalg.qr(terms)[0]
    left = np.sqrt(np.diag(inverse(fitted.information - (J.T @ Q) @ (Q.T @ J), fitted.information)))
    return {n: (float(m), float(s)) for n, m, s in zip(fitted.names, moved, left, strict=True)}


def _place(candidate: Candidate) -> str:
    return f"{candidate.place} += {candidate.function.text}"


def _terms(
    candidates: Sequence[Candidate],
    chosen: Sequence[int],
    equally: Sequence[tuple[str, ...]],
    X: Array,
    e: Array,
) -> list[OpenTerm]:
    gram = X[:, chosen].T @ X[:, chosen]
    covariance = inverse(gram)
    coefficient = covariance @ (X[:, chosen].T @ e)
    return [
        OpenTerm(
            place=candidates[i].place,
            place_unit=candidates[i].unit,
            function=candidates[i].function,
            coefficient=float(coefficient[k] * candidates[i].amplitude),
            sd=float(np.sqrt(covariance[k, k]) * candidates[i].amplitude),
            unit=str(parse_unit(candidates[i].unit) / candidates[i].function.unit),
            equally_good=equally[k][:5],
        )
        for k, i in enumerate(chosen)
    ]


def _held_out(problem: Problem, state: State, white: Array, settings: Settings) -> Array:
    """Gain in squared error (n,) on rows that coefficients and nuisances were not fitted to (linear in both)."""
    noise, fitted, gain = state.noise, state.fit, np.zeros(state.noise.keep.size)
    base = problem.predict(fitted.values)
    e = noise.whiten(problem.measured - base)
    local = noise.whiten(differences(problem, fitted.values, base, problem.local_names))
    for test in folds(problem, noise, settings.folds):
        train_states = WindowStates(local, noise.row_window, ~test)
        test_states = WindowStates(local, noise.row_window, test)
        J, A, b = fitted.columns[~test], train_states.off(white)[~test], train_states.off(e)[~test]
        prior = fitted.information - fitted.columns.T @ fitted.columns
        H = np.block([[J.T @ J + prior, J.T @ A], [A.T @ J, A.T @ A]])
        c = inverse(H) @ np.concatenate([J.T @ b, A.T @ b])
        with_terms = test_states.off(e - fitted.columns @ c[: J.shape[1]] - white @ c[J.shape[1] :])
        plain = inverse(J.T @ J + prior) @ (J.T @ b)
        without = test_states.off(e - fitted.columns @ plain)
        gain[test] = without[test] ** 2 - with_terms[test] ** 2
    return gain


def extended(model: Model, found: OpenEnded) -> Model:
    """The model with the equation built in at its ports, so that it runs with it from then on."""
    inner, places = model.simulate, {port.name for port in model.ports}
    acting = [t for t in found.terms if t.place in places]

    def simulate(
        window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        # terms see the outputs of the model without them: first order in the term, as they were fitted
        true = {**window.known, **inner(window, values, extra)}
        added = {name: extra.get(name, np.zeros(window.time_s.size)) for name in places}
        for t in acting:
            added[t.place] = added[t.place] + t.coefficient * t.function.of(true, window.step_s)
        return inner(window, values, added)

    return replace(model, simulate=simulate)


def significance(term: OpenTerm) -> float:
    """Two-sided p-value of one coefficient by itself."""
    return float(2.0 * norm.sf(abs(term.coefficient) / term.sd))
