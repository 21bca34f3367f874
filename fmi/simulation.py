"""The simulate function of a model that is an FMU: one instance a process, reset before every simulation."""

import os
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from discrepancy.model.description import Window
from discrepancy.signals.recording import Array
from fmi.archive import FmuError
from fmi.description import Description, Variable
from fmi.instance import Instance, StepError

SHOWN: Final = 8  # values of parameters in an error


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """Which variables of the FMU belong to the model's inputs, outputs and parameters, by their names in the model."""

    inputs: Mapping[str, Variable]
    held: frozenset[str]  # inputs whose value holds over a step; others change linearly
    outputs: Mapping[str, Variable]
    parameters: Mapping[str, Variable]  # parameters and initial states of the model
    constants: Mapping[str, Variable]  # that a recording gives
    fixed: Mapping[str, tuple[Variable, float]]  # other start values, in the FMU's unit


class Simulation:
    """Callable as `Model.simulate`.

    Time in the FMU is 0 at the start of each window. An input that is not held is given as its mean over the step, and as its value at the
    grid point when outputs are read. Equal arguments give equal results: that is proved once, and an FMU that its reset does not bring
    back is instantiated anew for every simulation.
    """

    def __init__(self, description: Description, exchange: Exchange) -> None:
        self.exchange = exchange
        self._of = description
        self._inputs = list(exchange.inputs.items())
        self._outputs = list(exchange.outputs.items())
        self._instance: Instance | None = None
        self._process = 0  # that made the instance; a forked child needs its own
        self._proved = False

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        """Outputs on window.time_s. Raises StepError, an OverflowError, where the FMU fails at these values."""
        instance = self._ready()
        starts = self._starts(window, values)
        inputs = self._driven(window, extra)
        try:
            found = self._run(instance, starts, inputs, window.step_s)
            if not self._proved:
                self._prove(instance, starts, inputs, window.step_s, found)
        except StepError as error:
            raise StepError(f"{error}; values: {_shown(starts)}") from error
        return {
            name: variable.factor * found[:, i] + variable.offset
            for i, (name, variable) in enumerate(self._outputs)
        }

    def _ready(self) -> Instance:
        if self._instance is None or self._process != os.getpid():
            inputs, outputs = [v for _, v in self._inputs], [v for _, v in self._outputs]
            self._instance, self._process = Instance(self._of, inputs, outputs), os.getpid()
            self._proved = False
            weakref.finalize(self, _close, self._instance, self._process)
        return self._instance

    def _starts(self, window: Window, values: Mapping[str, float]) -> list[tuple[Variable, float]]:
        """Start values in the FMU's units; later ones win."""
        exchange = self.exchange
        found = {variable.name: (variable, value) for variable, value in exchange.fixed.values()}
        for name, variable in exchange.constants.items():
            found[variable.name] = variable, variable.from_si(window.constants[name])
        for name, variable in exchange.parameters.items():
            if name in values:  # an effect may have been left out of the library
                found[variable.name] = variable, variable.from_si(values[name])
        return list(found.values())

    def _driven(self, window: Window, extra: Mapping[str, Array]) -> Array:
        """Inputs (n, m) at the grid points in the FMU's units; one that the recording lacks has its start value."""
        found: Array = np.empty((window.time_s.size, len(self._inputs)))
        for i, (name, variable) in enumerate(self._inputs):
            known = window[name] if window.has(name) else variable.to_si(variable.start or 0.0)
            found[:, i] = (known + extra.get(name, 0.0) - variable.offset) / variable.factor
        return found

    def _run(
        self, instance: Instance, starts: list[tuple[Variable, float]], inputs: Array, step_s: float
    ) -> Array:
        """Outputs (n, k) in the FMU's units."""
        count, changing = inputs.shape[0], [name not in self.exchange.held for name, _ in self._inputs]
        found: Array = np.empty((count, len(self._outputs)))
        over = None
        if any(changing):
            over = inputs.copy()
            over[:-1, changing] = 0.5 * (inputs[:-1, changing] + inputs[1:, changing])
        instance.start(starts, inputs[0])
        instance.run(inputs, over, step_s, found)
        return found

    def _prove(
        self,
        instance: Instance,
        starts: list[tuple[Variable, float]],
        inputs: Array,
        step_s: float,
        first: Array,
    ) -> None:
        """Simulate again and compare; without reset if it must be. Raises FmuError for an FMU that is not deterministic."""
        if not np.array_equal(first, self._run(instance, starts, inputs, step_s), equal_nan=True):
            instance.renew()
            again = self._run(instance, starts, inputs, step_s)
            if not np.array_equal(first, again, equal_nan=True):
                raise FmuError(
                    f"{self._of.file}: gives other outputs when the same simulation is repeated, so nothing can be fitted with it"
                )
        self._proved = True


def _close(instance: Instance, process: int) -> None:
    if os.getpid() == process:  # in a forked child it is the parent's
        instance.close()


def _shown(starts: list[tuple[Variable, float]]) -> str:
    if not starts:
        return "all at their start"
    listed = ", ".join(f"{v.name}={value:.6g}{f' {v.unit}' if v.unit else ''}" for v, value in starts[:SHOWN])
    return listed + (f" and {len(starts) - SHOWN} more" if len(starts) > SHOWN else "")
