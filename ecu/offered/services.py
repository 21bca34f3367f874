"""Makes the services of an ECU. Each is imported where it is asked for: an ECU that offers nothing loads nothing."""

import importlib.metadata
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bus.user_error import UserError
from configuration import CheckedTable
from dbc import loader_database
from ecu.calibration import read_calibration
from ecu.core import Ecu
from ecu.cycle import EcuCycle
from ecu.node import BusService

if TYPE_CHECKING:
    from ecu.measure.channel import Channel


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceOptions:
    """What the user asks for; nothing by default."""

    xcp: str | None = None  # identifiers of tool and ECU, for measuring and calibrating
    uds: str | None = None  # ... for diagnosis
    j1939: str | None = None  # fields of the NAME with which the ECU claims its address
    access_key: Path | None = None  # file with the secret behind seed and key; None: nothing can be changed


NO_SERVICES = ServiceOptions()


class ServicesError(UserError, ValueError):
    """This ECU cannot offer what was asked for."""


def services_of(cycle: Ecu, table: CheckedTable, options: ServiceOptions) -> list[BusService]:
    """The services of an ECU. table: that of its calibration. Raises UserError for identifiers or a key that cannot be used."""
    offered: list[BusService] = []
    if options.j1939 is not None:
        # any core: it looks at addresses and not into the ECU
        offered.append(_j1939(table, options.j1939))
    if options.xcp is None and options.uds is None:
        return offered
    if not isinstance(cycle, EcuCycle):
        raise ServicesError("XCP and UDS are offered by the ECU in Python only: leave --core at python")
    from ecu.measure.access import read_secret
    from ecu.measure.channel import Channel

    secret = None if options.access_key is None else read_secret(options.access_key)
    channels = {
        name: Channel.parse(text, loader_database())
        for name, text in (("xcp", options.xcp), ("uds", options.uds))
        if text is not None
    }
    words = [word for channel in channels.values() for word in (channel.receive, channel.send)]
    if len(set(words)) < len(words):
        raise ServicesError(f"--xcp {options.xcp} and --uds {options.uds} share an identifier")
    if "xcp" in channels:
        from ecu.xcp.service import xcp_service

        offered.append(xcp_service(cycle, table, channels["xcp"], secret=secret, random=secrets.token_bytes))
    if "uds" in channels:
        offered.append(_uds(cycle, table, channels["uds"], secret))
    return offered


def _j1939(table: CheckedTable, name: str) -> BusService:
    from ecu.j1939.name import Name
    from ecu.j1939.service import j1939_service

    return j1939_service(
        Name.parse(name),
        loader_database(),
        calibration=read_calibration(table).name,
        version=importlib.metadata.version("loaderhil"),
        random=lambda: secrets.randbelow(256),
    )


def _uds(cycle: EcuCycle, table: CheckedTable, channel: "Channel", secret: bytes | None) -> BusService:
    try:
        # an extra of the package: only this service needs it
        from ecu.uds.service import uds_service
    except ModuleNotFoundError as error:
        raise ServicesError(
            "UDS needs the package can-isotp: pip install loaderhil[diagnosis-on-bus]"
        ) from error

    version = importlib.metadata.version("loaderhil")
    return uds_service(cycle, table, channel, version=version, secret=secret, random=secrets.token_bytes)
