"""What a DBC file says, as plain data: made by the reader (`dbc.definitions.parsing`) or by what is kept of it (`dbc.definitions.kept`), used by `dbc.database`."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from dbc.conduct import LossConduct, NodeConduct
from dbc.signal import Signal


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageDefinition:
    """One message."""

    name: str
    can_id: int  # Linux `can_id` word: with the flag a 29-bit identifier never equals an 11-bit one of the same number
    length: int  # bytes
    is_fd: bool = False
    is_j1939: bool = False
    cycle_ns: int = 0  # 0 where the DBC gives no cycle time
    send_type: str = "cyclic"
    is_optional: bool = False  # its sender may leave it out
    comment: str = ""
    senders: tuple[str, ...] = ()
    receivers: tuple[str, ...] = ()
    layout: tuple[Signal, ...] = ()
    # data id and mode of AUTOSAR E2E profile 1; None for a message without that profile
    profile: tuple[int, str] | None = None
    conduct: LossConduct = field(default_factory=LossConduct)  # what is asked of a controller that loses it


@dataclass(frozen=True, slots=True)
class Definition:
    """One file: its messages in their order, and what it asks of its controllers, by name."""

    messages: tuple[MessageDefinition, ...]
    nodes: Mapping[str, NodeConduct] = field(default_factory=dict)
