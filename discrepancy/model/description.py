"""The description of a model for the engine, and the protocol of its function. For authors of models.

`simulate` gets a Window (inputs resampled to the model's own even grid, from `lead_s` before the scored part), the values of all parameters
by name, and the signals that the open-ended search adds at the model's ports. It returns the outputs on the same grid. Effects are off at
`Parameter.value`; the engine itself applies sensor effects (discrepancy.model.sensors). A model may use measured outputs of the past (an
observer gain, a measured speed as input); it is then a predictor. Errors of a model without measured outputs grow with time; short windows
with free initial states (`scope='window'`) limit them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from typing import Final, Literal, Protocol

import numpy as np

from discrepancy.signals.recording import Array, Recording, Signal
from discrepancy.signals.units import parse_unit

FEW = 3  # amplitude parameters; an effect with more is a profile
NEARLY_NONE = 0.02  # of a typical change: so small a step gives the local gradient
OLD_SCOPES = {"begin": "initial_uncertainty"}  # written in files of users before the name was changed

Scope = Literal["all", "window", "initial_uncertainty"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number of the model. Raises ValueError for a value outside its bounds, or a typical change of 0."""

    name: str  # unique in the model
    unit: str  # SI
    value: float = 0.0  # in the baseline; for an effect: off
    lower: float = -np.inf  # physical bounds
    upper: float = np.inf
    typical: float = 1.0  # a change that matters; scales steps and trial steps
    prior_sd: float | None = None  # standard deviation of the prior about `value`; None: no prior
    # all: one value. window: an initial state, refitted in every window without prior. initial_uncertainty: an initial state that is
    # known to prior_sd in every window; it is never fitted, and its possible influence is part of the noise.
    scope: Scope = "all"
    shape: bool = False  # has no meaning while the effect is off (a time constant, a corner speed)
    discrete: bool = False  # means something only at `value` and at one typical change from it (a wrong sign)
    trial_steps: tuple[float, ...] = ()  # finite changes at which an effect is scored; none: the typical one
    small: bool = True  # scored at nearly no change too
    guess: Callable[["Window"], float] | None = None  # start of the fit in each window, for scope 'window'
    # of a rate: what matters as a change over a whole recording [unit s]; typical and bounds then follow from the length of the longest one
    over_recording: float | None = None
    whole: InitVar[bool] = False  # old name of discrete
    probes: InitVar[tuple[float, ...]] = ()  # old name of trial_steps

    def __post_init__(self, whole: bool, probes: tuple[float, ...]) -> None:
        # object.__setattr__, as the class is frozen: users' files keep working with the parameter names of earlier versions
        object.__setattr__(self, "discrete", self.discrete or whole)
        object.__setattr__(self, "trial_steps", self.trial_steps or probes)
        object.__setattr__(self, "scope", OLD_SCOPES.get(self.scope, self.scope))
        if not self.lower <= self.value <= self.upper:
            raise ValueError(
                f"parameter {self.name}={self.value} {self.unit} is outside [{self.lower}, {self.upper}]{'' if self.value else '; 0 is the default: give value=...'}"
            )
        if self.typical == 0.0:
            raise ValueError(
                f"parameter {self.name}: typical must be a change that matters, not 0 {self.unit}"
            )

    @property
    def trial_values(self) -> tuple[float, ...]:
        """Values of the parameter at which the effect is scored: its trial steps, and a very small one if `small`."""
        sizes = self.trial_steps or (self.typical,)
        return tuple(
            self.value + size for size in ((*sizes, NEARLY_NONE * self.typical) if self.small else sizes)
        )


MOST_OVER: Final = 20.0  # of what matters: bound of a change over a recording, as that of a constant error


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A term that is off by default, with all that a finding must say about it."""

    name: str
    sentence: str  # what it does, for a reader of the findings
    equation: str
    parameters: tuple[Parameter, ...]
    kind: Literal["physics", "sensor"]
    place: str  # part of the machine on which it acts
    reading: str = ""  # of a sensor's fault: the output whose reading it changes first
    readings: tuple[
        str, ...
    ] = ()  # of a delay that a device has: the outputs that all come late by its parameter
    reverse: str = ""  # the sentence for a first parameter below its baseline: early instead of late
    excited_by: str = ""  # what a recording must contain to show it
    confusable: Mapping[str, str] = field(
        default_factory=dict
    )  # other effects, and what would distinguish them

    def said(self, value: float) -> str:
        """The sentence for a value of the first parameter."""
        return self.reverse if self.reverse and value < self.parameters[0].value else self.sentence

    @property
    def size(self) -> int:
        """Its degrees of freedom."""
        return len(self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def amplitude_parameters(self) -> list[Parameter]:
        """Parameters that switch the effect on: all but shapes."""
        return [p for p in self.parameters if not p.shape]

    @property
    def is_profile(self) -> bool:
        """Whether it is a curve over something: it has many amplitudes, is linear in all of them, and needs one trial step only."""
        return len(self.amplitude_parameters) > FEW

    @property
    def amplitude_names(self) -> list[str]:
        return [p.name for p in self.amplitude_parameters]

    @property
    def shapes_at_typical(self) -> dict[str, float]:
        """Values of the shapes at which the effect is scored."""
        return {p.name: p.value + p.typical for p in self.parameters if p.shape}


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A place where an unknown quantity may act, for the open-ended search."""

    name: str
    unit: str
    typical: float  # an amplitude that matters
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A part of one recording on the model's even grid."""

    recording: str
    start_s: float  # of the part that is scored; the grid begins earlier by the lead
    end_s: float
    time_s: Array  # the grid (n,)
    step_s: float
    known: Mapping[str, Array]  # inputs and measured outputs that exist, on the grid
    constants: Mapping[str, float]  # of the recording, SI
    # shared parameters of the warm-up run before the window; empty: those of the baseline. Only where Model.warms_up.
    warm_up: Mapping[str, float] = field(default_factory=dict)

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
    """A test that could be driven, to compare what two explanations would predict for it."""

    name: str
    sentence: str
    duration_s: float
    inputs: Mapping[str, Signal] = field(default_factory=dict)  # the model's inputs over the test
    initial: Mapping[str, float] = field(default_factory=dict)  # initial states (nuisances of scope 'window')


@dataclass(frozen=True, slots=True)
class Clock:
    """Outputs of one recording that another clock has stamped."""

    parameter: str  # the nuisance that is their common delay [s]
    recording: str
    channels: tuple[str, ...]


