"""Unpacks an FMU, a zip archive of somebody else, into a folder that does not outlive this process.

An FMU is a program: its binary runs in this process with the rights of the user. The checks here only keep the unpacking itself harmless.
"""

import fcntl
import lzma
import os
import shutil
import struct
import tempfile
import time
import weakref
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Final

from bus.user_error import UserError

DESCRIPTION: Final = "modelDescription.xml"
MOST_FILES: Final = 20_000
MOST_BYTES: Final = 2 << 30  # unpacked; the largest FMUs of tools have some hundred megabytes
LARGEST_DESCRIPTION: Final = 64 << 20
FOLDER: Final = "loaderhil-fmu-"
LOCK: Final = ".in-use"  # held by the process that unpacked; no FMU may have a file of this name
UNLOCKED_S: Final = 3600.0  # a folder without a lock is this old before it counts as left behind


class FmuError(UserError, ValueError):
    """The FMU cannot be used; the message names the file and the reason."""


class Unpacked:
    """An unpacked FMU in `folder`.

    The folder is removed with the object, at the latest when the process ends. What a killed process left, the next one removes.
    """

    def __init__(self, file: Path) -> None:
        """Unpack the file. Raises FmuError."""
        _remove_left_behind()
        self.folder = Path(tempfile.mkdtemp(prefix=FOLDER))
        lock = os.open(self.folder / LOCK, os.O_CREAT | os.O_RDWR, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        self.close = weakref.finalize(self, _remove, self.folder, lock, os.getpid())
        try:
            _extract(file, self.folder)
        except BaseException:
            self.close()
            raise


def _extract(file: Path, folder: Path) -> None:
    try:
        with zipfile.ZipFile(file) as archive:
            for entry in _checked(file, archive):
                archive.extract(entry, folder)
    except OSError as error:
        raise FmuError(f"{file}: {error.strerror or error}") from error
    except FmuError:
        raise
    # RuntimeError: an encrypted entry, or an unknown compression; ValueError: a name or a place that cannot be
    except (
        zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, RuntimeError, ValueError,
    ) as error:  # fmt: skip
        raise FmuError(f"{file}: is no zip archive that can be read, so no FMU: {error}") from error
    text = (folder / DESCRIPTION).read_bytes()
    # a description needs no document type, and with one it could read files of this computer or grow without bound
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise FmuError(f"{file}: its {DESCRIPTION} declares a document type; refused")
    try:
        text.decode("utf-8")
    except UnicodeDecodeError as error:
        raise FmuError(f"{file}: its {DESCRIPTION} is not UTF-8: {error.reason}") from error


def _checked(file: Path, archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """The entries of the archive. Raises FmuError for names that leave the folder, and for an archive that is too large."""
    entries = archive.infolist()
    if len(entries) > MOST_FILES:
        raise FmuError(f"{file}: has {len(entries)} files, at most {MOST_FILES} are unpacked")
    # zipfile reads no more of an entry than its header says, so the sum of the headers is a bound
    if (size := sum(entry.file_size for entry in entries)) > MOST_BYTES:
        raise FmuError(
            f"{file}: would unpack to {size / 2**30:.1f} GiB, at most {MOST_BYTES >> 30} GiB are unpacked"
        )
    for entry in entries:
        if not entry.filename:  # zipfile ends a name at its first zero byte
            raise FmuError(f"{file}: has a file without a name; the archive is damaged")
        parts = PurePosixPath(entry.filename.replace("\\", "/")).parts
        drive = bool(parts) and parts[0].endswith(":")  # C:\\
        if ".." in parts or parts[:1] == ("/",) or drive or LOCK in parts:
            raise FmuError(
                f"{file}: has a file named {entry.filename!r}, which would leave its folder; refused"
            )
    described = [entry for entry in entries if entry.filename == DESCRIPTION]
    if not described:
        raise FmuError(f"{file}: has no {DESCRIPTION}, so it is no FMU")
    if described[0].file_size > LARGEST_DESCRIPTION:
        raise FmuError(f"{file}: its {DESCRIPTION} has {described[0].file_size >> 20} MiB; refused")
    return entries


def _remove(folder: Path, lock: int, owner: int) -> None:
    # a forked child must not remove the folder of its parent
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
    os.close(lock)


def _remove_left_behind() -> None:
    """Remove the folders of processes that were killed: nobody holds their lock."""
    for folder in Path(tempfile.gettempdir()).glob(f"{FOLDER}*"):
        try:
            # an unlocked folder may be one that another process is making at this moment
            if not (folder / LOCK).exists():
                if time.time() - folder.stat().st_mtime > UNLOCKED_S:
                    shutil.rmtree(folder, ignore_errors=True)
                continue
            lock = os.open(folder / LOCK, os.O_RDWR)
        except OSError:  # of another user, or gone meanwhile
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        except OSError:
            pass
        finally:
            os.close(lock)
