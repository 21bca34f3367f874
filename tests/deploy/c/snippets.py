"""Functions for the tests of the translation: what it takes and what it refuses."""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LARGEST = 4.0
"""A constant of this module."""
WAYS = 4


class Point(NamedTuple):
    """A record."""

    x: float  # to the right [m]
    y: float


class Segment(NamedTuple):
    """A record of records."""

    begin: Point
    end: Point


def swapped_in_a_loop(a: float, b: float) -> float:
    """Names that are assigned from one another, carried from turn to turn."""
    for k in range(5):
        a, b = b, a + b * k
        if a > 100.0:
            break
    return a - 2.0 * b


def carried_past_a_condition(a: float, b: float) -> float:
    """A local whose first assignment lies inside a condition inside a loop."""
    total = 0.0
    for k in range(4):
        if k == 0:  # noqa: SIM108
            kept = a  # both branches assign: declared above the loop in C
        else:
            kept = kept * b
        if k % 2 == 1:
            continue
        total += kept
    return total


def chosen(a: float, b: float) -> float:
    """Chains of comparisons, membership, nested choices, truth values as numbers."""
    way = int(abs(a)) % WAYS
    sign = (a > 0.0) - (a < 0.0)
    if way in (1, 3) and -LARGEST <= b <= LARGEST:
        return b * sign if not a == b else math.copysign(1.0, a)  # noqa: SIM201
    return min(max(b, -1.0, a), LARGEST, 2.0**way)


def halved(a: float, b: float) -> Segment:
    """A record of records from two numbers."""
    middle = (a + b) / 2.0
    return Segment(Point(a, y=middle), Point(x=middle, y=b))


def length(segment: Segment) -> float:
    """A record as an argument, its parts by name and by unpacking."""
    begin, end = segment
    x, y = end
    return math.sqrt((x - begin.x) * (x - begin.x) + (y - begin.y) * (y - begin.y))


def both(a: float, b: float) -> tuple[float, float]:
    """Two results."""
    return a * b, divided_by(a, b)


def divided_by(a: float, b: float) -> float:
    """A quotient."""
    return a / b


def through_records(a: float, b: float) -> float:
    """Results of calls as arguments, and items of tuples."""
    product, quotient = both(a, b)
    return length(halved(a, b)) + product - quotient * both(b, a)[0]


class Mood(enum.IntEnum):
    """An enumeration."""

    CALM = 3
    WILD = 7


@dataclass(frozen=True, kw_only=True)
class Watch:
    """A record with defaults, among them one that is a record and a time that has not come."""

    mood: Mood = Mood.CALM
    since_ns: int | None = None
    pair: tuple[float, float] = (0.5, -0.5)
    place: Point = Point(1.0, 2.0)  # noqa: RUF009 - a named tuple cannot be changed


def watched(before: Watch, now_ns: int, wild: bool) -> Watch:
    """Times, enumerations, defaults and choices of records."""
    if wild and before.since_ns is None:
        return Watch(mood=Mood.WILD, since_ns=now_ns)
    return before if wild else Watch()


def times_and_moods(a: float, b: float) -> float:
    """How long it has been wild, in whole steps of time."""
    seen, start_ns = Watch(), 10
    seen = watched(seen, start_ns, a > 0.0)
    seen = watched(seen, start_ns + 5, a > 0.0 and b > 0.0)
    first, second = seen.pair
    known = 0.0 if seen.since_ns is None else 1.0
    return seen.mood * known + first - second * seen.place.y


def bumped(rows: Floats, place: int, by: float) -> float:
    """Writes into an array of the caller's."""
    rows[1, place] += by
    return rows[1, place]


def most(row: Floats) -> float:
    """The largest number of a row."""
    found = row[0]
    for k in range(1, row.size):
        found = max(found, row[k])
    return found


def emptied(row: Floats) -> None:
    """Has no result."""
    row[:] = 0.0


