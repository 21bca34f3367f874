"""Random drives for comparing two ECUs: noise and wild but possible signals while it runs, bursts of trouble, and calm to recover in.

Frames of random bits alone would put an ECU into FAULT and keep it there: after a second with every input good it comes back, and with
random bits there is no such second. So trouble comes in bursts of 0.05 to 2 s, with 0.1 to 2.5 s of calm between them.
"""

import math
import random
from collections import deque
from collections.abc import Callable, Iterator
from typing import Final

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector, sign
from ecu.calibration import Calibration
from tests.ecu.machine import MESSAGES, PERIOD_NS, FakeMachine

MS: Final = 1_000_000
WHEELS: Final = (1, 2, 3, 4)
# middle, half range, largest change in a tick, standard deviation of the noise; inside of what the ECU holds for plausible
WALKS: Final = {
    "articulation_angle": (0.0, 0.72, 0.015, 2e-4),
    "articulation_rate": (0.0, 1.5, 0.2, 2e-3),
    **{f"wheel_speed_{n}": (0.0, 27.0, 1.0, 0.02) for n in WHEELS},
    **{f"wheel_torque_{n}": (0.0, 59e3, 4e3, 60.0) for n in WHEELS},
    "specific_force_x": (0.0, 12.0, 1.0, 0.03),
    "specific_force_y": (0.0, 14.0, 1.0, 0.03),
    "specific_force_z": (10.0, 7.5, 1.0, 0.05),
    "roll_rate": (0.0, 2.0, 0.2, 0.01),
    "pitch_rate": (0.0, 2.0, 0.2, 0.01),
    "yaw_rate": (0.0, 2.0, 0.2, 0.01),
    "pitch": (0.0, 1.0, 0.02, 2e-3),
    "roll": (0.0, 1.0, 0.02, 2e-3),
    "lift_pressure": (1.8e7, 1.8e7, 1e6, 5e4),
    "tilt_pressure": (1.8e7, 1.8e7, 1e6, 5e4),
    "lift_arm_angle": (0.0, 1.0, 0.015, 2e-3),
    "tilt_angle": (0.0, 1.7, 0.015, 2e-3),
    "steering_pressure_left": (1e7, 1e7, 1e6, 5e4),
    "steering_pressure_right": (1e7, 1e7, 1e6, 5e4),
}  # fmt: skip
DEMANDS: Final = {"articulation_rate_demand": 1.4, "lift_demand": 1.0, "tilt_demand": 1.0}


class Walk:
    """A signal that goes to random targets, no faster than it may."""

    def __init__(
        self, generator: random.Random, middle: float, half: float, step: float, noise: float
    ) -> None:
        self._random, self._middle, self._half, self._step, self._noise = generator, middle, half, step, noise
        self._at, self._target = middle, middle

    def next(self, amplitude: float, target: float | None = None) -> float:
        """The next sample; amplitude: share of the range; target: to go there instead of anywhere."""
        if target is not None:
            self._target = target
        elif self._random.random() < 0.02:
            self._target = self._middle + amplitude * self._random.uniform(-self._half, self._half)
        self._at += min(max(self._target - self._at, -self._step), self._step)
        return self._at + self._random.gauss(0.0, self._noise)


