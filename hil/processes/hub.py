"""The hub process: the bus that everybody else connects to."""

from bus.hub import serve
from bus.transport import BusUnavailable
from hil.ending import Ending
from hil.lifeline import Lifeline

PREFIX = "hub:"


def run(line: Lifeline, address: str, bit_rate: int | None) -> Ending:
    """Serve until told to end. bit_rate [bit/s]: also take the time that a real bus would take."""
    if not address.startswith(PREFIX):
        raise BusUnavailable(f"--bus {address}: a hub serves hub:PATH; other buses need no process of ours")
    status = serve(address.removeprefix(PREFIX), bit_rate=bit_rate, on_ready=line.ready)
    dropped = sum(client.dropped for client in status.clients)
    line.finished(complete=True, frames=status.frames, dropped=dropped)
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED
