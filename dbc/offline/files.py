"""A table of one message as a CSV or a Parquet file, to which rows are appended.

A file is open only while it is written to: a DBC may have more messages than a process may have open files.
"""

import csv
import io
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dbc.database import MessageCodec

Rows = Mapping[str, Sequence[NDArray[Any]]]
"""Columns by name, each in parts; `channel` as numbers."""
_REPEATING_BITS = 12  # signals of so few bits repeat their values often


class TableFile(ABC):
    """time_s, the channel if there are several, further origins, then the signals."""

    def __init__(self, part: Path, codec: MessageCodec, kinds: Mapping[str, np.dtype[Any]]) -> None:
        """part: an empty file beside the final place. kinds: types of the signals."""
        self.has_channel = False
        self._part, self._codec, self._kinds = part, codec, kinds
        self._units = {name: codec.by_signal[name].unit for name in kinds}

    @abstractmethod
    def add_channel(self, name: str) -> None:
        """Have a column for the channel from now on; rows that were written before came from channel `name`."""

    @abstractmethod
    def append(self, rows: Rows, channels: Sequence[str]) -> None:
        """Write rows behind the others. channels: names by number."""

    @abstractmethod
    def close(self) -> None:
        """Write what a whole file needs at its end."""

    def move(self, target: Path) -> None:
        """Put the closed file into its place."""
        # a NamedTemporaryFile is readable by its owner only
        self._part.chmod(0o644)
        self._part.replace(target)

    def discard(self) -> None:
        """Remove the file if it was not moved."""
        self._part.unlink(missing_ok=True)

    def _rewrite(self, content: Callable[[Path], None]) -> None:
        """Let `content` write a second file, and take it for the first one."""
        second = self._part.with_name(f"{self._part.name}.2")
        try:
            content(second)
            second.replace(self._part)
        finally:
            second.unlink(missing_ok=True)


class CsvFile(TableFile):
    """Headers `Signal [unit]`; numbers in their shortest form that reads back to the same value."""

    _begun = False

    def append(self, rows: Rows, channels: Sequence[str]) -> None:
        """Write rows behind the others; the header before the first."""
        columns: list[list[Any]] = []
        headers = []
        for name, parts in rows.items():
            if name == "channel" and not self.has_channel:
                continue
            unit = self._units.get(name)
            headers.append(f"{name} [{unit}]" if unit else name)
            kind = self._kinds.get(name)
            values: list[Any] = []
            for part in parts:
                values += part.tolist() if kind is None else _as_python(part, kind)
            columns.append([channels[number] for number in values] if name == "channel" else values)
        with self._part.open("a", encoding="utf-8", newline="") as stream:
            out = csv.writer(stream, lineterminator="\n")
            if not self._begun:
                out.writerow(headers)
                self._begun = True
            out.writerows(zip(*columns, strict=True))

    def add_channel(self, name: str) -> None:
        """Copy the file line by line with the new column behind the first one."""
        self.has_channel = True
        if not self._begun:
            return
        field = io.StringIO()
        csv.writer(field, lineterminator="").writerow([name])

        def content(second: Path) -> None:
            with (
                self._part.open(encoding="utf-8", newline="") as old,
                second.open("w", encoding="utf-8", newline="") as new,
            ):
                between = "channel"
                # no value holds an end of line, and no header: names are identifiers, units printable
                for line in old:
                    stamp, _, others = line.partition(",")
                    new.write(f"{stamp},{between},{others}" if others else f"{line[:-1]},{between}\n")
                    between = field.getvalue()

        self._rewrite(content)

    def close(self) -> None:
        """A CSV file has no end."""


