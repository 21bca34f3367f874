"""The model with an equation outside the library in its baseline, so that what else is missing can be looked for beside it.

The equation's sizes and widths are nuisances there: refitted with every effect, and without a prior, because nothing is known of them but these
recordings. The signals on which it depends are those of the fit that it was found beside: near enough to the truth for what follows from them, and no
simulation more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model, Parameter, Window
from discrepancy.model.equations import driven
from discrepancy.selection.functions import Function
from discrepancy.selection.open_ended import FittedTerm
from discrepancy.selection.state import State
from discrepancy.signals.recording import Array

WIDEST: Final = 8.0  # times the width that a term was found with, up and down: how far a refit may move it
NEAR: Final = 0.3  # of a size or a width: a change that matters

KEPT: Final = 8  # values of each term's width for which its function of a window is kept

Key = tuple[str, float, float]


def built_in(problem: Problem, state: State, terms: Sequence[FittedTerm]) -> Model:
    """The problem's model with these terms of its ports in its baseline. state: beside which they were found."""
    model, inner = problem.model, problem.model.simulate
    known = driven(model, problem.windows, lambda blind: problem.motions(blind, state.fit.values))
    settled = {_key(window): signals for window, signals in zip(problem.windows, known, strict=True)}
    grids = {_key(window): window.time_s for window in problem.windows}

    @lru_cache(KEPT * len(terms) * len(problem.windows))
    def again(number: int, width: float, key: Key, step_s: float) -> Array:
        # most simulations move neither the signals nor a width
        return _function(terms[number], width).of(settled[key], step_s)

    def on_grid_of(window: Window, key: Key) -> Mapping[str, Array]:
        """The signals of a window on another grid of it."""
        between = {name: np.interp(window.time_s, grids[key], s) for name, s in settled[key].items()}
        return {**between, **{name: window[name] for name in model.driving if window.has(name)}}

    def added(number: int, width: float, window: Window, values: Mapping[str, float]) -> Array:
        key = _key(window)
        if key in settled and grids[key].size == window.time_s.size:
            return again(number, width, key, window.step_s)
        if key in settled:
            return _function(terms[number], width).of(on_grid_of(window, key), window.step_s)
        # another manoeuvre: to first order, the signals without the equation
        signals = driven(model, [window], lambda blind: [inner(w, values, {}) for w in blind])[0]
        return _function(terms[number], width).of(signals, window.step_s)

    def simulate(
        window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        pushed = dict(extra)
        for number, term in enumerate(terms):
            place, width = term.reported.place, values.get(width_name(number), 0.0)
            push = values[size_name(number)] * added(number, width, window, values)
            pushed[place] = pushed.get(place, 0.0) + push
        return inner(window, values, pushed)

    parameters = [p for number, term in enumerate(terms) for p in _parameters(number, term)]
    return replace(model, nuisances=(*model.nuisances, *parameters), simulate=simulate)


def _function(term: FittedTerm, width: float) -> Function:
    """The term's function of known signals, of this width if it has one."""
    wide = term.function.wide
    return term.function if wide is None else wide.having(width)


def size_name(number: int) -> str:
    """Name of the nuisance that is the size of one term."""
    return f"equation.{number + 1}"


def width_name(number: int) -> str:
    """Name of the nuisance that is its width."""
    return f"equation.{number + 1}.width"


def _key(window: Window) -> Key:
    return window.recording, window.start_s, window.end_s


def _parameters(number: int, term: FittedTerm) -> list[Parameter]:
    """The size of a term and, where it has one, its width."""
    size, wide = term.reported.coefficient, term.function.wide
    found = [Parameter(name=size_name(number), unit=term.reported.unit, value=size, typical=NEAR * abs(size))]
    if wide is not None:
        found.append(
            Parameter(
                name=width_name(number),
                unit=wide.unit,
                value=wide.width,
                lower=wide.width / WIDEST,
                upper=wide.width * WIDEST,
                typical=NEAR * wide.width,
            )
        )
    return found


def switched_off(terms: Sequence[FittedTerm]) -> dict[str, float]:
    """The values of these nuisances without which the equation does nothing."""
    return {
        p.name: 0.0 if p.name == size_name(number) else p.value
        for number, term in enumerate(terms)
        for p in _parameters(number, term)
    }


def refitted(terms: Sequence[FittedTerm], fitted: Fit) -> list[FittedTerm]:
    """The terms with the sizes and widths of a fit, as they are reported."""
    found = []
    for number, term in enumerate(terms):
        size, sd = fitted.values.shared[size_name(number)], fitted.sd(size_name(number))
        wide = term.function.wide
        function = term.function if wide is None else wide.having(fitted.values.shared[width_name(number)])
        reported = replace(
            term.reported,
            function=function.text,
            coefficient=size,
            low=size - 1.96 * sd,
            high=size + 1.96 * sd,
        )
        found.append(FittedTerm(reported, function))
    return found
