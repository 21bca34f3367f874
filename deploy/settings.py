"""Settings of a deployed ECU: one TOML file, checked before anything is sent on the bus."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from configuration import CheckedTable
from hil.ecu_side import CALIBRATION, FORMS, Form
from hil.shell.realtime_options import PRIORITIES, RealtimeOptions

NAME_LENGTH = 15  # IFNAMSIZ of Linux less the closing zero


@dataclass(frozen=True, slots=True, kw_only=True)
class CanSettings:
    """The CAN interface and what has to be on it."""

    interface: str
    bit_rate: int  # [bit/s]
    restart_ms: int  # after a bus-off, until the controller is started again; 0: never
    listen_s: float  # how long to listen before the first frame is sent [s]
    needs_machine: bool  # whether a silent bus is an error before the start, or only remarked


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """A deployed ECU."""

    can: CanSettings
    calibration: str  # name or path of the ECU's calibration
    form: Form
    limits: bool
    realtime: RealtimeOptions
    watchdog_s: float  # without a tick for so long, systemd ends and restarts the ECU [s]

    @property
    def address(self) -> str:
        """The bus, as every command takes it."""
        return f"socketcan:{self.can.interface}"

    @classmethod
    def from_file(cls, path: Path) -> Self:
        """Raises ConfigurationError with file, key, value, unit and permitted range."""
        top = CheckedTable.from_file(path)
        can, ecu, realtime, service = (top.table(name) for name in ("can", "ecu", "realtime", "service"))
        form = ecu.choice("form", FORMS) if "form" in ecu else FORMS[0]
        fifo, cpu = (
            realtime.integer(key, low=low, high=high) if key in realtime else None
            for key, low, high in (("fifo", *PRIORITIES), ("cpu", 0, 8191))
        )
        settings = cls(
            can=_can(can),
            calibration=ecu.text("calibration", default=CALIBRATION),
            form=next(known for known in FORMS if known == form),
            limits=ecu.flag("limits", default=True),
            realtime=RealtimeOptions(
                fifo=fifo, cpu=cpu, lock_memory=realtime.flag("lock_memory", default=True)
            ),
            # Below 0.2 s a busy host would look like a dead ECU.
            watchdog_s=service.number("watchdog_s", unit="s", low=0.2, high=60.0, default=1.0),
        )
        for table in (can, ecu, realtime, service, top):
            table.finish()
        return settings


def _can(table: CheckedTable) -> CanSettings:
    """The table [can]."""
    interface = table.text("interface")
    # The name becomes part of file names and of commands that root runs.
    if len(interface) > NAME_LENGTH or not interface.isascii() or not interface.isalnum():
        raise table.error(
            "interface",
            f"= {interface!r} is no name of a CAN interface: at most {NAME_LENGTH} letters and digits",
        )
    return CanSettings(
        interface=interface,
        bit_rate=table.integer("bit_rate_bit_s", low=10_000, high=1_000_000, default=500_000),
        restart_ms=table.integer("restart_ms", low=0, high=60_000, default=100),
        listen_s=table.number("listen_s", unit="s", low=0.1, high=60.0, default=1.0),
        needs_machine=table.flag("needs_machine", default=False),
    )
