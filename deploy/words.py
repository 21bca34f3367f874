"""Text as systemd reads it in unit files: words of a command line, and paths that a service with our sandbox can see.

systemd.service(5), "Command lines"; systemd.exec(5), ProtectHome= and PrivateTmp=.
"""

import re
from pathlib import PurePosixPath
from typing import Final

from bus.user_error import UserError

_PLAIN: Final = re.compile(r"[A-Za-z0-9_@+=:,./-]+")
"""Words that mean themselves everywhere."""
_HIDDEN: Final = {
    "/home": "ProtectHome=yes",
    "/root": "ProtectHome=yes",
    "/run/user": "ProtectHome=yes",
    "/tmp": "PrivateTmp=yes",
    "/var/tmp": "PrivateTmp=yes",
}
"""Folders that a service of ours does not see, and why."""


class UnitTextError(UserError, ValueError):
    """A text cannot stand in a unit file, or a service could not use it."""


def word(value: str) -> str:
    """One word of an ExecStart= line, whatever it holds: in quotes where it has to be, with what systemd would replace written twice."""
    if not single_line(value):
        # a line end would begin a directive of its own
        raise UnitTextError(f"{value!r} has a control character, which no line of a unit file can hold")
    if _PLAIN.fullmatch(value):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{escaped}"'


def executable(path: str) -> str:
    """The first word of an ExecStart= line. Raises UnitTextError for a path that systemd would refuse or not find."""
    # systemd replaces no "$" in it, so that doubling it would name another file; the others it calls special and refuses
    if special := sorted({*path} & {*"$\"'\\"}):
        raise UnitTextError(f"{path!r}: systemd starts no program with {special[0]} in its path")
    if trouble := unseen(path):
        raise UnitTextError(f"{path!r} {trouble}")
    return word(path)


def single_line(value: str) -> bool:
    """Whether a text has no control character, and so no end of line."""
    return value.isprintable()


def unseen(path: str) -> str:
    """Why a service cannot use this path, or nothing."""
    if not path.startswith("/"):
        return "is relative, and a service has no folder of yours to start from: write the whole path"
    parts = PurePosixPath(path)
    if ".." in parts.parts:
        return "has a '..': write the whole path"
    for folder, setting in _HIDDEN.items():
        if parts.is_relative_to(folder):
            return f"is below {folder}, which the services do not see ({setting}): put it below /etc/loaderhil, /opt or /usr"
    return ""
