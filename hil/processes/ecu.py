"""The ECU process of a real-time run: the virtual ECU on the bus."""

from collections import Counter
from contextlib import ExitStack
from pathlib import Path

from dbc import loader_database
from ecu import node
from ecu.calibration import calibration_table, read_calibration
from ecu.core import PYTHON, Core, Form
from ecu.findings import Finding
from ecu.offered.services import NO_SERVICES, ServiceOptions, services_of
from hil import rundir
from hil.ecu_side import CALIBRATION
from hil.ending import Ending
from hil.foreign.duplicates import OwnIdentifiers, other_sender
from hil.gateway.latency import keep_ticks
from hil.gateway.tap import tapped
from hil.shell.lifeline import Lifeline
from hil.shell.process import counters, log_to, reach, run_until_signal
from hil.shell.realtime_options import ORDINARY, RealtimeOptions
from hil.shell.service_manager import ServiceManager
from hil.timing.host import OwnWaits, Sleeps

NODE = "EstimatorEcu"


def run(
    line: Lifeline,
    form: Form,
    limits: bool,
    address: str,
    out: Path | None,
    realtime: RealtimeOptions = ORDINARY,
    calibration: str = CALIBRATION,
    detect_faults: bool = False,
    core: Core = PYTHON,
    services: ServiceOptions = NO_SERVICES,
) -> Ending:
    """Run the virtual ECU on the bus until a signal ends it; with `out`, its timing and log are written there."""
    log_to(out and out / rundir.ECU_LOG)
    # read once: the ECU and what a tool sees of its calibration are of one state of the file
    table = calibration_table(calibration)
    # options that do not fit together are an error of the command line, whether there is a bus or not
    cycle = core.ecu(read_calibration(table), form=form, limits=limits, detect_faults=detect_faults)
    offered = services_of(cycle, table, services)
    # fails at once if there is no bus, not after the compilation of Python's estimators
    reach(address)
    manager = ServiceManager.from_environment()
    cycle.warm_up()  # compiles Python's estimators, which takes seconds the first time: before the other side waits for answers
    # after the warm-up: objects and code that exist now are frozen and locked
    realtime.apply()
    kinds: Counter[str] = Counter()

    def found(finding: Finding) -> None:
        kinds[f"finding_{type(finding).__name__}"] += 1
        node.log_finding(finding)

    with ExitStack() as stack:
        if out and not line.supervised:
            stack.callback(keep_ticks, out, "ecu")
        stamps = out and rundir.stamps(out, "ecu")
        sleeps = Sleeps()
        waits = stack.enter_context(OwnWaits(line.waited, sleeps))
        tap, timing = stack.enter_context(tapped(address, "ecu", stamps, waits))
        bus = OwnIdentifiers(
            tap,
            NODE,
            loader_database(),
            lambda name: other_sender(line, "ecu", address, name),
            sends=lambda: all(service.may_send() for service in offered),
        )
        line.ready()
        manager.ready(f"estimating on {address}, calibration {calibration}")
        try:
            work = node.run(bus, cycle, timing=timing, found=found, ticked=manager.alive, services=offered)
            run_until_signal(work, sleeps)
        finally:
            manager.stopping()
            line.finished(complete=True, missed=timing.missed, **kinds, **counters(bus), **bus.figures())
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED
