"""The one error of the translation: a piece of Python that has no exact counterpart in the C that is written."""

import ast
from pathlib import Path

from bus.user_error import UserError


class TranslationRefused(UserError, ValueError):
    """Python that cannot be translated exactly; the message names file, line and what to write instead."""


def refused(file: Path, line: int, what: str) -> TranslationRefused:
    """The error for a line of a file."""
    return TranslationRefused(f"{file}:{line}: cannot be translated to C: {what}")


def refused_node(file: Path, first_line: int, node: ast.AST, what: str) -> TranslationRefused:
    """The error for a node of a function whose source begins at `first_line` of the file."""
    return refused(file, first_line + getattr(node, "lineno", 1) - 1, what)
