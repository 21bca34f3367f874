"""What the translation reads besides the live objects: syntax trees, comments, and where a name is defined."""

import ast
import importlib
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from deploy.c.translation.refused import refused

_NO_REMARK = re.compile(r"#\s*(fmt:|noqa|type:|pragma)")
"""Comments for tools, not for readers."""


@dataclass(frozen=True, slots=True)
class FunctionSource:
    """A Python function as it is written."""

    function: Any
    tree: ast.FunctionDef
    file: Path
    first_line: int
    comments: Mapping[int, str]  # line within the function -> remark


@lru_cache(maxsize=512)
def function_source(function: Any) -> FunctionSource:
    """Source of a Python function; OSError where Python has none."""
    # a method or nested function is indented, which ast.parse rejects
    text = textwrap.dedent(inspect.getsource(function))
    tree = ast.parse(text).body[0]
    file, line = Path(inspect.getfile(function)), function.__code__.co_firstlineno
    if not isinstance(tree, ast.FunctionDef):
        raise refused(file, line, "only functions written with def are")
    return FunctionSource(function, tree, file, line, comments_of(text))


def comments_of(text: str) -> dict[int, str]:
    """Line number -> remark, without those for tools."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not _NO_REMARK.match(token.string):
            remark = token.string.lstrip("# ").rstrip()
            found[token.start[0]] = re.sub(r"\s*#\s*(fmt:|noqa|type:).*", "", remark)
    return found


@lru_cache(maxsize=512)
def field_comments(record: type) -> Mapping[str, str]:
    """Field of a named tuple or dataclass -> the remark beside or above it."""
    text = textwrap.dedent(inspect.getsource(record))
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.ClassDef)
    comments = comments_of(text)
    found = {}
    for item in tree.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            # a formatter may have moved the remark to the last line of a long annotation
            lines = range(item.lineno, (item.end_lineno or item.lineno) + 1)
            remark = " ".join(comments[line] for line in lines if line in comments)
            if remark:
                found[item.target.id] = remark
    return found


@lru_cache(maxsize=64)
def _module_tree(module: ModuleType) -> ast.Module:
    return ast.parse(inspect.getsource(module))


def _assigned(statement: ast.stmt) -> set[str]:
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = list(statement.targets)
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    return {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}


def definition_of(module: ModuleType, name: str) -> tuple[ModuleType, str]:
    """Module that defines a constant which `module` uses under `name`, and the docstring below it, "" if it has none."""
    body = _module_tree(module).body
    for place, statement in enumerate(body):
        # follow imports to where the constant is assigned: its comment and its one name in C stand there
        if isinstance(statement, ast.ImportFrom) and statement.module:
            for alias in statement.names:
                if (alias.asname or alias.name) == name:
                    return definition_of(importlib.import_module(statement.module), alias.name)
        if name in _assigned(statement):
            after = body[place + 1] if place + 1 < len(body) else None
            text = after.value if isinstance(after, ast.Expr) else None
            documented = isinstance(text, ast.Constant) and isinstance(text.value, str)
            return module, str(text.value) if documented and isinstance(text, ast.Constant) else ""
    return module, ""
