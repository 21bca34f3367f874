"""Looks up frames in the DBC files and selects the messages and signals that the user asked for."""

import difflib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fnmatch import fnmatchcase

from bus.frame import ERROR, REMOTE
from bus.user_error import UserError
from dbc.database import Database, MessageCodec
from dbc.signal import Signal

Number = int | float
ABSENT = "n/a"
_PROTECTION = ("Crc", "AliveCounter")
_MOST_DECIMALS = 6


class SelectionError(UserError, ValueError):
    """The user asked for a message, signal or sender that no DBC has."""


class Field:
    """One signal as it is shown: its value with unit, the name of its value, or n/a."""

    def __init__(self, signal: Signal) -> None:
        self.signal = signal
        self.name, self.unit = signal.name, signal.unit
        # by physical value: the codec decodes value tables as numbers
        self._labels = {raw * signal.scale + signal.offset: text for raw, text in signal.choices.items()}
        raw = signal.not_available
        if raw is not None:
            self._labels.setdefault(raw * signal.scale + signal.offset, ABSENT)
        number = f"%.{_MOST_DECIMALS}g" if signal.is_float else f"%.{_decimals(signal)}f"
        unit = signal.unit.replace("%", "%%")
        self._format = f"{number} {unit}" if unit else number
        self._json_unit = json.dumps(signal.unit)

    def label(self, value: Number) -> str:
        """The name that the value table or the DBC's range gives the value, '' for a plain number."""
        return self._labels.get(value, "")

    def text(self, value: Number) -> str:
        """The value as text, with as many decimals as the signal resolves."""
        return self._labels.get(value) or self._format % value

    def json(self, value: Number) -> str:
        """The value as a JSON object: value (null for NaN and infinity), unit, and name where it has one."""
        number = repr(value) if math.isfinite(value) else "null"
        label = self._labels.get(value)
        name = f', "name": {json.dumps(label)}' if label else ""
        return f'{{"value": {number}, "unit": {self._json_unit}{name}}}'


def _decimals(signal: Signal) -> int:
    """Number of decimals that keep neighbouring values different."""
    # 1e-9: log10 of a power of ten is off by a rounding error, which ceil would turn into one decimal more
    step = math.ceil(-math.log10(abs(signal.scale)) - 1e-9)
    exponent = Decimal(str(signal.offset)).normalize().as_tuple().exponent
    of_offset = -exponent if isinstance(exponent, int) else 0
    return min(max(step, of_offset, 0), _MOST_DECIMALS)


class Shown:
    """A message with its selected signals."""

    def __init__(self, codec: MessageCodec, fields: tuple[Field, ...]) -> None:
        self.codec, self.fields = codec, fields
        self._places = [(codec.signals.index(field.name), field) for field in fields]

    def readings(self, data: bytes) -> list[tuple[Field, Number]]:
        """The shown signals that the frame carries, with their physical values.

        DecodeError if the frame fits no such message.
        """
        if self.codec.is_multiplexed:
            decoded = self.codec.decode_dict(data)
            return [(field, decoded[field.name]) for field in self.fields if field.name in decoded]
        values = self.codec.decode(data)
        return [(field, values[index]) for index, field in self._places]


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The user's selection, as shell patterns; an empty part selects everything."""

    messages: Sequence[str] = ()
    senders: Sequence[str] = ()
    signals: Sequence[str] = ()  # `Signal` or `Message.Signal`
    protection: bool = False  # show CRC and counter too; when named in `signals` they are shown anyway

    @property
    def everything(self) -> bool:
        """Whether unknown frames are shown too."""
        return not (self.messages or self.senders or self.signals)

    def of(self, codec: MessageCodec) -> Shown | None:
        """The selected signals of a message; None if it is not selected."""
        if self.messages and not _any_matches(self.messages, [codec.name]):
            return None
        if self.senders and not _any_matches(self.senders, codec.senders):
            return None
        wanted = [signal for signal in codec.layout if self._wants(codec, signal)]
        if self.signals and not wanted:
            return None
        return Shown(codec, tuple(map(Field, wanted)))

    def _wants(self, codec: MessageCodec, signal: Signal) -> bool:
        if self.signals:
            return any(_names_signal(pattern, codec.name, signal.name) for pattern in self.signals)
        return self.protection or codec.protection is None or signal.name not in _PROTECTION


def _names_signal(pattern: str, message: str, signal: str) -> bool:
    """Whether a pattern means a signal: its name, or with a dot in the pattern its message's and its own."""
    return fnmatchcase(f"{message}.{signal}" if "." in pattern else signal, pattern)


def _any_matches(patterns: Iterable[str], names: Iterable[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns for name in names)


class Messages:
    """The DBC files as one table; the first that knows an identifier decides, J1939 by parameter group."""

    def __init__(self, databases: Sequence[Database], selection: Selection) -> None:
        """SelectionError if the selection names what no DBC has."""
        self._databases = databases
        self.selection = selection
        self._shown = {
            codec: shown
            for database in databases
            for codec in database.by_id.values()
            if (shown := selection.of(codec)) is not None
        }
        self._known: dict[int, Shown | None] = {}
        self._check()

    def of(self, can_id: int) -> Shown | None:
        """The selected signals of a frame; None if it is unknown or not selected."""
        if can_id not in self._known:
            codec = None if can_id & (ERROR | REMOTE) else self._codec(can_id)
            self._known[can_id] = None if codec is None else self._shown.get(codec)
        return self._known[can_id]

    def _codec(self, can_id: int) -> MessageCodec | None:
        # exact identifiers of all files before parameter groups: an own message must not be taken for a J1939 one
        exact = (database.by_id.get(can_id) for database in self._databases)
        grouped = (database.match(can_id) for database in self._databases)
        return next((codec for codec in (*exact, *grouped) if codec is not None), None)

    def expected_beside(self, codec: MessageCodec) -> list[Shown]:
        """The other cyclic messages that the sender of this one has to send, as far as they are selected."""
        database = next(d for d in self._databases if d.by_id.get(codec.can_id) is codec)
        return [
            self._shown[other]
            for other in database.by_id.values()
            if other in self._shown and other.is_owed and set(other.senders) & set(codec.senders)
        ]

    def _check(self) -> None:
        """Refuse a pattern that matches nothing: a misspelt name would show an empty table for ever."""
        codecs = [codec for database in self._databases for codec in database.by_id.values()]
        names = {
            "message": [codec.name for codec in codecs],
            "sender": [sender for codec in codecs for sender in codec.senders],
            "signal": [
                text for codec in codecs for name in codec.signals for text in (name, f"{codec.name}.{name}")
            ],
        }
        asked = (self.selection.messages, self.selection.senders, self.selection.signals)
        for (kind, known), patterns in zip(names.items(), asked, strict=True):
            for pattern in patterns:
                if not _any_matches([pattern], known):
                    near = difflib.get_close_matches(pattern, dict.fromkeys(known), n=3)
                    hint = f"; did you mean {', '.join(near)}?" if near else ""
                    sources = ", ".join(database.source for database in self._databases)
                    raise SelectionError(f"no {kind} '{pattern}' in {sources}{hint}")
        if not self._shown:
            raise SelectionError(
                "no message fulfils all conditions: leave out --message, --sender or --signals"
            )
