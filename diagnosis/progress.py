"""Signs of life of a diagnosis: every step as it begins, and the current one again while it lasts."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.console import Console

    from discrepancy.selection.state import Progress

EVERY_S: Final = 5.0  # after which a reader wonders whether anything happens
STILL: Final = " (still)"
SHORT: Final = (
    60  # characters of a step that is shown again: whoever follows a log has read the whole line before
)


@contextmanager
def shown_progress(console: "Console", every_s: float = EVERY_S) -> "Iterator[Progress]":
    """The current step with its time: one changing line on a terminal, below lines of results; otherwise a line per step.

    Without a terminal a line comes at least every `every_s` seconds.
    """
    from rich.markup import escape  # late: with the console

    start = time.monotonic()
    if console.is_terminal:
        with console.status("starting") as status:

            def change(text: str) -> None:
                if ": " in text and not text.endswith(STILL):  # a result; a step has no colon
                    console.print(
                        f"[dim]{time.monotonic() - start:6.1f} s[/]  {escape(text)}", highlight=False
                    )
                status.update(f"{escape(text)} [dim]{time.monotonic() - start:.0f} s[/]")

            with repeated(change, every_s) as progress:
                yield progress
        return

    def print_line(text: str) -> None:
        print(f"{time.monotonic() - start:6.1f} s  {text}", file=sys.stderr, flush=True)

    with repeated(print_line, every_s) as progress:
        yield progress


def shorten(text: str) -> str:
    """The beginning of a long text."""
    return text if len(text) <= SHORT else f"{text[: SHORT - 1].rstrip()}…"


@contextmanager
def repeated(show: Callable[[str], None], every_s: float) -> "Iterator[Progress]":
    """A progress function that shows each step at once, and the last one again whenever `every_s` seconds passed without another."""
    current, news, over = ["starting"], threading.Event(), threading.Event()

    def step(text: str) -> None:
        current[0] = text
        show(text)
        news.set()  # begins the waiting time anew

    def repeat() -> None:
        while not over.is_set():
            if news.wait(every_s):
                news.clear()
            else:
                show(f"{shorten(current[0])}{STILL}")

    # a simulation of the user's may take minutes and knows nothing of progress: hence a thread beside it
    thread = threading.Thread(target=repeat, name="progress", daemon=True)
    thread.start()
    try:
        yield step
    finally:
        over.set()
        news.set()
        thread.join()
