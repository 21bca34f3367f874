"""Checked reading of TOML: an error names file, key, value, unit and permitted range.

A table is read key by key and then finished: keys that no reader asked for are refused, because a
misspelt key that is ignored silently changes a run.
"""

import difflib
import math
import os
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Self, cast

from bus.user_error import UserError

Change = tuple[tuple[str, ...], object]
"""A dotted key, split, and its new value."""


NAME_SHOWN = 80  # characters of an unknown name in an error


class ConfigurationError(UserError, ValueError):
    """A configuration file cannot be used; the message says where and why."""


class CheckedTable:
    """One table of a TOML file, with the names needed for a good error."""

    def __init__(self, values: Mapping[str, object], *, file: str, section: str = "") -> None:
        self._values = values
        self._file = file
        self._section = section
        # keys that a reader has asked for; `finish` refuses the rest
        self._asked: set[str] = set()

    @classmethod
    def from_file(cls, path: Path, changes: Sequence[Change] = (), *, bases: Path | None = None) -> Self:
        """The top table of a TOML file, with `changes` laid over it.

        bases: folder of the files that a key `base` may name; what the file does not say is as in its base.
        """
        values = read_toml(path)
        if bases is not None and "base" in values:
            # a base is merged before --set, so that --set has the last word
            values = _merged(read_toml(_base(path, values.pop("base"), bases)), values)
        file = f"{path} with --set" if changes else str(path)
        for key, value in changes:
            _lay_over(values, key, value, file)
        return cls(values, file=file)

    @property
    def file(self) -> str:
        """The file this table is from, as given."""
        return self._file

    @property
    def values(self) -> Mapping[str, object]:
        """The table as it was read, unchecked."""
        return self._values

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def keys(self) -> list[str]:
        """The keys of the table in the order of the file."""
        return list(self._values)

    def number(
        self,
        key: str,
        *,
        unit: str,
        low: float = -math.inf,
        high: float = math.inf,
        default: float | None = None,
    ) -> float:
        """The number at `key` in `unit`, within [low, high]; `default` where the key is absent."""
        bounded = math.isfinite(low) and math.isfinite(high)
        permitted = f"{low:g}..{high:g} {unit}" if bounded else f"a number of {unit}"
        value = self._value(key, default, permitted)
        # bool is a subclass of int in Python: `mass = true` must not read as 1 kg
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"= {value!r} is not a number of {unit}")
        self._refuse_beyond_floats(key, value)
        if not low <= value <= high:
            raise self.error(key, f"= {value} {unit} is outside {low:g}..{high:g} {unit}")
        return float(value)

    def integer(self, key: str, *, low: int, high: int, default: int | None = None) -> int:
        """The whole number at `key`, within [low, high]."""
        value = self._value(key, default)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, f"= {value!r} is not a whole number")
        if not low <= value <= high:
            raise self.error(key, f"= {value} is outside {low}..{high}")
        return value

    def text(self, key: str, *, default: str | None = None) -> str:
        """The non-empty text at `key`."""
        value = self._value(key, default)
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"= {value!r} is not a text")
        return value

    def choice(self, key: str, choices: Sequence[str]) -> str:
        """The text at `key`, one of `choices`."""
        value = self.text(key)
        if value not in choices:
            raise self.error(key, f"= {value!r} is not one of {', '.join(choices)}")
        return value

    def flag(self, key: str, *, default: bool) -> bool:
        """true or false at `key`."""
        value = self._value(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"= {value!r} is neither true nor false")
        return value

    def texts(self, key: str, *, count: int) -> tuple[str, ...]:
        """The `count` non-empty texts at `key`."""
        value = self._value(key, None)
        if not isinstance(value, list) or len(value) != count:
            raise self.error(key, f"= {value!r} is not a list of {count} texts")
        items = CheckedTable(
            {f"{key}[{i}]": item for i, item in enumerate(value)}, file=self._file, section=self._section
        )
        return tuple(items.text(f"{key}[{i}]") for i in range(count))

    def one_or_more(self, key: str) -> tuple[str | float, ...]:
        """The text or number at `key`, or those of a list there; at least one."""
        value = self._value(key, None)
        items = value if isinstance(value, list) else [value]
        if not items or any(
            isinstance(item, bool) or not isinstance(item, str | int | float) for item in items
        ):
            raise self.error(key, f"= {value!r} is neither a text or number nor a list of them")
        for item in items:
            self._refuse_beyond_floats(key, item)
        return tuple(items)

    def numbers(self, key: str, *, unit: str, count: int, low: float, high: float) -> tuple[float, ...]:
        """The `count` numbers at `key`, each within [low, high]."""
        value = self._value(key, None)
        if not isinstance(value, list) or len(value) != count:
            raise self.error(key, f"= {value!r} is not a list of {count} numbers of {unit}")
        items = CheckedTable(
            {f"{key}[{i}]": item for i, item in enumerate(value)}, file=self._file, section=self._section
        )
        return tuple(items.number(f"{key}[{i}]", unit=unit, low=low, high=high) for i in range(count))

    def points(self, key: str, *, unit: str, low: float, high: float) -> tuple[tuple[float, float], ...]:
        """The [time_s, value] pairs at `key`: times from 0 on, never falling; values within [low, high]."""
        value = self._value(key, None)
        if not isinstance(value, list) or not value:
            raise self.error(key, f"= {value!r} is not a list of [time_s, value] pairs")
        pairs: list[tuple[float, float]] = []
        for i, pair in enumerate(value):
            if not isinstance(pair, list) or len(pair) != 2:
                raise self.error(f"{key}[{i}]", f"= {pair!r} is not a [time_s, value] pair")
            item = CheckedTable(
                {"time": pair[0], "value": pair[1]}, file=self._file, section=f"{self._path(key)}[{i}]"
            )
            # equal times are allowed: two points at one time are a step
            time = item.number("time", unit="s", low=pairs[-1][0] if pairs else 0.0)
            pairs.append((time, item.number("value", unit=unit, low=low, high=high)))
        return tuple(pairs)

    def beside(self, key: str, *, default: str | None = None) -> Path:
        """The file that `key` names, beside the file of this table; ConfigurationError where there is none."""
        name, folder = self.text(key, default=default), Path(self._file).parent
        # os.path answers False for a name that is too long or holds a zero byte; Path would raise
        if not os.path.isfile(folder / name):  # noqa: PTH113
            raise self.error(key, f"= {name[:NAME_SHOWN]!r}: no such file in {folder}")
        return folder / name

    def table(self, key: str) -> "CheckedTable":
        """The table at `key`; an empty one where it is absent."""
        value = self._value(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"= {value!r} is not a table")
        return CheckedTable(cast("dict[str, object]", value), file=self._file, section=self._path(key))

    def tables(self, key: str) -> "list[CheckedTable]":
        """The tables of an array of tables, [[key]]; none where it is absent."""
        value = self._value(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self.error(key, f"= {value!r} is not an array of tables, [[{key}]]")
        return [
            CheckedTable(cast("dict[str, object]", item), file=self._file, section=f"{self._path(key)}[{i}]")
            for i, item in enumerate(value)
        ]

    def finish(self) -> None:
        """Refuse the keys that were not asked for."""
        for key in self._values:
            if key not in self._asked:
                raise self.unknown(key, self._asked)

    def unknown(self, key: str, known: Iterable[str]) -> ConfigurationError:
        """The error for an unknown key, with the most similar known one."""
        # sorted: the same error at every start, whatever the order of a set
        names = sorted(known)
        # most unknown keys are misspelt ones
        near = difflib.get_close_matches(key, names, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(names)}"
        return self.error(key, f"is not a known key; {hint}")

    def error(self, key: str, what: str) -> ConfigurationError:
        """An error about `key`, naming the file and the full key."""
        return ConfigurationError(f"{self._file}: {self._path(key)} {what}")

    def _refuse_beyond_floats(self, key: str, value: object) -> None:
        # TOML's whole numbers have no limit in Python, and a float of one raises
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise self.error(key, f"= a whole number of {len(str(abs(value)))} digits is too large")

    def _path(self, key: str) -> str:
        return f"{self._section}.{key}" if self._section else key

    def _value(self, key: str, default: object, permitted: str = "") -> object:
        """The value at `key`; where there is none, the error says what is permitted."""
        self._asked.add(key)
        # TOML has no null, so None can only mean that the key is absent
        value = self._values.get(key, default)
        if value is None:
            raise self.error(key, f"is missing ({permitted})" if permitted else "is missing")
        return value


def read_toml(path: Path) -> dict[str, object]:
    """The values of a TOML file, unchecked. Raises ConfigurationError where it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    # a UTF-16 file from an editor is as common as a missing one
    except (OSError, UnicodeDecodeError) as error:
        cause = error.strerror if isinstance(error, OSError) else f"not UTF-8, {error}"
        raise ConfigurationError(f"{path}: cannot be read: {cause}") from error
    except RecursionError:
        # tomllib calls itself for every bracket
        raise ConfigurationError(f"{path}: not valid TOML: brackets nested hundreds deep") from None
    # ValueError beside TOMLDecodeError: an integer of more than 4300 digits
    except ValueError as error:
        raise ConfigurationError(f"{path}: not valid TOML: {error}") from error


def find_file(name_or_path: str | Path, folder: Path, what: str) -> Path:
    """The TOML file of that name in `folder`, or the file at that path. ConfigurationError for a name that the folder has not."""
    if Path(name_or_path).suffix == ".toml":
        return Path(name_or_path)
    # a list instead of a look at the file: a name may be too long for one, or lead out of the folder
    known = sorted(file.stem for file in folder.glob("*.toml"))
    if str(name_or_path) not in known:
        shown = str(name_or_path)[:NAME_SHOWN]
        raise ConfigurationError(
            f"no {what} named {shown!r}; known: {', '.join(known)}, or give a path to a .toml file"
        )
    return folder / f"{name_or_path}.toml"


def _base(path: Path, name: object, bases: Path) -> Path:
    """The file that `path` names as its base."""
    known = sorted(file.stem for file in bases.glob("*.toml"))
    if name not in known:
        raise ConfigurationError(f"{path}: base = {name!r} is not one of {', '.join(known)}")
    return bases / f"{name}.toml"


def _merged(base: Mapping[str, object], over: Mapping[str, object]) -> dict[str, object]:
    """Both in one, table by table; where both have a value, that of `over`."""
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(below, dict) and isinstance(value, dict):
            value = _merged(below, value)
        merged[key] = value
    return merged


def _lay_over(values: dict[str, object], key: tuple[str, ...], value: object, file: str) -> None:
    """Set the value at a dotted key; missing tables on the way are created."""
    for depth, part in enumerate(key[:-1], 1):
        # --set may name a table that the file leaves out: its defaults are then laid over
        inner = values.setdefault(part, {})
        if not isinstance(inner, dict):
            raise ConfigurationError(
                f"{file}: {'.'.join(key)}: {'.'.join(key[:depth])} = {inner!r} is not a table"
            )
        values = cast("dict[str, object]", inner)
    values[key[-1]] = value
