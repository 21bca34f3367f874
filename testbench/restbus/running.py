"""A rest bus on a real bus: paced by a timer, with a script and orders from a stream. The thin shell around `RestBus`."""

import contextlib
import os
import select
import time
from collections.abc import Callable

from bus.address import open_transport
from bus.ticks import Alarm
from hil.ending import Ending
from hil.shell.lifeline import Lifeline
from hil.shell.process import Stop
from testbench.restbus.core import RestBus, RestBusError
from testbench.restbus.values import Order, Values

LOOK_NS = 10_000_000
"""How often values are looked at that only send on change."""
LONGEST_ORDER = 4096
"""Bytes of one line of standard input; a longer one is no order."""


class Orders:
    """Lines of a descriptor that is read without waiting; empty after its end."""

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def read(self) -> list[str]:
        """Whole lines that have come; at most one read, so that a flood cannot hold up the bus."""
        if self._descriptor is None:
            return []
        # A process in the background that reads its terminal is stopped by the kernel.
        if os.isatty(self._descriptor) and os.tcgetpgrp(self._descriptor) != os.getpgrp():
            return []
        if not select.select([self._descriptor], [], [], 0)[0]:
            return []
        # at most so much per round: orders that are poured in must not delay frames
        piece = os.read(self._descriptor, LONGEST_ORDER)
        if not piece:
            self._descriptor = None
        *lines, self._rest = (self._rest + piece).split(b"\n")
        # input without a line end must not fill the memory
        self._rest = self._rest[-LONGEST_ORDER:]
        return [line.decode("utf-8", "replace") for line in lines if line.strip()]


def run(
    line: Lifeline,
    address: str,
    make: Callable[[int], RestBus],
    values: Values,
    *,
    for_s: float | None = None,
    orders: Orders | None = None,
) -> Ending:
    """Send until Ctrl-C or the end of `for_s`. make: the rest bus that starts at a time [ns]."""
    orders = orders or Orders(None)
    with (
        open_transport(address, name="restbus") as transport,
        Stop() as stop,
        contextlib.closing(Alarm()) as alarm,
    ):
        start_ns = time.monotonic_ns()
        bus = make(start_ns)
        script = [(start_ns + round(time_s * 1e9), order) for time_s, order in values.script]
        end_ns = None if for_s is None else start_ns + round(for_s * 1e9)
        line.ready()
        sent = refused = 0
        # 1 ns after boot: at once. 0 would disarm the timer.
        alarm.set(1)
        for _ in stop.readable(alarm.fileno(), transport.fileno()):
            while transport.drain():  # not ours, but must not fill the receive buffer
                pass
            now_ns = time.monotonic_ns()
            # orders before frames: a value that is due now goes out with this tick's frame
            while script and script[0][0] <= now_ns:
                script.pop(0)[1].give(bus, now_ns)
            for text in orders.read():
                try:
                    Order.parse(text).give(bus, now_ns)
                except RestBusError as error:  # a slip of the keyboard does not end the bus
                    line.note(str(error))
            for frame in bus.due(now_ns):
                taken = transport.send(frame)
                sent += taken
                refused += not taken
            if end_ns is not None and now_ns >= end_ns:
                break
            times = (bus.next_ns(), script[0][0] if script else None, end_ns, now_ns + LOOK_NS)
            alarm.set(min(t for t in times if t is not None))
        line.finished(complete=True, sent=sent, refused=refused)
        if not line.supervised:
            line.note(
                f"{sent} frames sent" + (f", {refused} refused because the bus was full" if refused else "")
            )
    return Ending.PASSED
