"""What a DBC asks of a controller beyond its frames: states after loss of an input, times to start and to recover.

No standard has attributes for that. Ours are read where a DBC has them; what it leaves out is not judged.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

MS = 1_000_000


@dataclass(frozen=True, slots=True)
class LossConduct:
    """Attributes of a message: what its receiver shall do when it stays away.

    state: value of the receiver's StateSignal that shall follow, "" if the DBC does not say. timeout_ns: within this time
    after the last frame [ns].
    """

    ATTRIBUTES: ClassVar = ("InputLossState", "InputTimeout")
    state: str = ""
    timeout_ns: int = 0

    @classmethod
    def of(cls, name: str, attributes: Mapping[str, Any]) -> Self:
        """ValueError for a state without a time."""
        found = cls(str(attributes.get("InputLossState", "")), int(attributes.get("InputTimeout", 0)) * MS)
        if found.state and not found.timeout_ns:
            raise ValueError(f"message {name}: InputLossState {found.state} without InputTimeout")
        return found


SEND_OPTIONAL = "SendOptional"
"""Attribute of a message: 1 where its sender may leave it out. A frame that is sent has to obey everything else."""
UNCERTAINTY_OF = "UncertaintyOf"
"""Attribute of a signal: the signal, as `Message.Signal`, whose standard deviation it is."""


@dataclass(frozen=True, slots=True)
class NodeConduct:
    """Attributes of a node.

    state_signal: `Message.Signal` that says its state; running: the value it has when all is well. start_ns: from its first
    frame to `running`, with all inputs there; recovery_ns: from the return of a lost input to `running` [ns]; 0: not said.
    """

    ATTRIBUTES: ClassVar = ("StateSignal", "StateRunning", "StartTime", "RecoveryTime")
    state_signal: str = ""
    running: str = ""
    start_ns: int = 0
    recovery_ns: int = 0

    @classmethod
    def of(cls, name: str, attributes: Mapping[str, Any]) -> Self:
        """ValueError for a signal without the name of its good state, and for a signal that is no Message.Signal."""
        found = cls(
            str(attributes.get("StateSignal", "")),
            str(attributes.get("StateRunning", "")),
            int(attributes.get("StartTime", 0)) * MS,
            int(attributes.get("RecoveryTime", 0)) * MS,
        )
        if bool(found.state_signal) is not bool(found.running) or (
            found.state_signal and found.state_signal.count(".") != 1
        ):
            raise ValueError(
                f"node {name}: StateSignal {found.state_signal!r} and StateRunning {found.running!r}: give both, the first as Message.Signal"
            )
        return found
