"""What the engine must know of a model: a description and one function that turns inputs into outputs.

`simulate` gets a Window (inputs resampled to the model's own even grid, from `lead_s` before the scored part), the
values of all parameters by name, and what the open-ended search adds at the model's ports; it returns the outputs on
the same grid. Effects are off at `Parameter.value`; sensor effects (discrepancy.sensors) are applied by the engine.
A model may use measured outputs of the past (an observer gain, a measured speed as input): that is its predictor
form. Short windows with free initial states (`scope='window'`) are the other way to keep errors from piling up.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from discrepancy.recording import Array, Recording, Signal
from discrepancy.units import parse_unit

NEARLY_NONE = 0.02  # of a typical change: the local gradient


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number of the model. `value` is the baseline (for an effect: off), `typical` a change that matters.

    name: unique in the model; lower, upper: physical bounds; prior_sd: standard deviation of what is known beforehand,
    None if nothing; scope 'window': refitted in every window without prior (initial states), `guess` gives its
    start there; scope 'begin': of the state each window begins in, never fitted: each window's own, known to `prior_sd`, is part of the noise;
    shape: has no meaning while the effect is off (a time constant, a corner speed); whole: means something at `value` and a
    typical change from it only (a wrong sign); probes: finite changes at
    which an effect is scored, default (typical,), needed where the gradient vanishes at zero; small: scored at nearly no change too.
    """

    name: str
    unit: str
    value: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    typical: float = 1.0
    prior_sd: float | None = None
    scope: Literal["all", "window", "begin"] = "all"
    shape: bool = False
    whole: bool = False
    probes: tuple[float, ...] = ()
    small: bool = True
    guess: Callable[["Window"], float] | None = None

    def __post_init__(self) -> None:
        if not self.lower <= self.value <= self.upper:
            raise ValueError(
                f"parameter {self.name}={self.value} {self.unit} is outside [{self.lower}, {self.upper}]"
            )
        if self.typical == 0.0:
            raise ValueError(
                f"parameter {self.name}: typical must be a change that matters, not 0 {self.unit}"
            )

    @property
    def tried(self) -> tuple[float, ...]:
        """Values of the parameter at which the effect is scored: finite changes, and nearly none where asked for."""
        sizes = self.probes or (self.typical,)
        return tuple(
            self.value + size for size in ((*sizes, NEARLY_NONE * self.typical) if self.small else sizes)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A term that is off by default, with all that a finding must say about it.

    confusable: other effects' names and what would tell them apart; excited_by: what a recording must contain.
    """

    name: str
    sentence: str
    equation: str
    parameters: tuple[Parameter, ...]
    kind: Literal["physics", "sensor"]
    place: str
    excited_by: str = ""
    confusable: Mapping[str, str] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Degrees of freedom it takes."""
        return len(self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A place where an unknown quantity may act, for the open-ended search; `typical` is an amplitude that matters."""

    name: str
    unit: str
    typical: float
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A stretch of one recording on the model's even grid; scored from `start_s` to `end_s`, led in before it.

    known: inputs and measured outputs that exist, resampled to `time_s` (shape (n,)).
    """

    recording: str
    start_s: float
    end_s: float
    time_s: Array
    step_s: float
    known: Mapping[str, Array]
    constants: Mapping[str, float]

    def has(self, name: str) -> bool:
        return name in self.known

    def __getitem__(self, name: str) -> Array:
        if name not in self.known:
            raise KeyError(f"no signal '{name}' in {self.recording}; there are {', '.join(self.known)}")
        return self.known[name]

    def at_start(self, name: str) -> float:
        """The value of a signal at the first grid point; 0 where the recording has none, for initial states that are fitted anyway."""
        return float(self.known[name][0]) if name in self.known else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """A test that could be driven, to compare what two explanations would predict for it.

    inputs: the model's inputs over the test; initial: the initial states (window-scoped nuisances); duration_s.
    """

    name: str
    sentence: str
    duration_s: float
    inputs: Mapping[str, Signal] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Clock:
    """Outputs of one recording that were stamped by another clock; `parameter` [s]: how late they are for it."""

    parameter: str
    recording: str
    channels: tuple[str, ...]


class Simulate(Protocol):
    """The function of a model. One that also has `together(windows, values)`, the list of what it returns for each of many
    windows, is asked for all at once where nothing is added at ports and no parameter belongs to a window. One that has `settle(values)` is
    told the parameters as far as they are known, whenever they have been fitted: its motions may begin from there.
    """

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        """Outputs on window.time_s; `extra[port]`, where given, is added at that port."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Inputs, outputs, units, nuisances, effects and the function. `optional` inputs may be missing.

    window_s, lead_s: length of a window and of what is simulated before it; held_out_s: stretches held out in turn,
    None for whole windows (shorter ones where an effect is a profile along the recording); constants: what each recording
    must say beside its signals, with units; held: channels whose values stand until the next one (commands); columns: what
    channels are called in recordings where not by their own names ('Message.Signal', several by comma are averaged).
    stretches: chooses what of a recording, between two times, is scored, in place of all of it. For costly models: slopes_hold, by how many
    typical changes parameters may move before sensitivities are computed anew; threads: whether `simulate` may run in several at once. negligible: share of a typical change
    that an effect must surely reach, or it is told but is no finding; least_explained: share of some channel's squared one-step errors that an effect or an
    equation must take away. floors: standard deviation by output that the model's one-step errors have at least. All
    three hold off what the model itself is wrong by, which long recordings and instruments without noise make significant.
    lags: time constant by output of a sampled sensor's low-pass that `simulate` has in it already [s]; more lag adds to it.
    """

    name: str
    sentence: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    nuisances: tuple[Parameter, ...]
    effects: tuple[Effect, ...]
    simulate: Simulate
    step_s: float
    window_s: float | None = None
    lead_s: float = 0.0
    held_out_s: float | None = None
    optional: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)
    held: tuple[str, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict)
    ports: tuple[Port, ...] = ()
    manoeuvres: tuple[Manoeuvre, ...] = ()
    clocks: tuple[Clock, ...] = ()
    stretches: Callable[[Recording, tuple[float, float]], Sequence[tuple[float, float]]] | None = None
    slopes_hold: float = 0.0
    negligible: float = 0.0
    least_explained: float = 0.0
    floors: Mapping[str, float] = field(default_factory=dict)
    lags: Mapping[str, float] = field(default_factory=dict)
    threads: bool = False

    def __post_init__(self) -> None:
        names = [p.name for p in self.parameters]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(
                f"model {self.name}: parameter names must be unique, repeated: {', '.join(repeated)}"
            )
        channels = {**self.inputs, **self.optional, **self.outputs, **self.constants}
        for name, unit in (*channels.items(), *((port.name, port.unit) for port in self.ports)):
            try:
                parse_unit(unit)
            except ValueError as error:
                raise ValueError(f"model {self.name}, {name}: {error}; models speak SI") from error
        for manoeuvre in self.manoeuvres:
            for name, given in manoeuvre.inputs.items():
                if given.held != (name in self.held):
                    raise ValueError(
                        f"model {self.name}, manoeuvre {manoeuvre.name}: {name} is{'' if given.held else ' not'} held there, "
                        f"in the model's `held` it is{'' if name in self.held else ' not'}"
                    )

    @property
    def costly(self) -> bool:
        """Whether simulations are spared where there is little to win by them."""
        return self.slopes_hold > 0.0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return self.nuisances + tuple(p for effect in self.effects for p in effect.parameters)

    def parameter(self, name: str) -> Parameter:
        return next(p for p in self.parameters if p.name == name)

    def effect(self, name: str) -> Effect:
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(
            f"model {self.name} has no effect {name!r}; it has {', '.join(e.name for e in self.effects)}"
        )
