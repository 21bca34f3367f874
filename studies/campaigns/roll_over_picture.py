"""The roll-over campaign as a picture: one panel per load and turn, speed across, articulation rate upward."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from studies.campaigns.batch import Result

ABREAST = 4
LONGEST_LEAD_S = 1.5
MARKER = 150
FIXED: Any = {"svg.hashsalt": "loaderhil", "svg.fonttype": "none", "font.size": 9}
LEGEND: dict[str, dict[str, Any]] = {
    "lifts, prevented by the limits": {"marker": "o", "color": "#2a6f97"},
    "lifts, not prevented": {"marker": "X", "color": "#2a6f97"},
    "stays down, not warned": {"marker": ".", "color": "#888888"},
    "stays down, warned with less than 30 % left": {
        "marker": "o",
        "color": "none",
        "markeredgecolor": "#888888",
    },
    "false alarm": {"marker": "s", "color": "none", "markeredgecolor": "#c1121f"},
}


def draw(cases: Sequence[Any], results: Sequence[Result], file: Path) -> None:
    """Write the picture; equal results give equal bytes."""
    # in the order of the cases, each once
    panels = list(dict.fromkeys((case.load.name, case.turn) for case in cases))
    rows = math.ceil(len(panels) / ABREAST)
    norm = Normalize(0, LONGEST_LEAD_S)
    with plt.rc_context(FIXED):
        figure, axes = plt.subplots(
            rows, ABREAST, figsize=(11, 1.1 + 2.8 * rows), sharex=True, sharey=True, layout="constrained", squeeze=False
        )  # fmt: skip
        for panel, (load, turn) in zip(axes.flat, panels, strict=False):
            for case, result in zip(cases, results, strict=True):
                if (case.load.name, case.turn) == (load, turn):
                    panel.scatter(case.speed_kmh, case.rate_deg_s, **_mark(result, norm))
            panel.set_title(f"{load}, {turn}", fontsize="medium")
            panel.margins(0.12)
        for panel in axes[-1]:
            panel.set_xlabel("speed [km/h]")
        for panel in axes[:, 0]:
            panel.set_ylabel("articulation rate [°/s]")
        figure.colorbar(
            ScalarMappable(norm, "viridis"), ax=axes, label="warning ahead of lift-off [s]", pad=0.01
        )
        handles = [Line2D([], [], linestyle="", label=label, **look) for label, look in LEGEND.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        figure.savefig(file, metadata={"Date": None})
        plt.close(figure)


def _mark(result: Result, norm: Normalize) -> dict[str, Any]:
    """How one turn looks."""
    if result["lift_off_s"] is not None:
        lead = result["lead_s"]
        # red is outside the scale of colours: late is another kind of result, not a small lead
        colour = "#c1121f" if lead is None or lead <= 0 else matplotlib.colormaps["viridis"](norm(lead))
        return {"marker": "X" if result["limited_lifts"] else "o", "s": MARKER, "color": colour}
    if result["false_alarm"]:
        return {"marker": "s", "s": MARKER, "facecolors": "none", "edgecolors": "#c1121f"}
    if result["warned"]:
        return {"marker": "o", "s": MARKER, "facecolors": "none", "edgecolors": "#888888"}
    return {"marker": ".", "s": MARKER / 3, "color": "#888888"}
