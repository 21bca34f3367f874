"""Frames of a diagnostic tool that keeps to the protocol now and then: long requests, answers taken in pieces, and noise."""

import random
from collections.abc import Iterator

SERVICES = (0x10, 0x11, 0x14, 0x19, 0x22, 0x27, 0x31, 0x3E)
REQUESTS = (
    b"\x10\x03", b"\x19\x0a", b"\x19\x02\xff", b"\x19\x03", b"\x22\xf1\x90", b"\x22\xf1\x90\x10\x00\x10\x05",
    b"\x27\x01", b"\x27\x02" + bytes(16), b"\x31\x01\x02\x01", b"\x3e\x00", b"\x14\xff\xff\xff", b"\x11\x01",
    b"\x22" + b"\xf1\x90" * 60, b"\x22" + bytes(range(200)),
)  # fmt: skip
"""Of every service, short and long, answered shortly and at length."""


def tool_frames(rng: random.Random, count: int) -> Iterator[bytes | None]:
    """Contents of `count` frames; None where the time goes on."""
    made = 0
    while made < count:
        match rng.randrange(8):
            case 0:
                yield None
            case 1:
                made += 1
                yield flow_control(rng)
            case 2:
                made += 1
                yield noise(rng)
            case _:
                for data in parts(_request(rng)):
                    if rng.random() < 0.03:
                        continue  # a lost frame
                    made += 1
                    yield data
                    if rng.random() < 0.02:
                        yield noise(rng)
                if rng.random() < 0.8:
                    yield flow_control(rng)


def _request(rng: random.Random) -> bytes:
    request = rng.choice(REQUESTS)
    if rng.random() < 0.2:
        request = bytes((rng.choice(SERVICES),)) + rng.randbytes(rng.randrange(12))
    return request


def parts(message: bytes) -> Iterator[bytes]:
    """The frames of one message."""
    if len(message) < 8:
        yield bytes((len(message),)) + message
        return
    yield bytes((0x10 | len(message) >> 8, len(message) & 0xFF)) + message[:6]
    for k, at in enumerate(range(6, len(message), 7), 1):
        yield bytes((0x20 | k & 0x0F,)) + message[at : at + 7]


def flow_control(rng: random.Random) -> bytes:
    """Go on at once, in blocks or with pauses; now and then wait, stop, or nothing that there is."""
    status = rng.choice((0, 0, 0, 0, 0, 1, 2, 3, 9))
    block = rng.choice((0, 0, 0, 1, 2, 8))
    pause = rng.choice((0, 0, 0, 1, 10, 30, 0x7F, 0x80, 0xF1, 0xF9, 0xFF))
    return bytes((0x30 | status, block, pause, *([0xCC] * rng.randrange(6))))


def noise(rng: random.Random) -> bytes:
    """One to eight bytes; the kind of frame is one that there is."""
    data = bytearray(rng.randbytes(rng.randint(1, 8)))
    data[0] = rng.choice((0x00, 0x10, 0x20, 0x30, rng.randrange(256))) | data[0] & 0x0F
    return bytes(data)
