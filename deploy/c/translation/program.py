"""The translation of functions and of everything that they call, as the texts of one C file or of several."""

import importlib
import inspect
import textwrap
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from deploy.c.translation.expressions import initialiser, literal
from deploy.c.translation.kinds import Array, Group, Kind, Record, fields_of, item_of, kind_of
from deploy.c.translation.names import Names, constant_name, function_name, local_name, wrapped
from deploy.c.translation.python_source import definition_of, field_comments, function_source
from deploy.c.translation.refused import refused
from deploy.c.translation.scope import Scope, Signature
from deploy.c.translation.statements import Statements

NO_ARRAYS: Mapping[str, Array] = {}


@dataclass(slots=True)
class Written:
    """A translated function."""

    above: str  # its comment
    head: str
    body: str
    others_call_it: bool

    @property
    def text(self) -> str:
        """Its definition."""
        return (
            f"{self.above}{wrapped(self.head if self.others_call_it else f'static {self.head}')}\n{self.body}"
        )


@dataclass(slots=True)
class File:
    """What one file of C holds."""

    written: dict[Any, Written] = field(default_factory=dict)  # by Python function, callees first
    kinds: dict[Kind, str] = field(default_factory=dict)  # struct definitions, parts first
    constants: dict[str, str] = field(default_factory=dict)

    @property
    def functions(self) -> list[str]:
        """Their definitions, callees first."""
        return [function.text for function in self.written.values()]

    @property
    def prototypes(self) -> list[str]:
        """Those of the functions that others call."""
        return [wrapped(f"{each.head};") for each in self.written.values() if each.others_call_it]

    @property
    def types(self) -> str:
        """Definitions of its structs."""
        return "\n".join(text for text in self.kinds.values() if text)

    @property
    def definitions(self) -> str:
        """Definitions of the constants that it uses."""
        return "\n".join(self.constants.values())


