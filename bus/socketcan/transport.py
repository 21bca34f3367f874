"""A bus of the Linux kernel: raw AF_CAN, classic and FD, with the kernel's stamps and drop counts.

Error frames come as frames (ERROR in the identifier), and as findings in plain text. An
interface that goes down, or away, or bus off, and comes back is a finding, not an end:
meanwhile nothing is received, and frames to send are counted as dropped. `fileno` stays the
same throughout; it is an epoll of the socket and, while the interface is down, of the
kernel's messages about interfaces.

A frame's stamp is the kernel's, taken when its controller's driver handed it over. That of
an own frame (`confirmations`) is taken when the driver confirms its sending.

Documentation/networking/can.rst of Linux; constants that Python's socket lacks are for
64-bit kernels on architectures with the generic socket options (x86-64, ARM, RISC-V).
"""

import errno
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress

from bus import errors
from bus.closing import Closing
from bus.errors import FINDINGS_LIMIT, BusFinding, Fault
from bus.frame import ERROR, FD, LOCAL, Frame
from bus.hub import packet
from bus.socketcan.can_socket import bind, can_socket, longer_queue, require_up
from bus.socketcan.link import Link, LinkWatch
from bus.socketcan.wallclock import JUMP_NS, SHARED
from bus.transport import BusClosed, BusUnavailable, Statistics

RECEIVE_BUFFER = 4 << 20
"""Receive buffer asked for [bytes]; without privilege the kernel grants at most net.core.rmem_max."""
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL, _CAN_RAW_ERR_FILTER = 33, 35, 40, 2
_SO_MEMINFO, _MEMINFO_DROPS = 55, struct.Struct("=32xI")  # linux/sock_diag.h, SK_MEMINFO_DROPS
EVERYTHING = ((0, 0),)
_FILTER = struct.Struct("=II")
_CLASSIC = struct.Struct("=IB3x8s")
_FD = struct.Struct("=IBBxx64s")
_TIMESPEC = struct.Struct("=qq")
_COUNT = struct.Struct("=I")
# room for exactly the two control messages asked for below; more would be cut off silently
_ANCILLARY = socket.CMSG_SPACE(_TIMESPEC.size) + socket.CMSG_SPACE(_COUNT.size)
_LINK_ERRORS = {errno.ENETDOWN: Fault.LINK_DOWN, errno.ENODEV: Fault.LINK_GONE, errno.ENXIO: Fault.LINK_GONE}
_FULL = (errno.ENOBUFS, errno.EAGAIN)


