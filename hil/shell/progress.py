"""Progress of a recording that is read, as a bar on the terminal that disappears at the end."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeElapsedColumn

from dbc.recordings import reading


@contextmanager
def reading_progress(errors: Console, name: str) -> Iterator[reading.Progress]:
    """Shows the bytes that were read. errors: console of standard error."""
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeElapsedColumn())
    # where nobody sees a bar, rich would print an empty line for it
    with Progress(*columns, console=errors, transient=True, disable=not errors.is_terminal) as progress:
        task = progress.add_task(name, total=None)
        yield lambda read, total: progress.update(task, completed=read, total=total)
