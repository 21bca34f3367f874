"""Latency histograms as HdrHistogram log files (.hlog, format 1.2), readable by the viewers of that format.

One line per hop, tagged with its name; values in nanoseconds at three significant digits, the interval's
maximum in milliseconds as the format has it.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from hdrh.histogram import HdrHistogram
from hdrh.log import HistogramLogReader, HistogramLogWriter
from numpy.typing import NDArray

LOWEST_NS: Final = 1
HIGHEST_NS: Final = 60_000_000_000
DIGITS: Final = 3
FOLD: Final = 4096
"""Values collected before they are counted: memory stays flat, and counting is paid for by the batch."""


class Latencies:
    """Counts durations [ns]; what lies outside 1 ns to 60 s counts at the edge."""

    def __init__(self, values_ns: Iterable[int] = ()) -> None:
        self._histogram: Any = HdrHistogram(LOWEST_NS, HIGHEST_NS, DIGITS)
        self._fresh: list[int] = list(values_ns)

    def add(self, value_ns: int) -> None:
        """One duration."""
        self._fresh.append(value_ns)
        if len(self._fresh) >= FOLD:
            self._fold()

    def _fold(self) -> None:
        """Move the collected values into the histogram."""
        values = np.clip(np.array(self._fresh, np.int64), LOWEST_NS, HIGHEST_NS)
        self._fresh.clear()
        # The 12 leading bits hold more than the three digits that the histogram resolves. Without the others most
        # values of a batch are equal, so that each distinct one is recorded once with its count.
        bits = np.maximum(np.frexp(values.astype(float))[1] - 12, 0)
        distinct, counts = np.unique(values >> bits << bits, return_counts=True)
        for value, count in zip(distinct.tolist(), counts.tolist(), strict=True):
            self._histogram.record_value(value, count)

    @property
    def histogram(self) -> Any:
        """The HdrHistogram of everything so far."""
        if self._fresh:
            self._fold()
        return self._histogram

    @property
    def count(self) -> int:
        """Durations so far."""
        return int(self.histogram.get_total_count())

    def percentile_ns(self, percent: float) -> float:
        """NaN without a value."""
        return float(self.histogram.get_value_at_percentile(percent)) if self.count else float("nan")


def write_log(file: Path, hops: Mapping[str, Latencies], *, start_s: float, duration_s: float) -> None:
    """One line per hop that has values. start_s: since the epoch."""
    with file.open("w", encoding="ascii") as stream:
        writer = HistogramLogWriter(stream)
        writer.output_comment("[Latencies of the bench by hop, ns]")
        writer.output_log_format_version()
        stream.write(f"#[StartTime: {start_s:.3f} (seconds since epoch), UTC]\n")
        writer.output_legend()
        for name, latencies in hops.items():
            if latencies.count:
                stream.write(f"Tag={tag_of(name)},")
                writer.output_interval_histogram(latencies.histogram, 0.001, 0.001 + duration_s)


def tag_of(name: str) -> str:
    """A name without what the format forbids in tags: commas, spaces and line ends."""
    return name.replace("'", "").replace(",", "").replace(" ", "-")


def read_log(file: Path) -> dict[str, Any]:
    """The histograms of a log by tag, as HdrHistogram's own reader finds them."""
    reader = HistogramLogReader(str(file), HdrHistogram(LOWEST_NS, HIGHEST_NS, DIGITS))
    found: dict[str, Any] = {}
    try:
        while (histogram := reader.get_next_interval_histogram()) is not None:
            found[histogram.get_tag() or ""] = histogram
    finally:
        reader.close()
    return found


def counted(hops: Mapping[str, NDArray[np.int64]]) -> dict[str, Latencies]:
    """Histograms of arrays."""
    return {name: Latencies(values.tolist()) for name, values in hops.items()}
