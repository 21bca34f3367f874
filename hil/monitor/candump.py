"""Prints frames exactly as candump does, for `monitor --raw`: normal form and log form (can-utils 2020.11, Debian 12).

A line of the normal form is

    stamp, interface right-aligned, [RX or TX and the FD flags], identifier, [length], data, [text]

candump indents 11-bit identifiers once it has met a 29-bit one, widens the interface's column when it
meets a longer name, and numbers colours in the order in which interfaces first speak. `Candump` keeps
that state; everything else is a function of the frame.

Flags of CAN FD frames are those of Linux 6.1 and later, where every such frame carries CANFD_FDF.
"""

import time
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, LOCAL, REMOTE, STANDARD_MASK, Frame

_MICROSECOND, _SECOND = 1_000, 1_000_000_000
_RESET, _BOLD = "\33[0m", "\33[1m"
_COLOURS = tuple(_BOLD + code for code in ("\33[34m", "\33[31m", "\33[32m", "", "\33[35m", "\33[36m"))
_CLASSIC_MOST = 8
_BITS = tuple(f"{byte:08b}" for byte in range(256))
_HEX = tuple(f"{byte:02X}" for byte in range(256))
_PRINTABLE = "".join(chr(byte) if 0x1F < byte < 0x7F else "." for byte in range(256))


class Stamp(StrEnum):
    """The form of time stamps."""

    NONE = ""
    ABSOLUTE = "a"  # (seconds since 1970)
    DATE = "A"  # (date and local time)
    DELTA = "d"  # since the line before
    ZERO = "z"  # since the first line


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """What is shown, by candump's options."""

    stamp: Stamp = Stamp.NONE  # -t
    log: bool = False  # -L
    extra: bool = False  # -x: direction and flags
    text: bool = False  # -a
    binary: bool = False  # -i
    swapped: bool = False  # -S
    colour: int = 0  # how often -c was given


class Stamper:
    """Time stamps in brackets, with a blank behind; the first of DELTA and ZERO is zero."""

    def __init__(self, stamp: Stamp) -> None:
        self._stamp = stamp
        self._reference_us: int | None = None

    def text(self, wall_ns: int) -> str:
        """The stamp of the next line; wall_ns: when its frame came, since 1970."""
        at_us = wall_ns // _MICROSECOND
        match self._stamp:
            case Stamp.NONE:
                return ""
            case Stamp.ABSOLUTE:
                return f"({at_us // 1_000_000:010d}.{at_us % 1_000_000:06d}) "
            case Stamp.DATE:
                date = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at_us // 1_000_000))
                return f"({date}.{at_us % 1_000_000:06d}) "
        if self._reference_us is None:
            self._reference_us = at_us
        # stamps of several interfaces may run backwards by a little; candump prints no negative times
        since_us = max(0, at_us - self._reference_us)
        if self._stamp is Stamp.DELTA:
            self._reference_us = at_us
        return f"({since_us // 1_000_000:03d}.{since_us % 1_000_000:06d}) "


class Candump:
    """Lines of the frames of one run of candump, in the order in which they are given."""

    def __init__(self, style: Style, interfaces: tuple[str, ...] = ()) -> None:
        """interfaces: the names on the command line; their column has the width of the longest from the start."""
        self._style = style
        self._width = max(map(len, interfaces), default=0)
        self._numbers: dict[str, int] = {}
        self._names: dict[str, tuple[str, str]] = {}
        self._indent = False
        self._stamper = Stamper(style.stamp)

    def line(self, interface: str, frame: Frame, wall_ns: int) -> str:
        """One line without its end; wall_ns: when the frame came, since 1970."""
        if interface not in self._names:
            self._meet(interface)
        before, name = self._names[interface]
        if self._style.log:
            return log_line(name, frame, wall_ns, direction=self._style.extra)
        # state, as in candump: after the first 29-bit identifier the 11-bit ones are indented
        self._indent |= bool(frame.can_id & EXTENDED)
        style = self._style
        return (
            f" {before}{self._stamper.text(wall_ns)} {name}{_extra(frame) if style.extra else ''}"
            f"{_RESET if style.colour == 1 else ''}  {long_form(frame, style, indent=self._indent)}"
            f"{_RESET if style.colour > 1 else ''}"
        )

    def _meet(self, interface: str) -> None:
        """Number an interface that speaks for the first time, and make its column wide enough."""
        self._numbers[interface] = len(self._numbers)
        self._width = max(self._width, len(interface))
        colour, log = self._style.colour, self._style.log
        for known, number in self._numbers.items():
            ink = _COLOURS[number % len(_COLOURS)] if colour and not log else ""
            before, beside = (ink, "") if colour > 2 else ("", ink)
            self._names[known] = before, beside + known.rjust(self._width)


def log_line(interface: str, frame: Frame, wall_ns: int, *, direction: bool = False) -> str:
    """A line of candump's log format."""
    stamp = f"({wall_ns // _SECOND:010d}.{wall_ns % _SECOND // _MICROSECOND:06d})"
    origin = (" T" if frame.flags & LOCAL else " R") if direction else ""
    return f"{stamp} {interface} {short_form(frame)}{origin}"


def short_form(frame: Frame) -> str:
    """Identifier, '#' and data, as cansend takes them."""
    can_id, data, _, flags = frame
    if flags & FD:
        return f"{identifier(can_id)}##{flags & 0xF:X}{data.hex().upper()}"
    if can_id & REMOTE:
        return f"{identifier(can_id)}#R{len(data) or ''}"
    return f"{identifier(can_id)}#{data.hex().upper()}"


@lru_cache(maxsize=4096)
def identifier(can_id: int) -> str:
    """The identifier in three or eight digits, with the error bit but no other flag."""
    if can_id & ERROR:
        return f"{can_id & (EXTENDED_MASK | ERROR):08X}"
    return f"{can_id & EXTENDED_MASK:08X}" if can_id & EXTENDED else f"{can_id & STANDARD_MASK:03X}"


def _extra(frame: Frame) -> str:
    """Direction and flags, for -x."""
    direction = "TX" if frame.flags & LOCAL else "RX"
    return f"  {direction} {'B' if frame.flags & BRS else '-'} {'E' if frame.flags & ESI else '-'}"


def long_form(frame: Frame, style: Style, *, indent: bool) -> str:
    """Identifier, length and data, as people read them; indent: 11-bit identifiers stand below 29-bit ones."""
    can_id, data, _, flags = frame
    digits = identifier(can_id)
    head = f"{digits:>8}  " if indent or len(digits) > 3 else f"{digits}  "
    head += f"[{len(data):02d}]" if flags & FD else f" [{len(data)}]"
    if can_id & REMOTE and not flags & FD:
        return f"{head}  remote request"
    return head + " " + _bytes(data, style) + _behind(can_id, data, style)


def _bytes(data: bytes, style: Style) -> str:
    """The data, each byte behind a blank, or in reverse and marked."""
    if not data:
        return ""
    if not style.binary and not style.swapped:
        return f" {data.hex(' ').upper()}"
    digits = _BITS if style.binary else _HEX
    if style.swapped:
        return " " + "`".join([digits[byte] for byte in reversed(data)])
    return " " + " ".join([digits[byte] for byte in data])


def _behind(can_id: int, data: bytes, style: Style) -> str:
    """The text after data of at most eight bytes: the mark of an error frame, or the data as text."""
    if len(data) > _CLASSIC_MOST or not (style.text or can_id & ERROR):
        return ""
    room = (9 if style.binary else 3) * (_CLASSIC_MOST - len(data))
    if can_id & ERROR:
        return "ERRORFRAME".rjust(room + 13)
    quote = "`" if style.swapped else "'"
    text = (data[::-1] if style.swapped else data).decode("latin-1").translate(_PRINTABLE)
    return f"{quote.rjust(room + 4)}{text}{quote}"
