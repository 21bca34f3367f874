"""Makes a Model of the diagnosis from an FMU and its companion file."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from discrepancy.model.description import Effect, Model, Parameter, Port, Window
from discrepancy.model.sensors import sensor_effects
from discrepancy.signals.recording import Recording
from fmi.archive import FmuError
from fmi.companion import Companion, Fitted, Hidden, Output, read_companion
from fmi.description import Description, Variable, read_description
from fmi.simulation import Exchange, Simulation

MATTERS: Final = (
    0.1  # of a channel's standard deviation: an offset of a sensor, or an addition to an input, that matters
)
DELAY_S: Final = 0.05  # of a sensor, where the file gives none; at least half a step


@dataclass(frozen=True, slots=True)
class FmuModel:
    """An FMU with its companion, ready to become a Model for any recordings."""

    description: Description
    companion: Companion

    def build(self, recordings: Sequence[Recording]) -> Model:
        """The Model; sizes that nobody gave are a tenth of the channels' movement in these recordings. Raises FmuError."""
        d, c = self.description, self.companion
        step_s = self._step(recordings)
        outputs = self._measured(recordings)
        fitted = [*c.parameters, *(p for e in c.effects for p in e.parameters)]
        settings: dict[str, Any] = {name: value for name, value in c.settings.items() if name != "step_s"}
        exchange = Exchange(
            inputs={name: i.variable for name, i in c.inputs.items()},
            held=frozenset(name for name, i in c.inputs.items() if i.held),
            outputs={name: o.variable for name, o in outputs.items()},
            parameters={p.variable.name: p.variable for p in fitted},
            constants=c.constants,
            fixed=c.values,
        )
        try:
            return Model(
                name=d.name,
                sentence=c.sentence,
                inputs={n: i.variable.si for n, i in c.inputs.items() if not i.optional},
                optional={n: i.variable.si for n, i in c.inputs.items() if i.optional},
                held=tuple(n for n, i in c.inputs.items() if i.held),
                outputs={n: o.variable.si for n, o in c.outputs.items()},
                columns=_columns(c),
                constants={n: v.si for n, v in c.constants.items()},
                nuisances=tuple(_parameter(p, c) for p in c.parameters),
                effects=(
                    *(_effect(e, c) for e in c.effects),
                    *(x for n, o in outputs.items() for x in _sensors(n, o, step_s, recordings)),
                ),
                ports=tuple(self._ports(recordings)),
                simulate=Simulation(d, exchange),
                step_s=step_s,
                sensor_noise=_sizes(outputs, "noise"),
                disturbances=_sizes(outputs, "disturbance"),
                floors=_sizes(outputs, "floor"),
                lags={n: o.lag_s for n, o in outputs.items() if o.lag_s},
                **settings,
            )
        except ValueError as error:
            raise FmuError(f"{c.file or d.file}: {error}") from error

    def _measured(self, recordings: Sequence[Recording]) -> dict[str, Output]:
        """The outputs that any recording has: an FMU may have hundreds, and each that is simulated costs time."""
        there = {n: o for n, o in self.companion.outputs.items() if any(n in r.signals for r in recordings)}
        return there or dict(self.companion.outputs)

    def _ports(self, recordings: Sequence[Recording]) -> list[Port]:
        found = []
        for name, i in self.companion.inputs.items():
            size = _size(i.variable, i.port, name, recordings)
            if size > 0.0:
                found.append(Port(name=name, unit=i.variable.si, typical=size, sentence=i.sentence))
        return found

    def _step(self, recordings: Sequence[Recording]) -> float:
        """The step of the file, else of the FMU, else the usual one of the recordings [s]."""
        given = self.companion.settings.get("step_s", self.description.step_s)
        if given is not None:
            return given
        apart = [
            float(np.median(np.diff(s.time_s)))
            for r in recordings
            for s in r.signals.values()
            if s.time_s.size > 1
        ]
        return float(f"{min(apart):.6g}") if apart and min(apart) > 0.0 else 0.01


def read_model(file: Path, companion: Path | None = None) -> FmuModel:
    """The FMU, with this companion or the one beside it. Raises FmuError or ConfigurationError."""
    description = read_description(file)
    beside = file.with_suffix(".toml")
    if companion is None and beside.is_file():
        companion = beside
    found = FmuModel(description, read_companion(description, companion))
    if not found.companion.outputs:
        raise FmuError(f"{file}: has no output that is a single number, so nothing can be compared")
    return found


def _columns(c: Companion) -> dict[str, str]:
    """Names in recordings, of the channels that are called otherwise there."""
    names = {n: i.column for n, i in c.inputs.items()} | {n: o.column for n, o in c.outputs.items()}
    return {n: column for n, column in names.items() if column != n}


def _parameter(p: Fitted, companion: Companion) -> Parameter:
    v = p.variable
    bounds = sorted((v.to_si(p.lower), v.to_si(p.upper)))  # a unit may have a negative factor
    size = abs(v.factor)
    _check_name(v.name, companion)
    return Parameter(
        name=v.name,
        unit=v.si,
        value=v.to_si(p.value),
        lower=bounds[0],
        upper=bounds[1],
        typical=size * p.typical,
        prior_sd=size * p.prior_sd if p.prior_sd is not None else None,
        scope="window" if p.initial else "all",
        guess=partial(_first, p.guess) if p.guess else None,
        shape=p.shape,
    )


def _first(output: str, window: Window) -> float:
    return window.at_start(output)


def _check_name(name: str, companion: Companion) -> None:
    """Raises FmuError for a parameter that is named as the engine names faults of sensors."""
    output, _, kind = name.rpartition(".")
    if output in companion.outputs and kind in ("bias", "scale", "delay", "lag", "sign", "drift"):
        raise ValueError(
            f"the parameter {name} is named as a fault of the sensor of {output}; leave it out of [parameters] and [effects]"
        )


def _effect(e: Hidden, companion: Companion) -> Effect:
    return Effect(
        name=e.name,
        sentence=e.sentence,
        equation=e.equation,
        parameters=tuple(_parameter(p, companion) for p in e.parameters),
        kind=e.kind,
        place=e.place,
        reverse=e.reverse,
        excited_by=e.excited_by,
        confusable=e.confusable,
    )


def _sensors(name: str, output: Output, step_s: float, recordings: Sequence[Recording]) -> tuple[Effect, ...]:
    bias = _size(output.variable, output.bias, name, recordings)
    delay_s = output.delay_s or max(DELAY_S, 0.5 * step_s)
    return sensor_effects(name, output.variable.si, bias=bias or 1.0, kinds=output.kinds, delay_s=delay_s)


def _size(variable: Variable, given: float | None, name: str, recordings: Sequence[Recording]) -> float:
    """A size that matters [SI]: as given, else a tenth of the channel's movement, else by the FMU's nominal value."""
    if given is not None:
        return abs(variable.factor) * given
    moved = [float(np.std(r.signals[name].value)) for r in recordings if name in r.signals]
    spread = max((m for m in moved if np.isfinite(m)), default=0.0)
    if spread == 0.0:
        spread = abs(variable.factor * (variable.nominal or variable.start or 1.0))
    return float(f"{MATTERS * spread:.1g}")


def _sizes(outputs: dict[str, Output], attribute: str) -> dict[str, float]:
    given = {name: getattr(output, attribute) for name, output in outputs.items()}
    return {
        name: abs(outputs[name].variable.factor) * size for name, size in given.items() if size is not None
    }
