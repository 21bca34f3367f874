"""The rest bus: the frames of simulated nodes, each at its time. Pure: times in, frames out.

A cyclic message is sent at its cycle time, an event message when one of its values changes or on demand; one that is both,
both. Counters go on through everything, also through `stop` and `resume`: the node stays alive, only its message stays away.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bus.frame import FD, Frame
from bus.user_error import UserError
from dbc.database import Database, MessageCodec
from dbc.errors import EncodeError
from dbc.protection import Protector
from dbc.signal import Signal
from testbench.restbus.generators import Constant, Generator

SPREAD_NS = 500_000
"""Offset between the first frames of two messages: they do not all compete for the bus at once."""


class RestBusError(UserError, ValueError):
    """A node, message, signal or value does not exist; the message says what there is."""


@dataclass(slots=True)
class _Message:
    """One message that is sent; due_ns: None for a message without cycle time."""

    codec: MessageCodec
    generators: dict[str, Generator]
    protector: Protector | None
    due_ns: int | None
    sent: int = 0
    stopped: bool = False
    asked: bool = False
    on_change: bool = False
    last: dict[str, float] = field(default_factory=dict)


class RestBus:
    """Sends the messages of some nodes. Times are those of the caller's monotonic clock [ns]."""

    def __init__(
        self,
        database: Database,
        nodes: Iterable[str],
        generators: Mapping[str, Generator] | None = None,
        *,
        start_ns: int = 0,
        without: Iterable[str] = (),
    ) -> None:
        """generators: by `Message.Signal`; signals without one have their start value, else the one nearest to 0.
        Those of messages of other nodes are left out: one values file serves every node of a DBC.

        without: nodes that are real; of a message with several senders nothing is sent where one of them is.
        """
        wanted, real = set(nodes), set(without)
        known = {node for codec in database.by_name.values() for node in codec.senders}
        for node in (*sorted(wanted), *sorted(real)):
            if node not in known:
                raise RestBusError(
                    f"node {node!r}: no message of {database.source} comes from it; there are {', '.join(sorted(known))}"
                )
        self._start_ns = start_ns
        self._messages: dict[str, _Message] = {}
        for codec in database.by_name.values():
            # the real node sends it: two senders of one identifier would spoil its counter
            if wanted.intersection(codec.senders) and not real.intersection(codec.senders):
                self._messages[codec.name] = self._made(codec, start_ns + len(self._messages) * SPREAD_NS)
        for name, generator in (generators or {}).items():
            message = name.partition(".")[0]
            # of another node of this DBC; a name that no message has is still an error
            if message in self._messages or message not in database.by_name:
                self.generate(name, generator)

    @staticmethod
    def _made(codec: MessageCodec, first_ns: int) -> _Message:
        return _Message(
            codec=codec,
            generators={signal.name: Constant(start_value(signal, codec)) for signal in codec.layout},
            protector=Protector(codec) if codec.protection is not None else None,
            due_ns=first_ns if codec.cycle_ns else None,
            on_change=codec.send_type != "cyclic" or not codec.cycle_ns,
        )

    @property
    def messages(self) -> tuple[str, ...]:
        """Names of the messages that are sent."""
        return tuple(self._messages)

    def _message(self, name: str) -> _Message:
        if name not in self._messages:
            raise RestBusError(f"{name!r}: not sent here; there are {', '.join(self._messages)}")
        return self._messages[name]

    def generate(self, name: str, generator: Generator) -> None:
        """From now on the values of `Message.Signal` come from this generator."""
        message, _, signal = name.partition(".")
        of = self._message(message)
        if signal not in of.codec.by_signal:
            raise RestBusError(
                f"{name!r}: {message} has no signal {signal!r}; it has {', '.join(of.codec.signals)}"
            )
        before, of.generators[signal] = of.generators[signal], generator
        try:
            # encoded on trial: an error is the caller's who set the value, and must not end the bus at a later tick
            self._data(of, 0.0)
        except RestBusError:
            of.generators[signal] = before  # a value that cannot be sent leaves the old one
            raise

    def set(self, name: str, value: float | str) -> None:
        """From now on `Message.Signal` has this value, in the DBC's unit or by its name in the value table."""
        message, _, signal = name.partition(".")
        choices = {
            label: raw
            for found in [self._message(message).codec.by_signal.get(signal)]
            if found is not None
            for raw, label in found.choices.items()
        }
        try:
            level = float(choices.get(str(value), value))
        except ValueError:
            names = f"; its values are {', '.join(choices)}" if choices else ""
            raise RestBusError(f"{name} = {value!r} is no value{names}") from None
        self.generate(name, Constant(level))

    def stop(self, *names: str) -> None:
        """These messages stay away."""
        for name in names:
            self._message(name).stopped = True

    def resume(self, now_ns: int, *names: str) -> None:
        """These messages are sent again, at once and then cyclically."""
        for name in names:
            of = self._message(name)
            of.stopped = False
            if of.due_ns is not None:
                # not at the time it was due before it stopped: that lies in the past, and its phase means nothing any
                # more
                of.due_ns = now_ns

    def send(self, name: str) -> None:
        """Send this message once with the next `due`."""
        self._message(name).asked = True

    def next_ns(self) -> int | None:
        """When the next cyclic frame is due; None if there is none."""
        times = [of.due_ns for of in self._messages.values() if of.due_ns is not None and not of.stopped]
        return min(times, default=None)

    def due(self, now_ns: int) -> list[Frame]:
        """The frames to send now, in the order in which they were due. A time that was missed is skipped, as controllers do."""
        made: list[tuple[int, Frame]] = []
        time_s = (now_ns - self._start_ns) * 1e-9
        for of in self._messages.values():
            if not (of.on_change or of.asked) and (of.due_ns is None or of.due_ns > now_ns):
                continue  # most messages most of the time
            due_ns = self._take(of, now_ns, time_s)
            if due_ns is None:
                continue
            data = self._data(of, time_s)
            if of.protector is not None:
                # here and not where the value is made: the counter has to count frames that are sent
                data = of.protector.protect(data)
            of.sent += 1
            of.asked = False
            made.append((due_ns, Frame(of.codec.can_id, data, flags=FD if of.codec.is_fd else 0)))
        # in the order of the DBC its first message would always be sent first, which no real bus does
        return [frame for _, frame in sorted(made, key=lambda each: each[0])]

    def _take(self, of: _Message, now_ns: int, time_s: float) -> int | None:
        """When the frame of a message was due that is to be sent now; None for none."""
        if of.stopped:
            return None
        due_ns: int | None = now_ns if of.asked else None
        if of.due_ns is not None and of.due_ns <= now_ns:
            due_ns, cycle = of.due_ns, of.codec.cycle_ns
            # on its own grid, however late this look is; missed times are not sent in a burst
            of.due_ns += cycle * ((now_ns - of.due_ns) // cycle + 1)
        if due_ns is None and of.on_change:
            values = self._values(of, time_s)
            # the first look only remembers: nothing has changed yet
            if of.last and values != of.last:
                due_ns = now_ns
            of.last = values
        return due_ns

    @staticmethod
    def _values(of: _Message, time_s: float) -> dict[str, float]:
        return {name: generator.value(time_s, of.sent) for name, generator in of.generators.items()}

    def _data(self, of: _Message, time_s: float) -> bytes:
        try:
            return of.codec.encode_dict(self._values(of, time_s))
        except EncodeError as error:
            raise RestBusError(str(error)) from None


def start_value(signal: Signal, codec: MessageCodec) -> float:
    """The DBC's start value of a signal in its unit; without one the value in its range that is nearest to 0."""
    if signal.start_value is not None:
        return float(signal.start_value * signal.scale + signal.offset)
    if signal.is_multiplexer:
        # A multiplexer has to select something, or the frame cannot be made.
        branches = [
            min(s.multiplexer_ids) for s in codec.layout if s.multiplexer == signal.name and s.multiplexer_ids
        ]
        return float(min(branches, default=0))
    if signal.is_float:
        return 0.0
    low, high = sorted(raw * signal.scale + signal.offset for raw in signal.raw_range)
    return float(min(max(0.0, low), high))
