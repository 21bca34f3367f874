"""Logs the findings of a bus for a process: a new finding at once, repetitions as a count."""

import logging
from collections.abc import Iterable

from bus.errors import BusFinding, Fault

AGAIN_NS = 1_000_000_000
"""Shortest time between two lines about the same finding."""
log = logging.getLogger(__name__)


class TroubleLog:
    """One line per finding; the same finding within a second is counted, and the next line says the count."""

    def __init__(self) -> None:
        self._logged: dict[tuple[Fault, str], tuple[int, int]] = {}

    def log(self, findings: Iterable[BusFinding]) -> None:
        """Log what is new."""
        for finding in findings:
            # error counters accompany every change of state and are in the recording; a line each would be noise
            if finding.fault is not Fault.COUNTERS:
                self._log(finding)

    def _log(self, finding: BusFinding) -> None:
        key = finding.fault, finding.detail
        # as if logged one interval ago, so that a first finding is logged at once
        logged_ns, since = self._logged.get(key, (finding.at_ns - AGAIN_NS, 0))
        if finding.at_ns - logged_ns < AGAIN_NS:
            self._logged[key] = logged_ns, since + 1
            return
        self._logged[key] = finding.at_ns, 0
        log.warning("bus: %s%s", finding, f", {since} more since the last line" if since else "")
