"""A file that is made new and written piece by piece, for the writers of all recording formats."""

import os
from pathlib import Path


class NewFile:
    """An unbuffered file that did not exist before; every write is whole or an error."""

    def __init__(self, path: Path) -> None:
        # O_EXCL: a recording never overwrites another one. Unbuffered, so that a kill loses no written byte.
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self.size = 0

    def append(self, content: bytes) -> int:
        """Write at the end; returns where that was."""
        at = self.size
        self.patch(at, content)
        self.size = at + len(content)
        return at

    def patch(self, at: int, content: bytes) -> None:
        """Write over what stands at `at`."""
        view = memoryview(content)
        while view:
            written = os.pwrite(self._descriptor, view, at)
            view, at = view[written:], at + written

    def close(self) -> None:
        """Close; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
