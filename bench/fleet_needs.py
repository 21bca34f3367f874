"""What a fleet of machines that stream all day needs, from costs measured on one computer. Arithmetic alone.

Cores are counted at full use. Nothing is assumed to get cheaper with size; what the shares below say is beyond the costs that were measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass

DAY_S = 86_400.0
TASK_S = 3600.0
"""Seconds of one machine's stream that a worker takes as one task."""
USED = 0.5
"""Share of each core and of each link that the plan uses: the rest is for peaks, failed computers and taking up after a pause."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """Measured on one computer; processor time."""

    frames_per_s: float  # of one machine
    rows_per_s: float  # cycles of the ECU's estimators, of one machine
    record_s: float  # of writing one frame into a recording
    decode_s: float  # of decoding one frame of a recording into columns
    estimate_s: float  # of the estimators with the outlook over one row
    task_s: float  # of handing one task to a worker and keeping its result
    efficiency: float  # of two workers: speed over that of one, by two
    recorded_bytes: float  # of one frame in a recording
    table_bytes: float  # of one frame in tables of its signals
    stream_bytes: float  # of one frame on the network


@dataclass(frozen=True, slots=True)
class Need:
    """One line of the plan."""

    what: str
    amount: float
    unit: str
    follows: str  # from which figures


def needs(c: Costs, machines: int, hours: float) -> Sequence[Need]:
    """Cores, storage and network for so many machines that stream so many hours a day."""
    frames, rows = machines * c.frames_per_s, machines * c.rows_per_s
    share = hours * 3600.0 / DAY_S  # recordings of the hours are worked on over the whole day
    tasks_per_s = machines / TASK_S * share
    record = frames * c.record_s
    decode = frames * c.decode_s * share / c.efficiency
    estimate = rows * c.estimate_s * share / c.efficiency
    handing = tasks_per_s * c.task_s
    day = frames * hours * 3600.0
    return (
        Need("frames", frames, "frames/s", f"{machines} machines of {c.frames_per_s:.0f} 1/s"),
        Need("frames a day", day, "frames", f"over {hours:g} h"),
        Need("cores that record", record, "cores", "frames by the time to write one"),
        Need(
            "cores that decode",
            decode,
            "cores",
            "frames by the time to decode one, over the efficiency of workers",
        ),
        Need(
            "cores that estimate",
            estimate,
            "cores",
            "rows by the time of one, over the efficiency of workers",
        ),
        Need("cores that hand out tasks", handing, "cores", f"tasks of {TASK_S / 3600:g} h of one machine"),
        Need(
            "cores to be bought",
            (record + decode + estimate + handing) / USED,
            "cores",
            f"the sum, each used for {USED:.0%} of its time",
        ),
        Need("storage of recordings a day", day * c.recorded_bytes, "B", "frames by the bytes of one"),
        Need("storage of tables a day", day * c.table_bytes, "B", "frames by the bytes of one"),
        Need("network, all machines", frames * c.stream_bytes * 8.0, "bit/s", "frames by the bytes of one"),
        Need("network, one machine", c.frames_per_s * c.stream_bytes * 8.0, "bit/s", "the same"),
        Need(
            "links to be rented",
            frames * c.stream_bytes * 8.0 / USED,
            "bit/s",
            f"each used for {USED:.0%} of what it carries",
        ),
    )


PREFIXES = ((1e15, "P"), (1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))


def amount(need: Need) -> str:
    """The amount with its unit, three digits."""
    if need.unit == "cores":
        return f"{need.amount:.1f} cores"
    for size, prefix in PREFIXES:
        if need.amount >= size:
            return f"{need.amount / size:.3g} {prefix}{need.unit}"
    return f"{need.amount:.3g} {need.unit}"
