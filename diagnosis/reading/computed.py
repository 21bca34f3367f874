"""Computes channels from columns of a table, with units: `--channel "power=voltage * current"`.

The formula is parsed, never evaluated as Python: it comes from a command line, and only arithmetic is allowed.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from diagnosis.reading.tables import Column, Unreadable
from discrepancy.signals.recording import Array
from discrepancy.signals.units import Unit, parse_scaled, parse_unit

OPERATORS = "+-*/("
ONE = parse_unit("1")


@dataclass(frozen=True, slots=True)
class _Value:
    """The value of a part of a formula."""

    value: Array  # SI
    unit: Unit | None  # None where a column without a unit is involved


def is_formula(text: str, columns: Sequence[Column]) -> bool:
    """Whether a text is a formula. Names of columns, also several by comma, are not, whatever signs they contain ('oil-temp')."""
    return (
        "," not in text
        and text.strip() not in {c.name for c in columns}
        and any(s in text for s in OPERATORS)
    )


def names_in(text: str, columns: Sequence[Column]) -> list[str]:
    """Names in a formula that are columns or ought to be; raises Unreadable for a text that is no formula."""
    formula, by_placeholder = _with_placeholders(text, columns)
    return [
        by_placeholder.get(node.id, node.id) for node in ast.walk(_parsed(formula, text)) if isinstance(node, ast.Name)
    ]  # fmt: skip


def computed(text: str, columns: Sequence[Column]) -> Column:
    """The column that a formula of + - * / ** and numbers gives, in SI, at the stamps of its first column.

    Raises Unreadable for an unknown column, and for a sum of different quantities.
    """
    formula, by_placeholder = _with_placeholders(text, columns)
    tree = _parsed(formula, text)
    by_name = {c.name: c for c in columns}
    used = [
        by_placeholder[n.id] for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id in by_placeholder
    ]
    if not used:
        raise Unreadable(f"'{text}': uses no column; there are {', '.join(by_name)}")
    time_s = by_name[used[0]].time_s
    known = {p: _value(by_name[name], time_s) for p, name in by_placeholder.items() if name in used}
    found = _evaluated(tree.body, known, text)
    return Column(
        text, None if found.unit is None else str(found.unit), time_s, np.broadcast_to(found.value, time_s.shape).copy()
    )  # fmt: skip


def _with_placeholders(text: str, columns: Sequence[Column]) -> tuple[str, dict[str, str]]:
    """The formula with Python names in place of columns, whose names may have spaces and dots; columns by placeholder."""
    by_placeholder = {}
    # longest first: "speed ref" must be replaced before "speed"
    for i, name in enumerate(sorted({c.name for c in columns}, key=len, reverse=True)):
        pattern = rf"(?<![\w.]){re.escape(name)}(?![\w.])"
        text, count = re.subn(pattern, f"column_{i}_", text)
        if count:
            by_placeholder[f"column_{i}_"] = name
    return text, by_placeholder


def _parsed(formula: str, text: str) -> ast.Expression:
    try:
        return ast.parse(formula.strip(), mode="eval")
    except SyntaxError as error:
        raise Unreadable(
            f"'{text}': is neither a column nor a formula such as 'voltage * current'"
        ) from error


def _value(column: Column, time_s: Array) -> _Value:
    values = column.value if column.time_s is time_s else np.interp(time_s, column.time_s, column.value)
    if column.unit is None:
        return _Value(values, None)
    try:
        scaled = parse_scaled(column.unit)
    except ValueError as error:
        raise Unreadable(f"{column.name}: {error}") from error
    return _Value(values * scaled.factor + scaled.offset, scaled.unit)


def _evaluated(node: ast.expr, known: Mapping[str, _Value], text: str) -> _Value:
    """The value of a node. Raises Unreadable for anything but arithmetic of columns and numbers."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return _Value(np.array(float(number)), ONE)
        case ast.Name(id=name) if name in known:
            return known[name]
        case ast.Name(id=name):
            raise Unreadable(f"'{text}': there is no column {name}")
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _evaluated(operand, known, text)
            return _Value(-inner.value, inner.unit)
        # only a constant whole power: with any other exponent the unit would be unknown
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as power)):
            base = _evaluated(left, known, text)
            return _Value(base.value**power, None if base.unit is None else base.unit ** Fraction(power))
        case ast.BinOp(left=left, op=operator, right=right):
            return _combined(_evaluated(left, known, text), operator, _evaluated(right, known, text), text)
    raise Unreadable(f"'{text}': only + - * / ** of columns and numbers can be computed")


def _combined(a: _Value, operator: ast.operator, b: _Value, text: str) -> _Value:
    known = a.unit is not None and b.unit is not None
    match operator:
        case ast.Mult():
            return _Value(a.value * b.value, a.unit * b.unit if a.unit and b.unit else None)
        case ast.Div():
            # division by zero gives inf or NaN, which later counts as damage of single samples
            with np.errstate(divide="ignore", invalid="ignore"):
                return _Value(a.value / b.value, a.unit / b.unit if a.unit and b.unit else None)
        case ast.Add() | ast.Sub():
            if a.unit is not None and b.unit is not None and not a.unit.same_quantity(b.unit):
                raise Unreadable(f"'{text}': adds {a.unit} and {b.unit}, which are different quantities")
            signed = b.value if isinstance(operator, ast.Add) else -b.value
            return _Value(a.value + signed, a.unit if known else None)
    raise Unreadable(f"'{text}': only + - * / ** of columns and numbers can be computed")
