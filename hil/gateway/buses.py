"""The buses of a real-time run: one for all processes, or one each for plant and ECU with the gateway between them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bus.address import parts_of
from bus.hub.client import hub_status
from bus.transport import BusUnavailable
from bus.user_error import UserError
from hil.gateway.routes import SIDES, Side

HUB: Final = "hub:"


class BusesError(UserError, ValueError):
    """The buses chosen for a run do not go together; the message names the options."""


def _check_address(option: str, address: str | None) -> None:
    """Refuse what is no address before anything is started: a process that opened the bus would end the run half-way."""
    if address is None:
        return
    try:
        parts_of(address)
    except BusUnavailable as error:
        raise BusesError(f"{option}: {error}") from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Buses:
    """The choice of buses, as options of `loaderhil run`."""

    gateway: bool = False  # two buses with a gateway between them
    plant: str | None = None  # address of the plant's side of the gateway; None: a hub started by the run
    ecu: str | None = None  # address of the ECU's side; None: a hub started by the run
    routes: Path | None = None  # TOML file of the gateway
    control: Path | None = None  # socket on which the gateway takes live commands
    foreign_plant: str | None = None  # bus of a node that replaces our plant process
    foreign_ecu: str | None = None  # bus of a node that replaces our ECU process
    wait_s: float = 60.0  # longest wait for the first frame of a foreign node [s]

    def __post_init__(self) -> None:
        addresses = {"--plant-bus": self.plant, "--ecu-bus": self.ecu}
        options = addresses | {"--routes": self.routes, "--control": self.control}
        given = [name for name, value in options.items() if value is not None]
        if given and not self.gateway:
            raise BusesError(f"{given[0]} is about a gateway; add --gateway, or leave it out")
        for option, address in (
            addresses | {"--ecu": self.foreign_ecu, "--plant": self.foreign_plant}
        ).items():
            _check_address(option, address)
        if self.plant is not None and self.plant == self.ecu:
            raise BusesError(
                f"--plant-bus and --ecu-bus are both {self.plant}: a gateway stands between two buses"
            )
        if self.foreign_plant is not None and self.foreign_ecu is not None:
            raise BusesError(
                "--plant and --ecu together leave nothing for the bench to run; use `loaderhil record`"
            )
        for side, address in self.foreign.items():
            if self._side(side) is not None:
                raise BusesError(f"--{side} {address} names the bus already; leave --{side}-bus out")

    @property
    def foreign(self) -> dict[Side, str]:
        """Side -> address of its bus, for the sides whose node is foreign."""
        given: dict[Side, str | None] = {"plant": self.foreign_plant, "ecu": self.foreign_ecu}
        return {side: address for side, address in given.items() if address is not None}

    def _side(self, side: Side) -> str | None:
        return self.plant if side == "plant" else self.ecu

    def addresses(self, folder: Path) -> dict[Side, str]:
        """The address of each side; equal without a gateway. folder: for the sockets of the hubs that the run starts."""
        if not self.gateway:
            shared = next(iter(self.foreign.values()), f"hub:{folder / 'hub'}")
            return dict.fromkeys(SIDES, shared)
        return {side: self.foreign.get(side) or self._side(side) or f"hub:{folder / side}" for side in SIDES}

    def own_hubs(self, folder: Path) -> dict[str, str]:
        """The hubs that the run has to start, by the name of their process.

        A hub for a foreign node is started only if none serves its address yet.
        """
        addresses = self.addresses(folder)
        if not self.gateway:
            return {"hub": addresses["plant"]} if self._to_start(addresses["plant"]) else {}
        return {
            f"{side}-hub": addresses[side]
            for side in SIDES
            if self._side(side) is None and self._to_start(addresses[side])
        }

    def _to_start(self, address: str) -> bool:
        if address not in self.foreign.values():
            return True
        if not address.startswith(HUB):
            return False
        try:
            hub_status(address.removeprefix(HUB))
        except BusUnavailable:
            return True
        return False


ONE_BUS: Final = Buses()
