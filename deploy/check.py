"""The check before a deployed ECU sends its first frame: settings, calibration, interface, and what is on the bus. It only listens."""

import os
import selectors
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

from bus.address import open_transport
from bus.errors import BusFinding
from bus.socketcan.link import Link, can_interfaces
from bus.transport import BusUnavailable, Transport
from bus.user_error import UserError
from configuration import CheckedTable
from dbc import loader_database
from dbc.database import Database
from deploy.c.core import BY_NAME
from deploy.settings import KEY, ServiceSettings
from ecu.calibration import calibration_table, read_calibration
from ecu.core import Ecu
from ecu.measure.access import SecretError
from ecu.offered.services import NO_SERVICES, services_of
from hil.foreign.silence import identifiers_of
from hil.gateway.settings import read_settings, routes_of
from hil.processes.ecu import NODE
from hil.verdict import Result, Verdict

INTERFACE = "the interface can send"
GATEWAY = "the gateway's other interface can send"
ALONE = "no other node sends the ECU's messages"
MACHINE = "the machine is on the bus"
HEALTHY = "the bus is free of errors"


@dataclass(slots=True)
class Heard:
    """What came while the check listened."""

    frames: Counter[int] = field(default_factory=Counter)  # by `can_id`
    findings: list[BusFinding] = field(default_factory=list)  # from error frames and from the interface
    errors: int = 0  # error frames


def check(settings: ServiceSettings) -> list[Verdict]:
    """All verdicts, in the order in which they were found; raises ConfigurationError where a setting cannot be used."""
    use(settings)
    verdicts = [judge_interface(settings, Link.read(settings.can.interface))]
    if verdicts[0].result is Result.PASSED:
        try:
            # an interface that is down would make every later verdict a wrong one, so listening comes only after the first
            with open_transport(settings.address, name="deploy check") as bus:
                heard = listen(bus, settings.can.listen_s)
        except BusUnavailable as error:
            return [Verdict(question=INTERFACE, result=Result.FAILED, reason=str(error))]
        verdicts += judge(settings, heard, loader_database())
    if settings.gateway is not None:
        machine = settings.gateway.machine_interface
        verdicts.append(judge_interface(settings, Link.read(machine), machine, GATEWAY))
    return verdicts


def use(settings: ServiceSettings) -> None:
    """Use every setting once, as the services will. Raises ConfigurationError with the file and the key of the first that cannot be used."""
    cpu, allowed = settings.realtime.cpu, os.sched_getaffinity(0)
    if cpu is not None and cpu not in allowed:
        known = ", ".join(map(str, sorted(allowed)))
        raise settings.error(
            "realtime.cpu", f"= {cpu}: this computer has no such processor for us; it has {known}"
        )
    try:
        table = calibration_table(settings.calibration)
        calibration = read_calibration(table)
    except UserError as error:
        raise settings.error("ecu.calibration", f"= {settings.calibration!r}: {error}") from error
    try:
        # made once here: what is not in C, or cannot be compiled, is found before the service starts
        cycle = BY_NAME[settings.core].ecu(
            calibration, form=settings.form, limits=settings.limits, detect_faults=settings.detect_faults
        )
    except UserError as error:
        raise settings.error("ecu.core", f"= {settings.core!r}: {error}") from error
    _offer(settings, cycle, table)
    if settings.gateway is not None and settings.gateway.routes is not None:
        routes = settings.gateway.routes
        try:
            routes_of(read_settings(Path(routes)), loader_database(), routes)
        except UserError as error:
            raise settings.error("gateway.routes", f"= {routes!r}: {error}") from error


def _offer(settings: ServiceSettings, cycle: Ecu, table: CheckedTable) -> None:
    """Make each service by itself, so that an error names its key, then all together."""
    offered = settings.offered
    alone = {
        key: replace(NO_SERVICES, access_key=offered.access_key, **{key: value})
        for key in ("j1939", "xcp", "uds")
        if (value := getattr(offered, key)) is not None
    }
    for key, options in {
        **{f"offered.{key}": each for key, each in alone.items()},
        "offered": offered,
    }.items():
        try:
            services_of(cycle, table, options)
        except SecretError as error:
            raise settings.error(KEY, f"= {str(offered.access_key)!r}: {error}") from error
        except UserError as error:
            raise settings.error(key, f"cannot be offered: {error}") from error