class Simulate(Protocol):
    """The function of a model. Its result depends on its arguments alone, because the engine caches results.

    It may also have a method `together(windows, values)`, which returns the list of results for many windows. The engine calls that one
    where nothing is added at ports and no parameter belongs to a single window.
    """

    def __call__(
        self, window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        """Outputs on window.time_s; `extra[port]`, where given, is added at that port."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model and its library of effects; units are SI.

    Every model is slightly wrong, and long recordings or exact instruments make that significant. `negligible`, `least_explained` and
    `floors` keep such differences from becoming findings.
    """

    name: str
    sentence: str
    inputs: Mapping[str, str]  # channels with their units
    outputs: Mapping[str, str]
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Effect, ...]
    simulate: Simulate
    step_s: float  # of the grid
    window_s: float | None = None  # length of a window; None: a recording is one
    lead_s: float = 0.0  # simulated before each window
    held_out_s: float | None = (
        None  # parts held out in turn; None: whole windows. Shorter where an effect is a profile along the recording
    )
    optional: Mapping[str, str] = field(default_factory=dict)  # inputs that may be missing
    # inputs that may be missing and only bound what others demand: `simulate` knows them, no equation is made of them
    limits: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)  # what a recording must say beside its signals
    held: tuple[str, ...] = ()  # channels whose values stand until the next one (commands)
    columns: Mapping[str, str] = field(
        default_factory=dict
    )  # their names in recordings; several by comma are averaged
    ports: tuple[Port, ...] = ()
    manoeuvres: tuple[Manoeuvre, ...] = ()
    clocks: tuple[Clock, ...] = ()
    # chooses what of a recording, between two times, is scored; None: all of it
    segments: Callable[[Recording, tuple[float, float]], Sequence[tuple[float, float]]] | None = None
    jacobian_reach: float = (
        0.0  # typical changes over which Jacobian columns are reused; above 0: simulations are expensive
    )
    negligible: float = (
        0.0  # share of a typical change; an effect whose 95 % interval reaches below it is no finding
    )
    least_explained: float = (
        0.0  # share of some channel's squared one-step errors that an effect or an equation must take away
    )
    floors: Mapping[str, float] = field(
        default_factory=dict
    )  # least standard deviation of the one-step error by output
    sensor_noise: Mapping[str, float] = field(
        default_factory=dict
    )  # standard deviation of what the sensor adds, by output, from its sheet; where there is none, it is measured on the recording
    disturbances: Mapping[str, float] = field(
        default_factory=dict
    )  # what disturbances that nobody measured move an output by within a window, standard deviation; else a tenth of its movement
    # highest frequency at which the model is meant to be right; None: by what its parameters do to the outputs. Samples that
    # come faster are averaged.
    bandwidth_hz: float | None = None
    lags: Mapping[str, float] = field(
        default_factory=dict
    )  # low-passes that `simulate` has in it already, by output [s]
    threads: bool = False  # whether `simulate` may run in several threads at once
    warms_up: bool = False  # whether `simulate` uses Window.warm_up

    def __post_init__(self) -> None:
        names = [p.name for p in self.parameters]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(
                f"model {self.name}: parameter names must be unique, repeated: {', '.join(repeated)}"
            )
        channels = {**self.driving, **self.outputs, **self.constants}
        for name, unit in (*channels.items(), *((port.name, port.unit) for port in self.ports)):
            try:
                parse_unit(unit)
            except ValueError as error:
                raise ValueError(f"model {self.name}, {name}: {error}; units of a model are SI") from error
        for effect in self.effects:
            if strange := sorted({*effect.readings} - {*self.outputs}):
                raise ValueError(
                    f"model {self.name}, {effect.name}: {', '.join(strange)} is no output; it has {', '.join(self.outputs)}"
                )
        for manoeuvre in self.manoeuvres:
            for name, given in manoeuvre.inputs.items():
                if given.held != (name in self.held):
                    raise ValueError(
                        f"model {self.name}, manoeuvre {manoeuvre.name}: {name} is{'' if given.held else ' not'} held there, "
                        f"in the model's `held` it is{'' if name in self.held else ' not'}"
                    )

    @property
    def driving(self) -> Mapping[str, str]:
        """All inputs with their units, those that may be missing and limits included."""
        return {**self.inputs, **self.optional, **self.limits}

    @property
    def costly(self) -> bool:
        """Whether simulations are expensive, so that the search avoids those of little use."""
        return self.jacobian_reach > 0.0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return self.nuisances + tuple(p for effect in self.effects for p in effect.parameters)

    def parameter(self, name: str) -> Parameter:
        return next(p for p in self.parameters if p.name == name)

    def in_recordings_of(self, duration_s: float) -> "Model":
        """The model with rates (a drift) whose typical size and bounds matter in recordings of this length [s]."""

        def scaled(p: Parameter) -> Parameter:
            if p.over_recording is None or duration_s <= 0.0:
                return p
            typical = p.over_recording / duration_s
            return replace(p, typical=typical, lower=-MOST_OVER * typical, upper=MOST_OVER * typical)

        if all(p.over_recording is None for e in self.effects for p in e.parameters):
            return self
        effects = tuple(replace(e, parameters=tuple(scaled(p) for p in e.parameters)) for e in self.effects)
        return replace(self, effects=effects)

    def effect(self, name: str) -> Effect:
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(
            f"model {self.name} has no effect {name!r}; it has {', '.join(e.name for e in self.effects)}"
        )
