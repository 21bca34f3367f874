"""The listening socket of a hub: in a file, or without one (`@name`, an abstract name of Linux)."""

import contextlib
import errno
import fcntl
import os
import socket
import stat
from collections.abc import Iterator
from pathlib import Path

from bus.hub.peer import peer_pid
from bus.transport import BusUnavailable

BACKLOG = 64
PATH_LIMIT = 107
"""Bytes in a socket's name (struct sockaddr_un)."""


def socket_name(path: str) -> str:
    """What the kernel is given for `path`; BusUnavailable if that cannot be a socket's name."""
    name = "\0" + path[1:] if path.startswith("@") else path
    if not path.strip("@"):
        raise BusUnavailable("the hub's socket has no name; give a path, or @NAME")
    if len(os.fsencode(name)) > PATH_LIMIT:
        raise BusUnavailable(
            f"{path}: {len(os.fsencode(name))} bytes are too long for a socket's name, at most "
            f"{PATH_LIMIT}; use a shorter path such as /tmp/loader.hub, or hub:@NAME"
        )
    return name


class Listener:
    """The listening socket of a hub; replaces a file that a killed hub left, never one in use."""

    def __init__(self, path: str) -> None:
        name = socket_name(path)
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        self._file: tuple[int, int] | None = None
        try:
            if path.startswith("@"):
                self._bind(name)
            else:
                # "look for a stale socket, remove it, bind" is not atomic: without the lock two hubs that start
                # together could remove each other's file
                with _locked(Path(path).parent):
                    _remove_stale(Path(path))
                    self._bind(name)
                found = Path(path).lstat()
                # device and inode identify our file: a path alone could be another hub's by the time we close
                self._file = found.st_dev, found.st_ino
            self.socket.listen(BACKLOG)
        except BaseException:
            self.socket.close()
            raise

    def _bind(self, name: str) -> None:
        try:
            self.socket.bind(name)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise BusUnavailable(_in_use(self.path, name)) from error
            raise BusUnavailable(f"{self.path}: no socket can be made here: {error.strerror}") from error

    def close(self) -> None:
        """Stop listening and remove the file, unless another hub has replaced it."""
        self.socket.close()
        if self._file is not None:
            with contextlib.suppress(FileNotFoundError):
                found = Path(self.path).lstat()
                if (found.st_dev, found.st_ino) == self._file:
                    Path(self.path).unlink()
            self._file = None


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """One hub at a time may look at and replace the files of a folder."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        remedy = f"mkdir -p {folder}" if isinstance(error, FileNotFoundError) else "choose another folder"
        raise BusUnavailable(
            f"{folder}: the hub's socket cannot be made there: {error.strerror}; {remedy}"
        ) from error
    try:
        # the folder itself is locked: a lock file would have to be cleaned up after a kill
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _remove_stale(path: Path) -> None:
    """Remove the socket of a hub that is gone; BusUnavailable if anything else is in the way."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(mode):
        raise BusUnavailable(f"{path}: in the way, and not a socket; remove it or use another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        answer = probe.connect_ex(os.fspath(path))
    if answer == errno.ECONNREFUSED:
        # a file whose process is gone refuses; the kernel does not remove it
        path.unlink()
    # EAGAIN: somebody listens, and its backlog is full
    elif answer in (0, errno.EAGAIN):
        raise BusUnavailable(_in_use(os.fspath(path), os.fspath(path)))
    else:
        raise BusUnavailable(f"{path}: in the way, and {os.strerror(answer).lower()}; use another path")


def _in_use(path: str, name: str) -> str:
    """Who serves an address already, as far as the kernel reports it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        pid = peer_pid(probe) if probe.connect_ex(name) == 0 else 0
    who = f"a hub (process {pid})" if pid else "a hub"
    return f"{path}: {who} already serves this address; use it, end it, or serve another (--bus hub:PATH)"
