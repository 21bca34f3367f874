"""Exchanged wheel sensors of an axle, found by the yaw rate that their difference would mean.

An axle that turns with yaw rate w has its right wheel faster by w T / r (ISO 8855, left positive). The gyro sits on the
rear frame; the front axle turns with it and with the articulation. Slip adds to the difference of the wheels, and seldom
turns it round: only a difference near the opposite of the expected one, many frames in a row, counts. A lifted wheel
that is driven does turn it round: not to be asked near lift-off.
"""

from dataclasses import dataclass

NEAR = 0.5
"""Share of the expected difference within which a measured one is near it: it cannot be near both."""


@dataclass(slots=True)
class AxleSides:
    """Whether left and right of one axle are exchanged. lever: wheel radius over track; frames: in a row that decide."""

    lever: float
    turning: float
    frames: float
    exchanged: bool = False
    _against: int = 0

    def look(self, left: float, right: float, yaw_rate: float) -> bool:
        """One frame: wheel speeds and the axle's yaw rate [rad/s]; whether they are exchanged as far as is known."""
        if not self.frames or abs(yaw_rate) < self.turning:
            return self.exchanged
        shown = (right - left) * self.lever
        expected = -yaw_rate if self.exchanged else yaw_rate
        contradicts = abs(shown + expected) < NEAR * abs(yaw_rate)
        self._against = self._against + 1 if contradicts else 0
        if self._against >= self.frames:
            self.exchanged, self._against = not self.exchanged, 0
        return self.exchanged
