"""Keeps the results of arms in a folder: one small Parquet file per arm, complete or absent, and all of them as one table.

DIR/work.json             what determines the results; results of other work are refused in this folder
DIR/arms/KEY.parquet      the row of a finished arm
DIR/results.parquet       all rows, arms that failed included
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from bus.user_error import UserError

Value = str | float | int | bool | None
Row = Mapping[str, Value]

KEY, FAILED = "key", "failed"
SHORT = 40  # characters of a value that is quoted in a message


class NotOurs(UserError, ValueError):
    """The folder contains results of other work, or cannot be written."""


class Store:
    """The folder of one work. Raises NotOurs."""

    def __init__(self, folder: Path, work: Mapping[str, Value]) -> None:
        self._arms, self._table = folder / "arms", folder / "results.parquet"
        text = json.dumps(work, indent=2, sort_keys=True) + "\n"
        file = folder / "work.json"
        try:
            self._arms.mkdir(parents=True, exist_ok=True)
            if file.exists():
                _check_same(folder, json.loads(file.read_text(encoding="utf-8")), work)
            else:
                _whole(file, text.encode())
        except OSError as error:
            raise NotOurs(f"{folder}: {error.strerror or error}") from error
        except json.JSONDecodeError as error:
            raise NotOurs(f"{file}: is damaged; remove {folder} to begin again") from error

    def __contains__(self, key: str) -> bool:
        return self._file(key).is_file()

    def keep(self, key: str, row: Row) -> None:
        """Write the row of a finished arm, completely or not at all."""
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist([{KEY: key, **row}]), sink)
        _whole(self._file(key), sink.getvalue().to_pybytes())

    def rows(self, keys: Iterable[str]) -> list[Row]:
        """Rows of the finished ones of these arms."""
        return [pq.read_table(self._file(key)).to_pylist()[0] for key in keys if key in self]

    def collect(self, keys: Iterable[str], failures: Mapping[str, str]) -> Path:
        """Write all rows as one table, with the reason in the column `failed` where an arm failed; returns its path."""
        rows: list[dict[str, Value]] = [{**row, FAILED: None} for row in self.rows(keys)]
        rows += [{KEY: key, FAILED: reason} for key, reason in failures.items()]
        columns = dict.fromkeys(name for row in rows for name in row)
        sink = pa.BufferOutputStream()
        pq.write_table(pa.table({name: [row.get(name) for row in rows] for name in columns}), sink)
        _whole(self._table, sink.getvalue().to_pybytes())
        return self._table

    def _file(self, key: str) -> Path:
        return self._arms / f"{quote(key, safe=' +,=()')}.parquet"


def _whole(file: Path, data: bytes) -> None:
    """Write a file so that it is complete or absent: a rename is atomic, also when the process is killed."""
    part = file.with_name(f".{file.name}.part")
    part.write_bytes(data)
    part.replace(file)


def _check_same(folder: Path, before: Mapping[str, Value], now: Mapping[str, Value]) -> None:
    for name in {**before, **now}:
        if before.get(name) != now.get(name):
            short = max(len(str(work.get(name))) for work in (before, now)) <= SHORT
            other = f"{name} = {before.get(name)!r}, not {now.get(name)!r}" if short else f"another {name}"
            raise NotOurs(
                f"{folder}: holds results of {other}; give another folder, or remove it to begin again"
            )
