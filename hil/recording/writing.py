"""The recorder's second process: takes frames from the ring and writes the file.

It outlives the process that fills the ring: when that one ends, for whatever reason, the ring is emptied and the file
closed. It reports in lines of JSON on its standard output: ready, then the end or an error.
"""

import json
import os
import selectors
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hil.recording.files import Plan, RecordingFiles, files_of
from hil.recording.formats import RecordingError
from hil.recording.ring import Ring

BATCH = 1 << 15
PATIENCE_S = 60.0
"""How long the writer may take for what is left in the ring."""


def main(ring_descriptor: int, life_descriptor: int, plan: Plan) -> int:
    """Write until the other end of `life_descriptor` is closed."""
    ring = Ring.attach(ring_descriptor)
    files = None
    try:
        files = RecordingFiles(plan)
        _say({"ready": True})
        ended = False
        with selectors.DefaultSelector() as selector:
            selector.register(life_descriptor, selectors.EVENT_READ)
            while not ended:
                # before the ring is emptied: frames that were put before the end are then all taken
                # Half of the time promised: writing and waiting for a processor have the other half.
                ended = bool(selector.select(plan.flush_s / 2))
                while len(records := ring.peek(BATCH)):
                    files.write(records)
                    # after the write: the count of a killed writer is then that of its file
                    ring.release(len(records))
        files.close()
    except (RecordingError, OSError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        where = f"{files.paths[-1]}: " if files and isinstance(error, OSError) else ""
        _say({"error": f"{where}{reason or error}"} | _figures(files))
        return 1
    _say({"finished": True} | _figures(files))
    return 0


def _figures(files: RecordingFiles | None) -> dict[str, Any]:
    return {"frames": files.frames, "paths": list(map(str, files.paths))} if files else {}


def _say(event: dict[str, Any]) -> None:
    with_newline = json.dumps(event) + "\n"
    try:
        os.write(1, with_newline.encode())
    except BrokenPipeError:
        return  # the other process is gone; the file matters, not the report


@dataclass(frozen=True, slots=True)
class Written:
    """The report of the writer at its end."""

    frames: int
    paths: tuple[Path, ...]
    error: str  # '' if there was none


class WriterProcess:
    """The writer as seen by the process that fills the ring."""

    def __init__(self, ring: Ring, plan: Plan, program: Sequence[str] = ("-m", __name__)) -> None:
        """Start it and wait until its file is open; RecordingError if that fails.

        program: what Python runs; a test may put limits around the writer.
        """
        self._ring, self._plan = ring, plan
        theirs, self._life = os.pipe2(os.O_CLOEXEC)
        words = json.dumps(asdict(plan) | {"path": str(plan.path)})
        try:
            self._process = subprocess.Popen(
                [sys.executable, *program, str(ring.fileno()), str(theirs), words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                pass_fds=(ring.fileno(), theirs),
                process_group=0,  # Ctrl-C must not reach the writer: it ends when the ring is empty
            )
        finally:
            os.close(theirs)
        first = self._line()
        if "ready" not in first:
            self.finish()
            raise RecordingError(first.get("error", "the process that writes the recording did not start"))

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def fileno(self) -> int:
        """Readable when the writer has ended, which it should not before `finish`."""
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def _line(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return json.loads(line) if line else {}

    def finish(self) -> Written:
        """Let the writer empty the ring, and wait for its end; a second call gives nothing new."""
        if self._life >= 0:
            os.close(self._life)
            self._life = -1
        assert self._process.stdout is not None
        last = self._line() if not self._process.stdout.closed else {}
        try:
            code = self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._process.stdout.close()
        error = last.get("error", "" if code == 0 else f"the process that writes it ended with code {code}")
        if not last:  # it was killed; the ring has the count of the frames that it had written
            return Written(self._ring.taken_count, files_of(self._plan), error)
        return Written(last.get("frames", 0), tuple(map(Path, last.get("paths", ()))), error)


if __name__ == "__main__":
    given: dict[str, Any] = json.loads(sys.argv[3])
    given |= {"path": Path(given["path"]), "channels": tuple(given["channels"])}
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]), Plan(**given)))
