"""The gateway process of a real-time run: routes, checks and faults between the plant's bus and the ECU's."""

import logging
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bus.transport import BusUnavailable, Transport
from dbc import FOLDER, loader_database
from dbc.database import Database
from dbc.protections import read_protections
from hil import rundir
from hil.ending import Ending
from hil.faults.control import ControlServer
from hil.faults.injector import Injector
from hil.faults.passage import Action
from hil.faults.record import injected, write_faults
from hil.faults.table import faults_of
from hil.gateway.core import GatewayCore
from hil.gateway.routes import SIDES, Side
from hil.gateway.settings import Settings, read_settings, routes_of
from hil.gateway.shell import GatewayLoop
from hil.gateway.tap import tapped
from hil.gateway.watcher import Watcher
from hil.shell.lifeline import Lifeline
from hil.shell.process import Stop, log_to
from hil.shell.realtime_options import ORDINARY, RealtimeOptions
from hil.timing.host import OwnWaits

log = logging.getLogger(__name__)
LAST_BATCHES = 256
"""Batches that still cross after the signal to end: as many as the hub's whole backlog."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Between:
    """The buses and the rules of a gateway."""

    addresses: dict[Side, str]
    routes: Path | None = None  # TOML file; None: by senders and receivers of the DBC
    dbc: Path | None = None  # None: loader.dbc
    protection: Path | None = None  # TOML file with protections of the user; None: those of the DBC
    inject: tuple[Path, ...] = ()  # files with faults
    seed: int = 0  # of the random choices of faults
    control: Path | None = None  # socket on which live commands are accepted

    def __post_init__(self) -> None:
        if self.addresses["plant"] == self.addresses["ecu"]:
            raise BusUnavailable(
                f"both sides are {self.addresses['ecu']}: a gateway stands between two buses"
            )

    def database(self) -> Database:
        """The database of the messages on both buses."""
        if self.protection is None:
            return Database.from_file(self.dbc) if self.dbc is not None else loader_database()
        # A database of its own: the protections must not reach whoever else uses the shared one.
        database = Database.from_file(self.dbc or FOLDER / "loader.dbc")
        database.protect_with(read_protections(self.protection))
        return database

    def injector(self, database: Database) -> Injector | None:
        """The faults of the files, and those that commands will bring; None if there can be none."""
        if not self.inject and self.control is None:
            return None
        faults = [fault for file in self.inject for fault in faults_of(file, database)]
        return Injector(database, faults, seed=self.seed)

    def core(self, database: Database, injector: Injector | None) -> tuple[GatewayCore, Watcher]:
        """A fresh gateway by these rules, and its end-to-end check."""
        settings = read_settings(self.routes) if self.routes is not None else Settings()
        routes = routes_of(settings, database, str(self.routes or "the built-in routes"))
        watcher = Watcher(routes)
        frames = settings.queue_frames
        return GatewayCore(routes, injector=injector, watcher=watcher, queue_frames=frames), watcher


def run(line: Lifeline, between: Between, out: Path | None, realtime: RealtimeOptions = ORDINARY) -> Ending:
    """Route between two buses until a signal ends it; with `out`, its log, stamps and faults are written there."""
    log_to(out and out / rundir.GATEWAY_LOG)
    database = between.database()
    injector = between.injector(database)
    core, watcher = between.core(database, injector)
    with ExitStack() as stack:
        buses: dict[Side, Transport] = {}
        for side in SIDES:
            stamps = out and rundir.stamps(out, f"gateway-{side}")
            buses[side], _ = stack.enter_context(tapped(between.addresses[side], "gateway", stamps))
        control = stack.enter_context(_control(between.control, core, watcher, injector))
        stop = stack.enter_context(Stop())
        loop = stack.enter_context(GatewayLoop(core, buses, act=lambda action: _act(line, action)))
        waits = stack.enter_context(OwnWaits(line.waited))
        realtime.apply()
        line.ready()
        kept = 0
        try:
            for _ in stop.readable(loop.fileno(), *([control.fileno()] if control else [])):
                if control is not None:
                    control.serve()
                loop.serve()
                waits.look(time.monotonic_ns())
                kept = _keep(injector, core, out, kept)
            _pass_what_came(loop)
        finally:
            _log_troubles(watcher)
            if injector is not None:
                _conclude(injector, core, out)
            line.finished(complete=True, dropped=lost(core, buses), **figures(core, watcher))
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED


def _control(
    path: Path | None, core: GatewayCore, watcher: Watcher, injector: Injector | None
) -> AbstractContextManager[ControlServer | None]:
    """The server of live commands; None without a socket or an injector."""
    if path is None or injector is None:
        return nullcontext()

    def obey(request: Mapping[str, Any]) -> Mapping[str, Any]:
        if request.get("command") == "status":
            return {"ok": True, "figures": figures(core, watcher)}
        return injector.command(request, time.monotonic_ns())

    return ControlServer(path, obey)


def _act(line: Lifeline, action: Action) -> None:
    """Pass an action on processes to the supervisor, which alone can kill and start them."""
    if line.supervised:
        line.act(action.kind, action.target)
    log.warning(
        "%s the %s process%s", action.kind, action.target, "" if line.supervised else ": nobody supervises it"
    )


def _keep(injector: Injector | None, core: GatewayCore, out: Path | None, kept: int) -> int:
    """Write faults.json if faults began or ended since it was written last; a gateway that is killed then leaves the file.

    kept: number of events in the file. Returns how many are in it now.
    """
    if injector is None or out is None or len(injector.events) == kept:
        return kept
    write_faults(out, injected(injector.events, core.started_ns or 0))
    return len(injector.events)


def _conclude(injector: Injector, core: GatewayCore, out: Path | None) -> None:
    """End the faults that still last, log what there was, and leave it in the run directory."""
    injector.finish(time.monotonic_ns())
    zero_ns = core.started_ns or 0
    for event in injector.events:
        at_s = (event.at_ns - zero_ns) * 1e-9
        log.info(
            "%.3f s: fault %d %s: %s (%d frames)", at_s, event.number, event.what, event.label, event.struck
        )
    if out is not None:
        write_faults(out, injected(injector.events, zero_ns))


def _pass_what_came(loop: GatewayLoop) -> None:
    """Let the frames cross that had arrived before the signal to end; bounded, because a bus need not fall silent."""
    for _ in range(LAST_BATCHES):
        if not loop.serve():
            return


def lost(core: GatewayCore, buses: dict[Side, Transport]) -> int:
    """Frames that the gateway should have passed on and did not."""
    # `held` is not counted: a frame that a bus refused was offered again
    unread = sum(bus.statistics().dropped_in for bus in buses.values())
    return unread + sum(core.counts[side].overflowed + len(core.waiting(side)) for side in SIDES)


def _log_troubles(watcher: Watcher) -> None:
    """One line per message that was ever in trouble."""
    for side in SIDES:
        troubles = watcher.troubles(side)
        for name in dict.fromkeys(name for name, _ in troubles):
            counts = [f"{count} {what.value}" for (of, what), count in troubles.items() if of == name]
            log.info("%s side: %s: %s", side, name, ", ".join(counts))


def figures(core: GatewayCore, watcher: Watcher) -> dict[str, int]:
    """The counters of both sides as figures of the process, SIDE_NAME; what is zero is left out."""
    named: Counter[str] = Counter()
    for side in SIDES:
        for (_, trouble), count in watcher.troubles(side).items():
            named[f"{side}_{trouble.name.lower()}"] += count
        counts = core.counts[side]
        named |= {f"{side}_received": counts.received, f"{side}_sent": counts.sent}
        others = {
            "overflowed": counts.overflowed,
            "held": counts.held,
            "silenced": counts.silenced,
            "injected": counts.injected,
            **{f"stayed_{fate.name.lower()}": count for fate, count in counts.stayed.items()},
        }
        named |= {f"{side}_{name}": count for name, count in others.items() if count}
    return dict(named)
