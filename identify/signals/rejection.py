"""Which samples count, and why the others do not: one reason per rejected sample, so that counts add up."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


@dataclass
class Rejection:
    """Samples of one signal or run that are rejected; the first reason that is given for a sample stays."""

    size: int
    _of: NDArray[np.int16] = field(init=False)
    _reasons: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._of = np.zeros(self.size, np.int16)

    def reject(self, mask: Mask, reason: str) -> None:
        """Reject samples, except those that are rejected already."""
        if reason not in self._reasons:
            self._reasons.append(reason)
        self._of[mask & (self._of == 0)] = 1 + self._reasons.index(reason)

    @property
    def kept(self) -> Mask:
        """The samples that count (n,)."""
        return self._of == 0

    @property
    def counts(self) -> Mapping[str, int]:
        """Rejected samples by reason."""
        return {
            r: int(np.count_nonzero(self._of == i))
            for i, r in enumerate(self._reasons, 1)
            if np.any(self._of == i)
        }


def added(*counts: Mapping[str, int]) -> dict[str, int]:
    """The sum of several counts by reason."""
    total: dict[str, int] = {}
    for one in counts:
        for reason, number in one.items():
            total[reason] = total.get(reason, 0) + number
    return total
