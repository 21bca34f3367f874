"""Arrays of numbers in C: rows whose sizes are known when the text is written, on the stack or in the caller's memory."""

import ast
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from deploy.c.translation.kinds import INT, REAL, Array
from deploy.c.translation.scope import Value


def size_of(shape: Sequence[int]) -> Value:
    """How many numbers there are, as a constant."""
    size = math.prod(shape)
    return Value(str(size), INT, exact=size)


def place_in(owner: Value, indices: Sequence[str]) -> Value:
    """A number of an array, or a row of it, which is a pointer to the row's first number."""
    kind = owner.kind
    assert isinstance(kind, Array)
    base = owner.field("at") if len(kind.shape) == 2 else owner.c
    text = base + "".join(f"[{index}]" for index in indices)
    left = kind.shape[len(indices) :]
    if not left:
        return Value(text, kind.item, place=text)
    return Value(text, Array(kind.item, left), place=text, pointer=True, root=owner.root)


def fresh_array(node: ast.Call, function: Any, value: Callable[[ast.expr], Value]) -> Value | None:
    """np.empty(sizes), np.zeros(sizes) and array.copy(): an array of this function's own. None for another call."""
    called = node.func
    if isinstance(called, ast.Attribute) and called.attr == "copy" and not node.args and function is None:
        found = value(called.value)
        if isinstance(found.kind, Array):
            return Value(found.c, found.kind, fresh="copy")
    if function not in (np.empty, np.zeros) or len(node.args) != 1 or node.keywords:
        return None
    sizes = node.args[0].elts if isinstance(node.args[0], ast.Tuple) else node.args
    found_sizes = [value(size).exact for size in sizes]
    if not all(isinstance(size, int) for size in found_sizes):
        return None
    shape = tuple(size for size in found_sizes if isinstance(size, int))
    return Value("", Array(REAL, shape), fresh=function.__name__)


def own_array(c: str, struct: str, value: Value) -> list[str]:
    """The declaration of an array of this function's own, and what fills it."""
    kind = value.kind
    assert isinstance(kind, Array)
    rows = len(kind.shape) == 2
    declared = f"{struct} {c}" if rows else f"{kind.item.c} {c}[{kind.shape[0]}]"
    if value.fresh == "zeros":
        return [f"{declared} = {{{'{' if rows else ''}0{'}' if rows else ''}}};"]
    if value.fresh == "copy":
        from_ = f"&{value.c}" if rows and not value.pointer else value.c
        return [f"{declared};", f"(void)memcpy({'&' if rows else ''}{c}, {from_}, sizeof {c});"]
    return [f"{declared};"]


def filled(value: Value, number: str) -> list[str]:
    """Loops that set every number of an array to the same, outermost first; the innermost ends with the assignment."""
    kind = value.kind
    assert isinstance(kind, Array)
    indices = ["i", "j"][: len(kind.shape)]
    loops = [
        f"for (int32_t {index} = 0; {index} < {size}; ++{index}) {{"
        for index, size in zip(indices, kind.shape, strict=True)
    ]
    return [*loops, f"{place_in(value, indices).c} = {number};"]
