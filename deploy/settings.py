"""Settings of a deployed ECU: one TOML file, checked before anything is sent on the bus."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from configuration import CheckedTable, ConfigurationError
from deploy.c.core import BY_NAME
from deploy.words import single_line
from ecu.core import Form
from ecu.offered.services import NO_SERVICES, ServiceOptions
from hil.ecu_side import CALIBRATION, FORMS
from hil.shell.realtime_options import PRIORITIES, RealtimeOptions

CORES = tuple(BY_NAME)
KEY = "offered.access_key"
SUFFIXES = ("blf", "log", "asc", "mf4")
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
class RecorderSettings:
    """The service that records the bus."""

    suffix: str  # of the files, which is their format
    rotate_mib: float  # a new file begins after this size [MiB]


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewaySettings:
    """The service that stands between the ECU's bus and that of the machine."""

    machine_interface: str  # CAN interface on the machine's bus
    routes: str | None  # path of a TOML file with rules; None: what the DBC says


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """A deployed ECU."""

    file: Path  # that holds the settings; errors name it
    can: CanSettings
    core: str  # what computes the ECU: python, c
    calibration: str  # name or path of the ECU's calibration
    form: Form
    limits: bool
    realtime: RealtimeOptions
    watchdog_s: float  # without a tick for so long, systemd ends and restarts the ECU [s]
    recorder: RecorderSettings | None = None
    gateway: GatewaySettings | None = None
    detect_faults: bool = True  # whether sensors are tested against each other
    offered: ServiceOptions = NO_SERVICES  # what the ECU answers on the bus beside its own messages

    @property
    def address(self) -> str:
        """The bus, as every command takes it."""
        return f"socketcan:{self.can.interface}"

    @property
    def paths(self) -> Mapping[str, str]:
        """The files that the services read, by the key that names them."""
        named = {
            # a calibration without a suffix is one that the package has
            "ecu.calibration": self.calibration if self.calibration.endswith(".toml") else None,
            KEY: None if self.offered.access_key is None else str(self.offered.access_key),
            "gateway.routes": None if self.gateway is None else self.gateway.routes,
        }
        return {key: path for key, path in named.items() if path is not None}

    def error(self, key: str, what: str) -> ConfigurationError:
        """An error about a key of the file, such as `ecu.core`."""
        return ConfigurationError(f"{self.file}: {key} {what}")

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
        recorder = top.table("recorder") if "recorder" in top else None
        gateway = top.table("gateway") if "gateway" in top else None
        offered = top.table("offered") if "offered" in top else None
        settings = cls(
            file=path,
            can=_can(can),
            core=ecu.choice("core", CORES) if "core" in ecu else CORES[0],
            calibration=_line(ecu, "calibration", CALIBRATION),
            form=next(known for known in FORMS if known == form),
            limits=ecu.flag("limits", default=True),
            detect_faults=ecu.flag("detect_faults", default=True),
            realtime=RealtimeOptions(
                fifo=fifo, cpu=cpu, lock_memory=realtime.flag("lock_memory", default=True)
            ),
            # Below 0.2 s a busy host would look like a dead ECU.
            watchdog_s=service.number("watchdog_s", unit="s", low=0.2, high=60.0, default=1.0),
            recorder=_recorder(recorder) if recorder is not None else None,
            gateway=_gateway(gateway, can) if gateway is not None else None,
            offered=_offered(offered) if offered is not None else NO_SERVICES,
        )
        for table in (can, ecu, realtime, service, recorder, gateway, offered, top):
            if table is not None:
                table.finish()
        return settings


def _can(table: CheckedTable) -> CanSettings:
    """The table [can]."""
    return CanSettings(
        interface=_interface(table, "interface"),
        bit_rate=table.integer("bit_rate_bit_s", low=10_000, high=1_000_000, default=500_000),
        restart_ms=table.integer("restart_ms", low=0, high=60_000, default=100),
        listen_s=table.number("listen_s", unit="s", low=0.1, high=60.0, default=1.0),
        needs_machine=table.flag("needs_machine", default=False),
    )


def _recorder(table: CheckedTable) -> RecorderSettings:
    """The table [recorder]."""
    return RecorderSettings(
        suffix=table.choice("format", SUFFIXES) if "format" in table else SUFFIXES[0],
        # files of a size that a mail or a stick takes; a recorder of days must not make one file of them
        rotate_mib=table.number("rotate_mib", unit="MiB", low=1.0, high=100_000.0, default=64.0),
    )


def _gateway(table: CheckedTable, can: CheckedTable) -> GatewaySettings:
    """The table [gateway]."""
    machine = _interface(table, "machine_interface")
    if machine == can.text("interface"):
        raise table.error("machine_interface", f"= {machine!r} is the ECU's own: a gateway has two buses")
    return GatewaySettings(
        machine_interface=machine, routes=_line(table, "routes") if "routes" in table else None
    )


def _offered(table: CheckedTable) -> ServiceOptions:
    """The table [offered]. Identifiers, NAME and key are checked with the ECU that they belong to (deploy.check)."""
    words = {key: _line(table, key) if key in table else None for key in ("xcp", "uds", "j1939")}
    key_file = Path(_line(table, "access_key")) if "access_key" in table else None
    return ServiceOptions(**words, access_key=key_file)


def _line(table: CheckedTable, key: str, default: str | None = None) -> str:
    """The text at `key`, which becomes a word of a command that root's files start."""
    value = table.text(key, default=default)
    if not single_line(value):
        raise table.error(key, f"= {value!r} has a control character, such as the end of a line")
    return value


def _interface(table: CheckedTable, key: str) -> str:
    """The name of a CAN interface."""
    interface = table.text(key)
    # The name becomes part of file names and of commands that root runs.
    if len(interface) > NAME_LENGTH or not interface.isascii() or not interface.isalnum():
        raise table.error(
            key,
            f"= {interface!r} is no name of a CAN interface: at most {NAME_LENGTH} letters and digits",
        )
    return interface
