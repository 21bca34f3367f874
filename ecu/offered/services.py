"""Makes the services of an ECU. Each is imported where it is asked for: an ECU that offers nothing loads nothing."""

import importlib.metadata
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

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


@runtime_checkable
class OffersByItself(Protocol):
    """An ECU of another core that has XCP and UDS of its own."""

    def offer(
        self,
        table: CheckedTable,
        channels: "tuple[Channel | None, Channel | None]",
        secret: bytes | None,
        random: Callable[[int], bytes],
    ) -> BusService:
        """Both as one service, before the first frame. channels: of XCP and of UDS; secret: without one nothing can be unlocked."""
        ...


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
    if isinstance(cycle, OffersByItself):
        both = channels.get("xcp"), channels.get("uds")
        return [*offered, cycle.offer(table, both, secret, secrets.token_bytes)]
    if not isinstance(cycle, EcuCycle):
        raise ServicesError("this core of the ECU offers neither XCP nor UDS: take --core python or c")
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