def through_arrays(a: float, b: float) -> float:
    """Arrays of its own, rows of them under another name, chains and tuples of assignments, writes of a callee."""
    near, far = min(max(a, -9.0), 9.0), min(max(b, -9.0), 9.0)
    rows, own = np.empty((3, 4)), np.zeros(4)
    rows[:] = 1.0
    row = rows[1]
    row[0], rows[2, 3] = near, far
    rows[0, 1] = rows[0, 2] = near * far
    row[1], row[0] = rows[1, 0], row[1]  # one memory under two names
    kept = row.copy()
    change = bumped(rows, 2, far) - 1.0
    wild = near > 0.0
    wild |= most(rows[2]) > LARGEST
    for k in range(rows.shape[1]):
        own[k] -= rows[1, k] * (k + 1) - kept[k] * rows[0, k]
    total = own[0] + 2.0 * own[1] + own[2] + own[3]
    emptied(rows[0])
    rows[0, 3] = bumped(rows, 0, near)
    return total + change + most(rows[0]) if wild else total - (abs(near) + 1.0) ** (1.0 / 3.0)


TAKEN = (
    through_arrays,
    times_and_moods,
    swapped_in_a_loop,
    carried_past_a_condition,
    chosen,
    divided_by,
    through_records,
)


# -- refused


def loops_while(a: float) -> float:
    while a > 1.0:
        a = a / 2.0
    return a


def takes_text(a: float) -> float:
    return a if f"{a}" else 0.0


def keeps_a_list(a: float) -> float:
    values = [a, a]
    return values[0]


def reads_a_number_as_truth(a: float) -> float:
    return 1.0 if a else 0.0


def raises_to_any_power(a: float) -> float:
    return a**3.5


def catches(a: float) -> float:
    try:
        return 1.0 / a
    except ZeroDivisionError:
        return 0.0


def calls_what_is_unknown(a: float) -> float:
    return float(round(a))


def calls_itself(a: float) -> float:
    return calls_itself(a - 1.0) if a > 0.0 else a


def skips_a_call(a: float) -> float:
    return length(halved(a, 1.0)) if a > 0.0 else 0.0


def has_a_default(a: float, b: float = 1.0) -> float:
    return a + b


def mixes_kinds(a: float) -> float:
    found = 1
    if a > 0.0:
        found = a
    return found


def steps_by_two(a: float) -> float:
    for _ in range(0, 4, 2):
        a += 1.0
    return a


def without_annotation(a):
    return a


def changes_twice_in_a_sum(a: float) -> float:
    rows = np.zeros((2, 2))
    return bumped(rows, 0, a) + bumped(rows, 1, a)


def reads_beside_a_change(a: float) -> float:
    rows = np.zeros((2, 2))
    return rows[1, 0] + bumped(rows, 0, a)


def counts_from_the_end(a: float) -> float:
    row = np.zeros(2)
    row[0] = a
    return row[-1]


def reads_beyond_the_end(a: float) -> float:
    row = np.zeros(2)
    row[0] = a
    return row[2]


def has_two_sizes(a: float) -> float:
    short, long = np.zeros(2), np.zeros(3)
    return most(short) + most(long) + a


def assigns_a_row(a: float) -> float:
    rows = np.zeros((2, 2))
    rows[0] = a
    return rows[0, 0]


REFUSED = {
    changes_twice_in_a_sum: "changes an array",
    reads_beside_a_change: "beside a read",
    counts_from_the_end: "from 0 to 1",
    reads_beyond_the_end: "from 0 to 1",
    has_two_sizes: "another size",
    assigns_a_row: "the row",
    loops_while: "While",
    takes_text: "JoinedStr",
    keeps_a_list: "List",
    reads_a_number_as_truth: "no truth value",
    raises_to_any_power: "power",
    catches: "Try",
    calls_what_is_unknown: "round",
    calls_itself: "recursion",
    skips_a_call: "may be skipped",
    has_a_default: "argument b",
    mixes_kinds: "is needed",
    steps_by_two: "a step",
    without_annotation: "argument a",
}
