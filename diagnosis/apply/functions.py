"""Functions of an open-ended equation as code: of arrays for a model's file, of numbers for an effect of the plant.

Their texts are those that discrepancy.selection.functions gives them.
"""

import re
from dataclasses import dataclass

from bus.user_error import UserError


class NoEffect(UserError, ValueError):
    """The findings hold nothing that an effect could be made of."""


@dataclass(frozen=True, slots=True)
class Function:
    """A function read: its signals, its code over arrays s["name"], and over numbers by name; "" where it has a memory

    or, as a sign does, a width that only a whole recording tells.
    """

    signals: tuple[str, ...]
    arrays: str
    numbers: str


_Forms = tuple[tuple[str, str, str], ...]
_FORMS: _Forms = (
    (r"1", "np.ones_like(next(iter(s.values())))", "1.0"),
    (r"sign\((?P<a>\w+)\)", "np.tanh({a} / (0.05 * np.std({a}) + 1e-300))", ""),
    (r"\|(?P<a>\w+)\|", "np.abs({a})", "abs({a})"),
    (r"d/dt (?P<a>\w+)", "np.diff({a}, prepend={a}[:1]) / step", ""),
    (r"play\((?P<a>\w+), (?P<n>[-+.\de]+)(?: .*)?\)", "play({a}, {n})", ""),
    (r"play\((?P<a>\w+), (?P<n>[-+.\de]+)(?: .*)?\)·(?P<b>\w+)", "play({a}, {n}) * {b}", ""),
    (r"lowpass\((?P<a>\w+), (?P<n>[-+.\de]+) s\)", "lagged({a}, {n}, step)", ""),
    (r"(?P<a>\w+)·\|(?P=a)\|", "{a} * np.abs({a})", "{a} * abs({a})"),
    (r"(?P<a>\w+)²", "{a}**2", "{a}**2"),
    (r"(?P<a>\w+)³", "{a}**3", "{a}**3"),
    (r"(?P<a>\w+)·(?P<b>\w+)", "{a} * {b}", "{a} * {b}"),
    (r"(?P<a>\w+)", "{a}", "{a}"),
)
"""Text with the signals a and b and the number n, and its code over arrays and over numbers."""


def read_function(text: str) -> Function:
    """Read the text of a function. Raises NoEffect for one that is not known."""
    for pattern, arrays, numbers in _FORMS:
        match = re.fullmatch(pattern, text)
        if match is None:
            continue
        found = match.groupdict()
        signals = {key: found[key] for key in ("a", "b") if key in found}
        width = {"n": found["n"]} if "n" in found else {}
        held = {key: f's["{name}"]' for key, name in signals.items()}
        return Function(tuple(signals.values()), arrays.format(**held, **width), numbers.format(**signals))
    raise NoEffect(f"cannot make code of the function '{text}'")
