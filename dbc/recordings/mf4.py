"""Reads CAN frames from MF4 files (ASAM MDF 4, bus logging) through asammdf, a column at a time."""

import gc
import io
import struct
import sys
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Source
from asammdf.blocks.utils import MdfException
from numpy.typing import NDArray

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE
from dbc.errors import LogError
from dbc.recordings.logfile import Damage, FrameTable
from dbc.recordings.mf4_blocks import DATA, Broken, broken_block, channel_beyond_record

_KINDS = {"CAN_DataFrame": 0, "CAN_ErrorFrame": ERROR, "CAN_RemoteFrame": REMOTE}
"""Structures of the bus-logging standard, and what they add to the identifier."""
_UNREADABLE = (MdfException, OSError, ValueError, KeyError, IndexError, TypeError, AttributeError,
               OverflowError, MemoryError, struct.error, zlib.error)  # fmt: skip
"""What asammdf raises on a file that is cut off or damaged."""
_NUMBERS = {"ID", "IDE", "DLC", "DataLength", "EDL", "BRS", "ESI", "BusChannel"}
"""Fields of a frame that have to be one whole number each."""
_LENGTHS = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], np.uint8)
"""Data length of a data length code (ISO 11898-1, table 5)."""
_UNFINISHED = b"UnFinMF "


def read_mf4(path: Path, progress: Callable[[int, int], None] | None = None) -> FrameTable:
    """Every CAN frame of an MF4, in the order of time; channels are named can0 for bus channel 0, and so on.

    Stamps are rounded to the microsecond. LogError when asammdf cannot read the file's structure.
    """
    with path.open("rb") as file:
        unfinished = file.read(len(_UNFINISHED)) == _UNFINISHED
        size = path.stat().st_size
        broken = broken_block(file, size)
        if broken is not None and broken.kind not in DATA:
            raise LogError(
                f"{path}: byte {broken.at}: the MF4's structure breaks off here ({size} bytes in all), "
                "so its data cannot be found; was it cut off while being copied or written?"
            )
        if (at := channel_beyond_record(file, size)) is not None:
            raise LogError(
                f"{path}: byte {at}: the MF4 describes a channel that lies beyond its record; is the file damaged?"
            )
        file.seek(0)
        source: Any = io.BytesIO(file.read()) if unfinished else file  # finalising writes into the copy
        with closing(_opened(source, path)) as mdf:
            return _table(mdf, path, broken, progress)


def _opened(source: Any, path: Path) -> Any:
    before, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        return MDF(source)
    except _UNREADABLE as error:
        reason = str(error) or type(error).__name__
    finally:
        gc.collect()  # now, while messages are muted: asammdf's destructor fails on a half-built object
        sys.unraisablehook = before
    raise LogError(f"{path}: the MF4 cannot be read: {reason}")


def _table(
    mdf: Any, path: Path, broken: Broken | None, progress: Callable[[int, int], None] | None
) -> FrameTable:
    groups = [(index, name) for index, group in enumerate(mdf.groups) if (name := _bus_structure(group))]
    parts, damaged = [], []
    for done, (index, name) in enumerate(groups, 1):
        wanted = mdf.groups[index].channel_group.cycles_nr
        signal = _samples(mdf, name, index, wanted)
        count = 0 if signal is None else len(signal.timestamps)
        if count < wanted:
            reason = f"{wanted - count} of {wanted} records of group {index} ({name}) cannot be read"
            at = broken.at if broken else path.stat().st_size
            damaged.append(Damage(at, f"the data break off: {reason}", "byte", at_end=True))
        if count:
            parts.append(_columns(signal, name, mdf.header.abs_time, path))
        if progress is not None:
            progress(done, len(groups))
    return _joined(parts, tuple(damaged))


def _bus_structure(group: Any) -> str:
    """Name of the CAN structure that a channel group holds, '' if none."""
    channels, source = group.channel_group, group.channel_group.acq_source
    is_can = source is not None and source.bus_type == Source.BUS_TYPE_CAN
    if not is_can or not channels.cycles_nr:
        return ""
    return next((channel.name for channel in group.channels if channel.name in _KINDS), "")


