"""The exit codes of all commands, for scripts and the supervisor; docs/howto lists them for users."""

import enum


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
