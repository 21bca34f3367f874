"""What a bus reports, as lines of a log: told when it is new, counted while it goes on."""

import logging
from collections.abc import Iterable

from bus.errors import BusFinding, Fault

AGAIN_NS = 1_000_000_000
"""The same is not told again before this time has passed."""
log = logging.getLogger(__name__)


class TroubleLog:
    """One line per finding; the same finding within a second is counted and told with the next.

    Error counters alone are not told: they come with every change of state, and are in the recording.
    """

    def __init__(self) -> None:
        self._told: dict[tuple[Fault, str], tuple[int, int]] = {}

    def tell(self, findings: Iterable[BusFinding]) -> None:
        """Log what is new."""
        for finding in findings:
            if finding.fault is not Fault.COUNTERS:
                self._tell(finding)

    def _tell(self, finding: BusFinding) -> None:
        key = finding.fault, finding.detail
        told_ns, since = self._told.get(key, (finding.at_ns - AGAIN_NS, 0))
        if finding.at_ns - told_ns < AGAIN_NS:
            self._told[key] = told_ns, since + 1
            return
        self._told[key] = finding.at_ns, 0
        log.warning("bus: %s%s", finding, f", {since} more since the last line" if since else "")
