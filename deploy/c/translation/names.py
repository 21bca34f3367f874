"""Names in C for what Python keeps apart by modules: types, functions, constants, locals."""

import re
from types import ModuleType
from typing import Any, Final

from deploy.c.translation.kinds import BOOL, REAL, Array, Group, Kind, Record, Scalar

RESERVED: Final = frozenset(
    {
        "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "bool", "true", "false", "real_t", "main", "errno", "free", "abs", "exit", "signal", "time",
    }
)  # fmt: skip
"""Words of C99 and of the runtime that are ordinary names in Python."""


class Names:
    """Gives every type one name; a second class of the same name gets its module's name before its own."""

    def __init__(self) -> None:
        self._types: dict[type, str] = {}
        self._groups: dict[Group, str] = {}

    def record(self, record: type) -> str:
        """Name of a struct."""
        if record not in self._types:
            name = record.__name__
            # C has one name space for all structs of a file
            if name in self._types.values():
                name = _capitalised(record.__module__.rsplit(".", 1)[-1]) + name
            self._types[record] = name
        return self._types[record]

    def group(self, group: Group) -> str:
        """Name of the struct for a tuple: that of its items one after another, `Two` where both are alike."""
        if group not in self._groups:
            parts = [self._word(item) for item in group.items]
            alike = len(set(parts)) == 1
            counts = {2: "Two", 3: "Three", 4: "Four"}
            self._groups[group] = (
                counts.get(len(parts), f"Tuple{len(parts)}") + parts[0] + "s" if alike else "And".join(parts)
            )
        return self._groups[group]

    def kind(self, kind: Kind) -> str:
        """Name of any type."""
        if isinstance(kind, Scalar):
            return kind.c
        if isinstance(kind, Array):
            # a pointer to the first number of a row; rows are a struct, so that a pointer to constant rows is an ordinary one
            return kind.item.c if len(kind.shape) == 1 else self.rows(kind)
        return self.record(kind.python) if isinstance(kind, Record) else self.group(kind)

    def rows(self, kind: Array) -> str:
        """Name of the struct for rows of numbers: `Reals3x4`."""
        return f"{self._word(kind.item)}s{'x'.join(map(str, kind.shape))}"

    def _word(self, kind: Kind) -> str:
        if isinstance(kind, Scalar):
            return {REAL: "Real", BOOL: "Bool"}.get(kind, "Int")
        return self.kind(kind)


def _capitalised(snake: str) -> str:
    return "".join(word.capitalize() for word in snake.split("_"))


def function_name(function: Any, folders: int = 0) -> str:
    """`module_function`: modules keep equal names of functions apart, in C nothing else does. folders: how many stand before."""
    return f"{_last(function.__module__, folders)}_{function.__name__.lstrip('_')}"


def constant_name(module: ModuleType, name: str, folders: int = 0) -> str:
    """`MODULE_NAME`."""
    return f"{_last(module.__name__, folders)}_{name}".upper()


def _last(module: str, folders: int) -> str:
    return "_".join(module.split(".")[-1 - folders :])


def local_name(name: str) -> str:
    """A local or a field under its own name, unless C needs it."""
    return f"{name}_" if name in RESERVED else name


def wrapped(line: str, width: int = 110) -> str:
    """A line of C broken at spaces; continuation lines are indented by two more steps."""
    if len(line) <= width:
        return line
    indent = re.match(r" *", line)
    assert indent is not None
    hang = indent.group() + " " * 8
    lines, current = [], indent.group()
    for word in line.split():
        if len(current) + len(word) >= width and current.strip():
            lines.append(current.rstrip())
            current = hang
        current += word + " "
    return "\n".join([*lines, current.rstrip()])
