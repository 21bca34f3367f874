"""Kinds of values that both languages have: real, integer, truth value, record of named fields, tuple, array of known size.

A record is a NamedTuple or a frozen dataclass in Python and a struct in C; a tuple is a struct without field names.
"""

import dataclasses
import enum
from dataclasses import dataclass
from typing import Any, Final, get_args, get_origin, get_type_hints

import numpy as np


@dataclass(frozen=True, slots=True)
class Scalar:
    """A number or truth value."""

    c: str  # type in C


REAL: Final = Scalar("real_t")
INT: Final = Scalar("int32_t")
BOOL: Final = Scalar("bool")
TIME: Final = Scalar("int64_t")
"""Nanoseconds: an integer whose name ends in `_ns`; None, a time that has not come, is NEVER_NS."""
VOID: Final = Scalar("void")
"""What a function without a result returns."""
NUMBERS: Final = (REAL, INT, BOOL, TIME)


@dataclass(frozen=True, slots=True)
class Record:
    """A NamedTuple or a dataclass."""

    python: type


@dataclass(frozen=True, slots=True)
class Group:
    """A tuple of values that a function returns."""

    items: "tuple[Kind, ...]"


@dataclass(frozen=True, slots=True)
class Array:
    """Numbers in a row or in rows. Annotations do not say how many: a function takes the sizes of its first call."""

    item: Scalar
    shape: tuple[int, ...]  # one or two sizes


Kind = Scalar | Record | Group | Array


def kind_of(hint: Any, name: str = "") -> Kind | None:
    """The kind of an annotation; None where C has no exact counterpart here. name: of what is annotated."""
    if name.endswith("_ns") and hint in (int, int | None):
        return TIME
    scalar = {float: REAL, int: INT, bool: BOOL, type(None): VOID}.get(hint) if hint is not None else None
    if scalar is not None:
        return scalar
    if is_record(hint):
        return Record(hint)
    if isinstance(hint, type) and issubclass(hint, enum.IntEnum):
        return INT
    if get_origin(hint) is tuple:
        items = tuple(kind_of(item) for item in get_args(hint))
        kinds = tuple(item for item in items if item is not None)
        return Group(kinds) if kinds and len(kinds) == len(items) else None
    return None


def item_of(hint: Any) -> Scalar | None:
    """The kind of the numbers in an annotated array; None for what is no array of reals or integers."""
    if get_origin(hint) is not np.ndarray:
        return None
    (number,) = get_args(get_args(hint)[1])
    return {np.float64: REAL, np.int64: INT}.get(number)


def is_record(thing: Any) -> bool:
    """Whether it is the type of a NamedTuple or of a dataclass."""
    return isinstance(thing, type) and (
        (issubclass(thing, tuple) and hasattr(thing, "_fields")) or dataclasses.is_dataclass(thing)
    )


def fields_of(record: type) -> dict[str, Kind | None]:
    """Field -> its kind, in their order."""
    hints = get_type_hints(record)
    names = getattr(record, "_fields", None) or [field.name for field in dataclasses.fields(record)]
    return {name: kind_of(hints[name], name) for name in names}


def defaults_of(record: type) -> dict[str, Any]:
    """Field -> its default, of those that have one."""
    if dataclasses.is_dataclass(record):
        return {f.name: f.default for f in dataclasses.fields(record) if f.default is not dataclasses.MISSING}
    return dict(getattr(record, "_field_defaults", {}))
