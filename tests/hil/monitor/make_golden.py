"""Writes golden/: what Debian's candump prints for frames of every kind; run under scripts/with-vcan.

    scripts/with-vcan .venv/bin/python -m tests.hil.monitor.make_golden

`log.txt` is candump's log of the frames, with which the other files can be made anew line by line.
"""

import os
import tempfile
import time
from pathlib import Path

from bus.socketcan.transport import SocketCanTransport
from tests.hil.monitor.candump_tool import STYLES, candumps, every_kind

GOLDEN = Path(__file__).parent / "golden"
TARGET = "any,0:0,#FFFFFFFF"
FRAMES, SEED = 60, 3


def file_of(options: str) -> Path:
    """The file for candump's options."""
    return GOLDEN / f"candump{options.replace(' ', '') or '-plain'}.txt"


def main() -> None:
    """Send the frames on two interfaces in turns, slowly enough for the time stamps to differ."""
    os.environ["TZ"] = "UTC"
    GOLDEN.mkdir(exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        SocketCanTransport("vcan0") as zero,
        SocketCanTransport("vcan1") as one,
        candumps(Path(folder), [(options, [TARGET]) for options in STYLES]) as running,
    ):
        for number, frame in enumerate(every_kind(FRAMES, SEED)):
            (one if number % 3 == 2 else zero).send(frame)
            time.sleep(0.01)
        for options, candump in zip(STYLES, running, strict=True):
            file_of(options).write_bytes(candump.finish())


if __name__ == "__main__":
    main()