class RandomDrive:
    """Endless calls of an ECU: a frame with its time, or None with the time of a tick [ns]."""

    def __init__(self, calibration: Calibration, seed: int) -> None:
        self._random = random.Random(seed)
        self._machine = FakeMachine()
        self._walks = {name: Walk(self._random, *values) for name, values in WALKS.items()}
        self._geometry, self._radius = (
            calibration.parameters.geometry,
            calibration.parameters.wheel.unloaded_radius,
        )
        self._amplitude, self._chapter_ticks = 0.1, 0
        self._trouble: Callable[[Frame], list[Frame]] | None = None
        self._until = 0  # tick at which the trouble, or the calm, ends
        self._held: deque[tuple[int, Frame]] = deque()  # frames that come late, with their tick
        self._last: dict[int, bytes] = {}  # frames of the sensors that stand still
        self._stand: frozenset[int] = frozenset()
        self._now_ns = 0

    def calls(self, frames: int) -> Iterator[tuple[Frame | None, int]]:
        """At least so many frames with the ticks between them."""
        made = 0
        while made < frames:
            self._turn()
            for frame in self._received():
                made += 1
                yield frame._replace(at_ns=self._now_ns), self._now_ns
            yield None, self._now_ns + PERIOD_NS // 2
            # uneven ticks belong to the trouble: with these alone every counter is right
            uneven = self._trouble is not None and self._random.random() < 0.05
            self._now_ns += self._random.randrange(1, 60) * MS if uneven else PERIOD_NS

    def _turn(self) -> None:
        """The machine's next sample, and whether trouble begins or ends."""
        draw, machine = self._random, self._machine
        if self._chapter_ticks == 0:
            # Mostly drives as they are; of the rest some shake and some are as far off as can still be plausible.
            self._amplitude = draw.choice((0.0, 0.0, 0.0, 0.05, 0.3, 1.0))
            self._chapter_ticks = draw.randrange(200, 1000)
        self._chapter_ticks -= 1
        targets = self._drive() if self._amplitude == 0.0 else {}
        for name, walk in self._walks.items():
            machine.values[name] = walk.next(self._amplitude, targets.get(name))
        for name, most in DEMANDS.items():
            if draw.random() < 0.02:
                machine.values[name] = draw.choice((0.0, 0.0, draw.uniform(-most, most)))
        if machine.tick >= self._until:
            self._change()

    def _drive(self) -> dict[str, float]:
        """Where the signals of a machine in a turn stand: yaw rate, wheels and lateral acceleration fit one another."""
        t, g = self._machine.tick * 0.01, self._geometry
        angle, rate = 0.5 * math.sin(0.4 * t), 0.2 * math.cos(0.4 * t)
        speed = 4.0 + 4.0 * math.sin(0.11 * t)
        yaw = (speed * math.sin(angle) + g.front_length * rate) / (
            g.front_length * math.cos(angle) + g.rear_length
        )
        found = {
            "articulation_angle": angle, "articulation_rate": rate, "yaw_rate": -yaw,
            "specific_force_x": 0.3, "specific_force_y": -speed * yaw, "specific_force_z": 9.81,
            "roll_rate": 0.0, "pitch_rate": 0.0, "pitch": 0.02, "roll": 0.03,
            "lift_pressure": 8e6, "tilt_pressure": 3e6, "lift_arm_angle": 0.4 * math.sin(0.2 * t), "tilt_angle": 0.5,
            "steering_pressure_left": 2e6, "steering_pressure_right": 2e6,
        }  # fmt: skip
        for n, (side, track, turning) in zip(
            WHEELS,
            ((-1, g.front_track, rate - yaw), (1, g.front_track, rate - yaw), (-1, g.rear_track, -yaw), (1, g.rear_track, -yaw)),
            strict=True,
        ):  # fmt: skip
            found[f"wheel_speed_{n}"] = (speed + side * 0.5 * track * turning) / self._radius
            found[f"wheel_torque_{n}"] = 1500.0 + 3000.0 * math.sin(t)
        return found

    def _change(self) -> None:
        """From calm to trouble and back."""
        draw, machine = self._random, self._machine
        machine.silent, machine.values["health"] = set(), 0.0
        if self._trouble is not None:
            self._trouble, self._until = None, machine.tick + draw.randrange(10, 250)
            return
        kinds = (
            self._lost, self._late, self._doubled, self._random_bits, self._wrong_crc, self._cut, self._swapped, self._stuck,
        )  # fmt: skip
        self._trouble = draw.choice(kinds)
        self._until = machine.tick + round(math.exp(draw.uniform(math.log(5), math.log(200))))
        self._last, self._stand = {}, frozenset(draw.sample(list(loader_database().by_id), 8))
        # beside the trouble with frames: messages that fall silent, sensors that report a fault
        names = list(loader_database().by_name)
        if draw.random() < 0.5:
            machine.silent = set(draw.sample(names, 3))
        if draw.random() < 0.15:
            machine.values["health"] = float(draw.randrange(4))

    def _received(self) -> list[Frame]:
        """What is received in this tick in the place of what was sent."""
        tick, found = self._machine.tick, []
        while self._held and self._held[0][0] <= tick:
            found.append(self._held.popleft()[1])
        for frame in self._machine.frames():
            found += self._trouble(frame) if self._trouble is not None else [frame]
        return found

    def _lost(self, frame: Frame) -> list[Frame]:
        return [] if self._random.random() < 0.4 else [frame]

    def _late(self, frame: Frame) -> list[Frame]:
        if self._random.random() < 0.7:
            return [frame]
        self._held.append((self._machine.tick + self._random.randrange(1, 6), frame))
        return []

    def _doubled(self, frame: Frame) -> list[Frame]:
        return [frame] * self._random.choice((1, 1, 2, 3))

    def _swapped(self, frame: Frame) -> list[Frame]:
        """Behind the other frames of the tick."""
        if self._random.random() < 0.5:
            return [frame]
        self._held.append((self._machine.tick, frame))
        return []

    def _random_bits(self, frame: Frame) -> list[Frame]:
        """Signed, so that the values are looked at; the counter goes on."""
        if self._random.random() < 0.4:
            return [frame]
        return [signed(frame, self._random.randbytes(len(frame.data)))]

    def _wrong_crc(self, frame: Frame) -> list[Frame]:
        if self._random.random() < 0.7:
            return [frame]
        data = bytearray(frame.data)
        data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return [frame._replace(data=bytes(data))]

    def _stuck(self, frame: Frame) -> list[Frame]:
        """The values of a sensor stand still; counter and CRC go on."""
        if frame.can_id not in self._stand:
            return [frame]
        return [signed(frame, self._last.setdefault(frame.can_id, frame.data))]

    def _cut(self, frame: Frame) -> list[Frame]:
        return (
            [frame._replace(data=frame.data[: self._random.randrange(9)])]
            if self._random.random() < 0.2
            else [frame]
        )


