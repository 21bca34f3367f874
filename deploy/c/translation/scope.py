"""What is known while one function is translated: its locals, and what has to stand before the present statement."""

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from deploy.c.translation.kinds import Array, Kind, Record
from deploy.c.translation.names import Names, local_name
from deploy.c.translation.python_source import FunctionSource
from deploy.c.translation.refused import TranslationRefused, refused_node


@dataclass(slots=True)
class Signature:
    """A translated function, as its callers see it."""

    name: str  # in C
    parameters: list[tuple[str, Kind]]
    result: Kind
    written: frozenset[str] = frozenset()  # parameters, arrays all of them, that it writes into


class Program(Protocol):
    """The whole translation, as an expression sees it."""

    names: Names
    perturbed: bool

    def needs_function(
        self, function: Any, where: Callable[[str], Exception], arrays: Mapping[str, Array] = ...
    ) -> Signature:
        """A function that is called, with the kinds of its arguments that are arrays."""
        ...

    def needs_kind(self, kind: Kind) -> str:
        """Name in C of a type that is used."""
        ...

    def needs_constant(self, module: Any, name: str, value: Any) -> str:
        """Name in C of a module's constant that is used."""
        ...


@dataclass(slots=True)
class Local:
    """A variable of the function."""

    c: str
    kind: Kind
    pointer: bool = False  # a record or an array that the caller owns
    root: str = ""  # of a row: the local whose memory it is


@dataclass(slots=True)
class Scope:
    """One function under translation."""

    program: Program
    source: FunctionSource
    result: Kind
    locals: dict[str, Local] = field(default_factory=dict)
    before: list[str] = field(default_factory=list)  # statements that the present one needs done first
    conditional: int = 0  # depth of operands that Python may skip
    temporaries: dict[str, int] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)  # arrays that are written, and those whose rows are
    reads: set[str] = field(default_factory=set)  # arrays that the present statement reads
    changes: list[set[str]] = field(default_factory=list)  # arrays that each call in it writes into

    def refused(self, node: ast.AST, what: str) -> TranslationRefused:
        """The error for a piece of the function."""
        return refused_node(self.source.file, self.source.first_line, node, what)

    def temporary(self, node: ast.AST, base: str, kind: Kind, text: str) -> str:
        """Name of a new local that holds `text`, declared before the present statement."""
        if self.conditional:
            # What Python may skip may also fail; done before, it would fail always.
            raise self.refused(
                node,
                f"the result of {base} is needed in an operand that may be skipped: name it in an if statement",
            )
        base = base.rsplit(".", 1)[-1].lstrip("_")
        number = self.temporaries.get(base, 0) + 1
        self.temporaries[base] = number
        name = f"{base}_{number}"
        while name in self.locals:
            name += "_"
        self.before.append(f"const {self.program.needs_kind(kind)} {name} = {text};")
        return name

    def writes(self, name: str) -> None:
        """The memory of this array changes."""
        self.written.add(name)
        if self.locals[name].root:
            self.writes(self.locals[name].root)

    def statement_ends(self, node: ast.AST) -> None:
        """Refuse what C may do in another order: it does not say which operand of a sum comes first."""
        if len(self.changes) > 1 or any(changed & self.reads for changed in self.changes):
            raise self.refused(node, "a call that changes an array beside another one or beside a read of it")
        self.reads.clear()
        self.changes.clear()

    def memory(self, name: str) -> str:
        """The array whose row this is; any other name itself."""
        local = self.locals.get(name)
        return self.memory(local.root) if local is not None and local.root else name

    def declare(self, name: str, kind: Kind, *, pointer: bool = False) -> Local:
        """A new local; one that is known keeps its kind."""
        if name not in self.locals:
            self.locals[name] = Local(local_name(name), kind, pointer)
        return self.locals[name]


@dataclass(slots=True)
class Value:
    """A translated expression."""

    c: str
    kind: Kind
    place: str = ""  # an lvalue that holds it, "" for a result that has no place yet
    pointer: bool = False  # `place` is a pointer to it
    atom: bool = True  # needs no parentheses as an operand
    exact: float | int | None = None  # value of a constant
    root: str = ""  # of an array: the local whose memory it is
    fresh: str = ""  # an array that is made here: empty, zeros, copy

    def field(self, name: str) -> str:
        """One of its fields."""
        if self.pointer:
            return f"{self.place}->{name}"
        return f"{self.place or self.c}.{name}"

    def operand(self) -> str:
        """Its text as an operand."""
        return self.c if self.atom else f"({self.c})"


def is_record(value: Value) -> bool:
    """Whether it is a record."""
    return isinstance(value.kind, Record)
