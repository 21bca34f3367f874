"""Functions of an open-ended equation as code: of arrays for a model's file, of numbers for an effect of the plant.

Their texts are those that discrepancy.openended gives them.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from bus.mistake import Mistake


class NoEffect(Mistake, ValueError):
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
    (r"sign\((\w+)\)", "np.tanh({a} / (0.05 * np.std({a}) + 1e-300))", ""),
    (r"\|(\w+)\|", "np.abs({a})", "abs({a})"),
    (r"d/dt (\w+)", "np.diff({a}, prepend={a}[:1]) / step", ""),
    (r"play\((\w+), ([-+.\de]+) [^)]*\)", "play({a}, {n})", ""),
    (r"lowpass\((\w+), ([-+.\de]+) s\)", "lagged({a}, {n}, step)", ""),
    (r"(\w+)·\|\1\|", "{a} * np.abs({a})", "{a} * abs({a})"),
    (r"(\w+)²", "{a}**2", "{a}**2"),
    (r"(\w+)³", "{a}**3", "{a}**3"),
    (r"(\w+)·(\w+)", "{a} * {b}", "{a} * {b}"),
    (r"(\w+)", "{a}", "{a}"),
)


def read_function(text: str) -> Function:
    """Read the text of a function. Raises NoEffect for one that is not known."""
    for pattern, arrays, numbers in _FORMS:
        match = re.fullmatch(pattern, text)
        if match is None:
            continue
        groups = match.groups()
        width = "(" in pattern and groups[1:] and re.fullmatch(r"[-+.\de]+", groups[1])
        signals = groups[:1] if width else groups
        return Function(signals, _filled(arrays, groups, 's["{}"]'.format), _filled(numbers, groups, str))
    raise NoEffect(f"cannot make code of the function '{text}'")


def _filled(template: str, groups: tuple[str, ...], named: Callable[[str], str]) -> str:
    if not groups:
        return template
    last = groups[-1]
    return template.format(a=named(groups[0]), b=named(last), n=last)
