"""`python -m fmi.slave RESOURCES`: the process behind an exported plant. Started by the FMU's binary (fmi/runtime/slave.c)."""

import os
import socket
import struct
import sys
from pathlib import Path
from typing import Final

import numpy as np

from fmi.quantities import COMMANDS, TRUTH, commands_of
from plant.physics.surface import Surface
from plant.plant import Plant
from plant.sheets.machine import Machine, load_machine

PARAMETERS: Final = {
    "start_payload_mass": ("kg", 0.0, "in the bucket"),
    "friction": ("1", 0.75, "of the ground"),
    "grade": ("rad", 0.0, "of the ground, uphill positive"),
    "bank": ("rad", 0.0, "of the ground"),
    "start_speed": ("m/s", 0.0, "of the rear axle at the start"),
    "start_articulation_angle": ("rad", 0.0, "at the start, left positive"),
    "start_heading": ("rad", 0.0, "at the start, about the road's normal"),
}
"""Parameter -> SI unit, start value, description."""

OUTPUTS: Final = tuple(name for name in TRUTH if name != "time_s")
MACHINE: Final = "machine.toml"
LONGEST: Final = 1000  # bytes of a message to the FMU, whose buffer holds some more
_KEPT: Final = np.array([i for i, name in enumerate(TRUTH) if name != "time_s"])


class Line:
    """One end of the connection to the binary."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end

    def doubles(self, count: int) -> list[float] | None:
        """Numbers that the binary sends; None when it has closed the line."""
        data = self.bytes(8 * count)
        return None if data is None else list(struct.unpack(f"={count}d", data))

    def bytes(self, count: int) -> bytes | None:
        """So many bytes; None when the line is closed."""
        data = b""
        while len(data) < count:
            more = self._end.recv(count - len(data))
            if not more:
                return None
            data += more
        return data

    def answer(self, plant: Plant) -> None:
        """Send the outputs."""
        self._end.sendall(b"\0" + plant.truth().row[_KEPT].tobytes())

    def refuse(self, error: Exception) -> None:
        """Send the reason why a call failed."""
        text = str(error).encode()[:LONGEST]
        self._end.sendall(b"\1" + struct.pack("=I", len(text)) + text)


def made(machine: Machine, numbers: list[float]) -> Plant:
    """The plant of parameters in the order of PARAMETERS. Raises ValueError for values out of range."""
    p = dict(zip(PARAMETERS, numbers, strict=True))
    return Plant(
        machine,
        Surface(friction=p["friction"], grade=p["grade"], bank=p["bank"]),
        payload_mass=p["start_payload_mass"],
        speed=p["start_speed"],
        articulation_angle=p["start_articulation_angle"],
        heading=p["start_heading"],
    )


def serve(line: Line, machine: Machine) -> None:
    """Answer calls until the binary closes the line."""
    plant: Plant | None = None
    while (call := line.bytes(1)) is not None:
        numbers = line.doubles(len(PARAMETERS) if call == b"S" else 2 + len(COMMANDS))
        if numbers is None:
            return
        try:
            if call == b"S":
                plant = made(machine, numbers)
            elif plant is not None:
                plant.advance(commands_of(numbers[2:]), numbers[1])
        except (ValueError, RuntimeError) as error:  # a value out of range; DivergedError
            line.refuse(error)
        else:
            assert plant is not None
            line.answer(plant)


def main() -> None:
    """Serve the plant of the machine in RESOURCES on the socket that is standard input."""
    end = socket.socket(fileno=os.dup(0))
    serve(Line(end), load_machine(Path(sys.argv[1]) / MACHINE))


if __name__ == "__main__":
    main()
