"""The gateway process: everything between the plant's bus and the ECU's."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from bus.address import open_transport
from bus.transport import BusUnavailable, Transport
from dbc import loader_database
from dbc.database import Database
from hil.ending import Ending
from hil.gateway.core import Counts, GatewayCore
from hil.gateway.routes import SIDES, Fate, Side
from hil.gateway.settings import Settings, read_settings, routes_of
from hil.gateway.shell import GatewayLoop
from hil.lifeline import Lifeline
from hil.processes.shell import HostShare, Stop, log_to

LOG = "gateway.log"


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
    """Route between two buses until told to end; with `out`, its log is left there."""
    log_to(out and out / LOG)
    core = between.core()
    host = HostShare()
    with ExitStack() as stack:
        buses: dict[Side, Transport] = {
            side: stack.enter_context(open_transport(between.addresses[side], name="gateway"))
            for side in SIDES
        }
        stop, loop = stack.enter_context(Stop()), stack.enter_context(GatewayLoop(core, buses))
        line.ready()
        try:
            for _ in stop.readable(loop.fileno()):
                loop.serve()
        finally:
            figures = {
                f"{side}_{key}": value for side in SIDES for key, value in _told(core.counts[side]).items()
            }
            line.finished(complete=True, dropped=lost(core, buses), **figures, **host.figures())
    return Ending.PASSED if line.supervised else Ending.INTERRUPTED


def lost(core: GatewayCore, buses: dict[Side, Transport]) -> int:
    """Frames that the gateway should have passed on and did not; what a bus refused at first was offered again."""
    unread = sum(bus.statistics().dropped_in for bus in buses.values())
    return unread + sum(core.counts[side].overflowed + len(core.waiting(side)) for side in SIDES)


def _told(counts: Counts) -> dict[str, int]:
    """The counters of one side as figures of the process; what is zero is left out."""
    stayed = {f"stayed_{fate.name.lower()}": counts.stayed[fate] for fate in Fate}
    figures = {
        "received": counts.received,
        "sent": counts.sent,
        "overflowed": counts.overflowed,
        "held": counts.held,
        "silenced": counts.silenced,
        "injected": counts.injected,
        **stayed,
    }
    return {name: count for name, count in figures.items() if count or name in ("received", "sent")}
