"""Which wheel's torque is wrong, by what has changed since a second or two: an offset of a sound sensor stays.

The torques of an axle are compared with each other, so that neither is known to be the wrong one. Both follow one drive and one
brake with those of the other axle, but offsets and the drive's division are unknown: the axles cannot be compared as
they are. Their changes can. A wheel that does not follow the other axle is wrong, when its neighbour does.
"""

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    C_BOUND,
    C_TIME,
    C_TORQUE,
    EARLIER,
    FRONT_TORQUES,
    NOISE,
    PRESENT,
    RECENT,
    SPOILED,
    TOLERANCE,
)
from ecu.detection.machine import NOTHING, over
from ecu.watched import TORQUE

Floats = NDArray[np.float64]

HELD = 1.5
"""Time between two memories [s]. Changes are taken over one to two of it: as long as a small drift takes to be noticed."""
AVERAGED = 0.1
"""Time constant of the mean of a torque [s]."""
LEAST_SHARE, MOST_SHARE = 0.5, 2.0
"""Change of one axle's torque over that of the other: motors and brakes differ from axle to axle, machine by machine."""
UNKNOWN = -1.0
"""For a signal that is no torque, or while the torques say nothing."""


@compiled
def remembered(m: Floats, bound: Floats, rules: Floats, state: Floats, dt: float) -> None:
    """Update the torques of now, and from time to time the memories of them."""
    for k in range(4):
        state[PRESENT, C_TORQUE + k] += dt / AVERAGED * (m[TORQUE + k] - state[PRESENT, C_TORQUE + k])
    for axle in range(2):
        j = FRONT_TORQUES + axle
        state[PRESENT, C_BOUND + axle] = NOTHING
        if state[SPOILED, j] > 0.0:  # by a known fault, which a memory may hold
            state[RECENT, C_BOUND + axle] = state[EARLIER, C_BOUND + axle] = NOTHING
        elif bound[j] < NOTHING:
            state[PRESENT, C_BOUND + axle] = bound[j] - rules[TOLERANCE, j] + rules[NOISE, j]
    state[RECENT, C_TIME] += dt
    if over(state[RECENT, C_TIME], HELD):
        for i in range(C_TIME):
            state[EARLIER, i] = state[RECENT, i]
            state[RECENT, i] = state[PRESENT, i]
        state[RECENT, C_TIME] = 0.0


@compiled
def unexplained(k: int, state: Floats) -> float:
    """How far the neighbour of wheel torque `k` does not follow the other axle, as a share of what is permitted; UNKNOWN without an answer.

    The bound of a change is that of now and that of then, each without the offsets of sound sensors. The torque `k` itself
    plays no part: if it is the wrong one, nothing has changed here, whatever the fault looks like.
    """
    if not TORQUE <= k < TORQUE + 4:
        return UNKNOWN
    own = 0
    if k >= TORQUE + 2:
        own = 1
    for axle in range(2):
        if state[PRESENT, C_BOUND + axle] >= NOTHING or state[EARLIER, C_BOUND + axle] >= NOTHING:
            return UNKNOWN
    across = C_TORQUE + 2 * (1 - own)
    other = (change(across, state) + change(across + 1, state)) / 2.0
    beside = change(C_TORQUE + 4 * own + 1 - (k - TORQUE), state)  # the wheels of axle a are 2 a and 2 a + 1
    least, most = min(LEAST_SHARE * other, MOST_SHARE * other), max(LEAST_SHARE * other, MOST_SHARE * other)
    permitted = state[PRESENT, C_BOUND + own] + state[EARLIER, C_BOUND + own]
    return abs(beside - min(max(beside, least), most)) / permitted


@compiled
def change(place: int, state: Floats) -> float:
    """Now less then."""
    return state[PRESENT, place] - state[EARLIER, place]
