"""Functions of an open-ended equation as Python code: over arrays for a model file, over numbers for an effect of the plant.

The texts are those that discrepancy.selection.functions writes.
"""

import re
from dataclasses import dataclass

from bus.user_error import UserError


class NoEffect(UserError, ValueError):
    """The findings contain no equation from which an effect can be written."""


@dataclass(frozen=True, slots=True)
class Function:
    """A function of signals, read from its text."""

    signals: tuple[str, ...]
    arrays: str  # code over arrays s["name"]
    # Code over numbers by name, for one step of the plant; "" where a single step is not enough: a function with a memory
    # (play, low-pass, derivative), or a sign, whose smoothing width is the spread of a whole recording.
    numbers: str


# Order matters, since the first form that matches the whole text is taken: \w also matches 1, ² and ³, so the constant and
# the powers stand before the bare name of a signal.
_Forms = tuple[tuple[str, str, str], ...]
_FORMS: _Forms = (
    (r"1", "np.ones_like(next(iter(s.values())))", "1.0"),
    (r"sign\((?P<a>\w+)\)", "np.tanh({a} / (0.05 * np.std({a}) + 1e-300))", ""),
    (r"\|(?P<a>\w+)\|", "np.abs({a})", "abs({a})"),
    (r"d/dt (?P<a>\w+)", "np.diff({a}, prepend={a}[:1]) / step", ""),
    (r"play\((?P<a>\w+), (?P<n>[-+.\de]+)(?: .*)?\)", "play({a}, {n})", ""),
    (r"play\((?P<a>\w+), (?P<n>[-+.\de]+)(?: .*)?\)·(?P<b>\w+)", "play({a}, {n}) * {b}", ""),
    (r"lowpass\((?P<a>\w+), (?P<n>[-+.\de]+) s\)", "lagged({a}, {n}, step)", ""),
    (r"\(lowpass\((?P<a>\w+), (?P<n>[-+.\de]+) s\) - (?P=a)\)", "(lagged({a}, {n}, step) - {a})", ""),
    (
        r"\(lowpass\((?P<a>\w+), (?P<n>[-+.\de]+) s\) - (?P=a)\)·sign\((?P<b>\w+)\)",
        "(lagged({a}, {n}, step) - {a}) * np.tanh({b} / (0.05 * np.std({b}) + 1e-300))",
        "",
    ),
    (r"\((?P<a>\w+) - (?P<b>\w+)\)", "({a} - {b})", "({a} - {b})"),
    (
        r"\((?P<a>\w+) - (?P<b>\w+)\)·\|(?P=a) - (?P=b)\|",
        "({a} - {b}) * np.abs({a} - {b})",
        "({a} - {b}) * abs({a} - {b})",
    ),
    (
        r"sign\((?P<a>\w+) - (?P<b>\w+)\)·√\|(?P=a) - (?P=b)\|",
        "np.sign({a} - {b}) * np.sqrt(np.abs({a} - {b}))",
        "({a} - {b}) / max(abs({a} - {b}) ** 0.5, 1e-150)",
    ),
    (r"\((?P<a>\w+) - (?P<b>\w+)\)·(?P<c>\w+)", "({a} - {b}) * {c}", "({a} - {b}) * {c}"),
    (r"(?P<a>\w+)·\|(?P=a)\|", "{a} * np.abs({a})", "{a} * abs({a})"),
    (r"(?P<a>\w+)²", "{a}**2", "{a}**2"),
    (r"(?P<a>\w+)³", "{a}**3", "{a}**3"),
    (r"(?P<a>\w+)·(?P<b>\w+)", "{a} * {b}", "{a} * {b}"),
    (r"(?P<a>\w+)", "{a}", "{a}"),
)
"""Pattern of the text with signals a, b and c and number n; code over arrays; code over numbers."""


def read_function(text: str) -> Function:
    """The function of a text. Raises NoEffect for an unknown one."""
    for pattern, arrays, numbers in _FORMS:
        match = re.fullmatch(pattern, text)
        if match is None:
            continue
        found = match.groupdict()
        signals = {key: found[key] for key in ("a", "b", "c") if key in found}
        width = {"n": found["n"]} if "n" in found else {}
        held = {key: f's["{name}"]' for key, name in signals.items()}
        return Function(tuple(signals.values()), arrays.format(**held, **width), numbers.format(**signals))
    raise NoEffect(f"the function '{text}' cannot be written as code")
