"""Candidates of the open-ended search: functions of known signals, simulated at the ports of a model or added to its readings."""

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from discrepancy.estimation.problem import Problem
from discrepancy.model.equations import READING, driven
from discrepancy.selection.functions import Function, functions
from discrepancy.selection.state import State, switched_off
from discrepancy.signals.recording import Array

COPY = 0.1  # of a function's size: what is left of it without the accepted effects, below which it is one of them
MOST_READINGS = 200  # functions of readings that are whitened; with many channels there are thousands


@dataclass(frozen=True, slots=True)
class Candidate:
    """A function at one place, simulated."""

    place: str  # a port, or READING and a channel
    unit: str  # of the place
    function: Function
    amplitude: float  # coefficient for which `raw` was simulated, in `unit` over the function's unit
    raw: Array  # change of the raw rows (N,)


@dataclass(frozen=True, slots=True)
class Shape:
    """A function evaluated on the grid of every window."""

    function: Function
    series: Sequence[Array]  # one per window, in the function's unit
    rms: float  # root mean square over all windows


class Simulated:
    """Functions of the known signals as they act at the ports of a model and on its readings, beside one fit."""

    def __init__(self, problem: Problem, state: State) -> None:
        model, values = problem.model, state.fit.values
        self._problem, self._values = problem, values
        self._accepted = [model.effect(name) for name in state.accepted]
        self._base = problem.predict(values)
        self._known = driven(model, problem.windows, lambda blind: problem.motions(blind, values))
        units = {**model.inputs, **model.optional, **model.outputs}
        common = [n for n in units if all(n in k for k in self._known)]
        self.spread = {n: float(np.std(np.concatenate([k[n] for k in self._known]))) for n in common}
        self.units = {n: units[n] for n in common if self.spread[n] > 0.0}

    def shape(self, function: Function) -> "Shape | None":
        """The function on the grid of every window; None where it is zero or not finite."""
        series = self._series(function, self._known)
        rms = _rms(series)
        return Shape(function, series, rms) if rms >= 1e-12 and np.isfinite(rms) else None

    def of_effects(self, function: Function) -> bool:
        """Whether a function is there only because of the accepted effects, and hardly without them."""
        if not self._accepted:
            return False
        here, without = (_rms(self._series(function, known)) for known in (self._known, self._without))
        return without < COPY * here

    def _series(self, function: Function, known: Sequence[Mapping[str, Array]]) -> list[Array]:
        """The function of these signals on the grid of every window."""
        return [function.of(k, w.step_s) for k, w in zip(known, self._problem.windows, strict=True)]

    @cached_property
    def _without(self) -> Sequence[Mapping[str, Array]]:
        """The known signals of the same fit, the accepted effects off."""
        off = {name: size for effect in self._accepted for name, size in switched_off(effect).items()}
        values = self._values.with_shared(off)
        return driven(
            self._problem.model, self._problem.windows, lambda blind: self._problem.motions(blind, values)
        )

    def at(self, place: str, shape: "Shape") -> Candidate:
        """The candidate of a function at a port (simulated) or on a reading (added)."""
        model = self._problem.model
        port = next((p for p in model.ports if p.name == place), None)
        if port is not None:
            amplitude = port.typical / shape.rms
            moved = self._problem.predict(self._values, [{place: amplitude * s} for s in shape.series])
            return Candidate(place, port.unit, shape.function, amplitude, moved - self._base)
        channel = place.removeprefix(READING)
        # no simulation: an error of a reading does not change the motion
        amplitude = self.spread[channel] / shape.rms
        raw = amplitude * self._on_reading(channel, shape.series)
        return Candidate(place, model.outputs[channel], shape.function, amplitude, raw)

    def _on_reading(self, channel: str, series: Sequence[Array]) -> Array:
        """Rows (N,) of a function added to one channel, with the function's value one step before each reading."""
        # One step before: a driver or controller reacts to the error of a reading, so that its later commands contain that error.
        # A function of them would then explain the error by its own consequence.
        problem = self._problem
        raw = np.zeros(problem.measured.size)
        for block in problem.blocks:
            if channel in block.channels:
                i, c = block.channels.index(channel), len(block.channels)
                window = problem.windows[block.window]
                # a command may answer to any reading of the row that it is averaged in
                before = block.sample_s[:: block.averaged] - window.step_s
                raw[block.start + i : block.stop : c] = np.interp(before, window.time_s, series[block.window])
        return raw


def _rms(series: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(series) ** 2)))


def candidates(problem: Problem, state: State, simulated: Simulated) -> list[Candidate]:
    """All functions at all ports, and the most promising ones on readings."""
    model, readings, found = problem.model, _Readings(problem, state), list[Candidate]()
    for function in functions(simulated.units, simulated.spread, {*model.inputs, *model.optional}):
        shape = simulated.shape(function)
        if shape is None:
            continue
        found += [simulated.at(port.name, shape) for port in model.ports]
        for channel in problem.channels:
            if function.of_readings and channel in simulated.units and function.text != channel:
                readings.consider(channel, simulated.at(READING + channel, shape))
    best = readings.best()
    # What two sensors differ by through the slip alone is the slip once more, a step earlier: added to a reading, it would take its place.
    by_text = {c.function.text: c.function for c in best}
    copies = {text for text, function in by_text.items() if simulated.of_effects(function)}
    return found + [c for c in best if c.function.text not in copies]


class _Readings:
    """Keeps the most promising functions of readings: those that correlate most with the innovations of their own channel.

    This test needs no whitening with all other channels, which is the expensive part.
    """

    def __init__(self, problem: Problem, state: State) -> None:
        self._kept: list[tuple[float, int, Candidate]] = []
        self._seen = 0
        self._own = {
            name: np.flatnonzero(state.noise.row_channel == i) for i, name in enumerate(problem.channels)
        }
        self._noise, self._residual = state.noise, state.fit.residual

    def consider(self, channel: str, candidate: Candidate) -> None:
        """Keep the candidate for this channel if it is among the most promising so far."""
        rows = self._own[channel]
        seen, left = candidate.raw[self._noise.keep[rows]], self._residual[rows]
        power = float(seen @ seen)
        promise = float(seen @ left) ** 2 / power if power > 0.0 else 0.0
        self._seen += 1
        heapq.heappush(self._kept, (promise, self._seen, candidate))
        if len(self._kept) > MOST_READINGS:
            heapq.heappop(self._kept)

    def best(self) -> list[Candidate]:
        """The candidates that were kept, most promising first."""
        return [candidate for _, _, candidate in sorted(self._kept, key=lambda entry: -entry[0])]
