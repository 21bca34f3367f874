"""Keeps modules out of a process that its libraries would load for features that it does not use."""

import sys


def without_mf4() -> None:
    """To be called before a DBC is read, by a process that never reads or writes MF4.

    cantools loads python-can, which loads asammdf wherever that is installed, and with it pandas: 84 MB and
    0.2 s. To python-can it is optional; a module that is None in sys.modules is one that is not installed.
    """
    sys.modules.setdefault("asammdf", None)  # type: ignore[arg-type]  # documented: importlib's reference, "sys.modules"
