"""Style of the pictures on the thesis pages: the same colours everywhere, bands for the unknown mass split."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

Array = NDArray[np.float64]

TRUE, PRINTED, CORRECTED, REPAIRED = "#222222", "#c1121f", "#2a6f97", "#e09f3e"
BAND = 0.18  # opacity
FIXED: Any = {
    "svg.hashsalt": "loaderhil",
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "path.simplify_threshold": 0.5,  # of a pixel: invisible detail would only make the file larger
}


@contextmanager
def panels(
    file: Path, rows: int, columns: int, size: tuple[float, float], **shared: Any
) -> Iterator[tuple[Figure, Any]]:
    """A figure with its axes, written when the block ends. Equal data give equal bytes, so that a page only changes with its results."""
    with plt.rc_context(FIXED):
        figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", **shared)
        yield figure, axes
        figure.savefig(file, metadata={"Date": None})
        plt.close(figure)


def band(axes: Axes, x: Array, many: Array, colour: str) -> None:
    """What every split of the mass gives, (splits, n)."""
    axes.fill_between(x, many.min(axis=0), many.max(axis=0), color=colour, alpha=BAND, linewidth=0)


def key(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """One legend for all panels, below them."""
    named = {
        label: handle
        for axes in panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=columns, frameon=False)
