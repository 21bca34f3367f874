"""The gateway process: everything between the plant's bus and the ECU's."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from bus.transport import BusUnavailable, Transport
from dbc import loader_database
from dbc.database import Database
from hil import rundir
from hil.ending import Ending
from hil.gateway.core import GatewayCore
from hil.gateway.routes import SIDES, Side
from hil.gateway.settings import Settings, read_settings, routes_of
from hil.gateway.shell import GatewayLoop
from hil.gateway.tap import tapped
from hil.lifeline import Lifeline
from hil.processes.shell import HostShare, Stop, log_to

LAST_BATCHES = 256
"""Batches passed on after the end was asked for: the hub's whole backlog."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Between:
    """What a gateway stands between, and by which rules.

    routes: TOML file, None for what the DBC says; dbc: other than loader.dbc.
    """

    addresses: dict[Side, str]
    routes: Path | None = None
    dbc: Path | None = None
    settings: Settings = field(init=False)

    def __post_init__(self) -> None:
        if self.addresses["plant"] == self.addresses["ecu"]:
            raise BusUnavailable(
                f"both sides are {self.addresses['ecu']}: a gateway stands between two buses"
            )
        settings = read_settings(self.routes) if self.routes is not None else Settings()
        object.__setattr__(self, "settings", settings)

    def core(self) -> GatewayCore:
        """A fresh gateway by these rules."""
        database = Database.from_file(self.dbc) if self.dbc is not None else loader_database()
        routes = routes_of(self.settings, database, str(self.routes or "the built-in routes"))
        return GatewayCore(routes, queue_frames=self.settings.queue_frames)


def run(line: Lifeline, between: Between, out: Path | None) -> Ending:
    """Route between two buses until told to end; with `out`, its log and stamps are left there."""
    log_to(out and out / rundir.GATEWAY_LOG)
    core = between.core()
    host = HostShare()
    with ExitStack() as stack:
        buses: dict[Side, Transport] = {}
        for side in SIDES:
            stamps = out and rundir.stamps(out, f"gateway-{side}")
            buses[side], _ = stack.enter_context(tapped(between.addresses[side], "gateway", stamps))
        stop, loop = stack.enter_context(Stop()), stack.enter_context(GatewayLoop(core, buses))
        line.ready()
        try:
            for _ in stop.readable(loop.fileno()):
                loop.serve()
            _pass_what_came(loop)
        finally:
            line.finished(complete=True, dropped=lost(core, buses), **figures(core), **host.figures())
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED


def _pass_what_came(loop: GatewayLoop) -> None:
    """What had arrived when the end was asked for still crosses; a bus that never falls silent is left."""
    for _ in range(LAST_BATCHES):
        if not loop.serve():
            return


def lost(core: GatewayCore, buses: dict[Side, Transport]) -> int:
    """Frames that the gateway should have passed on and did not; what a bus refused at first was offered again."""
    unread = sum(bus.statistics().dropped_in for bus in buses.values())
    return unread + sum(core.counts[side].overflowed + len(core.waiting(side)) for side in SIDES)


def figures(core: GatewayCore) -> dict[str, int]:
    """The counters of both sides as figures of the process, SIDE_NAME; what is zero is left out."""
    named: dict[str, int] = {}
    for side in SIDES:
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
    return named
