"""Reads a DBC file; gives for each message functions between frame bytes and physical values.

cantools reads a file that is new (`dbc.definitions.parsing`, `dbc.definitions.kept`); the functions are generated at load time (`dbc.codegen`)
and give cantools' values bit for bit, with value tables left as numbers.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Self

from bus.frame import EXTENDED
from dbc import codegen
from dbc.conduct import NodeConduct
from dbc.definitions.definition import MessageDefinition
from dbc.definitions.kept import keep, recall
from dbc.definitions.limits import read_text
from dbc.definitions.parsing import parse
from dbc.errors import DatabaseError, DecodeError, EncodeError
from dbc.j1939 import pgn
from dbc.protections import Profile1, Protection, ProtectionError
from dbc.signal import Signal

Number = int | float


class MessageCodec:
    """One message: its definition in the DBC, and its codec.

    decode(data): tuple of physical values in the order of `signals` (unmultiplexed messages).
    encode(values): frame bytes from physical values in that order (unmultiplexed messages).
    """

    decode: Callable[[bytes], tuple[Number, ...]]
    encode: Callable[[Sequence[Number]], bytes]

    def __init__(self, message: MessageDefinition) -> None:
        self.name = message.name
        self.comment = message.comment
        self.can_id = message.can_id  # Linux `can_id` word
        self.length = message.length  # bytes
        self.is_fd = message.is_fd
        self.cycle_ns = message.cycle_ns  # 0 where the DBC gives no cycle time
        self.senders = message.senders
        self.receivers = message.receivers
        self.layout = message.layout
        self.signals: tuple[str, ...] = tuple(signal.name for signal in self.layout)
        self.by_signal: Mapping[str, Signal] = {signal.name: signal for signal in self.layout}
        self.is_multiplexed: bool = any(signal.multiplexer is not None for signal in self.layout)
        self.send_type = message.send_type
        self.is_optional = message.is_optional  # its sender may leave it out
        self.is_j1939 = message.is_j1939
        profile = None if message.profile is None else Profile1(*message.profile)
        # data id of AUTOSAR E2E profile 1; None for a message without that profile
        self.e2e_data_id: int | None = None if profile is None else profile.data_id
        self.protection: Protection | None = profile  # counter and checksum; None for an unprotected message
        # the other messages of the database that profile 1 protects, by name; filled by `Database`
        self.neighbours: Mapping[str, Profile1] = {}
        # what the DBC asks of a controller that loses this message, see `dbc.conduct`
        self.conduct = message.conduct
        self._compile()

    def __repr__(self) -> str:
        return f"<{self.name} 0x{self.can_id & ~EXTENDED:X}, {self.length} bytes: {', '.join(self.signals)}>"

    @property
    def is_owed(self) -> bool:
        """Whether a sender that is there has to send it: it is cyclic, and may not be left out."""
        return bool(self.cycle_ns) and not self.is_optional

    @property
    def profile(self) -> Profile1 | None:
        """The protection if it is E2E profile 1, which the DBC describes; None otherwise."""
        return self.protection if isinstance(self.protection, Profile1) else None

    def _compile(self) -> None:
        layout, length = self.layout, self.length
        if self.is_multiplexed:
            # the signals of a multiplexed message differ from frame to frame: no fixed tuple, so the dict form is used
            self.decode, self.encode = self._refuse_decode, self._refuse_encode
        else:
            self.decode = codegen.compile_function(codegen.decode_source(layout, length), self.name, layout)
            self.encode = codegen.compile_function(codegen.encode_source(layout, length), self.name, layout)

    @cached_property
    def _decode_branches(self) -> Callable[[bytes], dict[str, Number]]:
        return codegen.compile_function(
            codegen.decode_dict_source(self.layout, self.length), self.name, self.layout
        )

    @cached_property
    def _encode_branches(self) -> Callable[[Mapping[str, Number]], bytes]:
        return codegen.compile_function(
            codegen.encode_dict_source(self.layout, self.length), self.name, self.layout
        )

    def decode_dict(self, data: bytes) -> dict[str, Number]:
        """Physical values by signal name; of a multiplexed message those that are present."""
        return (
            self._decode_branches(data)
            if self.is_multiplexed
            else dict(zip(self.signals, self.decode(data), strict=True))
        )

    def encode_dict(self, values: Mapping[str, Number]) -> bytes:
        """Frame bytes from physical values by signal name; bits of absent signals are 0."""
        try:
            if self.is_multiplexed:
                return self._encode_branches(values)
            return self.encode([values[name] for name in self.signals])
        except KeyError as missing:
            raise EncodeError(f"{self.name}: no value for signal {missing.args[0]}") from None
        except DecodeError as error:  # the value of a multiplexer
            raise EncodeError(str(error)) from None

    def _refuse_decode(self, data: bytes) -> tuple[Number, ...]:
        raise DecodeError(
            f"{self.name} is multiplexed, its signals vary from frame to frame: use decode_dict"
        )

    def _refuse_encode(self, values: Sequence[Number]) -> bytes:
        raise EncodeError(
            f"{self.name} is multiplexed, its signals vary from frame to frame: use encode_dict"
        )


class Database:
    """The messages of one DBC file, by name and by `can_id` word."""

    def __init__(
        self, source: str, codecs: Iterable[MessageCodec], nodes: Mapping[str, NodeConduct] | None = None
    ) -> None:
        """nodes: what the DBC asks of its controllers, by name."""
        self.source = source
        self.nodes: Mapping[str, NodeConduct] = dict(nodes or {})
        every = tuple(codecs)
        self.by_name: dict[str, MessageCodec] = {codec.name: codec for codec in every}
        self.by_id: dict[int, MessageCodec] = {codec.can_id: codec for codec in every}
        # reversed, so that of several messages with one parameter group the first of the file stays
        self.by_pgn: dict[int, MessageCodec] = {
            pgn(codec.can_id): codec for codec in reversed(every) if codec.is_j1939
        }
        # the signal that carries the standard deviation of another one, by the name `Message.Signal` of that one
        self.uncertainties: Mapping[str, tuple[MessageCodec, Signal]] = self._uncertainties()
        self._introduce()

    def _uncertainties(self) -> dict[str, tuple[MessageCodec, Signal]]:
        found = {}
        for codec in self.by_name.values():
            for signal in codec.layout:
                if not (of := signal.uncertainty_of):
                    continue
                message, _, name = of.partition(".")
                if message not in self.by_name or name not in self.by_name[message].by_signal:
                    raise ValueError(
                        f"signal {codec.name}.{signal.name}: UncertaintyOf {of!r} is no Message.Signal of this DBC"
                    )
                found[of] = (codec, signal)
        return found

    def _introduce(self) -> None:
        """Let the messages of profile 1 know each other: a receiver names the one that a masqueraded frame is."""
        protected = {name: codec.profile for name, codec in self.by_name.items() if codec.profile is not None}
        for codec in self.by_name.values():
            codec.neighbours = {
                name: profile
                for name, profile in protected.items()
                if codec.profile is None or profile.data_id != codec.profile.data_id
            }

    def protect_with(self, protections: Mapping[str, Protection]) -> None:
        """Take a user's protections for messages; ProtectionError for a message that is not there.

        They replace what the DBC says, before any frame is sent or judged.
        """
        for name, protection in protections.items():
            if name not in self.by_name:
                raise ProtectionError(f"PROTECTIONS: {self.source} has no message {name!r}")
            self.by_name[name].protection = protection
        self._introduce()

    @classmethod
    def from_file(cls, path: str | Path, *, strict: bool = True) -> Self:
        """Read a DBC file; `strict` refuses signals that overlap or do not fit their message."""
        text = read_text(Path(path))
        kept = recall(text, strict=strict)
        definition = parse(path, text, strict=strict) if kept is None else kept
        try:
            made = cls(str(path), map(MessageCodec, definition.messages), definition.nodes)
        except (ValueError, OverflowError, TypeError) as error:
            raise DatabaseError(f"{path}: {error}") from error
        if kept is None:
            keep(text, definition, strict=strict)
        return made

    def match(self, can_id: int) -> MessageCodec | None:
        """The message of a frame: by exact id, else a J1939 one by parameter group.

        J1939 puts priority and source address into the identifier; another sender's or
        priority's frame carries the same signals.
        """
        codec = self.by_id.get(can_id)
        return codec if codec is not None or not can_id & EXTENDED else self.by_pgn.get(pgn(can_id))
