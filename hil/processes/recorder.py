"""The recorder process: everything on the bus into a candump log, off the control path."""

from pathlib import Path

from bus.address import open_transport
from dbc.writer import CandumpWriter
from hil.ending import Ending
from hil.lifeline import Lifeline
from hil.processes.shell import Stop, counters

CHANNEL = "loader"


def run(line: Lifeline, address: str, log: Path) -> Ending:
    """Every frame of the bus into a candump log, until told to end; what had arrived by then is written."""
    count = 0
    with open_transport(address, name="recorder") as bus, CandumpWriter(log) as writer, Stop() as stop:
        line.ready()
        for _ in stop.readable(bus.fileno()):
            while frames := bus.drain():
                for frame in frames:
                    writer.write(frame, CHANNEL)
                count += len(frames)
        line.finished(complete=True, frames=count, **counters(bus))
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED
