"""A part of a recording, by message and sender: what a controller under test does not send itself."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

import numpy as np

from bus.user_error import UserError
from dbc.columns import ColumnDecoder
from dbc.database import Database
from dbc.recordings.logfile import FrameTable


class ChoiceOfFramesError(UserError, ValueError):
    """A message or node that no DBC has, or a choice that leaves no frame."""


def chosen_part(
    table: FrameTable,
    databases: Sequence[Database],
    messages: Sequence[str],
    senders: Sequence[str],
    not_senders: Sequence[str],
) -> FrameTable:
    """The rows of these messages (names or patterns) of these senders. Frames of no DBC go with `not_senders` only.

    An identifier's sender is what the DBC says: frames carry none.
    """
    codecs = [codec for database in databases for codec in database.by_name.values()]
    _known(senders, not_senders, {node for codec in codecs for node in codec.senders})
    for pattern in messages:
        if not any(fnmatchcase(codec.name, pattern) for codec in codecs):
            raise ChoiceOfFramesError(
                f"--message {pattern}: no DBC has such a message (name them with --dbc)"
            )
    decoder = ColumnDecoder(*databases)
    kept = []
    for can_id in np.unique(table.can_id).tolist():
        codec = decoder.codec_of(can_id)
        if codec is None:
            if not messages and not senders:
                kept.append(can_id)
            continue
        named = not messages or any(fnmatchcase(codec.name, pattern) for pattern in messages)
        sent = not senders or bool(set(senders).intersection(codec.senders))
        if named and sent and not set(not_senders).intersection(codec.senders):
            kept.append(can_id)
    part = table.select(np.isin(table.can_id, kept))
    if not len(part):
        raise ChoiceOfFramesError(
            "nothing left to send: no frame of the recording is of these messages and senders"
        )
    return part


def _known(senders: Iterable[str], not_senders: Iterable[str], nodes: set[str]) -> None:
    for option, names in (("--sender", senders), ("--not-sender", not_senders)):
        for name in names:
            if name not in nodes:
                raise ChoiceOfFramesError(
                    f"{option} {name}: no DBC has such a node; there are {', '.join(sorted(nodes))}"
                )
