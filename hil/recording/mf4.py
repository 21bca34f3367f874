"""Writes MF4 bus logging (ASAM MDF 4.10) for the recorder; the file is valid after every batch.

asammdf makes the structure without any record. Each batch is appended as a data block (DT) with a data list (DL) of its
own, which is then linked from the list before it. Last the number of records is raised.
"""

import datetime
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.v4_blocks import SourceInformation
from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS
from numpy.typing import NDArray

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE
from bus.hub.packet import FD_LENGTHS
from hil.recording.new_file import NewFile
from hil.recording.ring import Records

_BLOCK = struct.Struct("<4s4xQQ")  # of every block: kind, length, number of links
_DATA_LINK = 40  # of a data group (DG): third link
_CYCLES = 80  # of a channel group (CG): after six links and the record id
_DATA_LIST = struct.Struct("<4s4xQQ QQ B3xLQ")  # DL: next list, data block; flags, number of blocks, offset
_WORD = struct.Struct("<Q")
_FLAGS = [(name, "u1") for name in ("Dir", "EDL", "BRS", "ESI")]
_CODES = np.zeros(65, np.uint8)
_CODES[sorted(FD_LENGTHS)] = np.arange(16)


def _structure(name: str, width: int) -> np.dtype[np.void]:
    fields: list[Any] = [
        ("BusChannel", "u1"),
        ("ID", "<u4"),
        ("IDE", "u1"),
        ("DLC", "u1"),
        ("DataLength", "u1"),
    ]
    if width:
        fields.append(("DataBytes", "u1", (width,)))
    return np.dtype([(f"{name}.{field[0]}", *field[1:]) for field in (*fields, *_FLAGS)])


class _Group:
    """One channel group: the addresses in the file that have to be patched when a batch is appended."""

    def __init__(self, name: str, width: int) -> None:
        self.name, self.width = name, width
        self.structure = _structure(name, width)
        self.record = np.dtype([("time", "<f8"), ("frame", self.structure)])
        self.cycles_at = self.link_at = self.count = 0


_CLASSIC, _FD_FRAMES, _ERRORS, _REMOTES = range(4)


class Mf4Writer:
    """An MF4 file; classic and CAN FD frames, error frames and remote frames in a group each."""

    def __init__(self, path: Path, channels: int) -> None:
        """channels: number of buses, all numbered from 0 as python-can does."""
        if channels > 256:
            raise ValueError(f"channels={channels}: at most 256")
        self._file = NewFile(path)
        self._groups = (
            _Group("CAN_DataFrame", 8),
            _Group("CAN_DataFrame", 64),
            _Group("CAN_ErrorFrame", 8),
            _Group("CAN_RemoteFrame", 0),
        )
        self._start_ns: int | None = None

    def write(self, records: Records) -> None:
        """A data block per group that has frames in this batch; the first batch brings the structure."""
        if not len(records):
            return
        if self._start_ns is None:
            self._start_ns = int(records["at_ns"][0]) // 1000 * 1000
            self._file.append(_empty(self._groups, self._start_ns))
        word = records["can_id"]
        kinds = np.where(records["flags"] & FD, _FD_FRAMES, _CLASSIC)
        kinds[word & REMOTE != 0] = _REMOTES
        kinds[word & ERROR != 0] = _ERRORS
        for kind, group in enumerate(self._groups):
            if np.any(chosen := kinds == kind):
                self._append(group, _filled(group, records[chosen], self._start_ns))

    def _append(self, group: _Group, rows: NDArray[np.void]) -> None:
        content = rows.tobytes()
        padding = bytes(-len(content) % 8)
        block = _BLOCK.pack(b"##DT", _BLOCK.size + len(content), 0) + content + padding
        block_at = self._file.size
        list_at = block_at + len(block)
        offset = group.count * rows.dtype.itemsize
        listed = _DATA_LIST.pack(b"##DL", _DATA_LIST.size, 2, 0, block_at, 0, 1, offset)
        # The order makes the file valid at every moment: blocks first, then the link to them, then the count. A kill
        # in between leaves blocks that nothing refers to.
        self._file.append(block + listed)
        self._file.patch(group.link_at, _WORD.pack(list_at))
        group.count += len(rows)
        self._file.patch(group.cycles_at, _WORD.pack(group.count))
        group.link_at = list_at + _BLOCK.size

    def size(self) -> int:
        """Bytes in the file."""
        return self._file.size

    def close(self) -> None:
        """Close the file, which is whole already."""
        self._file.close()


def _empty(groups: tuple[_Group, ...], start_ns: int) -> bytes:
    """An MF4 with the groups but no record; sets in each group the addresses to be patched."""
    source = SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN)
    target = io.BytesIO()
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.datetime.fromtimestamp(0, datetime.UTC)
        mdf.header.abs_time = start_ns
        for group in groups:
            none = np.empty(0, group.structure)
            mdf.append(Signal(none, np.empty(0), name=group.name, source=source))
        mdf.save(target, compression=0)
    with MDF(io.BytesIO(target.getvalue())) as made:
        blocks: Any = made.groups
        for group, found in zip(groups, blocks, strict=True):
            assert found.channel_group.samples_byte_nr == group.record.itemsize
            group.link_at = found.data_group.address + _DATA_LINK
            group.cycles_at = found.channel_group.address + _CYCLES
    content = target.getvalue()
    return content + bytes(-len(content) % 8)


def _filled(group: _Group, records: Records, start_ns: int) -> NDArray[np.void]:
    """The group's records of frames."""
    rows = np.zeros(len(records), group.record)
    rows["time"] = (records["at_ns"] - start_ns) / 1e9
    word, length, flags = records["can_id"], records["length"], records["flags"]
    is_error = group.name == "CAN_ErrorFrame"
    values: dict[str, Any] = {
        "BusChannel": records["channel"],
        "ID": 0 if is_error else word & np.uint32(EXTENDED_MASK),
        "IDE": 0 if is_error else word & np.uint32(EXTENDED) != 0,
        "DLC": _CODES[length],
        "DataLength": 0 if group.name == "CAN_RemoteFrame" else length,
        "EDL": flags & FD != 0,
        "BRS": flags & BRS != 0,
        "ESI": flags & ESI != 0,
    }
    for name, value in values.items():
        rows["frame"][f"{group.name}.{name}"] = value
    if group.width:
        rows["frame"][f"{group.name}.DataBytes"] = records["data"][:, : group.width]
    return rows
