"""How far two runs may differ: defaults, and a file of the user's."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from configuration import CheckedTable
from dbc.database import Database
from testbench.expect.signals import BusSignal, SignalError, find_signal


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """share: root mean square of a difference, as a share of what the signal spans in the first run.

    signals: the same for single signals, in their own unit. moment_s: between the moments of one event in both runs [s].
    timing: how much slower the second run's p99 may be, as a share; timing_ms: and so much more [ms].
    available: how much the share of available samples may differ.
    """

    share: float = 0.02
    signals: Mapping[str, float] = field(default_factory=dict)
    moment_s: float = 0.05
    timing: float = 0.5
    timing_ms: float = 1.0
    available: float = 0.01

    @classmethod
    def from_file(cls, file: Path, database: Database) -> Self:
        """ConfigurationError names file, key, unit and range."""
        table, usual = CheckedTable.from_file(file), cls()
        named = table.table("signals")
        signals = {}
        for name in named.keys():  # noqa: SIM118 - a table is no mapping
            try:
                signal = find_signal(name, database)
            except SignalError as error:
                raise named.error(name, f"= {error}") from None
            if not isinstance(signal, BusSignal):
                raise named.error(name, "is no signal of the bus: only those are compared")
            signals[name] = named.number(name, unit=signal.unit or "1", low=0.0)
        found = cls(
            share=table.number("percent", unit="%", low=0.0, high=100.0, default=100 * usual.share) / 100,
            signals=signals,
            moment_s=table.number("moment_ms", unit="ms", low=0.0, high=1e6, default=1e3 * usual.moment_s)
            / 1e3,
            timing=table.number("timing_percent", unit="%", low=0.0, high=1e4, default=100 * usual.timing)
            / 100,
            timing_ms=table.number("timing_ms", unit="ms", low=0.0, high=1e4, default=usual.timing_ms),
            available=table.number(
                "available_percent", unit="%", low=0.0, high=100.0, default=100 * usual.available
            )
            / 100,
        )
        table.finish()
        return found
