"""Writes the tables of a recording, one per message, while it is decoded piece by piece.

Rows wait in memory until they fill BUFFERED bytes; then the longest tables are written, on all processors. Every
table is written beside its place and renamed at the end: all of it or nothing.
"""

import os
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dbc.columns import Columns, kind_in_tables
from dbc.j1939 import source_address
from dbc.offline.files import CsvFile, ParquetFile, TableFile
from dbc.recordings.logfile import FrameTable
from dbc.tables import Format, naming_the_file, target_of

BUFFERED = 16 << 20
"""Bytes of rows that wait in memory, of all tables together."""


class _Table:
    """The rows of one message that wait, and the file behind them."""

    def __init__(self, target: Path, file: TableFile) -> None:
        self.target, self.file = target, file
        self.waiting: list[dict[str, NDArray[Any]]] = []
        self.size = 0  # bytes that wait

    def add(self, columns: Columns, origin: Mapping[str, NDArray[Any]]) -> int:
        """Append rows; returns their bytes."""
        values = {"time_s": columns.time_s, **origin, **columns.signals}
        self.waiting.append(values)
        size = sum(column.nbytes for column in values.values())
        self.size += size
        return size

    def write(self, channels: tuple[str, ...]) -> None:
        """Hand what waits to the file. channels: names of all that are known; a column is made of them if they are several."""
        waiting, self.waiting, self.size = self.waiting, [], 0
        with naming_the_file(self.target):
            if len(channels) > 1 and not self.file.has_channel:
                self.file.add_channel(channels[0])
            if waiting:
                self.file.append({name: [rows[name] for rows in waiting] for name in waiting[0]}, channels)


class Tables:
    """The tables of one recording. To be entered: it leaves whole files after `finish`, else none."""

    def __init__(self, out: Path, log: Path, form: Format, *, several: bool, j1939: bool) -> None:
        """several: whether there are several recordings, which get a folder each. j1939: with a column for the source address."""
        self._out, self._log, self._form, self._several, self._j1939 = out, log, form, several, j1939
        self._tables: dict[str, _Table] = {}
        self._channels: tuple[str, ...] = ()
        self._size = 0
        self._pool = ThreadPoolExecutor(os.cpu_count() or 1)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(cancel_futures=True)
        for table in self._tables.values():
            table.file.discard()

    def take(self, frames: FrameTable, decoded: Mapping[str, Columns]) -> None:
        """Append a piece; TableError when a file cannot be written."""
        self._channels = frames.channels
        for name, columns in decoded.items():
            origin: dict[str, NDArray[Any]] = {"channel": frames.channel[columns.rows]}
            if self._j1939:
                origin["source_address"] = source_address(frames.can_id[columns.rows].astype(np.int64))
            if name not in self._tables:
                self._tables[name] = self._opened(name, columns)
            self._size += self._tables[name].add(columns, origin)
        if self._size > BUFFERED:
            ranked = sorted(self._tables.values(), key=lambda table: -table.size)
            chosen, left = list[_Table](), self._size
            while left > BUFFERED // 2:
                chosen.append(ranked[len(chosen)])
                left -= chosen[-1].size
            self._write(chosen)
            self._size = left

    def finish(self) -> None:
        """Write the rest, and put every table into its place."""
        tables = list(self._tables.values())
        self._write(tables)
        list(self._pool.map(_close, tables))
        for table in tables:
            with naming_the_file(table.target):
                table.file.move(table.target)

    def _opened(self, name: str, columns: Columns) -> _Table:
        target = target_of(self._out, self._log, name, self._form, several=self._several)
        kinds = {signal: kind_in_tables(columns.codec.by_signal[signal]) for signal in columns.signals}
        with naming_the_file(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(
                dir=target.parent, prefix=f".{target.name}.", delete=False
            ) as part:
                made = CsvFile if self._form is Format.CSV else ParquetFile
                return _Table(target, made(Path(part.name), columns.codec, kinds))

    def _write(self, tables: list[_Table]) -> None:
        # a list, so that the first error is raised here
        list(self._pool.map(lambda table: table.write(self._channels), tables))


def _close(table: _Table) -> None:
    with naming_the_file(table.target):
        table.file.close()
