"""The files of the Cortex-M4F replay: frames, ticks and starts in, answers with instructions and stack out (runtime/cortex_m4/replay.c)."""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bus.frame import Frame

_RECORD: Final = struct.Struct("<BB2xI8sq")
_FRAME, _TICK, _START = range(3)
"""Kinds of records."""
_ANSWER: Final = 16
_MARK: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class Answers:
    """What a replay gave."""

    ticks: list[list[tuple[int, bytes]]]  # of each tick: identifier and data of its frames
    instructions: list[int]  # of each tick
    stack: int  # its depth [bytes]


def frames_file(file: Path, *drives: Iterable[tuple[Frame | None, int]]) -> None:
    """Write frames for the ECU, and ticks (None), with their times [ns]. The ECU starts anew before each drive."""
    with file.open("wb") as out:
        for calls in drives:
            out.write(_RECORD.pack(_START, 0, 0, b"", 0))
            for frame, now_ns in calls:
                if frame is None:
                    out.write(_RECORD.pack(_TICK, 0, 0, b"", now_ns))
                else:
                    out.write(_RECORD.pack(_FRAME, len(frame.data), frame.can_id, bytes(frame.data), now_ns))


def answers_of(file: Path) -> Answers:
    """Read what the replay wrote; ValueError where it did not come to its end."""
    raw = file.read_bytes()
    ticks: list[list[tuple[int, bytes]]] = []
    instructions: list[int] = []
    for at in range(0, len(raw) - _ANSWER + 1, _ANSWER):
        first, second, third, _ = struct.unpack_from("<4I", raw, at)
        if first == _MARK and second == _MARK:
            return Answers(ticks, instructions, third)
        if first == _MARK:
            ticks.append([])
            instructions.append(third)
        else:
            length = raw[at + 4]
            ticks[-1].append((first, raw[at + 8 : at + 8 + length]))
    raise ValueError(f"{file}: the replay did not come to its end")
