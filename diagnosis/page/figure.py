"""A plot over anything but time: frequency, lag, the number of a parameter."""

from collections.abc import Sequence
from html import escape

from discrepancy.signals.recording import Array
from report.kit.axis import Axis
from report.kit.plot import UNITS, Curve, path


def figure(
    title: str,
    curves: Sequence[Curve],
    across: Axis,
    upward: Axis,
    labels: tuple[Sequence[tuple[float, str]], Sequence[tuple[float, str]]],
    x_name: str,
    described: str,
    level: float,
) -> str:
    """Curves over two axes, with a line at `level`; labels: place and text, for either axis; described: text for a screen reader."""
    x_labels, y_labels = labels
    upright = "".join(f"M{round(UNITS * float(across.share(at)))} 0v{UNITS}" for at, _ in x_labels)
    flat = "".join(f"M0 {UNITS - round(UNITS * float(upward.share(at)))}h{UNITS}" for at, _ in y_labels)
    zero = f"M0 {UNITS - round(UNITS * float(upward.share(level)))}h{UNITS}"
    lines = "".join(path(c, across, upward) for c in curves)
    ticks = "".join(f'<span style="left:{across.percent(at)}">{text}</span>' for at, text in x_labels)
    levels = "".join(f'<span style="bottom:{upward.percent(at)}">{text}</span>' for at, text in y_labels)
    legend = "".join(f'<li class="{c.style}"><i></i>{escape(c.name)}</li>' for c in curves if not c.silent)
    return (
        f'<figure class="plot"><figcaption>{escape(title)}</figcaption><div class="chart"><div class="y" aria-hidden="true">{levels}</div>'
        f'<div class="area" role="img" aria-label="{escape(described)}"><svg viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none" '
        f'aria-hidden="true"><path class="grid" d="{upright}{flat}"/><path class="zero" d="{zero}"/>{lines}</svg></div>'
        f'<div class="x" aria-hidden="true"><div>{ticks}</div><em>{x_name}</em></div></div><ul class="legend">{legend}</ul></figure>'
    )


def versions(before: Array, after: Array | None) -> list[tuple[str, Array, str]]:
    """Name, values and style of each curve of a model: before and after, or the one that there is where nothing was found."""
    if after is None:
        return [("model", before, "predicted")]
    return [("before", before, "predicted"), ("after", after, "estimate")]