def listen(bus: Transport, duration_s: float) -> Heard:
    """Everything that the bus gives within `duration_s`; nothing is sent."""
    heard = Heard()
    end = time.monotonic() + duration_s
    with selectors.DefaultSelector() as selector:
        selector.register(bus.fileno(), selectors.EVENT_READ)
        while (left := end - time.monotonic()) > 0:
            if selector.select(left):
                while frames := bus.drain():
                    heard.frames.update(frame.can_id for frame in frames)
                heard.findings += bus.findings()
    # the transport counts error frames that it does not hand on
    heard.errors = bus.statistics().errors
    return heard


def judge_interface(
    settings: ServiceSettings, link: Link | None, name: str | None = None, question: str = INTERFACE
) -> Verdict:
    """Whether an interface, by default the ECU's, exists, is a CAN interface, is up and can send."""
    name = name or settings.can.interface
    if link is None:
        known = ", ".join(can_interfaces()) or "none"
        return _failed(
            question, f"there is no interface {name} (CAN interfaces: {known}): is the adapter plugged in?"
        )
    if not link.can:
        return _failed(question, f"{name} is not a CAN interface")
    if not link.up:
        rate = settings.can.bit_rate
        return _failed(
            question, f"{name} is down: `ip link set {name} up type can bitrate {rate}`, or systemd-networkd"
        )
    if not link.carrier:
        return _failed(question, f"{name} is up but cannot send: bus-off, or nothing is plugged in")
    return Verdict(question=question, result=Result.PASSED, reason=f"{name} is up")


def judge(settings: ServiceSettings, heard: Heard, database: Database) -> list[Verdict]:
    """Verdicts on what was heard."""
    names = {can_id: codec.name for can_id, codec in database.by_id.items()}
    ours, machine = (heard.frames.keys() & identifiers_of(node, database) for node in (NODE, "Machine"))
    verdicts = []
    if ours:
        said = ", ".join(f"{names[can_id]} ({heard.frames[can_id]} frames)" for can_id in sorted(ours))
        # Two ECUs on one bus would each see the other's limits obeyed: the check has to come before the first frame.
        verdicts.append(_failed(ALONE, f"another node sends {said}"))
    else:
        verdicts.append(
            Verdict(question=ALONE, result=Result.PASSED, reason=f"listened for {settings.can.listen_s:g} s")
        )
    if heard.errors or heard.findings:
        first = f"; first: {heard.findings[0]}" if heard.findings else ""
        verdicts.append(
            _failed(HEALTHY, f"{heard.errors} error frames{first}: bit rate, termination, or a broken node?")
        )
    else:
        verdicts.append(
            Verdict(question=HEALTHY, result=Result.PASSED, reason=f"{heard.frames.total()} frames, no error")
        )
    verdicts.append(_judge_machine(settings, len(machine), heard))
    return verdicts


def _judge_machine(settings: ServiceSettings, messages: int, heard: Heard) -> Verdict:
    if messages:
        return Verdict(question=MACHINE, result=Result.PASSED, reason=f"{messages} of its messages came")
    other = f"{len(heard.frames)} other identifiers came" if heard.frames else "the bus is silent"
    reason = f"none of its messages came within {settings.can.listen_s:g} s; {other}"
    # A machine may be switched on after its ECU: only who asks for it gets a refusal.
    result = Result.FAILED if settings.can.needs_machine else Result.INCONCLUSIVE
    return Verdict(question=MACHINE, result=result, reason=reason)


def _failed(question: str, reason: str) -> Verdict:
    return Verdict(question=question, result=Result.FAILED, reason=reason)
