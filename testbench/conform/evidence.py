"""What a conformance test looks at: the frames of the tested node and of its inputs, from one recording."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE
from bus.user_error import UserError
from dbc.columns import decode_rows
from dbc.database import Database, MessageCodec
from dbc.recordings.logfile import FrameTable
from hil.timing.deadlines import Observer

SHARED_HOST_NS: Final = 100_000_000
"""How long a computer without a real-time kernel may keep a process waiting. On an idle virtual machine with two processors
gaps of 45 ms were seen in the frames of a process that needs 0.3 ms per tick, because the machine itself stood still."""
LATE_SHARE: Final = 0.05
"""Share of the bench's own times that may be late by 2 ms; beyond it the computer is too busy for a verdict on times."""


class ConformError(UserError, ValueError):
    """A conformance test cannot be made of this DBC, node or recording; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Traffic:
    """The rows of one message in the table, and their stamps [ns], in the order of time."""

    codec: MessageCodec
    rows: NDArray[np.int64]
    at_ns: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """What is known of the recorder: how complete a recording is, and how far its times can be trusted.

    from_start: it began before the node was switched on; dropped: frames that it lost; late_ns: its own largest lateness;
    late_share: of its wake-ups, those later than 2 ms; shared_host: the node may be a process of the same computer.
    """

    from_start: bool = False
    dropped: int = 0
    late_ns: int = 0
    late_share: float = 0.0
    shared_host: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A recording, divided.

    own: what the node sends, by name, also messages without a frame; inputs: what it receives. states: times [ns] and values of the
    node's state signal, None where the DBC names none. from_start: whether the recording begins before the node was switched on.
    observer: the window in which times are judged, and what is known against it. delay_ns: how late a frame may be without the
    node's doing, and host: why.
    """

    node: str
    database: Database
    table: FrameTable
    own: Mapping[str, Traffic]
    inputs: Mapping[str, Traffic]
    states: tuple[NDArray[np.int64], NDArray[np.int64]] | None
    from_start: bool
    observer: Observer
    delay_ns: int = 0
    host: str = ""

    @classmethod
    def of(cls, table: FrameTable, database: Database, node: str, bench: Bench = Bench()) -> Self:
        """Divide a recording that this bench made.

        ConformError where the DBC has no such node, or the recording no frame.
        """
        own = {name: c for name, c in database.by_name.items() if node in c.senders}
        if not own:
            nodes = sorted({sender for codec in database.by_name.values() for sender in codec.senders})
            raise ConformError(
                f"--node {node}: no message of {database.source} comes from it; there are {', '.join(nodes)}"
            )
        if not len(table):
            raise ConformError("the recording has no frame")
        # stable: frames of one stamp keep the order of the log, which is the order on the wire
        order = np.argsort(table.time_ns, kind="stable")
        table = table.select(order)
        inputs = {
            name: c for name, c in database.by_name.items() if node in c.receivers and node not in c.senders
        }
        by_name = _rows(table, database)
        own_traffic = {name: _traffic(codec, by_name, table) for name, codec in own.items()}
        # the node is judged from its own first frame on: before it, it was off or booting
        heard = [t.at_ns[0] for t in own_traffic.values() if t.at_ns.size]
        start_ns = int(min(heard)) if heard else int(table.time_ns[0])
        always = (
            f"the bench itself was late at {100 * bench.late_share:.0f} % of its times"
            if bench.late_share > LATE_SHARE
            else ""
        )
        # a bench that was late itself may have stamped, or sent, that much too late
        delay_ns, host = bench.late_ns, f"the bench itself was {bench.late_ns * 1e-6:.0f} ms late"
        if bench.shared_host and delay_ns < SHARED_HOST_NS:
            delay_ns = SHARED_HOST_NS
            host = (
                f"a node on the bench's own computer may wait up to {delay_ns * 1e-6:.0f} ms for a processor"
            )
        # a log whose last line is cut was interrupted while written: no frame before it is missing
        lost = bench.dropped + table.damaged_count - sum(1 for damage in table.damaged if damage.at_end)
        return cls(
            node=node,
            database=database,
            table=table,
            own=own_traffic,
            inputs={name: _traffic(codec, by_name, table) for name, codec in inputs.items()},
            states=_states(database, node, own_traffic, table),
            from_start=bench.from_start,
            observer=Observer(
                start_ns=start_ns,
                end_ns=int(table.time_ns[-1]),
                lost=lost,
                starved=always,
            ),
            delay_ns=delay_ns,
            host=host,
        )

    @property
    def frames(self) -> int:
        """Frames of the node."""
        return sum(traffic.rows.size for traffic in self.own.values())

    @property
    def state_names(self) -> Mapping[int, str]:
        """The value table of the state signal; empty where the DBC names no state."""
        signal = self.database.nodes[self.node].state_signal if self.node in self.database.nodes else ""
        message, _, name = signal.partition(".")
        return self.database.by_name[message].by_signal[name].choices if signal else {}

    def excuse(self, late_ns: float) -> str:
        """Why the computer may be to blame for what came `late_ns` too late; empty where it is not."""
        return self.observer.starved or (self.host if late_ns <= self.delay_ns else "")

    def since(self, at_ns: int) -> float:
        """A stamp as seconds after the first frame of the recording."""
        return (at_ns - int(self.table.time_ns[0])) * 1e-9


def _rows(table: FrameTable, database: Database) -> dict[str, NDArray[np.int64]]:
    """Rows by message name; frames with the source address of another node are not the message's."""
    found: dict[str, NDArray[np.int64]] = {}
    # error and remote frames carry an identifier as well, but no data of the message
    plain = table.can_id & np.uint32(ERROR | REMOTE) == 0
    for can_id in np.unique(table.can_id[plain]).tolist():
        codec = database.by_id.get(can_id)
        if codec is not None:
            found[codec.name] = np.flatnonzero(plain & (table.can_id == can_id))
    return found


def _traffic(codec: MessageCodec, rows: Mapping[str, NDArray[np.int64]], table: FrameTable) -> Traffic:
    of = rows.get(codec.name, np.empty(0, np.int64))
    return Traffic(codec=codec, rows=of, at_ns=table.time_ns[of])


def _states(
    database: Database, node: str, own: Mapping[str, Traffic], table: FrameTable
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    conduct = database.nodes.get(node)
    if conduct is None or not conduct.state_signal:
        return None
    message, _, name = conduct.state_signal.partition(".")
    traffic = own.get(message)
    if traffic is None or name not in traffic.codec.by_signal:
        raise ConformError(
            f"{database.source}: StateSignal of {node} is {conduct.state_signal!r}, which the node does not send"
        )
    # frames of another length are a verdict of their own (length); their state cannot be read
    whole = traffic.rows[table.length[traffic.rows] == traffic.codec.length]
    if not whole.size:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    values = np.asarray(decode_rows(traffic.codec, table, whole).signals[name], float)
    return table.time_ns[whole], np.rint(values).astype(np.int64)
