"""Folders for what a program can make again from its sources: machine code, definitions read from DBC files.

The folder's name holds a fingerprint of all sources that its content depends on, so that a changed source cannot leave it stale.
"""

import hashlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from bus.user_error import UserError

ROOT = Path(__file__).resolve().parents[1]
"""The folder that holds our packages."""

INSTALLED = "installed"
"""A file of this name says that a folder came with the package: whoever keeps code elsewhere begins with a copy of it."""

KEPT_S = 86_400.0
"""For how long no process has begun with what belongs to other sources when it is removed [s]: one may still use it."""


class NoCacheFolderError(UserError, ValueError):
    """No place for what is kept can be written to."""


def digest_of(sources: Iterable[Path]) -> str:
    """Fingerprint of the names and contents of files, 16 hexadecimal digits.

    Our own files are named from the folder that holds our packages, so that the digest is the same wherever they are installed.
    """
    fingerprint = hashlib.sha256()
    for source in sources:
        content = source.read_bytes()
        # name and length separate the files: moving a line from one file to the next changes the digest
        name = source.relative_to(ROOT).as_posix() if source.is_relative_to(ROOT) else str(source)
        fingerprint.update(f"{name}\0{len(content)}\0".encode())
        fingerprint.update(content)
    return fingerprint.hexdigest()[:16]


def cache_folder(package: Path, name: str, digest: str, chosen: str | None = None) -> Path:
    """Make and return the folder for what is kept of a package as its sources are now.

    It is in the folder `chosen` if that is given, else in the package's own `__pycache__`, else, where that is
    not writable, in the user's cache. It begins with what was installed with the package (`make wheel`), if anything.
    Errors: NoCacheFolderError where none of the places is writable.
    """
    own = package / "__pycache__"
    places = [own, _of_user() / "loaderhil"]
    if chosen:
        places.insert(0, Path(chosen))
    # an installed package may belong to another user; mkdir also succeeds on an existing folder without write access
    for place in places:
        folder = place / f"{name}-{digest}"
        try:
            if not folder.exists():
                _begin(folder, own / folder.name)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            os.utime(folder)  # its age counts from its last use
            _forget_others(folder, name)
            return folder
    tried = ", ".join(map(str, places))
    raise NoCacheFolderError(
        f"no folder for compiled code can be written to (tried {tried}): free space or permissions?"
    )


def _begin(folder: Path, installed: Path) -> None:
    """Make the folder, with a copy of what was installed for the same sources where this user cannot write."""
    if not (installed / INSTALLED).is_file():
        folder.mkdir(parents=True, exist_ok=True)
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    # another process may start at the same time: a folder appears whole or not at all
    fresh = folder.with_name(f"{folder.name}.{os.getpid()}")
    try:
        shutil.copytree(installed, fresh, copy_function=shutil.copyfile)
        fresh.rename(folder)
    except OSError:
        shutil.rmtree(fresh, ignore_errors=True)
        if not folder.is_dir():
            raise


def _of_user() -> Path:
    """Where this user's programs keep what they can make again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _forget_others(folder: Path, name: str) -> None:
    """Remove what belongs to other states of the same package's sources and was last used KEPT_S before this folder."""
    used = folder.stat().st_mtime
    for other in folder.parent.glob(f"{name}-*"):
        # another checkout, a process with other effects or an older one may still load it
        if other != folder and used - other.stat().st_mtime > KEPT_S:
            shutil.rmtree(other, ignore_errors=True)
