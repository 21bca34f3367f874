"""Loading the libraries of a command."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """No collection of garbage while modules are loaded.

    They make some hundred thousand objects that stay. Looking through them again and again takes a
    sixth of a run's start; afterwards the collector leaves them alone.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
