"""Debian's candump as the reference, and frames that show all it can print."""

import contextlib
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from bus.frame import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame
from bus.hub.packet import FD_LENGTHS
from hil.monitor.candump import Stamp, Style
from tests.bus.laws import WAIT_S

STYLES = {
    "": Style(),
    "-L": Style(log=True),
    "-L -x": Style(log=True, extra=True),
    "-t a": Style(stamp=Stamp.ABSOLUTE),
    "-t A -x": Style(stamp=Stamp.DATE, extra=True),
    "-t z -x -a": Style(stamp=Stamp.ZERO, extra=True, text=True),
    "-t d -c": Style(stamp=Stamp.DELTA, colour=1),
    "-t a -c -c": Style(stamp=Stamp.ABSOLUTE, colour=2),
    "-t d -x -c -c -c": Style(stamp=Stamp.DELTA, extra=True, colour=3),
    "-i -a": Style(binary=True, text=True),
    "-S -a": Style(swapped=True, text=True),
    "-i -S": Style(binary=True, swapped=True),
}
"""candump's options, and the style that stands for them."""


def every_kind(count: int, seed: int) -> list[Frame]:
    """Frames of every kind; the first are 11-bit ones, which candump indents only after the first 29-bit one."""
    draw = random.Random(seed)
    frames = [Frame(0x123, b"\x11\x22"), Frame(0x7FF, b"A \x7f~\x1f'`\\"), Frame(0, b"")]
    for _ in range(count - len(frames)):
        can_id = draw.choice((draw.getrandbits(11), EXTENDED | draw.getrandbits(29)))
        kind = draw.choice(("data", "data", "remote", "fd", "error"))
        if kind == "fd":
            flags = FD | draw.choice((0, BRS, ESI, BRS | ESI))
            frames.append(Frame(can_id, draw.randbytes(draw.choice(sorted(FD_LENGTHS))), 0, flags))
        elif kind == "remote":
            frames.append(Frame(can_id | REMOTE, bytes(draw.randint(0, 8))))
        elif kind == "error":
            frames.append(Frame(ERROR | 1 << draw.randrange(9) | draw.getrandbits(9), draw.randbytes(8)))
        else:
            frames.append(Frame(can_id, draw.randbytes(draw.randint(0, 8))))
    return frames


class RunningCandump:
    """A candump that listens, its output going into a file."""

    def __init__(self, output: Path, options: str, targets: Sequence[str]) -> None:
        self._output = output
        with output.open("wb") as file:
            self._process = subprocess.Popen(["candump", *options.split(), *targets], stdout=file)
        self._sockets = len(targets)
        _wait(lambda: self._listens() and self._settled())

    def _listens(self) -> bool:
        count = 0
        for link in Path(f"/proc/{self._process.pid}/fd").iterdir():
            with contextlib.suppress(FileNotFoundError):  # while it starts, files come and go
                count += str(link.readlink()).startswith("socket:")
        return count >= self._sockets

    def _settled(self) -> bool:
        """Whether it sleeps: with a frame to read it would not."""
        state = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()[0]
        return state == "S"

    def wait_settled(self) -> None:
        """Return once it has read all that came."""
        _wait(self._settled)

    def finish(self) -> bytes:
        """Everything it printed, once it has read all that came."""
        self.wait_settled()
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(WAIT_S)
        return self._output.read_bytes()

    def kill(self) -> None:
        """End it, whatever it does."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()


def _wait(ready: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not ready():
        assert time.monotonic() < deadline, "candump does not listen"
        time.sleep(0.002)


@contextmanager
def candumps(folder: Path, wanted: Sequence[tuple[str, Sequence[str]]]) -> Iterator[list[RunningCandump]]:
    """One candump for each (options, targets), all listening."""
    with ExitStack() as stack:
        running = []
        for number, (options, targets) in enumerate(wanted):
            running.append(RunningCandump(folder / f"candump{number}", options, targets))
            stack.callback(running[-1].kill)
        yield running
