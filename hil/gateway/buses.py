"""Where the processes of a run meet: all on one bus, or plant and ECU on two with the gateway between them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bus.hub.client import hub_status
from bus.transport import BusUnavailable
from bus.user_error import UserError
from hil.gateway.routes import SIDES, Side

HUB: Final = "hub:"


class BusesError(UserError, ValueError):
    """The buses chosen for a run do not go together; the message names the options."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Buses:
    """plant, ecu: addresses for the two sides of a gateway, None for a hub of the run's own.

    routes: the gateway's TOML file; control: where it listens for live commands.
    foreign_plant, foreign_ecu: address of the bus on which a node that is not ours stands in for our process; wait_s: how long to wait
    for its first frame.
    """

    gateway: bool = False
    plant: str | None = None
    ecu: str | None = None
    routes: Path | None = None
    control: Path | None = None
    foreign_plant: str | None = None
    foreign_ecu: str | None = None
    wait_s: float = 60.0

    def __post_init__(self) -> None:
        options = {
            "--plant-bus": self.plant,
            "--ecu-bus": self.ecu,
            "--routes": self.routes,
            "--control": self.control,
        }
        given = [name for name, value in options.items() if value is not None]
        if given and not self.gateway:
            raise BusesError(f"{given[0]} is about a gateway; add --gateway, or leave it out")
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
        """The sides that are not ours, each with the address of its bus."""
        given: dict[Side, str | None] = {"plant": self.foreign_plant, "ecu": self.foreign_ecu}
        return {side: address for side, address in given.items() if address is not None}

    def _side(self, side: Side) -> str | None:
        return self.plant if side == "plant" else self.ecu

    def addresses(self, folder: Path) -> dict[Side, str]:
        """Of both sides; equal without a gateway. folder: where the hubs of the run have their sockets."""
        if not self.gateway:
            shared = next(iter(self.foreign.values()), f"hub:{folder / 'hub'}")
            return dict.fromkeys(SIDES, shared)
        return {side: self.foreign.get(side) or self._side(side) or f"hub:{folder / side}" for side in SIDES}

    def own_hubs(self, folder: Path) -> dict[str, str]:
        """The hubs that the run has to start, by the name of their process.

        A hub for a foreign node may run already, or be the run's own: whichever, the node finds it at its address.
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
