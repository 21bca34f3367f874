"""Opening a bus by its address: `hub:/path/to/socket`, `hub:@NAME`, `socketcan:can0`, `virtual:NAME`."""

from pathlib import Path

from bus.hub.client import HubTransport
from bus.socketcan.transport import SocketCanTransport
from bus.transport import BusUnavailable, Transport
from bus.virtual import named_bus

KINDS = ("hub", "socketcan", "virtual")
FORMS = "hub:/path/to/socket, hub:@NAME, socketcan:INTERFACE or virtual:NAME"


def open_transport(address: str, *, name: str = "") -> Transport:
    """The bus at `address`; name: what the hub calls this client in its list.

    BusUnavailable if it cannot be opened, with the cause and what would help.
    """
    scheme, rest = parts_of(address)
    match scheme:
        case "hub":
            return HubTransport(rest, name=name)
        case "socketcan":
            return SocketCanTransport(rest)
        case _:
            return named_bus(rest).connect()


def parts_of(address: str) -> tuple[str, str]:
    """The kind of bus, and its place. BusUnavailable if the address has neither; nothing is opened."""
    scheme, separator, rest = address.partition(":")
    if not separator or not rest:
        raise BusUnavailable(f"{address!r} is no address of a bus; write {_meant(address) or FORMS}")
    if scheme not in KINDS:
        raise BusUnavailable(f"{address!r}: there is no kind of bus {scheme!r}; write {FORMS}")
    return scheme, rest


def inside_computer(address: str, interfaces: Path = Path("/sys/class/net")) -> bool:
    """Whether every node of the bus is a process of this computer: a hub, a virtual bus, a CAN interface without a device (vcan)."""
    scheme, _, rest = address.partition(":")
    return scheme != "socketcan" or not (interfaces / rest / "device").exists()


def _meant(address: str) -> str:
    """The likely full address where the scheme is missing ("can0", "/tmp/hub"); empty if it cannot be guessed."""
    if address.startswith(("can", "vcan", "slcan", "vxcan")):
        return f"socketcan:{address}"
    if address.startswith(("/", "./", "@")):
        return f"hub:{address}"
    return ""