def random_frames(seed: int, frames: int) -> Iterator[tuple[Frame | None, int]]:
    """Calls as of `RandomDrive`: random contents, mostly signed, of random length now and then, at times that also run backwards."""
    generator, now = random.Random(seed), 0
    codecs = [loader_database().by_name[name] for name in MESSAGES]
    protectors = {c.can_id: Protector(c) for c in codecs if c.e2e_data_id is not None}
    for k in range(frames):
        codec = codecs[k % len(codecs)]
        data = generator.randbytes(codec.length)
        if codec.can_id in protectors and generator.random() < 0.95:
            data = protectors[codec.can_id].protect(data)
        if generator.random() < 0.01:
            data = data[: generator.randrange(9)]
        can_id = codec.can_id if generator.random() < 0.99 else generator.getrandbits(29)
        yield Frame(can_id, bytes(data), now), now
        if k % len(codecs) == 0:
            now += generator.choice((PERIOD_NS, PERIOD_NS, PERIOD_NS, 7 * PERIOD_NS, -PERIOD_NS, 1 << 40))
            yield None, now


def signed(frame: Frame, content: bytes) -> Frame:
    """The frame with another content, its own counter and the right CRC."""
    codec, data = loader_database().by_id[frame.can_id], bytearray(content)
    if codec.e2e_data_id is not None:
        data[1] = (data[1] & 0xF0) | (frame.data[1] & 0x0F)
        sign(data, codec.e2e_data_id)
    return frame._replace(data=bytes(data))
