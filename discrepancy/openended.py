"""What no effect of the library explains: innovations regressed on functions of the known signals, with units.

Each function may act at each port of the model (a force, a yaw moment) or directly on an output; through a port
it is simulated, so that it reaches the outputs through the model's own dynamics. Terms are chosen one by one
(orthogonal matching pursuit) under the same penalty and held-out test as the library; among terms that cannot be
told apart the simplest is written down and the others are named with it.
"""

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import norm

from discrepancy.fit import Fit, WindowStates, differences
from discrepancy.model import Model, Window
from discrepancy.normal import inverse
from discrepancy.problem import Problem
from discrepancy.recording import Array
from discrepancy.screen import Projector, inflation_of, penalty, stretches
from discrepancy.sensors import lagged
from discrepancy.state import Settings, State
from discrepancy.trials import folds
from discrepancy.units import Unit, parse_unit

MOST_TERMS = 3
MOST_SIGNALS = 6
MOST_READINGS = 200  # functions added to readings that are looked at closely
LAG_S = (0.2, 1.0)
PLAY = 0.3  # width of the hysteresis operator, in standard deviations of its signal

Signals = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Function:
    """f(signals) with its text, unit and complexity (1: plain); series per window come from `of`."""

    text: str
    unit: Unit
    complexity: int
    signals: tuple[str, ...]
    of: Callable[[Signals, float], Array]


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
                f"({f'{t.coefficient:.4g} {t.unit}'.removesuffix(' 1')}) {t.function.text}".removesuffix(" 1")
                for t in self.terms
                if t.place == place
            )
            for place in places
        )


@dataclass(frozen=True, slots=True)
class _Candidate:
    place: str
    unit: str
    function: Function
    amplitude: float  # of the coefficient for which `raw` was simulated
    raw: Array


def functions(units: Mapping[str, str], spread: Mapping[str, float]) -> list[Function]:
    """Unit-consistent functions of named signals; spread: standard deviation of each, for the operators with a width."""
    one = parse_unit("1")
    found = [Function("1", one, 0, (), lambda s, _: np.ones_like(next(iter(s.values()))))]
    for name in list(units)[:MOST_SIGNALS]:
        found += _of_one(name, units[name], max(spread[name], 1e-12))
    names = list(units)[:MOST_SIGNALS]
    for i, a in enumerate(names):
        found += [
            Function(f"{a}·{b}", parse_unit(units[a]) * parse_unit(units[b]), 3, (a, b), _product(a, b))
            for b in names[i + 1 :]
        ]
    return found


def _of_one(name: str, unit_text: str, sd: float) -> list[Function]:
    unit, one = parse_unit(unit_text), parse_unit("1")

    def make(text: str, of_unit: Unit, complexity: int, of: Callable[[Array, float], Array]) -> Function:
        return Function(text, of_unit, complexity, (name,), lambda signals, step: of(signals[name], step))

    return [
        make(name, unit, 1, lambda x, _: x),
        make(f"{name}·|{name}|", unit**2, 2, lambda x, _: x * np.abs(x)),
        make(f"{name}²", unit**2, 2, lambda x, _: x**2),
        make(f"sign({name})", one, 2, lambda x, _: np.tanh(x / (0.05 * sd))),
        make(f"|{name}|", unit, 2, lambda x, _: np.abs(x)),
        make(f"d/dt {name}", unit / parse_unit("s"), 2, lambda x, step: np.diff(x, prepend=x[:1]) / step),
        make(f"{name}³", unit**3, 3, lambda x, _: x**3),
        make(f"play({name}, {PLAY * sd:.3g} {unit_text})", unit, 4, lambda x, _: play(x, PLAY * sd)),
        *(make(f"lowpass({name}, {T:g} s)", unit, 3, partial(_low_pass, time_constant_s=T)) for T in LAG_S),
    ]


def _low_pass(x: Array, step_s: float, time_constant_s: float) -> Array:
    return lagged(x, time_constant_s, step_s)


def _product(a: str, b: str) -> Callable[[Signals, float], Array]:
    return lambda s, _: s[a] * s[b]


def play(x: Array, width: float) -> Array:
    """Play (backlash) operator: follows x with a dead zone of +-width; the simplest memory without a time scale."""
    out = np.empty_like(x)
    now = float(x[0])
    for i, value in enumerate(x.tolist()):
        now = min(max(now, value - width), value + width)
        out[i] = now
    return out


def explore(problem: Problem, state: State, settings: Settings) -> OpenEnded:
    """Search the innovations of a state for what the known signals could still explain."""
    candidates = _candidates(problem, state)
    noise, fitted = state.noise, state.fit
    whole = np.bincount(noise.row_channel, fitted.residual**2, len(problem.channels))
    blocks = stretches(noise)
    projector = Projector(problem, noise, fitted)
    white = np.stack([noise.whiten(c.raw) for c in candidates], axis=1)
    X = projector.off(white)
    size, before = np.sum(X**2, axis=0), np.sum(white**2, axis=0)
    visible = size > 1e-6 * np.maximum(before, 1e-30)
    needed = penalty(1, len(candidates), settings.alpha)
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
        simplest = min(rivals, key=lambda i: (candidates[i].function.complexity, -plain[i]))
        confirmed = _held_out(problem, state, white[:, [*chosen, simplest]], settings)
        taken = np.bincount(noise.row_channel, confirmed, len(problem.channels)) / np.maximum(whole, 1e-300)
        if float(np.sum(confirmed)) < settings.held_out + gain * settings.confirmed:
            break
        if float(np.max(taken)) < problem.model.least_explained:
            break
        equally.append(tuple(_place(candidates[i]) for i in rivals if i != simplest))
        chosen.append(simplest)
        c = np.linalg.lstsq(X[:, chosen], fitted.residual, rcond=None)[0]
        left = fitted.residual - X[:, chosen] @ c
        gain = float(np.sum(fitted.residual**2) - np.sum(left**2))
    if not chosen:
        return OpenEnded((), 0.0, needed, {}, len(candidates), {})
    confirmed = _held_out(problem, state, white[:, chosen], settings)
    return OpenEnded(
        tuple(_terms(candidates, chosen, equally, X, fitted.residual)),
        gain,
        needed,
        {name: float(np.sum(confirmed[noise.row_channel == i])) for i, name in enumerate(problem.channels)},
        len(candidates),
        _beside(fitted, projector.states.off(white[:, chosen]), X[:, chosen]),
    )


