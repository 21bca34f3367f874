"""Exchanged wheel sensors of an axle, found by the yaw rate that their difference would mean.

An axle that turns with yaw rate w has its right wheel faster by w T / r (ISO 8855, left positive). The gyro sits on the
rear frame; the front axle turns with it and with the articulation. Slip changes the difference of the wheels, but seldom
its sign. So a difference counts only if it is near the opposite of the expected one, for many frames in a row. A lifted
wheel does change the sign: it is driven, or keeps its speed while the machine turns the other way after a kerb. Callers must not
ask near lift-off, and say so: the frames before and after are not in a row.
"""

from dataclasses import dataclass

NEAR = 0.5
"""A measured difference is near an expected one if they differ by less than this share of it. Half: it cannot be near both signs."""
LIGHT = 0.85
"""Share of gravity below which the vertical specific force says that wheels may be in the air: 0.97 on a bank of 15 degrees, 0.75 when both
rear wheels have left a kerb."""


@dataclass(slots=True)
class AxleSides:
    """Whether left and right of one axle are exchanged. lever: wheel radius over track; frames: in a row that decide."""

    lever: float
    turning: float
    frames: float
    exchanged: bool = False
    _against: int = 0

    def pause(self) -> bool:
        """A frame that says nothing; whether they are exchanged as far as is known."""
        self._against = 0
        return self.exchanged

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