def _samples(mdf: Any, name: str, group: int, wanted: int) -> Any:
    """The first records of a group, as many as can be read; None if that is none."""
    if (found := _get(mdf, name, group, wanted)) is not None:
        return found
    # bisection: asammdf raises for a range with one bad record, and does not say which
    readable, broken, best = 0, wanted, None
    while broken - readable > 1:
        count = (readable + broken) // 2
        if (found := _get(mdf, name, group, count)) is not None:
            readable, best = count, found
        else:
            broken = count
    return best


def _get(mdf: Any, name: str, group: int, count: int) -> Any:
    try:
        return mdf.get(name, group, raw=True, record_offset=0, record_count=count)
    except _UNREADABLE:
        return None


def _columns(signal: Any, name: str, start_ns: int, path: Path) -> tuple[NDArray[Any], ...]:
    """Columns of a FrameTable in its order, the channel by its own number. LogError where a field has not the form of the standard."""
    fields: dict[str, NDArray[Any]] = {
        field.removeprefix(f"{name}."): signal.samples[field] for field in signal.samples.dtype.names
    }
    for field in _NUMBERS & fields.keys():
        if fields[field].ndim != 1 or fields[field].dtype.kind not in "ui":
            raise LogError(
                f"{path}: the MF4's field {name}.{field} contains no whole numbers; is the file damaged?"
            )
    if "DataBytes" in fields and (fields["DataBytes"].ndim != 2 or fields["DataBytes"].dtype.kind != "u"):
        raise LogError(f"{path}: the MF4's field {name}.DataBytes contains no bytes; is the file damaged?")
    count = len(signal.timestamps)
    none = np.zeros(count, np.uint8)
    number = fields.get("ID", none).astype(np.uint32)
    extended = (fields["IDE"] != 0) if "IDE" in fields else (number & EXTENDED) != 0
    word = (number & EXTENDED_MASK) | np.uint32(_KINDS[name])
    if name != "CAN_ErrorFrame":
        word[extended] |= np.uint32(EXTENDED)
    codes = np.minimum(fields.get("DLC", none), 15)
    length = _LENGTHS[codes] if name == "CAN_RemoteFrame" else fields.get("DataLength", _LENGTHS[codes])
    data = np.atleast_2d(fields.get("DataBytes", none[:, np.newaxis]))
    flags = np.where(fields.get("EDL", none) != 0, FD, 0).astype(np.uint8)
    for field, bit in (("BRS", BRS), ("ESI", ESI)):
        flags |= np.where((flags != 0) & (fields.get(field, none) != 0), bit, 0).astype(np.uint8)
    microseconds = np.rint(signal.timestamps * 1e6).astype(np.int64) + round(start_ns / 1000)
    return microseconds * 1000, word, length.astype(np.uint8), flags, data, fields.get("BusChannel", none)


def _joined(parts: list[tuple[NDArray[Any], ...]], damaged: tuple[Damage, ...]) -> FrameTable:
    """One table in the order of time."""
    fd = any(int(part[2].max(initial=0)) > 8 for part in parts)
    kinds = (np.int64, np.uint32, np.uint8, np.uint8, np.uint8, np.uint8)
    empty = tuple(np.zeros((0, 1) if i == 4 else 0, kind) for i, kind in enumerate(kinds))
    widened = [(*part[:4], _of_width(part[4], 64 if fd else 8), part[5]) for part in (parts or [empty])]
    time_ns, can_id, length, flags, data, number = (
        np.concatenate(column) for column in zip(*widened, strict=True)
    )
    # groups are separate in the file (data, error, remote frames): merged by time
    order = np.argsort(time_ns, kind="stable")
    numbers, channel = np.unique(number, return_inverse=True)
    data = np.where(np.arange(data.shape[1]) < length[:, np.newaxis], data, 0)
    return FrameTable(
        time_ns=time_ns[order],
        can_id=can_id[order],
        length=length[order],
        flags=flags[order],
        data=np.ascontiguousarray(data[order], np.uint8),
        channel=channel.astype(np.uint8)[order],
        channels=tuple(f"can{number}" for number in numbers.tolist()),
        damaged=damaged,
        damaged_count=len(damaged),
    )


def _of_width(data: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    return np.pad(data[:, :width], ((0, 0), (0, max(0, width - data.shape[1]))))
