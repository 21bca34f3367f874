"""Frames of tools that keep to the protocol now and then: long requests, answers taken in pieces, lists, written numbers, and noise."""

import random
import struct
from collections.abc import Callable, Iterator

from ecu.measure.access import CALIBRATE, key_of
from ecu.measure.measurements import measurements
from ecu.measure.parameters import calibration_numbers

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


Ask = Callable[[bytes], list[bytes]]
"""Sends a command of XCP; its answers."""


def xcp_commands(rng: random.Random, count: int, ask: Ask, secret: bytes) -> Iterator[None]:
    """Ask `count` commands or more, and yield after every few of them, so that cycles can go on."""
    kinds = (_read, _write, _lists, _pages, _xcp_noise, _xcp_noise)
    asked = 0

    def counted(packet: bytes) -> list[bytes]:
        nonlocal asked
        asked += 1
        return ask(packet)

    while asked < count:
        if not counted(b"\xfd"):
            counted(b"\xff\x00")
            if rng.random() < 0.8:
                _unlock(counted, secret)
        rng.choice(kinds)(rng, counted)
        yield


def _unlock(ask: Ask, secret: bytes) -> None:
    seed = b"".join(answer[2:] for mode in (0, 1) for answer in ask(bytes((0xF8, mode, 1))))
    key = key_of(secret, CALIBRATE, seed)
    for at in range(0, len(key), 6):
        ask(bytes((0xF7, len(key) - at)) + key[at : at + 6])


def _address(rng: random.Random) -> int:
    rows = rng.choice((measurements(), calibration_numbers()))
    near = rng.choice((0, 0, 0, 0, 1, -1, 2, 0x1000))
    return max(rng.choice(rows).address + near, 0)


def _read(rng: random.Random, ask: Ask) -> None:
    ask(struct.pack("<BBBBI", 0xF4, rng.choice((1, 4, 4, 7, 8)), 0, 0, _address(rng)))
    ask(struct.pack("<BHBI", 0xF6, 0, 0, _address(rng)))
    ask(bytes((0xF5, rng.choice((1, 4, 7, 8, 40, 255)))))
    ask(struct.pack("<BxxxI", 0xF3, rng.choice((1, 4, 100, 500))))
    if rng.random() < 0.3:
        ask(bytes((0xFA, rng.randrange(7))))
        ask(bytes((0xF5, rng.randrange(20))))


def _write(rng: random.Random, ask: Ask) -> None:
    """Numbers near those that are there, in pieces now and then; or any bits."""
    for _ in range(rng.randint(1, 4)):
        number = rng.choice(calibration_numbers())
        ask(struct.pack("<BHBI", 0xF6, 0, 0, number.address))
        quantity = number.quantity
        value = rng.choice((quantity.low, quantity.high, rng.uniform(quantity.low, quantity.high)))
        data = struct.pack("<f", value) if rng.random() < 0.9 else rng.randbytes(4)
        if rng.random() < 0.2:
            ask(b"\xf0\x02" + data[:2])
            data = data[2:]
        ask(bytes((0xF0, len(data))) + data)


def _lists(rng: random.Random, ask: Ask) -> None:
    """Lists of random measurements, some of them wrong, started and stopped."""
    count = rng.randint(1, 3)
    ask(b"\xd6")
    ask(struct.pack("<BxH", 0xD5, count))
    sizes = [rng.randint(0, 3) for _ in range(count)]
    for k, odts in enumerate(sizes):
        ask(struct.pack("<BxHB", 0xD4, k, odts))
    for k, odts in enumerate(sizes):
        for odt in range(odts):
            ask(struct.pack("<BxHBB", 0xD3, k, odt, rng.randint(1, 3)))
    for k, odts in enumerate(sizes):
        for odt in range(odts):
            ask(struct.pack("<BxHBB", 0xE2, k, odt, 0))
            for _ in range(rng.randint(1, 3)):
                row = rng.choice(measurements())
                ask(struct.pack("<BBBBI", 0xE1, 0xFF, row.size, 0, row.address))
        ask(struct.pack("<BBHHBB", 0xE0, rng.choice((0, 0x10)), k, 0, rng.randint(1, 3), 0))
        ask(struct.pack("<BBH", 0xDE, rng.choice((1, 2)), k))
    ask(bytes((0xDD, rng.randrange(3))))


def _pages(rng: random.Random, ask: Ask) -> None:
    ask(bytes((0xEB, rng.choice((1, 2, 0x83)), 0, rng.choice((0, 1, 1, 1, 2)))))
    ask(bytes((0xEA, rng.randint(1, 2), 0)))
    if rng.random() < 0.3:
        ask(bytes((0xE4, 0, rng.randrange(2), 0, rng.randrange(2))))


def _xcp_noise(rng: random.Random, ask: Ask) -> None:
    small = (0, 0, 1, 2, 4, 0xFF, rng.randrange(256))
    ask(bytes((rng.randint(0xD0, 0xFF), *rng.choices(small, k=rng.randrange(8)))))