def _beside(fitted: Fit, terms: Array, projected: Array) -> dict[str, tuple[float, float]]:
    """Bias of the parameters by the omitted terms, which comes off again, and their standard deviations with them."""
    c = np.linalg.lstsq(projected, fitted.residual, rcond=None)[0]
    J = fitted.columns
    moved = -fitted.covariance @ (J.T @ (terms @ c))
    Q = np.linalg.qr(terms)[0]
    left = np.sqrt(np.diag(inverse(fitted.information - (J.T @ Q) @ (Q.T @ J), fitted.information)))
    return {n: (float(m), float(s)) for n, m, s in zip(fitted.names, moved, left, strict=True)}


def _place(candidate: _Candidate) -> str:
    return f"{candidate.place} += {candidate.function.text}"


def _terms(
    candidates: Sequence[_Candidate],
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


def _candidates(problem: Problem, state: State) -> list[_Candidate]:
    model, fitted = problem.model, state.fit
    base = problem.predict(fitted.values)
    units = {**model.inputs, **model.optional, **model.outputs}
    known = [driven(model, w, fitted.values.in_window(i)) for i, w in enumerate(problem.windows)]
    common = [n for n in units if all(n in k for k in known)]
    spread = {n: float(np.std(np.concatenate([k[n] for k in known]))) for n in common}
    moving = {n: units[n] for n in common if spread[n] > 0.0}
    readings, found = _Readings(problem, state), []
    for function in functions(moving, spread):
        series = [function.of(k, w.step_s) for k, w in zip(known, problem.windows, strict=True)]
        rms = float(np.sqrt(np.mean(np.concatenate(series) ** 2)))
        if rms < 1e-12 or not np.isfinite(rms):
            continue
        for port in model.ports:
            amplitude = port.typical / rms
            extra = [{port.name: amplitude * s} for s in series]
            raw = problem.predict(fitted.values, extra) - base
            found.append(_Candidate(port.name, port.unit, function, amplitude, raw))
        for name in [c for c in problem.channels if spread.get(c, 0.0) > 0.0 and function.text != c]:
            readings.consider(function, name, series, spread[name] / rms)
    return found + readings.best()


def driven(model: Model, window: Window, values: Mapping[str, float]) -> dict[str, Array]:
    """Signals to build functions of: inputs, and outputs simulated without sight of the measured ones.

    A measured output used as regressor would explain itself.
    """
    inputs = {n: window[n] for n in (*model.inputs, *model.optional) if window.has(n)}
    try:
        true = model.simulate(replace(window, known=inputs), values, {})
    except KeyError:  # the model is driven by a measured output
        return inputs
    return {**inputs, **{n: y for n, y in true.items() if n in model.outputs}}


class _Readings:
    """Functions that may be added to the readings of outputs, the most promising of them where there are many.

    Promising is what correlates with the innovations of the channel itself; only those are whitened with all other channels.
    """

    def __init__(self, problem: Problem, state: State) -> None:
        self._problem = problem
        self._kept: list[tuple[float, int, _Candidate]] = []
        self._seen = 0
        self._own = {
            name: np.flatnonzero(state.noise.row_channel == i) for i, name in enumerate(problem.channels)
        }
        self._noise, self._residual = state.noise, state.fit.residual

    def consider(self, function: Function, channel: str, series: Sequence[Array], amplitude: float) -> None:
        """Keep the function for this channel if it is among the most promising so far; series: per window, on its grid.

        It enters as it was just before each reading: a driver or controller answers to what is read, error and all, so that what it commands
        from then on would explain that error.
        """
        raw = np.zeros(self._problem.measured.size)
        for block in self._problem.blocks:
            if channel in block.channels:
                i, c = block.channels.index(channel), len(block.channels)
                window = self._problem.windows[block.window]
                before = block.time_s - window.step_s
                raw[block.start + i : block.stop : c] = np.interp(before, window.time_s, series[block.window])
        rows = self._own[channel]
        seen, left = raw[self._noise.keep[rows]], self._residual[rows]
        power = float(seen @ seen)
        promise = float(seen @ left) ** 2 / power if power > 0.0 else 0.0
        unit = self._problem.model.outputs[channel]
        candidate = _Candidate(f"reading of {channel}", unit, function, amplitude, raw * amplitude)
        self._seen += 1
        heapq.heappush(self._kept, (promise, self._seen, candidate))
        if len(self._kept) > MOST_READINGS:
            heapq.heappop(self._kept)

    def best(self) -> list[_Candidate]:
        """Those kept, most promising first."""
        return [candidate for _, _, candidate in sorted(self._kept, key=lambda entry: -entry[0])]


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
