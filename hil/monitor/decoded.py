"""Decoded frames as text: one line each, for people (`--lines`) or programs (`--json`).

A line is

    (stamp) interface Message Signal=value unit, Signal=name, ...  [what is wrong with it]

A JSON line is an object with time_s, bus, id, and either message, senders and signals (by name: value, unit
and, where there is one, name), or data; values are the codec's own, null for those that are no number.
Findings, if any, are a list of texts.
"""

import json
import math
from typing import Any

from bus import errors
from bus.frame import Frame
from dbc.errors import DecodeError
from hil.monitor.candump import Stamp, Stamper, identifier, short_form
from hil.monitor.integrity import Integrity
from hil.monitor.messages import Messages, Number, Shown
from hil.monitor.source import Batch

_MICROSECOND = 1_000


class LinesView:
    """`--lines`."""

    def __init__(self, messages: Messages, stamp: Stamp) -> None:
        self._messages, self._stamper = messages, Stamper(stamp)
        self._integrity = Integrity()
        self._width = 0

    def text(self, batch: Batch) -> str:
        """The batch's lines, each with its end."""
        lines = []
        for name, frame in batch.frames:
            shown = self._messages.of(frame.can_id)
            if shown is None and not self._messages.selection.everything:
                continue
            self._width = max(self._width, len(name))
            stamp = self._stamper.text(frame.at_ns + batch.ahead_ns)
            lines.append(f"{stamp}{name:>{self._width}}  {self._content(name, frame, shown)}\n")
        return "".join(lines)

    def _content(self, name: str, frame: Frame, shown: Shown | None) -> str:
        if shown is None:
            found = "; ".join(map(str, errors.findings(frame)))
            return f"{short_form(frame)}  [{found}]" if found else short_form(frame)
        findings = self._integrity.findings(name, frame, shown.codec)
        try:
            values = shown.values(frame.data)
        except DecodeError as error:
            return f"{short_form(frame)}  [{error}]"
        signals = ", ".join(
            [
                f"{field.name}={field.text(values[field.name])}"
                for field in shown.fields
                if field.name in values
            ]
        )
        wrong = f"  [{'; '.join(findings)}]" if findings else ""
        return f"{shown.codec.name} {signals}{wrong}"

    def end(self) -> str:
        """Nothing."""
        return ""


class JsonView:
    """`--json`."""

    def __init__(self, messages: Messages) -> None:
        self._messages = messages
        self._integrity = Integrity()

    def text(self, batch: Batch) -> str:
        """The batch's objects, one per line."""
        objects = (self._object(name, frame, batch.ahead_ns) for name, frame in batch.frames)
        return "".join([f"{json.dumps(each)}\n" for each in objects if each is not None])

    def _object(self, name: str, frame: Frame, ahead_ns: int) -> dict[str, Any] | None:
        shown = self._messages.of(frame.can_id)
        if shown is None and not self._messages.selection.everything:
            return None
        head = {
            "time_s": (frame.at_ns + ahead_ns) // _MICROSECOND / 1e6,
            "bus": name,
            "id": identifier(frame.can_id),
        }
        if shown is None:
            return head | {"data": frame.data.hex().upper()} | _findings(map(str, errors.findings(frame)))
        try:
            content = described(shown, shown.values(frame.data))
        except DecodeError as error:
            return head | {"data": frame.data.hex().upper(), "findings": [str(error)]}
        return head | content | _findings(self._integrity.findings(name, frame, shown.codec))

    def end(self) -> str:
        """Nothing."""
        return ""


def described(shown: Shown, values: dict[str, Number]) -> dict[str, Any]:
    """A decoded message for programs."""
    signals: dict[str, Any] = {}
    for field in shown.fields:
        if field.name in values:
            value = values[field.name]
            signals[field.name] = {"value": value if math.isfinite(value) else None, "unit": field.unit}
            if label := field.label(value):
                signals[field.name]["name"] = label
    return {"message": shown.codec.name, "senders": list(shown.codec.senders), "signals": signals}


def _findings(found: Any) -> dict[str, Any]:
    texts = list(found)
    return {"findings": texts} if texts else {}
