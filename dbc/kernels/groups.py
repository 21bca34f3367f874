"""Sorts the rows of a recording by message, in one compiled pass over the identifiers and one over the rows.

An identifier gets a number when it first comes, by a hash table with open addressing. The table is kept from piece
to piece, so that an identifier is looked up in the DBC files once.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dbc.compiled import released

_FIRST_SIZE = 1024
_FREE = -1
_MULTIPLIER = np.uint32(
    2654435769
)  # 2^32 over the golden ratio (Knuth, The Art of Computer Programming, 6.4)
_SHIFT = np.uint32(9)  # the upper bits of the product are the mixed ones


class Numbering:
    """Numbers of identifiers, from 0, in the order in which they first come."""

    def __init__(self) -> None:
        self._count = 0
        self._words = np.empty(0, np.uint32)
        self._make_room(_FIRST_SIZE)

    def __len__(self) -> int:
        return self._count

    def words(self, first: int = 0) -> list[int]:
        """The `can_id` words in the order of their numbers, from number `first` on."""
        return self._words[first : self._count].tolist()

    def of(self, can_id: NDArray[np.uint32]) -> NDArray[np.int32]:
        """The number of each word, (n,); new words are numbered on."""
        numbers = np.empty(can_id.size, np.int32)
        row = 0
        while True:
            row, self._count = number_words(
                can_id, row, self._keys, self._numbers, self._words, self._count, numbers
            )
            if row == can_id.size:
                return numbers
            self._make_room(2 * self._keys.size)

    def _make_room(self, size: int) -> None:
        """A table of `size` places, a power of two, with the words that are known."""
        known = self._words[: self._count]
        self._keys, self._numbers = np.zeros(size, np.uint32), np.full(size, _FREE, np.int32)
        self._words = np.empty(size, np.uint32)
        again = np.empty(known.size, np.int32)
        number_words(known, 0, self._keys, self._numbers, self._words, 0, again)


@released
def number_words(
    can_id: Any, row: Any, keys: Any, numbers: Any, words: Any, count: Any, found: Any
) -> tuple[int, int]:
    """Write the number of each word from `row` on into `found`; returns the row reached and the count of numbers.

    It ends before the last row when the table is half full: longer searches would cost more than a larger table.
    """
    mask = np.uint32(keys.size - 1)
    limit = keys.size // 2
    while row < can_id.size:
        word = can_id[row]
        # in 64 bits, because Python warns of what overflows
        place = np.uint32(np.uint32(np.uint64(word) * _MULTIPLIER) >> _SHIFT) & mask
        while numbers[place] != _FREE and keys[place] != word:
            place = np.uint32(place + np.uint32(1)) & mask
        if numbers[place] == _FREE:
            if count == limit:
                break
            keys[place], numbers[place], words[count] = word, count, word
            count += 1
        found[row] = numbers[place]
        row += 1
    return row, count


@released
def rows_by_group(numbers: Any, group_of: Any, groups: Any) -> Any:
    """Rows in the order of their groups, stable; where each group begins, (groups + 2,); rows of each number.

    group_of: group of each number; `groups` for a number of none, whose rows come last.
    """
    per_number = np.zeros(group_of.size, np.int64)
    for row in range(numbers.size):
        per_number[numbers[row]] += 1
    begins = np.zeros(groups + 2, np.int64)
    for number in range(group_of.size):
        begins[group_of[number] + 1] += per_number[number]
    for group in range(groups + 1):
        begins[group + 1] += begins[group]
    rows = np.empty(numbers.size, np.int64)
    next_place = begins.copy()
    for row in range(numbers.size):
        group = group_of[numbers[row]]
        rows[next_place[group]] = row
        next_place[group] += 1
    return rows, begins, per_number
