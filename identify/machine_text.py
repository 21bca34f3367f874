"""The text of a machine file with other values of its tyre."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

from bus.user_error import UserError
from diagnosis.apply.toml_text import Line, with_values
from plant.sheets.machine import MACHINES, load_machine

TyreValue = tuple[str, float, str]
"""Key of a machine file, value, and what is said of it."""


class NoBase(UserError, ValueError):
    """A machine cannot take an identified tyre."""


def check_base(base: str) -> None:
    """Raises NoBase for a machine whose tyre is that of a .tir file: its values would hold over the identified ones."""
    load_machine(base)
    if "tir" in tomllib.loads(_text(base)).get("tyre", {}):
        raise NoBase(
            f"{base}: takes its tyre from a .tir file, whose values hold over those of a machine file; name a machine without 'tir' in --machine"
        )


def _text(base: str) -> str:
    file = Path(base) if base.endswith(".toml") else MACHINES / f"{base}.toml"
    return file.read_text(encoding="utf-8")


def with_tyre(base: str, values: Sequence[TyreValue], origin: str) -> str:
    """The text of a machine on other values of its tyre: key, value, and what is said of it."""
    return f"# Tyre: {origin}\n" + with_values(_text(base), [Line(("tyre",), *one) for one in values])
