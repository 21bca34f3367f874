"""The exit codes of all commands, for scripts and the supervisor; docs/howto lists them for users."""

import enum
import errno


class Ending(enum.IntEnum):
    """Exit code of a command."""

    PASSED = 0
    FAILED = 1
    MISUSED = 2
    """The command line or an input file is wrong."""
    PEER_DIED = 3
    """Another process of the bench ended early."""
    HUB_LOST = 4
    """The bus went away, or did not exist."""
    INCONCLUSIVE = 5
    """The recordings do not allow a verdict."""
    INTERRUPTED = 130
    """Ctrl-C, as shells report it: 128 + SIGINT."""


STORAGE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a write: no space left, quota, limit of file size, a broken disk."""


def ending_of_error(error: BaseException) -> Ending:
    """The ending of a command that an error of the user ended: FAILED where the disk took no more, which no other command line mends."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.errno in STORAGE:
            return Ending.FAILED
        cause = cause.__cause__
    return Ending.MISUSED
