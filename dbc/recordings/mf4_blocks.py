"""Checks the blocks of an MF4 before asammdf reads them: that each lies in the file, and each channel in its record.

asammdf's C code takes both from the file without checking them; a channel beyond its record ends the process.
Layout of the blocks: ASAM MDF 4.1, chapter 5.
"""

import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

HEADER_AT = 64
DATA = (b"##DT", b"##DZ", b"##SD", b"##RD", b"##DV")
"""Blocks that hold records and no links."""
_BLOCK = struct.Struct("<4s4xQQ")  # of every block: kind, length, number of links
_GROUP = struct.Struct(
    "<QQHHLLL"
)  # CG behind its links: record id, cycles, flags, separator, -, data bytes, invalidation bytes
_CHANNEL = struct.Struct(
    "<BBBBLLLL"
)  # CN: type, synchronisation, data type, bit, byte, bits, flags, invalidation bit
_IN_RECORD = (0, 1, 2, 4)
"""Channel types whose value, or the place of it, is in the record: fixed and variable length, master, synchronisation."""
_HAS_INVALIDATION = 1 << 1


class Broken(NamedTuple):
    """A block that does not lie within the file."""

    at: int
    kind: bytes


def broken_block(file: BinaryIO, size: int) -> Broken | None:
    """The first block, by following the links, that does not lie within the file; one that holds data only if no other is broken."""
    waiting, seen, broken = [HEADER_AT], {0, HEADER_AT}, []
    while waiting:
        at = waiting.pop()
        kind, length, links = _block(file, at, size)
        if not kind.startswith(b"##") or at + length > size:
            broken.append(Broken(at, kind))
        elif kind not in DATA:
            waiting += [link for link in links if link not in seen]
            seen.update(links)
    return min(broken, key=lambda block: (block.kind in DATA, block.at), default=None)


def channel_beyond_record(file: BinaryIO, size: int) -> int | None:
    """Where the first channel is described that reaches beyond the record of its group; None if there is none."""
    for group_at, first_channel in _groups(file, size):
        record = _fields(file, _GROUP, group_at, size)
        if record is None:
            continue
        data_bytes, invalidation_bytes = record[5:]
        for at in _channels(file, first_channel, size):
            channel = _fields(file, _CHANNEL, at, size)
            if channel is None:
                return at
            kind, _, _, bit, byte, bits, flags, invalid_at = channel
            reaches = byte + (bit + bits + 7) // 8
            if kind in _IN_RECORD and reaches > data_bytes:
                return at
            if flags & _HAS_INVALIDATION and invalid_at >= 8 * invalidation_bytes:
                return at
    return None


def _groups(file: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """Address of every channel group, and that of its first channel."""
    _, _, links = _block(file, HEADER_AT, size)
    for data_group in _chain(file, links[:1], size):
        _, _, below = _block(file, data_group, size)
        for group in _chain(file, below[1:2], size):
            _, _, of_group = _block(file, group, size)
            yield group, of_group[1] if len(of_group) > 1 else 0


def _channels(file: BinaryIO, first: int, size: int) -> Iterator[int]:
    """Address of every channel from `first` on, with the members of structures."""
    waiting, seen = [first], {0}
    while waiting:
        at = waiting.pop()
        if at in seen:
            continue
        seen.add(at)
        kind, _, links = _block(file, at, size)
        if kind == b"##CN":
            yield at
            waiting += links[:2]  # the next channel, and the first member of a structure


def _chain(file: BinaryIO, first: tuple[int, ...], size: int) -> Iterator[int]:
    """Addresses of a list of blocks whose first link is the next block; a circle is followed once."""
    at, seen = (first or (0,))[0], {0}
    while at not in seen:
        yield at
        seen.add(at)
        _, _, links = _block(file, at, size)
        at = links[0] if links else 0


def _block(file: BinaryIO, at: int, size: int) -> tuple[bytes, int, tuple[int, ...]]:
    """Kind, length and links of the block at an address; no kind where there can be none, no links where they cannot be."""
    if at > size - _BLOCK.size:  # a damaged link may be more than a file's position can be
        return b"", 0, ()
    file.seek(at)
    kind, length, count = _BLOCK.unpack(file.read(_BLOCK.size))
    if kind in DATA or _BLOCK.size + 8 * count > min(length, size - at):
        return kind, length, ()
    return kind, length, struct.unpack(f"<{count}Q", file.read(8 * count))


def _fields(file: BinaryIO, layout: struct.Struct, at: int, size: int) -> tuple[int, ...] | None:
    """The fields behind the links of a block; None where the file ends before."""
    _, _, links = _block(file, at, size)
    start = at + _BLOCK.size + 8 * len(links)
    if start + layout.size > size:
        return None
    file.seek(start)
    return layout.unpack(file.read(layout.size))
