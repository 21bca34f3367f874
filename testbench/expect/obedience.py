"""The expectation that the machine keeps to the ECU's limits. Pure: evidence in, a verdict out."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.verdict import Verdict
from testbench.expect.evidence import Evidence
from testbench.expect.expectations import ROUNDING_S, Window, failed, open_question, passed

WHOLE_RUN = Window()


@dataclass(frozen=True, slots=True)
class LimitsObeyed:
    """The machine keeps to the limits of the ECU, by the truth. A limit counts `settle_s` after it was sent."""

    settle_s: float = 1.0  # [s]
    # The machine's governor reduces the speed over several km/h, and cylinders have inertia: hence tolerances.
    speed_tolerance: float = 4.0 / 3.6  # [m/s]
    rate_tolerance: float = math.radians(2.0)  # of the articulation [rad/s]
    window: Window = WHOLE_RUN

    @property
    def question(self) -> str:
        return f"the machine keeps to the ECU's limits{self.window}"

    def judge(self, evidence: Evidence) -> Verdict:
        limits, truth = evidence.messages.get("Limits"), evidence.truth
        if limits is None or "speed" not in truth or not truth["time_s"].size:
            return open_question(self.question, "no Limits on the bus, or no truth of the machine")
        worst_of_each = []
        for name, signal, scale, tolerance in (
            ("speed", "Speed", 1 / 3.6, self.speed_tolerance),
            ("articulation_rate", "ArticulationRate", math.radians(1.0), self.rate_tolerance),
        ):
            raw = np.asarray(limits.signals[signal], float)
            highest = limits.codec.by_signal[signal].maximum
            # raw values above the DBC's maximum mean "no limit" or "not available"
            allowed = np.where(raw > (highest or np.inf), np.inf, raw * scale)
            time_s = np.asarray(truth["time_s"], float)
            inside = (time_s >= self.window.from_s) & (time_s <= self.window.to_s)
            # the limits are magnitudes, for both directions of travel and of turn
            over = np.abs(np.asarray(truth[name], float)) - _lately(
                limits.time_s, allowed, time_s, self.settle_s
            )
            over = over[inside]
            if not over.size:
                return open_question(self.question, f"no truth{self.window}")
            worst = int(np.argmax(over))
            side = "above" if over[worst] > 0 else "below"
            amount = f"{abs(over[worst]) / scale:.1f} {limits.codec.by_signal[signal].unit}"
            text = f"{name.replace('_', ' ')} {amount} {side} the limit"
            if over[worst] > tolerance:
                return failed(self.question, f"{text} at {time_s[inside][worst]:.2f} s")
            worst_of_each.append(text)
        return passed(self.question, "at worst " + ", ".join(worst_of_each))


def _lately(
    sent_s: NDArray[np.float64], allowed: NDArray[np.float64], time_s: NDArray[np.float64], settle_s: float
) -> NDArray[np.float64]:
    """At each time the highest limit that was in force within the last `settle_s` [s]; inf before the first."""
    # index of the limit in force at the begin of the last `settle_s`
    first = np.searchsorted(sent_s, time_s - settle_s + ROUNDING_S, side="right") - 1
    last = np.searchsorted(sent_s, time_s, side="right") - 1
    found = np.full(time_s.size, np.inf)
    for row in np.flatnonzero(first >= 0):
        found[row] = allowed[first[row] : last[row] + 1].max()
    return found
