"""Divides the frames of each piece of a recording by channel and identifier."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, REMOTE
from dbc.columns import ColumnDecoder
from dbc.database import MessageCodec
from dbc.kernels.groups import Numbering, rows_by_group
from dbc.recordings.logfile import FrameTable

Key = tuple[int, int]
"""Number of a channel, and `can_id` word."""


class Identifiers:
    """Knows the message of each identifier that has come so far.

    By identifier, not by message: two senders of one J1939 group would look like one that is twice as fast.
    """

    def __init__(self, decoder: ColumnDecoder) -> None:
        self._decoder = decoder
        self._numbering = Numbering()
        self._known: list[tuple[int, MessageCodec]] = []
        self._group_of = np.empty(0, np.int64)  # by number of an identifier; 0 for one that no database knows
        self.unknown: Counter[int] = Counter()  # channel -> frames that no database knows

    def rows(self, table: FrameTable) -> Iterator[tuple[Key, MessageCodec, NDArray[np.int64]]]:
        """The rows of each known identifier on each channel, in the order of the table."""
        numbers = self._numbering.of(table.can_id)
        self._learn()
        for channel, rows in _by_channel(table.channel):
            chosen = numbers if rows is None else numbers[rows]
            ordered, begins, _ = rows_by_group(chosen, self._group_of, len(self._known))
            self.unknown[channel] += int(begins[1])
            for place, (word, codec) in enumerate(self._known, 1):
                found = ordered[begins[place] : begins[place + 1]]
                if found.size:
                    yield (channel, word), codec, found if rows is None else rows[found]

    def _learn(self) -> None:
        """Look up the identifiers that came for the first time."""
        groups = []
        for word in self._numbering.words(self._group_of.size):
            codec = None if word & (ERROR | REMOTE) else self._decoder.codec_of(word)
            if codec is not None:
                self._known.append((word, codec))
            groups.append(0 if codec is None else len(self._known))
        self._group_of = np.concatenate((self._group_of, np.array(groups, np.int64)))


def _by_channel(channel: NDArray[np.uint8]) -> Iterator[tuple[int, NDArray[np.int64] | None]]:
    """The rows of each channel; None for all of them."""
    if channel.size and channel.min() == channel.max():
        yield int(channel[0]), None
        return
    for number in np.unique(channel).tolist():
        yield number, np.flatnonzero(channel == number)
