"""The hub process of a run: the bus that all others connect to; and the printed counters of a running hub."""

import time
from dataclasses import dataclass

from bus.hub.client import hub_status
from bus.hub.server import serve
from bus.hub.status import HubStatus
from bus.transport import BusUnavailable
from bus.user_error import UserError
from hil.ending import Ending
from hil.shell.lifeline import Lifeline
from hil.shell.realtime_options import RealtimeOptions
from hil.timing.host import OwnWaits

PREFIX = "hub:"


class ImpossibleRates(UserError, ValueError):
    """No CAN bus has these bit rates."""


@dataclass(frozen=True, slots=True)
class BitRates:
    """Bit rates of the modelled wire [bit/s]."""

    nominal: int | None  # None: no wire is modelled, frames are relayed at once
    data: int | None  # of CAN FD frames with a bit-rate switch; None: as nominal

    def __post_init__(self) -> None:
        if self.data is None:
            return
        if self.nominal is None:
            raise ImpossibleRates(
                f"--data-bit-rate {self.data} needs --bit-rate too: the identifier is sent at that"
            )
        if self.data < self.nominal:
            raise ImpossibleRates(
                f"--data-bit-rate {self.data} is below --bit-rate {self.nominal} bit/s; data are never sent slower "
                "than the identifier (ISO 11898-1): exchanged?"
            )


def run(line: Lifeline, address: str, rates: BitRates, realtime: RealtimeOptions) -> Ending:
    """Serve until a signal ends it."""
    path = _path(address)
    realtime.apply()
    with OwnWaits(line.waited) as waits:
        status = serve(
            path,
            bit_rate=rates.nominal,
            data_bit_rate=rates.data,
            on_ready=line.ready,
            # only under a supervisor somebody collects the waits
            after_round=(lambda: waits.look(time.monotonic_ns())) if line.supervised else None,
        )
    dropped = sum(client.dropped for client in status.clients)
    line.finished(complete=True, frames=status.frames, dropped=dropped)
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED


def print_status(address: str) -> Ending:
    """Print the counters of the hub at `address` and of its clients."""
    from rich.console import Console
    from rich.table import Table

    status = hub_status(_path(address))
    print(summary(status))
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("client")
    for heading in ("process", "sent", "delivered", "dropped", "backlog", "waiting", "malformed"):
        table.add_column(heading, justify="right")
    for client in status.clients:
        counts = (
            client.pid,
            client.sent,
            client.delivered,
            client.dropped,
            client.backlog,
            client.waiting,
            client.malformed,
        )
        table.add_row(client.name, *map(str, counts))
    Console(highlight=False, markup=False).print(table)
    return Ending.PASSED


def summary(status: HubStatus) -> str:
    """The hub in one line."""
    line = f"{status.frames} frames in {status.uptime_s:.1f} s"
    if status.bit_rate is None:
        return f"{line}, without a bit rate"
    load = status.busy_s / status.uptime_s if status.uptime_s > 0 else 0.0
    return f"{line} at {status.bit_rate} bit/s, {100 * load:.1f} % bus load"


def _path(address: str) -> str:
    if not address.startswith(PREFIX):
        raise BusUnavailable(
            f"--bus {address}: a hub needs an address hub:PATH; other buses exist without it"
        )
    return address.removeprefix(PREFIX)