class SocketCanTransport(Closing):
    """A Transport on a CAN interface of this machine."""

    def __init__(
        self,
        interface: str,
        *,
        filters: Sequence[tuple[int, int]] | None = None,
        own_messages: bool = False,
        origins: bool = False,
        receive_buffer: int = RECEIVE_BUFFER,
    ) -> None:
        """filters: (can_id, mask) words of what the kernel lets through, None: everything.

        own_messages: our frames come back, stamped when the controller sent them, for `confirmations`.
        origins: frames that a process of this machine sent carry the flag LOCAL.
        BusUnavailable if there is no CAN, no such interface, or it is down.
        """
        self.interface = interface
        self._local = LOCAL if origins else 0
        self._received = self._sent = self._dropped_in = self._dropped_out = self._errors = 0
        # last value of the kernel's own drop counter; kept apart from `dropped_in`, because it wraps
        self._overflows = 0
        self._confirmed: list[Frame] = []
        self._findings: deque[BusFinding] = deque(maxlen=FINDINGS_LIMIT)
        self._trouble: Fault | None = None
        self._queue_full = False
        self._empty_ns = time.monotonic_ns()  # frames that wait have come since
        self._watch: LinkWatch | None = None
        self._filters = b"".join(_FILTER.pack(*pair) for pair in (EVERYTHING if filters is None else filters))
        self._socket = can_socket(interface)
        try:
            self._set_options(own_messages, receive_buffer)
            self._bind()
            link = require_up(interface)
        except BaseException:
            self._socket.close()
            raise
        # an epoll instead of the socket itself, so that the descriptor given out stays valid while
        # the set of things to wait for changes
        self._epoll = select.epoll()
        self._epoll.register(self._socket.fileno(), select.EPOLLIN)
        if not link.carrier:
            self._findings.append(BusFinding(Fault.BUS_OFF, time.monotonic_ns(), "when opened"))
            self._watch_for_recovery(Fault.BUS_OFF)

    def _set_options(self, own_messages: bool, receive_buffer: int) -> None:
        raw, option = socket.SOL_CAN_RAW, self._socket.setsockopt
        option(raw, socket.CAN_RAW_FD_FRAMES, 1)
        # returned when the driver confirms the sending, so their stamp is that of the wire
        option(raw, socket.CAN_RAW_RECV_OWN_MSGS, int(own_messages))
        option(raw, _CAN_RAW_ERR_FILTER, socket.CAN_ERR_MASK)
        option(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        # each frame then carries the count of frames that the full receive buffer has cost so far
        option(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        try:
            # ignores net.core.rmem_max, but needs CAP_NET_ADMIN
            option(socket.SOL_SOCKET, _SO_RCVBUFFORCE, receive_buffer)
        except PermissionError:
            option(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)

    def _bind(self) -> None:
        """Attach to the interface; its filters go with the interface, so they are set each time."""
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, self._filters)
        bind(self._socket, self.interface)

    def send(self, frame: Frame) -> bool:
        """Hand one frame to the kernel. False: its queue is full or the interface is down, and it is lost."""
        packet.check(frame)
        if self._trouble is Fault.BUS_OFF:  # the kernel would take it, and throw it away
            self._dropped_out += 1
            return False
        can_id, data, _, flags = frame
        if flags & FD:
            content = _FD.pack(can_id, len(data), flags, data)
        else:
            content = _CLASSIC.pack(can_id, len(data), data)
        try:
            self._socket.send(content)
        except OSError as error:
            if error.errno == errno.EINVAL and flags & FD:
                raise ValueError(
                    f"{self.interface} carries no CAN FD frames; set it up with fd on, or mtu 72"
                ) from error
            self._dropped_out += 1
            self._note_refusal(error)
            return False
        self._sent += 1
        self._queue_full = False
        return True

    def drain(self, limit: int = 64) -> list[Frame]:
        """At most `limit` frames that have arrived, with the kernel's stamps; [] if there are none."""
        if self._trouble is not None:
            self._look_for_recovery()
        # once per call, not per frame: somebody sets the clock rarely
        SHARED.check()
        frames: list[Frame] = []
        # locals: this loop runs once per frame of a saturated bus
        receive, fd_size, ahead_ns = self._socket.recvmsg, _FD.size, SHARED.ahead_ns
        started_ns = newest_ns = time.monotonic_ns()
        oldest_ns = self._empty_ns - JUMP_NS
        try:
            for _ in range(limit):
                data, ancillary, message_flags, _ = receive(fd_size, _ANCILLARY)
                at_ns = 0
                for _, kind, value in ancillary:
                    if kind == _SO_TIMESTAMPNS:
                        seconds, nanoseconds = _TIMESPEC.unpack(value)
                        at_ns = seconds * 1_000_000_000 + nanoseconds - ahead_ns
                        if not oldest_ns <= at_ns <= newest_ns:
                            newest_ns = time.monotonic_ns()
                            at_ns = _plausible(at_ns, oldest_ns, newest_ns)
                    elif kind == _SO_RXQ_OVFL:
                        self._note_drops(_COUNT.unpack(value)[0])
                # the kernel sets MSG_DONTROUTE on frames that a socket of this host sent (can.rst)
                origin = self._local if message_flags & socket.MSG_DONTROUTE else 0
                if len(data) == fd_size:
                    # with CAN_RAW_FD_FRAMES the size of the structure says which kind of frame it is
                    can_id, length, flags, content = _FD.unpack(data)
                    frame = Frame(can_id, content[:length], at_ns, flags | FD | origin)
                else:
                    can_id, length, content = _CLASSIC.unpack(data)
                    frame = Frame(can_id, content[:length], at_ns, origin)
                if message_flags & socket.MSG_CONFIRM:
                    # our own frame, returned by CAN_RAW_RECV_OWN_MSGS
                    self._confirmed.append(frame)
                    continue
                frames.append(frame)
                if can_id & ERROR:
                    self._note_error(frame)
        except BlockingIOError:
            # everything from before this call has been read
            self._empty_ns = started_ns
        except OSError as error:
            self._note_link(error)
        self._received += len(frames)
        return frames

    def _note_drops(self, count: int) -> None:
        """Take over the kernel's count of lost frames."""
        # It wraps at 32 bits. A queued frame may carry an older count than SO_MEMINFO has given: that looks like
        # a step of almost 2**32 and is ignored.
        more = (count - self._overflows) & 0xFFFF_FFFF
        if more < 1 << 31:
            self._dropped_in += more
            self._overflows = count

    def _ask_for_drops(self) -> None:
        """Read the drop count from the socket: frames lost after the last received one are in no frame's control message."""
        if self._socket.fileno() >= 0:
            with suppress(OSError):  # a kernel before 4.12 does not say
                info = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO_DROPS.size)
                self._note_drops(_MEMINFO_DROPS.unpack(info)[0])

    def _note_error(self, frame: Frame) -> None:
        """Count an error frame; a bus-off that the interface confirms stops sending until its carrier is back."""
        self._errors += 1
        found = errors.findings(frame)
        self._findings += found
        if any(finding.fault is Fault.BUS_OFF for finding in found):
            link = Link.read(self.interface)
            if link is not None and link.up and not link.carrier:
                self._watch_for_recovery(Fault.BUS_OFF)

    def _note_refusal(self, error: OSError) -> None:
        """The kernel did not take a frame: a full queue is reported once, until it takes a frame again."""
        if error.errno not in _FULL:
            self._note_link(error)
        elif not self._queue_full:
            self._queue_full = True
            self._findings.append(
                BusFinding(Fault.SEND_QUEUE, time.monotonic_ns(), longer_queue(self.interface))
            )

    def _note_link(self, error: OSError) -> None:
        """The interface is down or gone: report it once."""
        fault = _LINK_ERRORS.get(error.errno or 0)
        if fault is None:
            raise BusClosed(f"{self.interface}: {error.strerror}; was the transport closed?") from error
        if fault is self._trouble:
            return
        self._findings.append(BusFinding(fault, time.monotonic_ns(), self.interface))
        self._watch_for_recovery(fault)

    def _watch_for_recovery(self, fault: Fault) -> None:
        self._trouble = fault
        if self._watch is None:
            self._watch = LinkWatch()
            self._epoll.register(self._watch.fileno(), select.EPOLLIN)

    def _look_for_recovery(self) -> None:
        """Go on as before once the interface is up again, even if it was removed and made anew."""
        if self._watch is not None:
            self._watch.clear()
        link = Link.read(self.interface)
        if link is None or not link.up or not link.carrier:
            return
        try:
            self._bind()
        except BusUnavailable:  # removed again meanwhile
            return
        if self._watch is not None:
            self._epoll.unregister(self._watch.fileno())
            self._watch.close()
            self._watch = None
        self._trouble = None
        self._findings.append(BusFinding(Fault.LINK_UP, time.monotonic_ns(), self.interface))

    @property
    def link_up(self) -> bool:
        """Whether the interface was usable when last looked at."""
        return self._trouble is None

    @property
    def receive_buffer(self) -> int:
        """What the kernel has granted [bytes]; a frame takes some 800 of it."""
        return self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    def findings(self) -> list[BusFinding]:
        """Findings since the last call: error frames in plain text, and changes of the interface's state."""
        found = list(self._findings)
        self._findings.clear()
        return found

    def confirmations(self) -> list[Frame]:
        """Own frames that the controller has sent, with its stamps, as far as `drain` has read."""
        confirmed, self._confirmed = self._confirmed, []
        return confirmed

    def fileno(self) -> int:
        """Readable when `drain` has frames to give, or has to look at the interface."""
        return self._epoll.fileno() if not self._epoll.closed else -1

    def statistics(self) -> Statistics:
        """Counters since opening."""
        self._ask_for_drops()
        return Statistics(
            received=self._received,
            sent=self._sent,
            dropped_in=self._dropped_in,
            dropped_out=self._dropped_out,
            errors=self._errors,
        )

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        self._epoll.close()
        self._socket.close()
        if self._watch is not None:
            self._watch.close()
            self._watch = None


def _plausible(at_ns: int, oldest_ns: int, newest_ns: int) -> int:
    """A stamp from before the queue was last seen empty, or from later than now, as far as it can be true.

    On a starved machine the kernel stamps a frame and puts it into the queue many milliseconds
    later: such a stamp is right. After the clock was set, it may be an hour off, and would make
    everything that is measured from it look as old.
    """
    if at_ns < oldest_ns and SHARED.set_since(oldest_ns):
        return oldest_ns
    return min(at_ns, newest_ns)
