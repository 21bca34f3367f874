"""Where the processes of a run meet: all on one bus, or plant and ECU on two with the gateway between them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bus.mistake import Mistake
from hil.gateway.routes import SIDES, Side


class BusesError(Mistake, ValueError):
    """The buses chosen for a run do not go together; the message names the options."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Buses:
    """plant, ecu: addresses for the two sides of a gateway, None for a hub of the run's own.

    routes: the gateway's TOML file; control: where it listens for live commands.
    """

    gateway: bool = False
    plant: str | None = None
    ecu: str | None = None
    routes: Path | None = None
    control: Path | None = None

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

    def addresses(self, folder: Path) -> dict[Side, str]:
        """Of both sides; equal without a gateway. folder: where the hubs of the run have their sockets."""
        if not self.gateway:
            return dict.fromkeys(SIDES, f"hub:{folder / 'hub'}")
        return {
            "plant": self.plant or f"hub:{folder / 'plant'}",
            "ecu": self.ecu or f"hub:{folder / 'ecu'}",
        }

    def own_hubs(self, folder: Path) -> dict[str, str]:
        """The hubs that the run has to start, by the name of their process."""
        addresses = self.addresses(folder)
        if not self.gateway:
            return {"hub": addresses["plant"]}
        return {
            f"{side}-hub": addresses[side]
            for side in SIDES
            if {"plant": self.plant, "ecu": self.ecu}[side] is None
        }


ONE_BUS: Final = Buses()
