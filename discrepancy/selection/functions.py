"""Functions of known signals with units, for the open-ended search: powers, products, signs, derivatives, low-passes, plays (hysteresis), commands that act late, and differences.

Heat, flow and friction go with the difference of two temperatures, pressures or speeds. A power of each alone does not span a power of their difference, and what
is left would be taken for an error of a reading's zero, which shifts one of them (ADR 106).
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import combinations

import numpy as np

from discrepancy.model.operators import play
from discrepancy.model.sensors import lagged
from discrepancy.signals.quantities import quantity
from discrepancy.signals.recording import Array
from discrepancy.signals.units import Unit, parse_unit

MOST_SIGNALS = (
    6  # products grow with the square of this number, and every function raises the threshold of all others
)
LAG_S = (0.2, 1.0)  # time constants of the low-passes [s], a fast and a slow one
PLAY = 0.3  # width of the hysteresis operator, in standard deviations of its signal
PLAYS = (0.1, PLAY)  # widths for commands that act on another signal, in standard deviations
LATE_S = (0.15, 0.6)  # first time constants of a command that acts late [s]: a valve, a pump or a motor

Signals = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Function:
    """A function of signals."""

    text: str  # as it is reported
    unit: Unit
    complexity: int  # 0 a constant, 1 a signal; of equally good terms the simplest is reported
    signals: tuple[str, ...]
    of: Callable[[Signals, float], Array]  # the series (n,) of one window, from its signals and the step [s]
    wide: "_Wide | None" = None  # for functions with a width that is fitted
    meaning: str = ""  # what it stands for, where the formula alone does not say it
    of_readings: bool = True  # whether it may be the error of a reading too; an actuator acts at a port


@dataclass(frozen=True, slots=True)
class _Wide:
    """The width of a play in a function."""

    width: float
    unit: str  # of the width: that of its signal, or seconds
    having: Callable[[float], Function]  # the same function with another width


def functions(
    units: Mapping[str, str], spread: Mapping[str, float], commands: Collection[str] = ()
) -> list[Function]:
    """All functions of these signals.

    units, spread: unit and standard deviation by signal; commands: signals that may act through a play, times another signal.
    """
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
        if a in commands:
            found += [
                _played(a, units[a], b, units[b], width * spread[a])
                for width in PLAYS
                for b in names
                if b != a
            ]
            # a command with a sign of its own, or one that acts against the sign of what is read
            sides = [None, *(b for b in names if b not in commands)]
            found += [_late(a, units[a], b, spread.get(b or "", 1.0), T) for T in LATE_S for b in sides]
    for a, b in combinations(names, 2):
        if units[a] != "1" and parse_unit(units[a]).same_quantity(parse_unit(units[b])):
            found += _of_difference(a, b, {name: units[name] for name in names})
    return found


def _of_difference(a: str, b: str, units: Mapping[str, str]) -> list[Function]:
    """Functions of the difference of two signals of one quantity, and its products with the other signals; units: of all signals."""
    unit, text = parse_unit(units[a]), f"({a} - {b})"

    def make(said: str, of_unit: Unit, complexity: int, of: Callable[[Array], Array]) -> Function:
        return Function(
            said, of_unit, complexity, (a, b), lambda s, _: of(s[a] - s[b]), of_readings=complexity == 2
        )

    def scaled(other: str) -> Function:
        return Function(
            f"{text}·{other}",
            unit * parse_unit(units[other]),
            4,
            (a, b, other),
            lambda s, _: (s[a] - s[b]) * s[other],
            of_readings=False,
        )

    return [
        make(text, unit, 2, lambda x: x),
        make(f"{text}·|{text[1:-1]}|", unit**2, 3, lambda x: x * np.abs(x)),
        make(
            f"sign{text}·√|{text[1:-1]}|",
            unit ** Fraction(1, 2),
            3,
            lambda x: np.sign(x) * np.sqrt(np.abs(x)),
        ),
        *(scaled(other) for other in units if other not in (a, b)),
    ]


def _played(command: str, its_unit: str, factor: str, unit: str, width: float) -> Function:
    """Play of a command times another signal: steering with play turns a car in proportion to its speed."""
    return Function(
        f"play({command}, {quantity(width, its_unit)})·{factor}",
        parse_unit(its_unit) * parse_unit(unit),
        5,
        (command, factor),
        lambda s, _: play(s[command], width) * s[factor],
        _Wide(width, its_unit, partial(_played, command, its_unit, factor, unit)),
    )


def _late(command: str, its_unit: str, side: str | None, spread: float, time_constant_s: float) -> Function:
    """What a command lacks while its actuator follows it with a first-order lag.

    side: a signal against whose sign it acts, as a brake does against the speed; None: the command has a sign of its own.
    """

    def of(s: Signals, step_s: float) -> Array:
        lacking = lagged(s[command], time_constant_s, step_s) - s[command]
        return lacking if side is None else lacking * _sign(s[side], spread)

    against = "" if side is None else f"·sign({side})"
    return Function(
        f"(lowpass({command}, {time_constant_s:.3g} s) - {command}){against}",
        parse_unit(its_unit),
        5,
        (command,) if side is None else (command, side),
        of,
        _Wide(time_constant_s, "s", partial(_late, command, its_unit, side, spread)),
        f"as if {command} acted late, behind a lag of {time_constant_s:.2g} s",
        of_readings=False,
    )


def _sign(x: Array, spread: float) -> Array:
    # tanh instead of a jump: a sign that chatters about zero would be mostly sampling noise
    sign: Array = np.tanh(x / (0.05 * max(spread, 1e-12)))
    return sign


def _with_play(name: str, unit: str, width: float) -> Function:
    return Function(
        f"play({name}, {quantity(width, unit)})",
        parse_unit(unit),
        4,
        (name,),
        lambda s, _: play(s[name], width),
        _Wide(width, unit, partial(_with_play, name, unit)),
    )


def _of_one(name: str, unit_text: str, sd: float) -> list[Function]:
    unit, one = parse_unit(unit_text), parse_unit("1")

    def make(text: str, of_unit: Unit, complexity: int, of: Callable[[Array, float], Array]) -> Function:
        return Function(text, of_unit, complexity, (name,), lambda signals, step: of(signals[name], step))

    return [
        make(name, unit, 1, lambda x, _: x),
        make(f"{name}·|{name}|", unit**2, 2, lambda x, _: x * np.abs(x)),
        make(f"{name}²", unit**2, 2, lambda x, _: x**2),
        make(f"sign({name})", one, 2, lambda x, _: _sign(x, sd)),
        make(f"|{name}|", unit, 2, lambda x, _: np.abs(x)),
        make(f"d/dt {name}", unit / parse_unit("s"), 2, lambda x, step: np.diff(x, prepend=x[:1]) / step),
        make(f"{name}³", unit**3, 3, lambda x, _: x**3),
        _with_play(name, unit_text, PLAY * sd),
        *(make(f"lowpass({name}, {T:g} s)", unit, 3, partial(_low_pass, time_constant_s=T)) for T in LAG_S),
    ]


def _low_pass(x: Array, step_s: float, time_constant_s: float) -> Array:
    return lagged(x, time_constant_s, step_s)


def _product(a: str, b: str) -> Callable[[Signals, float], Array]:
    return lambda s, _: s[a] * s[b]
