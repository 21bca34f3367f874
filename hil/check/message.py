"""One message of a checked recording: hands its frames to the judge of its times and to the count of its contents."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.database import MessageCodec
from dbc.recordings.logfile import FrameTable
from dbc.tally.contents import ContentsCount
from dbc.tally.payloads import LastPayload, counters_of
from hil.timing.deadlines import COUNTER_MODULUS, STALE_AFTER, TOLERANCE, Judged, MessageJudge, Observer
from hil.timing.waits import Rows

NO_WAITS: Mapping[str, Mapping[str, Rows]] = {}


class Times:
    """The times and counters of one message, by its frames."""

    def __init__(
        self,
        codec: MessageCodec,
        *,
        waits: Mapping[str, Mapping[str, Rows]] = NO_WAITS,
        tolerance: float = TOLERANCE,
        stale_after: float = STALE_AFTER,
    ) -> None:
        """waits: those of `Observer`."""
        self._codec = codec
        self._sender = next(iter(codec.senders), "")
        counters = COUNTER_MODULUS if codec.protection is None else codec.protection.counters
        self._counts = codec.protection is not None and counters > 1
        self._payload = LastPayload()
        self._judge = MessageJudge(
            codec.cycle_ns or None,
            modulus=counters,
            waits=waits.get(self._sender),
            tolerance=tolerance,
            stale_after=stale_after,
        )

    def add(self, table: FrameTable, rows: NDArray[np.int64]) -> None:
        """Take the message's rows of the next piece."""
        at_ns = table.time_ns[rows]
        if self._counts:
            counters = counters_of(self._codec, table, rows)
            self._judge.add(at_ns, counters, self._payload.same(table, rows))
        else:
            self._judge.add(at_ns)

    def judged(self, name: str, channel: str, observer: Observer) -> Judged:
        """The verdict over the observer's window, which holds all rows."""
        return Judged(channel=channel, sender=self._sender, verdict=self._judge.verdict(name, observer))


@dataclass(frozen=True, slots=True)
class CheckedMessage:
    """What is counted of one identifier on one channel; None where it is not asked for."""

    codec: MessageCodec
    times: Times | None
    contents: ContentsCount | None

    def add(self, table: FrameTable, rows: NDArray[np.int64]) -> None:
        """Take the message's rows of the next piece."""
        if rows.size:
            if self.times is not None:
                self.times.add(table, rows)
            if self.contents is not None:
                self.contents.add(table, rows)
