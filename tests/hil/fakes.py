"""A plant and an ECU small enough to predict: they count, answer and stop."""

from dataclasses import dataclass, field

from bus.frame import EXTENDED, Frame

SENSOR, SPEEDS, ANSWER = 0x0CFF0121 | EXTENDED, 0x0CFF0221 | EXTENDED, 0x0CFF2127 | EXTENDED


@dataclass(frozen=True)
class FakeTruth:
    time_s: float
    normal_force: tuple[float, float, float, float]


@dataclass
class FakePlant:
    """Sends its tick number in two frames; remembers what it heard and when."""

    ticks: int
    heard: list = field(default_factory=list)
    ticked: list = field(default_factory=list)

    def receive(self, frame, now_ns):
        self.heard.append((frame, now_ns))
        return []

    def tick(self, now_ns):
        self.ticked.append(now_ns)
        number = len(self.ticked) - 1
        return [Frame(SPEEDS, number.to_bytes(8, "little")), Frame(SENSOR, number.to_bytes(8, "little"))]

    def reference_of(self, truths, first, at_ns):
        return [
            Frame(SENSOR + 0x100, (first + k).to_bytes(8, "little"), at_ns + 10_000_000 * k)
            for k, _ in enumerate(truths)
        ]

    @property
    def truth(self):
        return FakeTruth(self.ticked[-1] * 1e-9, (1.0, 2.0, 3.0, float(len(self.ticked))))

    @property
    def finished(self):
        return len(self.ticked) >= self.ticks


@dataclass
class FakeTick:
    frames: list
    findings: list


@dataclass
class FakeEcu:
    """Answers with the newest sensor number."""

    newest: bytes = b""
    heard: list = field(default_factory=list)
    ticked: list = field(default_factory=list)

    def receive(self, frame, now_ns):
        self.heard.append((frame, now_ns))
        self.newest = frame.data
        return ["heard"]

    def tick(self, now_ns):
        self.ticked.append(now_ns)
        return FakeTick([Frame(ANSWER, self.newest)], ["ticked"])
