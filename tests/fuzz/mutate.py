"""Mutations of bytes, repeatable from a seed: what damage, carelessness and malice make of a file."""

import random
import re
import struct
from collections.abc import Callable

NUMBERS = (
    0,
    1,
    7,
    8,
    64,
    127,
    128,
    255,
    4095,
    65_535,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
WORDS = (
    b"../../x",
    b"\x1b[2J",
    b"\0",
    b"nan",
    b"1e999",
    b"-1",
    b"9" * 400,
    b"[" * 2000,
    b"\xff\xfe",
    b"%s%n",
    b"\n" * 50,
)
MOST_EDITS = 8


def mutated(seed: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """The seed after one to MOST_EDITS edits, rather few than many; others: files to take pieces from."""
    data = bytearray(seed)
    for _ in range(min(rng.randint(1, MOST_EDITS), rng.randint(1, MOST_EDITS))):
        rng.choice(EDITS)(data, others, rng)
    return bytes(data)


def _place(data: bytearray, rng: random.Random) -> int:
    return rng.randint(0, len(data))


def _flip(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _number(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    """A number that is a limit of something, in binary or as text."""
    value, at = rng.choice(NUMBERS), _place(data, rng)
    form = rng.choice(("<B", "<H", "<I", "<Q", ">I", ""))
    new = struct.pack(form, value % 256 ** struct.calcsize(form)) if form else str(value).encode()
    data[at : at + len(new)] = new


def _word(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = _place(data, rng)
    data[at:at] = rng.choice(WORDS)


def _cut(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    del data[_place(data, rng) :]


def _delete(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = _place(data, rng)
    del data[at : at + rng.choice((1, 2, 8, 100))]


def _repeat(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = _place(data, rng)
    data[at:at] = data[at : at + rng.choice((1, 8, 100))] * rng.randint(1, 4)


def _splice(data: bytearray, others: list[bytes], rng: random.Random) -> None:
    other, at = rng.choice(others), _place(data, rng)
    start = rng.randint(0, len(other))
    data[at:at] = other[start : start + rng.choice((4, 40, 400))]


def _digits(data: bytearray, _: list[bytes], rng: random.Random) -> None:
    """Another number in the place of one: a text file stays well formed, and its reader's own checks are reached."""
    if found := list(re.finditer(rb"\d[\d.]*", data)):
        start, end = rng.choice(found).span()
        new = rng.choice(
            (rng.choice(NUMBERS), rng.uniform(-10.0, 10.0), rng.randrange(10), 1e308, "nan", "-inf")
        )
        data[start:end] = str(new).encode()


Edit = Callable[[bytearray, list[bytes], random.Random], None]
EDITS: tuple[Edit, ...] = (
    _flip,
    _flip,
    _number,
    _number,
    _word,
    _cut,
    _delete,
    _repeat,
    _splice,
    *[_digits] * 6,
)