class _Sink:
    """What a ParquetWriter takes for a file: keeps what is written until `drain`."""

    closed = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self._waiting: list[bytes] = []
        self._size = 0

    def write(self, data: Any) -> int:
        self._waiting.append(bytes(data))
        self._size += len(self._waiting[-1])
        return len(self._waiting[-1])

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Nothing before `drain`: an OSError has to come out of our own call."""

    def close(self) -> None:
        """The file is closed between the calls."""

    def drain(self) -> None:
        """Append what waits to the file."""
        with self.path.open("ab") as file:
            file.writelines(self._waiting)
        self._waiting = []


class ParquetFile(TableFile):
    """Columns under their plain names; units and the message's comment as field and table metadata.

    Each `append` is a row group.
    """

    _writer: Any = None
    _sink: _Sink

    def append(self, rows: Rows, channels: Sequence[str]) -> None:
        """Write rows as a row group."""
        fields, arrays = [], []
        for name, parts in rows.items():
            if name == "channel":
                if not self.has_channel:
                    continue
                numbers = pa.array(np.concatenate(parts))
                column = pa.DictionaryArray.from_arrays(numbers, pa.array(channels)).cast(pa.string())
            elif (kind := self._kinds.get(name)) is None:
                column = pa.array(np.concatenate(parts))
            else:
                column = pa.chunked_array([_as_arrow(part, kind) for part in parts])
            unit = "s" if name == "time_s" else self._units.get(name)
            arrays.append(column)
            fields.append(pa.field(name, column.type, metadata=None if unit is None else {"unit": unit}))
        metadata = {"message": self._codec.name, "comment": self._codec.comment}
        table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=metadata))
        if self._writer is None:
            self._open(self._part, table.schema)
        self._writer.write_table(table, row_group_size=max(table.num_rows, 1))
        self._sink.drain()

    def _open(self, path: Path, schema: Any) -> None:
        # a dictionary of values that hardly repeat costs three times as long, and saves a tenth of the space
        repeating = [
            name for name in schema.names if name in ("channel", "source_address") or self._is_short(name)
        ]
        self._sink = _Sink(path)
        # the system's pool gives memory back between the row groups, the default one keeps 60 MB more
        self._writer = pq.ParquetWriter(
            self._sink,
            schema,
            use_dictionary=repeating,
            write_statistics=["time_s"],
            memory_pool=pa.system_memory_pool(),
        )

    def _is_short(self, name: str) -> bool:
        return name in self._kinds and self._codec.by_signal[name].length <= _REPEATING_BITS

    def add_channel(self, name: str) -> None:
        """Copy the file row group by row group with the new column behind the first one."""
        self.has_channel = True
        if self._writer is None:
            return
        self.close()

        def content(second: Path) -> None:
            with pq.ParquetFile(self._part) as old:
                for table in _row_groups(old):
                    column = pa.array([name]).take(pa.array(np.zeros(table.num_rows, np.int64)))
                    wider = table.add_column(1, "channel", column)
                    if self._writer is None:
                        self._open(second, wider.schema)
                    self._writer.write_table(wider, row_group_size=max(wider.num_rows, 1))
                    self._sink.drain()

        self._rewrite(content)
        self._sink.path = self._part

    def close(self) -> None:
        """Write the file's directory."""
        if self._writer is not None:
            self._writer.close()
            self._sink.drain()
            self._writer = None


def _row_groups(file: Any) -> Iterator[Any]:
    for number in range(file.num_row_groups):
        yield file.read_row_group(number)


def _as_python(values: NDArray[Any], kind: np.dtype[Any]) -> list[Any]:
    """The values in a column of `kind`; NaN where an integer is missing."""
    if values.dtype == kind:
        return values.tolist()
    if kind == np.float64:
        return values.astype(np.float64).tolist()
    # v != v: NaN
    return [v if v != v else int(v) for v in values.tolist()]


def _as_arrow(values: NDArray[Any], kind: np.dtype[Any]) -> Any:
    """The values in a column of `kind`; null where an integer is missing."""
    # integers beyond 64 bits have no type in Parquet: as floats, rounded
    if kind.kind in "fO":
        return pa.array(values.astype(np.float64, copy=False))
    if values.dtype == kind:
        return pa.array(values)
    missing = values != values
    return pa.array(np.where(missing, 0, values).astype(kind), mask=missing)
