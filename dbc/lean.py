"""Keeps modules out of memory that a library would load for features that are not used here."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def without_mf4() -> Iterator[None]:
    """Import cantools or python-can inside it, and asammdf stays out: 84 MB and 0.2 s with the pandas and pyarrow behind it.

    cantools loads python-can, which loads asammdf wherever that is installed. To python-can it is optional, and a module
    that is None in sys.modules is one that is not installed. Afterwards asammdf can be imported as ever.
    """
    if "asammdf" in sys.modules:
        yield
        return
    sys.modules["asammdf"] = None  # type: ignore[assignment]  # documented: importlib's reference, "sys.modules"
    try:
        yield
    finally:
        del sys.modules["asammdf"]