class Translation:
    """C of Python functions, in one file after the other: what a later one calls of an earlier one is not written again.

    perturbed: every operation is wrapped in PERTURBED(), for a build that measures what rounding to single precision does
    to the results (docs/adr/0032-c-from-python.md).
    """

    def __init__(self, root: Path, *, exported: Collection[Any] = (), perturbed: bool = False) -> None:
        """root: folder of the Python packages; files are named from there in comments. exported: functions that others call."""
        self._exported = exported
        self.names = Names()
        self.perturbed = perturbed
        self._root = root
        self._signatures: dict[Any, Signature] = {}
        self._open: list[Any] = []  # functions under translation, for recursion
        self._taken: dict[str, Any] = {}  # name in C -> function or module that has it
        self.files = [File()]

    @property
    def file(self) -> File:
        """The file that is written at present."""
        return self.files[-1]

    def next_file(self) -> None:
        """Whatever is translated from now on stands in another file, which includes the header of those before."""
        self.files.append(File())

    def add(self, function: Any, arrays: Mapping[str, Array] = NO_ARRAYS) -> str:
        """Translate a function with everything below it; its name in C. arrays: sizes of its arguments. Raises TranslationRefused."""
        source = function_source(function)

        def error(what: str) -> Exception:
            return refused(source.file, source.first_line, what)

        return self.needs_function(function, error, arrays).name

    # -- what expressions ask for

    def needs_function(
        self, function: Any, where: Callable[[str], Exception], arrays: Mapping[str, Array] = NO_ARRAYS
    ) -> Signature:
        """Translate a function that is called, once. arrays: kinds of its arguments that are arrays, as this call has them."""
        # recursion has no bound on the stack that a microcontroller could reserve
        if function in self._open:
            raise refused(Path(inspect.getfile(function)), function.__code__.co_firstlineno, "recursion")
        if function in self._signatures:
            self._again(function, where, arrays)
            return self._signatures[function]
        if not inspect.isfunction(function):
            raise where(f"a call of {function!r}")
        # callees are translated first, so that C needs no forward declarations
        self._open.append(function)
        signature = self._signature(function, arrays)
        self._translate(function, signature)
        self._open.pop()
        self._signatures[function] = signature
        return signature

    def _again(self, function: Any, where: Callable[[str], Exception], arrays: Mapping[str, Array]) -> None:
        """One more call of a function that has been translated."""
        known = dict(self._signatures[function].parameters)
        other = [name for name, kind in arrays.items() if known[name] != kind]
        if other:
            raise where(f"a call of {function.__name__} with another size of {other[0]} than before")
        for file in self.files[:-1]:
            if function in file.written:
                file.written[function].others_call_it = True

    def needs_kind(self, kind: Kind) -> str:
        """Define a type that is used, once, after those that it consists of."""
        name, kinds = self.names.kind(kind), self.file.kinds
        if any(kind in file.kinds for file in self.files):
            return name
        if isinstance(kind, Record):
            kinds[kind] = ""
            kinds[kind] = self._struct(kind.python, name)
            kinds[kind] = kinds.pop(kind)  # after its parts
        elif isinstance(kind, Group):
            items = "".join(f"    {self.needs_kind(item)} item{k};\n" for k, item in enumerate(kind.items))
            kinds[kind] = f"typedef struct {{\n{items}}} {name};\n"
        elif isinstance(kind, Array) and len(kind.shape) == 2:
            rows, columns = kind.shape
            kinds[kind] = f"typedef struct {{\n    {kind.item.c} at[{rows}][{columns}];\n}} {name};\n"
        return name

    def needs_constant(self, module: Any, name: str, value: Any) -> str:
        """Define a constant that is used, once a file."""
        here = importlib.import_module(module)
        home, documentation = definition_of(here, name)
        c = self._free(constant_name(home, name), constant_name(home, name, 1), (home, name))
        if c not in self.file.constants:
            self.file.constants[c] = self._constant(home, c, value, documentation)
        return c

    def _free(self, name: str, longer: str, owner: Any) -> str:
        """The name, or the longer one where it belongs to something else."""
        return name if self._taken.setdefault(name, owner) == owner else longer

    # -- texts

    def _struct(self, record: type, name: str) -> str:
        remarks = field_comments(record)
        lines = []
        for part, kind in fields_of(record).items():
            if kind is None:
                raise refused(
                    Path(inspect.getfile(record)), 1, f"{record.__name__}.{part} is of no known kind"
                )
            remark = f" /* {remarks[part]} */" if part in remarks else ""
            lines.append(f"    {self.needs_kind(kind)} {local_name(part)};{remark}")
        return (
            comment(inspect.getdoc(record) or "", "")
            + "typedef struct {\n"
            + "\n".join(lines)
            + f"\n}} {name};\n"
        )

    def _constant(self, module: ModuleType, c: str, value: Any, documentation: str) -> str:
        above = comment(documentation, "")
        if isinstance(value, int):
            return f"{above}#define {c} ((int32_t){int(value)})\n"
        if isinstance(value, float):
            return f"{above}#define {c} {literal(value)}\n"
        kind = Record(type(value))
        return f"{above}static const {self.needs_kind(kind)} {c} = {initialiser(value)};\n"

    def _signature(self, function: Any, arrays: Mapping[str, Array]) -> Signature:
        file, line = Path(inspect.getfile(function)), function.__code__.co_firstlineno
        hints = get_type_hints(function)
        parameters = []
        for name, parameter in inspect.signature(function).parameters.items():
            item = item_of(hints.get(name))
            kind = arrays.get(name) if item is not None else kind_of(hints.get(name), name)
            if (
                kind is None
                or parameter.default is not parameter.empty
                or parameter.kind is not parameter.POSITIONAL_OR_KEYWORD
            ):
                raise refused(file, line, f"{function.__name__}: the argument {name}: {hints.get(name)}")
            parameters.append((name, kind))
        result = kind_of(hints.get("return"))
        if result is None:
            raise refused(file, line, f"{function.__name__}: the result {hints.get('return')}")
        name = self._free(function_name(function), function_name(function, 1), function)
        return Signature(name, parameters, result)

    def _translate(self, function: Any, signature: Signature) -> None:
        source = function_source(function)
        scope = Scope(self, source, signature.result)
        for parameter, kind in signature.parameters:
            # a record by value would be copied onto the stack at every call; an array is its own memory in Python too
            scope.declare(parameter, kind, pointer=isinstance(kind, (Record, Group, Array)))
        body = Statements(scope).translate()
        signature.written = frozenset(name for name, _ in signature.parameters if name in scope.written)
        texts = [self._argument(parameter, kind, scope) for parameter, kind in signature.parameters]
        head = f"{self.needs_kind(signature.result)} {signature.name}({', '.join(texts) or 'void'})"
        origin = f"{source.file.relative_to(self._root)}:{source.first_line}"
        # -Wextra rejects a parameter that nobody reads; Python permits one for the sake of a common signature
        used = " ".join(body)
        idle = [
            f"    (void){scope.locals[p].c};"
            for p, _ in signature.parameters
            if not _word_in(scope.locals[p].c, used)
        ]
        self.file.written[function] = Written(
            comment(f"{inspect.getdoc(function) or signature.name}\n\nPython: {origin}", ""),
            head,
            "{\n" + "\n".join([*idle, *body]) + "\n}\n",
            function in self._exported,
        )

    def _argument(self, name: str, kind: Kind, scope: Scope) -> str:
        """A parameter's declaration; memory that the function does not write is constant."""
        local, c = scope.locals[name], self.needs_kind(kind)
        if not local.pointer:
            return f"{c} {local.c}"
        constant = "" if name in scope.written else "const "
        return f"{constant}{c} *{local.c}"


def _word_in(word: str, text: str) -> bool:
    import re

    return re.search(rf"\b{re.escape(word)}\b", text) is not None


def comment(text: str, indent: str) -> str:
    """A C comment of one or several lines; "" for no text."""
    # a docstring may itself contain the marks of a C comment
    text = text.strip().replace("*/", "* /").replace("/*", "/ *")
    if not text:
        return ""
    lines = [part for line in text.splitlines() for part in (textwrap.wrap(line, 110) or [""])]
    if len(lines) == 1:
        return f"{indent}/* {lines[0]} */\n"
    return (
        indent + "/*\n" + "".join(f"{indent} * {line}".rstrip() + "\n" for line in lines) + f"{indent} */\n"
    )
