"""The ECU process: the virtual ECU on the bus, in real time."""

from pathlib import Path

from bus.address import open_transport
from bus.pacing import TickTiming
from ecu import node
from hil import rundir
from hil.ecu_side import Form, ecu_cycle
from hil.ending import Ending
from hil.lifeline import Lifeline
from hil.processes.shell import HostShare, counters, run_until_signal


def run(line: Lifeline, form: Form, limits: bool, address: str, out: Path | None) -> Ending:
    """The virtual ECU on the bus, until it is told to end; with `out`, its timing is left there."""
    cycle = ecu_cycle(form=form, limits=limits)
    timing = TickTiming()
    host = HostShare()
    with open_transport(address) as bus:
        line.ready()
        try:
            run_until_signal(node.run(bus, cycle, timing=timing))
        finally:
            if out:
                rundir.write_table(rundir.part_of_timing(out, "ecu"), timing.arrays())
            line.finished(complete=True, missed=timing.missed, **host.figures(), **counters(bus))
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED
