"""Formats decoded frames, one line each, for people (`--lines`) or programs (`--json`).

A line is

    (stamp) interface Message Signal=value unit, Signal=name, ...  [what is wrong with it]

A JSON line is an object with time_s, bus, id, and either message, senders and signals (by name: value, unit
and, where there is one, name), or data; values are the codec's own, null for those that are no number.
Findings, if any, are a list of texts.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import lru_cache

from bus import errors
from bus.frame import Frame
from dbc.errors import DecodeError
from hil.monitor.candump import Stamp, Stamper, identifier, short_form
from hil.monitor.integrity import Integrity
from hil.monitor.messages import Field, Messages, Number, Shown
from hil.monitor.source import Batch

_MICROSECOND = 1_000


class _View(ABC):
    """Base of both views: a line per selected frame."""

    def __init__(self, messages: Messages) -> None:
        self._messages = messages
        self._integrity = Integrity()

    def text(self, batch: Batch) -> str:
        """The batch's lines, each with its end."""
        lines = []
        for name, frame in batch.frames:
            shown = self._messages.of(frame.can_id)
            if shown is not None or self._messages.selection.everything:
                lines.append(f"{self._line(name, frame, frame.at_ns + batch.ahead_ns, shown)}\n")
        return "".join(lines)

    @abstractmethod
    def _line(self, name: str, frame: Frame, at_ns: int, shown: Shown | None) -> str:
        """Of a frame seen on the interface `name` at `at_ns` since 1970; shown: None if no DBC knows it."""

    def end(self) -> str:
        """Nothing."""
        return ""


class LinesView(_View):
    """`--lines`."""

    def __init__(self, messages: Messages, stamp: Stamp) -> None:
        super().__init__(messages)
        self._stamper = Stamper(stamp)
        self._width = 0

    def _line(self, name: str, frame: Frame, at_ns: int, shown: Shown | None) -> str:
        self._width = max(self._width, len(name))
        return f"{self._stamper.text(at_ns)}{name:>{self._width}}  {self._content(name, frame, shown)}"

    def _content(self, name: str, frame: Frame, shown: Shown | None) -> str:
        if shown is None:
            found = "; ".join(map(str, errors.findings(frame)))
            return f"{short_form(frame)}  [{found}]" if found else short_form(frame)
        findings = self._integrity.findings(name, frame, shown.codec)
        try:
            readings = shown.readings(frame.data)
        except DecodeError as error:
            return f"{short_form(frame)}  [{error}]"
        signals = ", ".join([f"{field.name}={field.text(value)}" for field, value in readings])
        wrong = f"  [{'; '.join(findings)}]" if findings else ""
        return f"{shown.codec.name} {signals}{wrong}"


class JsonView(_View):
    """`--json`."""

    def _line(self, name: str, frame: Frame, at_ns: int, shown: Shown | None) -> str:
        time_s = at_ns // _MICROSECOND / 1e6
        # assembled by hand: json.dumps of the whole object takes several times longer, and a saturated bus
        # brings thousands of frames a second
        head = f'"time_s": {time_s}, "bus": {_key(name)}, "id": "{identifier(frame.can_id)}"'
        return f"{{{head}, {self._content(name, frame, shown)}}}"

    def _content(self, name: str, frame: Frame, shown: Shown | None) -> str:
        if shown is None:
            return undecoded(frame, [str(finding) for finding in errors.findings(frame)])
        found = self._integrity.findings(name, frame, shown.codec)
        try:
            return decoded(shown, shown.readings(frame.data), found)
        except DecodeError as error:
            return undecoded(frame, [str(error)])


def decoded(shown: Shown, readings: Sequence[tuple[Field, Number]], findings: Sequence[str]) -> str:
    """The members of a decoded message's object, without the braces."""
    signals = ", ".join([f"{_key(field.name)}: {field.json(value)}" for field, value in readings])
    codec = shown.codec
    return f'"message": {_key(codec.name)}, "senders": {_list(codec.senders)}, "signals": {{{signals}}}{_found(findings)}'


def undecoded(frame: Frame, findings: Sequence[str]) -> str:
    """The members of any other frame's object."""
    return f'"data": "{frame.data.hex().upper()}"{_found(findings)}'


def _found(findings: Sequence[str]) -> str:
    return f', "findings": {json.dumps(list(findings))}' if findings else ""


@lru_cache(maxsize=4096)
def _key(name: str) -> str:
    return json.dumps(name)


@lru_cache(maxsize=4096)
def _list(names: tuple[str, ...]) -> str:
    return json.dumps(names)
