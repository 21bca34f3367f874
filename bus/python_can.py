"""The hub as an interface of python-can, for the tools of python-can and cantools.

    can.Bus(interface="loaderhil", channel="/path/to/socket")
    python -m can.viewer -i loaderhil -c /path/to/socket

Message.timestamp is wall time, as those tools expect; the hub's own stamps are monotonic.
"""

import select
import time

import can
from can.typechecking import CanFilters

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE, STANDARD_MASK, Frame
from bus.hub.client import HubTransport
from bus.transport import BusClosed, BusUnavailable


class HubBus(can.BusABC):
    """A python-can bus on the hub whose socket is `channel`."""

    def __init__(
        self,
        channel: str,
        can_filters: CanFilters | None = None,
        *,
        receive_own_messages: bool = False,
        name: str = "python-can",
        **_ignored: object,
    ) -> None:
        """name: shown in the hub's list of clients. Bit rates and the like are the hub's, and ignored here."""
        path = str(channel).removeprefix("hub:")
        try:
            self._transport = HubTransport(path, name=name, own_messages=receive_own_messages)
        except BusUnavailable as error:
            raise can.CanInitializationError(str(error)) from error
        # measured once: stamps of one bus must not jump when somebody sets the wall clock
        self._wall_ns = time.time_ns() - time.monotonic_ns()
        self._poll = select.poll()
        self._poll.register(self._transport.fileno(), select.POLLIN)
        self.channel_info = f"loaderhil hub {path}"
        # the hub carries both kinds; CAN_FD is the one that refuses neither
        self._can_protocol = can.CanProtocol.CAN_FD
        super().__init__(channel=path, can_filters=can_filters)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """One message, or None after `timeout` seconds.

        Frames are taken one at a time: frames kept here would not make the descriptor readable for a Notifier.
        """
        try:
            frame, own = self._take()
            if frame is None and self._poll.poll(None if timeout is None else max(0.0, timeout * 1e3)):
                frame, own = self._take()
        except BusClosed as error:
            raise can.CanOperationError(str(error)) from error
        if frame is None:
            return None, False
        return to_message(frame, self._wall_ns, self._transport.path, own=own), False

    def _take(self) -> tuple[Frame | None, bool]:
        """The next frame, and whether it is a confirmation of one of our own."""
        frames = self._transport.drain(1)
        if frames:
            return frames[0], False
        confirmed = self._transport.confirmations()
        return (confirmed[0], True) if confirmed else (None, False)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a message to the hub; can.CanOperationError if it takes none for `timeout` seconds."""
        frame = from_message(msg)
        try:
            if self._transport.send(frame):
                return
            writable = select.poll()
            writable.register(self._transport.fileno(), select.POLLOUT)
            writable.poll(0 if timeout is None else timeout * 1e3)
            if not self._transport.send(frame):
                raise can.CanOperationError(f"{self.channel_info} is too far behind to take a frame")
        except BusClosed as error:
            raise can.CanOperationError(str(error)) from error
        except ValueError as error:
            raise can.CanOperationError(f"no frame can carry this: {error}") from error

    def fileno(self) -> int:
        """Readable when a message waits."""
        return self._transport.fileno()

    def shutdown(self) -> None:
        """Leave the hub."""
        super().shutdown()
        self._transport.close()


def to_message(frame: Frame, wall_ns: int, channel: str, *, own: bool = False) -> can.Message:
    """python-can's form of a frame; wall_ns: what to add to its stamp for wall time."""
    remote = bool(frame.can_id & REMOTE)
    extended = bool(frame.can_id & EXTENDED)
    error = bool(frame.can_id & ERROR)
    return can.Message(
        timestamp=(frame.at_ns + wall_ns) * 1e-9,
        # error frames carry their class bits beyond the eleven of a standard identifier
        arbitration_id=frame.can_id & (EXTENDED_MASK if extended or error else STANDARD_MASK),
        is_extended_id=extended,
        is_remote_frame=remote,
        is_error_frame=error,
        is_fd=bool(frame.flags & FD),
        bitrate_switch=bool(frame.flags & BRS),
        error_state_indicator=bool(frame.flags & ESI),
        is_rx=not own,
        channel=channel,
        dlc=len(frame.data),
        data=None if remote else frame.data,
    )


def from_message(message: can.Message) -> Frame:
    """The frame of a python-can message; a remote request has its length as that many zeros."""
    can_id = message.arbitration_id
    can_id |= (
        EXTENDED * message.is_extended_id | REMOTE * message.is_remote_frame | ERROR * message.is_error_frame
    )
    flags = (FD | BRS * message.bitrate_switch | ESI * message.error_state_indicator) if message.is_fd else 0
    data = bytes(message.dlc) if message.is_remote_frame else bytes(message.data)
    return Frame(can_id, data, 0, flags)
