"""A function of a few unknowns against one channel in blocks, as a problem of the estimation: residuals, and derivatives by differences."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.tyre.rig_problem import Part, Unknown

Array = NDArray[np.float64]

STEP = 1e-4  # of a typical change, for central differences


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """predict: values by name to what each block should have read, (n,) per block; measured: (n,) per block; kept: which rows count."""

    unknowns: list[Unknown]
    predict: Callable[[Mapping[str, float]], Sequence[Array]]
    measured: Sequence[Array]
    kept: Sequence[NDArray[np.bool_]]

    def held_at(self, values: Mapping[str, float]) -> "Regression":
        """Itself: nothing is held."""
        return self

    def parts(self, values: Mapping[str, float]) -> list[Part]:
        """Prediction less measurement, by block."""
        names = list(values)
        columns = []
        for u in self.unknowns:
            h = STEP * u.typical
            up, down = (self.predict({**values, u.name: values[u.name] + s}) for s in (h, -h))
            columns.append([(a - b) / (2.0 * h) for a, b in zip(up, down, strict=True)])
        order = np.array([names.index(u.name) for u in self.unknowns], np.intp)
        return [
            Part(
                predicted - measured,
                np.stack([column[i] for column in columns], axis=1),
                np.eye(len(columns)),
                order,
                kept,
            )
            for i, (predicted, measured, kept) in enumerate(
                zip(self.predict(values), self.measured, self.kept, strict=True)
            )
        ]


def blocks(kept: NDArray[np.bool_], shortest: int, longest: int | None = None) -> list[slice]:
    """Runs of kept rows of at least `shortest` rows, cut at `longest`: memory of the noise does not reach over a gap."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], kept, [False])).astype(np.int8)))
    out = []
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        size = longest or b - a
        out += [slice(i, min(i + size, b)) for i in range(a, b, size) if min(i + size, b) - i >= shortest]
    return out
