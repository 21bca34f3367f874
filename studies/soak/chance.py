"""Random drives and random faults for soak runs, reproducible from the seed."""

import random
from collections.abc import Callable

from configuration import CheckedTable
from dbc import loader_database
from hil.faults.table import KINDS
from plant.unit.script import Script, read_script

Table = dict[str, object]

DATABASE = loader_database()
MESSAGES = tuple(DATABASE.by_name)
SPEEDS_KMH = (-4.0, 0.0, 4.0, 8.0, 12.0, 16.0)
QUICK_KMH, WIDE_DEG, NARROW_DEG = 9.0, 25.0, 10.0
"""Above QUICK_KMH the articulation stays below NARROW_DEG: a soak tests faults, and a machine that rolls over would end the drive."""
LEGS_S = (3.0, 8.0)  # duration between two demands of the driver


def drive(generator: random.Random, duration_s: float) -> Script:
    """A random drive as the driver's script."""
    return read_script(CheckedTable(driver(generator, duration_s), file="soak"))


def driver(generator: random.Random, duration_s: float) -> dict[str, Table]:
    """The [driver] table of a random drive: legs of speed and articulation, the lift arm moving now and then."""
    time_s, before = 1.0, 0.0
    speeds, angles, lifts = [[0.0, 0.0]], [[0.0, 0.0]], [[0.0, 0.0]]
    while time_s < duration_s:
        time_s += generator.uniform(*LEGS_S)
        speed = generator.choice(SPEEDS_KMH)
        bound = NARROW_DEG if max(abs(speed), abs(before)) > QUICK_KMH else WIDE_DEG
        before = speed
        speeds.append([time_s, speed])
        angles.append([time_s, generator.uniform(-bound, bound)])
        lifts.append([time_s, generator.choice((-10.0, 0.0, 0.0, 10.0))])
    points = {"speed_kmh": speeds, "articulation_deg": angles, "lift_percent": lifts}
    return {key: {"points": value} for key, value in points.items()}


def fault(generator: random.Random) -> Table:
    """The table of a fault of a random kind with random parameters; the caller adds its times."""
    # every kind as often: rare kinds are those whose handling is tried least
    kind = generator.choice(tuple(KINDS))
    return {"kind": kind, **_PARAMETERS[kind](generator)}


def _message(generator: random.Random) -> Table:
    return {"message": generator.choice(MESSAGES)}


def _some(generator: random.Random) -> Table:
    """A message that is struck always or with a small probability."""
    return _message(generator) | {"probability": generator.choice((0.05, 0.2, 1.0))}


def _signal(generator: random.Random) -> tuple[Table, float]:
    """A signal of the payload and the width of its range."""
    codec = DATABASE.by_name[generator.choice(MESSAGES)]
    # a shift of CRC or counter is only another corrupted frame, which `corrupt` covers
    signal = generator.choice([s for s in codec.layout if s.name not in ("Crc", "AliveCounter")])
    lowest, highest = signal.raw_range
    return {"message": codec.name, "signal": signal.name}, (highest - lowest) * signal.scale


def _shift(key: str) -> Callable[[random.Random], Table]:
    """A shift by up to a fifth of the signal's range, mostly a small one."""

    def shift(generator: random.Random) -> Table:
        signal, width = _signal(generator)
        # squared: small shifts, which are hard to detect, are drawn more often than large ones
        return signal | {key: round(generator.choice((-1, 1)) * width * generator.uniform(0.0, 0.45) ** 2, 4)}

    return shift


def _swap(generator: random.Random) -> Table:
    # only messages with two signals of one meaning: others would be out of range, which `offset` covers
    name = generator.choice(("WheelSpeedsFront", "WheelSpeedsRear", "WheelTorquesFront", "WheelTorquesRear"))
    return {"message": name, "signals": ["Left", "Right"]}


def _corrupt(generator: random.Random) -> Table:
    """Some flipped bits; or payloads that a defective sender signs as if they were sound, of one message or of all that the ECU reads."""
    if generator.random() < 0.5:
        return _some(generator) | {"bits": generator.randint(1, 8), "valid_crc": generator.random() < 0.5}
    # two inputs that are wrong at the same time are what a single message never shows
    where = _some(generator) if generator.random() < 0.5 else {"from": "plant", "probability": 0.05}
    return where | {"content": "any", "valid_crc": True}


_PARAMETERS: dict[str, Callable[[random.Random], Table]] = {
    "drop": _some,
    "repeat": lambda g: _some(g) | {"copies": g.randint(1, 3), "gap_ms": g.choice((0.0, 2.0))},
    "delay": lambda g: _message(g) | {"delay_ms": round(g.uniform(1.0, 150.0), 3)},
    "jitter": lambda g: _message(g) | {"jitter_ms": round(g.uniform(1.0, 60.0), 3)},
    "reorder": lambda g: _some(g) | {"depth": g.randint(1, 4)},
    "corrupt": _corrupt,
    "freeze": lambda g: _signal(g)[0],
    "offset": _shift("offset"),
    "spike": lambda g: _shift("height")(g) | {"every": g.randint(5, 50)},
    "swap": _swap,
    "babble": lambda g: {
        "from": g.choice(("plant", "ecu")),
        "interval_us": round(g.uniform(150.0, 2000.0), 1),
    },
    "bus_off": lambda g: {"node": g.choice(("plant", "ecu"))},
    "kill": lambda g: {"process": g.choice(("plant", "ecu"))},
}
