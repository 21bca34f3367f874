"""What an effect is: a sentence, an equation, parameters with units and bounds, and where it acts."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from configuration import CheckedTable

Array = NDArray[np.float64]

MOST_PARAMETERS = 8
"""Parameters of one effect, at most."""

HOOKS = ("joints", "before_tyre", "after_tyre", "bodies", "states")
"""Names of the compiled functions that an effect's module may define; see docs/howto/add-an-effect.md.

joints(q, x, state, p, work): efforts or accelerations of joints, before the tyres.
before_tyre(q, x, state, p, wheel, work): this wheel's own copy of the tyre block, its ground.
after_tyre(q, x, state, p, wheel, work): forces beside those of the tyre model.
bodies(q, x, state, p, work): forces and moments on bodies.
states(q, x, state, p, work): rates of the effect's own states, once all accelerations are known.

q: the effect's parameters, SI, in their order; x: index of its first own state in state and work.rate.
"""

PYTHON_HOOKS = ("prepare", "sensors", "start")
"""Names of the plain Python functions that an effect's module may define; each gets the parameters by name, SI.

prepare(q, p, machine): changes the plant's parameter vector once.
sensors(q, given): returns the sensors' parameters as the effect changes them.
start(q, x, state, p, work): sets the effect's own states, from index x on, for a plant at rest. It is called
again for the rest that the machine then finds, until neither changes.
"""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect, in `unit`; the name carries the unit's suffix where there is one.

    low, high: permitted; typical: what is taken where the user gives none. si: SI per unit.
    off: value at which the effect vanishes; shape: the parameter describes the form of the effect, not its size, and has no such value.
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    meaning: str
    si: float = 1.0
    off: float = 0.0
    shape: bool = False
    trial_steps: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise ValueError(f"{self.name}: typical {self.typical:g} is outside {self.low:g}..{self.high:g}")
        if not self.shape and not self.low <= self.off <= self.high:
            raise ValueError(f"{self.name}: off {self.off:g} is outside {self.low:g}..{self.high:g}")


def degrees(
    name: str,
    typical: float,
    low: float,
    high: float,
    meaning: str,
    *,
    shape: bool = False,
    trial_steps: tuple[float, ...] = (),
) -> Parameter:
    """A parameter given in degrees."""
    return Parameter(
        name,
        "deg",
        typical,
        low,
        high,
        meaning,
        si=math.radians(1.0),
        shape=shape,
        trial_steps=trial_steps,
    )


@dataclass(frozen=True, slots=True)
class Confusable:
    """Another effect that looks alike, and how a test separates the two."""

    name: str
    separate: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A left-out effect.

    sentence: what it is, for a test engineer. equation: in the symbols of its parameters.
    acts_on: where it is felt. signature: how it shows in the channels. excited_by: the manoeuvre that shows it.
    own_states: how many states it has. What it does are functions of its module, found by name: HOOKS, PYTHON_HOOKS.
    source: where equation and typical values are from.
    """

    name: str
    sentence: str
    equation: str
    parameters: tuple[Parameter, ...]
    acts_on: str
    signature: str
    excited_by: str
    confusable: tuple[Confusable, ...] = ()
    source: str
    own_states: int = 0

    def __post_init__(self) -> None:
        if len(self.parameters) > MOST_PARAMETERS:
            raise ValueError(
                f"effect {self.name}: {len(self.parameters)} parameters, at most {MOST_PARAMETERS}"
            )

    def typical(self) -> "ActiveEffect":
        """The effect with its typical parameters."""
        return ActiveEffect(self, tuple(parameter.typical * parameter.si for parameter in self.parameters))

    def read(self, table: CheckedTable) -> "ActiveEffect":
        """The effect with the parameters of a TOML table; those not given are typical."""
        values = tuple(
            table.number(item.name, unit=item.unit, low=item.low, high=item.high, default=item.typical)
            * item.si
            for item in self.parameters
        )
        table.finish()
        return ActiveEffect(self, values)

    def of(self, **values: float) -> "ActiveEffect":
        """The effect with the given parameters in their own units; those not given are typical."""
        return self.read(CheckedTable(values, file=f"effect {self.name}"))


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect that is switched on, with its parameters in SI, in the effect's order."""

    effect: Effect
    values: tuple[float, ...]

    @property
    def named(self) -> dict[str, float]:
        """The parameters by name, SI."""
        return {item.name: value for item, value in zip(self.effect.parameters, self.values, strict=True)}
