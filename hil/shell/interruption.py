"""Ends a computing command soon after Ctrl-C, with one line, also while compiled code or other threads run.

Python handles a signal between two of its own instructions in the main thread: not while a compiler runs, and not before
threads that compute have ended.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from hil.ending import Ending

SHOW_CURSOR: Final = "\x1b[?25h"


@contextmanager
def ended_at_once(patience_s: float) -> Iterator[None]:
    """Let Ctrl-C end the block as KeyboardInterrupt, or the process where that takes longer than `patience_s`.

    Only for work that writes files under a temporary name and renames them: such a file may be left behind. In the main thread only.
    """
    reader, writer = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writer, False)
    left = threading.Event()
    # The C handler of Python writes the signal's number into the pipe at once; this thread reads it without the
    # main thread having to run.
    watch = threading.Thread(target=_answer, args=(reader, left, patience_s), daemon=True)
    before = signal.set_wakeup_fd(writer)
    watch.start()
    try:
        yield
    finally:
        left.set()
        signal.set_wakeup_fd(before)
        os.close(writer)
        watch.join()
        os.close(reader)


_reported = threading.Event()


def report_interruption() -> None:
    """Print the line of an interrupted command, once."""
    if not _reported.is_set():
        _reported.set()
        print("loaderhil: interrupted", file=sys.stderr, flush=True)


def _answer(reader: int, left: threading.Event, patience_s: float) -> None:
    """Wait for the number of SIGINT, or for the end of the pipe."""
    while number := os.read(reader, 1):
        if number[0] != signal.SIGINT:
            continue
        report_interruption()
        if not left.wait(patience_s):
            if sys.stderr.isatty():
                os.write(2, SHOW_CURSOR.encode())  # a progress bar hides the cursor
            os._exit(Ending.INTERRUPTED)
        return
