"""Ticks and alarms at absolute times, from the kernel's timerfd.

A tick is due at `start_ns + k * period_ns` for k = 0, 1, 2, ..., however late the one
before was served, so lateness never accumulates. The kernel counts the ticks that have
come due; a count above one means that ticks were missed, and by how many. Python offers
timerfd from 3.13 on, so libc is called directly.
"""

import ctypes
import os
import sys
import time

from bus.closing import Closing

NS = 1_000_000_000
TFD_TIMER_ABSTIME = 1  # include/uapi/linux/timerfd.h
# None: the C library that is already loaded; get_errno needs use_errno
_LIBC = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


def _timespec(time_ns: int) -> _Timespec:
    return _Timespec(*divmod(time_ns, NS))


def _create() -> int:
    descriptor: int = _LIBC.timerfd_create(time.CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
    if descriptor < 0:
        raise OSError(ctypes.get_errno(), "timerfd_create failed")
    return descriptor


def _set(descriptor: int, first_ns: int, period_ns: int) -> None:
    """Fire at `first_ns` [ns], then every `period_ns` (0: once); a first time of 0 disarms."""
    schedule = _Itimerspec(interval=_timespec(period_ns), value=_timespec(first_ns))
    if _LIBC.timerfd_settime(descriptor, TFD_TIMER_ABSTIME, ctypes.byref(schedule), None) < 0:
        raise OSError(
            ctypes.get_errno(), f"timerfd_settime refused {first_ns} ns with a period of {period_ns} ns"
        )


class Alarm:
    """A timer that fires once, at an absolute time; its file descriptor is then readable."""

    def __init__(self) -> None:
        self._fd = _create()
        self._at_ns: int | None = None

    def fileno(self) -> int:
        """The file descriptor to wait on."""
        return self._fd

    def set(self, at_ns: int | None) -> None:
        """Fire at `at_ns` of CLOCK_MONOTONIC, at once if that is past; None: do not fire."""
        # spares a system call: the hub sets its alarm once per batch, mostly to the same time
        if at_ns != self._at_ns:
            _set(self._fd, at_ns or 0, 0)
            self._at_ns = at_ns

    def close(self) -> None:
        """Release the timer; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


class Ticks(Closing):
    """A periodic timer with a file descriptor that is readable when a tick is due."""

    def __init__(self, period_ns: int, start_ns: int | None = None) -> None:
        """First tick at `start_ns` of CLOCK_MONOTONIC, by default one period from now.

        A start in the past is allowed: the ticks since then count as due.
        """
        if period_ns <= 0:
            raise ValueError(f"period_ns={period_ns} must be positive")
        if start_ns is None:
            start_ns = time.monotonic_ns() + period_ns
        elif start_ns <= 0:
            raise ValueError(f"start_ns={start_ns} must be positive: a time of CLOCK_MONOTONIC")
        self.period_ns = period_ns
        self._due_ns = start_ns - period_ns
        self._fd = _create()
        _set(self._fd, start_ns, period_ns)

    @property
    def due_ns(self) -> int:
        """When the latest tick that `expired` reported was due; one period before the first if none was."""
        return self._due_ns

    def fileno(self) -> int:
        """The file descriptor to wait on."""
        return self._fd

    def expired(self) -> int:
        """Ticks that came due since the last call: 0 none, 1 on time, n > 1 means n - 1 were missed."""
        try:
            count = int.from_bytes(os.read(self._fd, 8), sys.byteorder)
        except BlockingIOError:
            return 0
        # from the count, not from the clock: a late reading does not shift the times of the ticks
        self._due_ns += count * self.period_ns
        return count

    def close(self) -> None:
        """Stop ticking; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
