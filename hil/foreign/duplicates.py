"""Detects two senders of one identifier: a process receives a frame with an identifier that it sends itself.

No transport returns a process' own frames, so such a frame is another sender's. CAN frames carry no sender: two foreign
nodes that send the same identifier cannot be distinguished; their counters jump, which `loaderhil check` reports.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from bus.closing import Closing
from bus.errors import BusFinding
from bus.frame import Frame
from bus.hub.client import hub_status
from bus.transport import BusUnavailable, Statistics, Transport
from dbc.database import Database
from hil.foreign.silence import identifiers_of
from hil.shell.lifeline import Lifeline
from hil.verdict import Result, Verdict

QUESTION = "every identifier has one sender"


class OwnIdentifiers(Closing):
    """Wraps a Transport and counts received frames with identifiers that this process itself sends."""

    def __init__(
        self,
        transport: Transport,
        node: str,
        database: Database,
        on_first: Callable[[str], str],
        sends: Callable[[], bool] = lambda: True,
    ) -> None:
        """on_first: called with the name of the first such message; returns a description of its sender.

        sends: whether this process sends at all at present. One that has lost its address does not, and then there is one sender.
        """
        self._transport = transport
        self._sends = sends
        self._own = {can_id: database.by_id[can_id].name for can_id in identifiers_of(node, database)}
        self._on_first = on_first
        self.heard: Counter[str] = Counter()
        self._by = ""

    def drain(self, limit: int = 64) -> list[Frame]:
        """As the transport's."""
        frames = self._transport.drain(limit)
        for frame in frames:
            if (name := self._own.get(frame.can_id)) is not None and self._sends():
                if not self.heard:
                    self._by = self._on_first(name)
                self.heard[name] += 1
        return frames

    def send(self, frame: Frame) -> bool:
        """As the transport's."""
        return self._transport.send(frame)

    def findings(self) -> list[BusFinding]:
        """As the transport's."""
        return self._transport.findings()

    def fileno(self) -> int:
        """As the transport's."""
        return self._transport.fileno()

    def statistics(self) -> Statistics:
        """As the transport's."""
        return self._transport.statistics()

    def close(self) -> None:
        """As the transport's."""
        self._transport.close()

    def figures(self) -> dict[str, int | str]:
        """For the run's record: number and messages of such frames; {} if there were none."""
        if not self.heard:
            return {}
        return {
            "duplicate_frames": self.heard.total(),
            "duplicate_messages": ", ".join(sorted(self.heard)),
            "duplicate_by": self._by,
        }


def other_sender(line: Lifeline, process: str, address: str, message: str) -> str:
    """Report at once that another sender uses an identifier of `process`; returns a description of that sender."""
    who = senders_on(address, without=(process,))
    line.note(f"two senders of {message}: our {process} process, and {who}")
    return who


def senders_on(address: str, without: Iterable[str] = ()) -> str:
    """A description of the other senders on a bus: on a hub the names of its clients, elsewhere only the address."""
    if address.startswith("hub:"):
        try:
            status = hub_status(address.removeprefix("hub:"))
        except BusUnavailable:
            return f"another client of {address}"
        ours = set(without)
        # only clients that have sent: recorder and monitor listen on every bus
        names = [f"{c.name!r} (process {c.pid})" for c in status.clients if c.sent and c.name not in ours]
        if names:
            return f"{' or '.join(names)} on {address}"
    return f"another node on {address}"


def judge_senders(statistics: Mapping[str, float | int | str], processes: Iterable[str]) -> list[Verdict]:
    """A FAILED verdict for each process whose identifiers had another sender; [] if there was none."""
    found = []
    for process in processes:
        if count := statistics.get(f"{process}_duplicate_frames"):
            messages = str(statistics[f"{process}_duplicate_messages"]).split(", ")
            named = ", ".join(messages[:3]) + (f" and {len(messages) - 3} more" if len(messages) > 3 else "")
            other = statistics.get(f"{process}_duplicate_by", "another node")
            reason = f"{named}: sent by our {process} process and by {other}, {count} frames"
            found.append(Verdict(question=QUESTION, result=Result.FAILED, reason=reason))
    return found
