"""How a command ends: the exit codes, the same for people, scripts and the supervisor."""

import enum


class Ending(enum.IntEnum):
    """Exit code. PEER_DIED: another process of the bench ended; HUB_LOST: the bus did, or was not there;

    INCONCLUSIVE: a diagnosis cannot tell from what was recorded.
    """

    PASSED = 0
    FAILED = 1
    MISUSED = 2
    PEER_DIED = 3
    HUB_LOST = 4
    INCONCLUSIVE = 5
    INTERRUPTED = 130
