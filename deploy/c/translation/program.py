"""The translation of a function and of everything that it calls, as the text of one C file."""

import importlib
import inspect
import textwrap
from collections.abc import Callable, Collection
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from deploy.c.translation.expressions import initialiser, literal
from deploy.c.translation.kinds import Group, Kind, Record, fields_of, kind_of
from deploy.c.translation.names import Names, constant_name, function_name, local_name, wrapped
from deploy.c.translation.python_source import definition_of, field_comments, function_source
from deploy.c.translation.refused import refused
from deploy.c.translation.scope import Scope
from deploy.c.translation.statements import Statements

Signature = tuple[str, list[tuple[str, Kind]], Kind]


class Translation:
    """C of Python functions.

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
        self.functions: list[str] = []  # their texts, callees first
        self.prototypes: list[str] = []  # of what is exported
        self._kinds: dict[Kind, str] = {}  # struct definitions, parts first
        self._constants: dict[str, str] = {}

    @property
    def types(self) -> str:
        """Definitions of all structs."""
        return "\n".join(text for text in self._kinds.values() if text)

    @property
    def constants(self) -> str:
        """Definitions of all constants of modules."""
        return "\n".join(self._constants.values())

    def add(self, function: Any) -> str:
        """Translate a function with everything below it; its name in C. Raises TranslationRefused."""
        source = function_source(function)

        def error(what: str) -> Exception:
            return refused(source.file, source.first_line, what)

        return self.needs_function(function, error)[0]

    # -- what expressions ask for

    def needs_function(self, function: Any, where: Callable[[str], Exception]) -> Signature:
        """Translate a function that is called, once."""
        # recursion has no bound on the stack that a microcontroller could reserve
        if function in self._open:
            raise refused(Path(inspect.getfile(function)), function.__code__.co_firstlineno, "recursion")
        if function in self._signatures:
            return self._signatures[function]
        if not inspect.isfunction(function):
            raise where(f"a call of {function!r}")
        # callees are translated first, so that C needs no forward declarations
        self._open.append(function)
        signature = self._signature(function)
        self._translate(function, signature)
        self._open.pop()
        self._signatures[function] = signature
        return signature

    def needs_kind(self, kind: Kind) -> str:
        """Define a type that is used, once, after those that it consists of."""
        name = self.names.kind(kind)
        if kind in self._kinds:
            return name
        if isinstance(kind, Record):
            self._kinds[kind] = ""
            self._kinds[kind] = self._struct(kind.python, name)
            self._kinds[kind] = self._kinds.pop(kind)  # after its parts
        elif isinstance(kind, Group):
            items = "".join(f"    {self.needs_kind(item)} item{k};\n" for k, item in enumerate(kind.items))
            self._kinds[kind] = f"typedef struct {{\n{items}}} {name};\n"
        return name

    def needs_constant(self, module: Any, name: str, value: Any) -> str:
        """Define a constant that is used, once."""
        here = importlib.import_module(module)
        home, documentation = definition_of(here, name)
        c = constant_name(home, name)
        if c not in self._constants:
            self._constants[c] = self._constant(home, c, value, documentation)
        return c

    # -- texts

    def _struct(self, record: type, name: str) -> str:
        remarks = field_comments(record)
        lines = []
        for field, kind in fields_of(record).items():
            if kind is None:
                raise refused(
                    Path(inspect.getfile(record)), 1, f"{record.__name__}.{field} is of no known kind"
                )
            remark = f" /* {remarks[field]} */" if field in remarks else ""
            lines.append(f"    {self.needs_kind(kind)} {local_name(field)};{remark}")
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

    def _signature(self, function: Any) -> Signature:
        file, line = Path(inspect.getfile(function)), function.__code__.co_firstlineno
        hints = get_type_hints(function)
        parameters = []
        for name, parameter in inspect.signature(function).parameters.items():
            kind = kind_of(hints.get(name), name)
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
        return function_name(function), parameters, result

    def _translate(self, function: Any, signature: Signature) -> None:
        name, parameters, result = signature
        source = function_source(function)
        scope = Scope(self, source, result)
        texts = []
        for parameter, kind in parameters:
            # a record by value would be copied onto the stack at every call
            pointer = isinstance(kind, (Record, Group))
            local = scope.declare(parameter, kind, pointer=pointer)
            c = self.needs_kind(kind)
            texts.append(f"const {c} *{local.c}" if pointer else f"{c} {local.c}")
        body = Statements(scope).translate()
        head = f"{self.needs_kind(result)} {name}({', '.join(texts) or 'void'})"
        if function in self._exported:
            self.prototypes.append(wrapped(f"{head};"))
        else:
            head = f"static {head}"
        origin = f"{source.file.relative_to(self._root)}:{source.first_line}"
        # -Wextra rejects a parameter that nobody reads; Python permits one for the sake of a common signature
        used = " ".join(body)
        idle = [
            f"    (void){scope.locals[p].c};" for p, _ in parameters if not _word_in(scope.locals[p].c, used)
        ]
        text = comment(f"{inspect.getdoc(function) or name}\n\nPython: {origin}", "")
        self.functions.append(text + wrapped(head) + "\n{\n" + "\n".join([*idle, *body]) + "\n}\n")


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
