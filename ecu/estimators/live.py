"""The estimators cycle by cycle, for the live loop: numbers in and out in rows.

Handing the tuples of parameters, inputs and state to compiled code in every cycle takes Python longer
than the estimators take. A compiled generator keeps parameters and state, and reads and writes rows. It leaves its
state in a row too, from which another generator goes on when parameters are changed while the machine runs.
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ecu.estimators.compiled import compiled
from ecu.estimators.estimate import corrected
from ecu.estimators.parameters import Parameters
from ecu.estimators.printed.estimate import printed
from ecu.estimators.printed.state import PRINTED_INITIAL, PrintedState
from ecu.estimators.rows import ESTIMATES, INPUTS, to_fixed_tuple
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import INITIAL, State

Floats = NDArray[np.float64]


class LiveEstimator:
    """All estimators of one machine, from cycle to cycle."""

    def __init__(self, parameters: Parameters, form: Literal["corrected", "printed"]) -> None:
        self._parameters = parameters
        self._form = form
        self._inputs, self._estimates = np.empty(INPUTS), np.empty(ESTIMATES)
        self._state = np.empty(len(PrintedState._fields if form == "printed" else State._fields))
        self._running: Iterator[None] | None = None

    def reset(self) -> None:
        """Forget all cycles."""
        self._running = None

    def change(self, parameters: Parameters) -> None:
        """Use other parameters from the next cycle on; what was learnt in the cycles so far is kept."""
        self._parameters = parameters
        if self._running is not None:
            # filters and the tracked loads go on: a fresh start would show as a jump of every estimate
            self._running = self._start(known=True)

    def estimate(self, inputs: Inputs) -> Estimates:
        """One cycle; the first one compiles on a fresh machine."""
        self._inputs[:] = inputs
        if self._running is None:
            self._running = self._start()
        next(self._running)
        return Estimates._make(self._estimates.tolist())

    def _start(self, *, known: bool = False) -> Iterator[None]:
        rows = self._inputs, self._estimates, self._state, self._parameters
        if self._form == "printed":
            return printed_cycles(
                *rows, PrintedState._make(self._state.tolist()) if known else PRINTED_INITIAL
            )
        return corrected_cycles(*rows, State._make(self._state.tolist()) if known else INITIAL)


@compiled
def corrected_cycles(
    inputs: Floats, estimates: Floats, carried: Floats, parameters: Parameters, state: State
) -> Iterator[None]:
    """The corrected estimators: each step reads `inputs`, leaves `estimates`, and its state in `carried`."""
    while True:
        found, state = corrected(Inputs(*to_fixed_tuple(inputs, INPUTS)), state, parameters)
        for k in range(ESTIMATES):
            estimates[k] = found[k]
        for k in range(carried.size):
            carried[k] = state[k]
        yield None


@compiled
def printed_cycles(
    inputs: Floats, estimates: Floats, carried: Floats, parameters: Parameters, state: PrintedState
) -> Iterator[None]:
    """The printed estimators: each step reads `inputs`, leaves `estimates`, and its state in `carried`."""
    while True:
        found, state = printed(Inputs(*to_fixed_tuple(inputs, INPUTS)), state, parameters)
        for k in range(ESTIMATES):
            estimates[k] = found[k]
        for k in range(carried.size):
            carried[k] = state[k]
        yield None
