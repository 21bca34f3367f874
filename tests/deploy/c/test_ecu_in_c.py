"""The whole ECU in C against the Python ECU: the same frames from the same frames, in double precision to the bit."""

import os
import random
import subprocess
import sys
from collections import Counter

import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from ecu.cycle import EcuCycle
from ecu.states import State
from tests.deploy.c.building import STRICT, build, compiler
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.random_drives import random_frames
from tests.ecu.machine import PERIOD_NS, FakeMachine
from tests.ecu.test_fuzz import CODECS, Bits, Values

MS = 1_000_000
DATABASE = loader_database()
CHOSEN = ("Limits", "LinkageLimits")
"""Messages whose values come from a choice among rates; those below likewise."""
CHOSEN_SIGNALS = frozenset(
    {
        "RollOver.LiftingWheel", "RollOver.PredictedLoadTransferRatio", "RollOver.TimeToLiftOff", "RollOver.State",
        "Warnings.RollOverPredicted", "Warnings.Level", "StabilityControl.RopEngineControlActive",
        "StabilityControl.RopBrakeControlActive",
    }
)  # fmt: skip


class Pair:
    """The Python ECU and the one in C, fed alike; every answer is compared."""

    def __init__(self, library, calibration=CALIBRATION, **options):
        self.python = EcuCycle(calibration, **options)
        self.c = BuiltEcu(library, limits_enabled=options.get("limits_enabled", True))
        self.ticks = 0

    def receive(self, frame, now_ns):
        self.c.receive(frame, now_ns)
        self.python.receive(frame, now_ns)

    def tick(self, now_ns):
        expected = [(f.can_id, bytes(f.data)) for f in self.python.tick(now_ns).frames]
        found = [(f.can_id, f.data) for f in self.c.tick(now_ns).frames]
        assert found == expected, (
            f"tick {self.ticks} at {now_ns * 1e-9:.3f} s: {differences(found, expected)}"
        )
        assert self.c.state == self.python.state
        self.ticks += 1


def differences(found, expected):
    """Signals that differ, with both values."""
    differing = []
    for (can_id, data), (_, other) in zip(found, expected, strict=False):
        codec = DATABASE.by_id[can_id]
        pairs = zip(codec.signals, codec.decode(data), codec.decode(other), strict=True)
        differing += [f"{codec.name}.{name} {a} for {b}" for name, a, b in pairs if a != b]
    return ", ".join(differing)


@pytest.fixture
def pair(ecu_double):
    return Pair(ecu_double)


def play(pair, machine, ticks, spoil=lambda frame: [frame]):
    """Run machine and ECUs; `spoil` gives what is received in the place of a frame."""
    for _ in range(ticks):
        now = machine.now_ns
        for frame in machine.frames():
            for received in spoil(frame):
                pair.receive(received, now)
        pair.tick(now + PERIOD_NS // 2)


def moving(machine, k):
    """A turn under way, with the noise without which a sensor counts as frozen."""
    noise = random.Random(k)
    speed, angle = 7.0, 0.3 * ((k % 200) / 100.0 - 1.0)
    for n in range(1, 5):
        machine.values[f"wheel_speed_{n}"] = speed + noise.gauss(0.0, 0.01)
        machine.values[f"wheel_torque_{n}"] = 1500.0 + noise.gauss(0.0, 50.0)
    machine.values["articulation_angle"] = angle
    for name in (
        "specific_force_x",
        "specific_force_y",
        "roll_rate",
        "pitch_rate",
        "yaw_rate",
        "pitch",
        "roll",
    ):
        machine.values[name] = noise.gauss(0.0, 0.02)
    machine.values["specific_force_z"] = noise.gauss(9.81, 0.03)
    for name, middle in (("lift_pressure", 8e6), ("tilt_pressure", 3e6)):
        machine.values[name] = noise.gauss(middle, 3e4)
    machine.values["lift_demand"] = (-1.0, 0.0, 1.0)[k // 60 % 3]


def drive_with_a_frozen_sensor(pair, machine):
    for k in range(40):
        moving(machine, k)
        machine.values["articulation_angle"] = 0.1
        play(pair, machine, 1)


def test_a_silent_bus_gives_the_same_answers(pair):
    for k in range(60):
        pair.tick(k * 10 * MS)


def test_a_drive_and_what_falls_silent_gives_the_same_answers(pair):
    """Every message in turn is lost for 0.15 s and comes back: validity, states, trouble codes."""
    machine = FakeMachine()
    messages = list(machine._names.values())
    for k in range(500):
        moving(machine, k)
        lost = messages[k // 30 % len(messages)]
        machine.silent = {lost} if k % 30 < 15 else set()
        play(pair, machine, 1)


def test_late_skipped_and_uneven_ticks_give_the_same_answers(pair):
    """Ticks that come late or are left out, with what the shell reports of them."""
    machine, generator, now = FakeMachine(), random.Random(5), 0
    for k in range(150):
        moving(machine, k)
        for frame in machine.frames():
            pair.receive(frame, now)
        pair.tick(now + generator.randrange(1, 9) * MS)
        for side in (pair.python, pair.c):
            side.executed(k * 12_345)
            if k % 40 == 39:
                side.overran(3)
        now += PERIOD_NS * (1 if generator.random() < 0.9 else generator.randrange(2, 6))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", [Bits, Values], ids=["bits", "values"])
def test_random_frames_give_the_same_answers(ecu_double, seed, kind):
    """Frames of random bits, dropped, doubled and out of order; signals that jump, stand still or are not available."""
    pair, machine, fuzz = Pair(ecu_double), FakeMachine(), kind(seed, 0.02)
    generator = random.Random(seed)
    kept = []

    protectors = {c.can_id: Protector(c) for c in CODECS if c.e2e_data_id is not None}

    def spoil(frame):
        content = fuzz.content(bytes(frame.data))
        if (
            frame.can_id in protectors and generator.random() < 0.98
        ):  # signed, so that its values are looked at
            content = protectors[frame.can_id].protect(content)
        frame = Frame(frame.can_id, content, frame.at_ns)
        kept.append(frame)
        chance = generator.random()
        if chance < 0.01:
            return []
        if chance < 0.02:
            return [frame, frame]
        if chance < 0.03:
            return [frame, kept[generator.randrange(max(len(kept) - 60, 0), len(kept))]]
        if chance < 0.035:
            return [Frame(frame.can_id, frame.data[: generator.randrange(9)], frame.at_ns)]
        return [frame]

    for k in range(400):
        moving(machine, k)
        fuzz.values(machine)
        play(pair, machine, 1, spoil)


def test_without_limits_the_answers_are_the_same(ecu_double):
    pair, machine = Pair(ecu_double, limits_enabled=False), FakeMachine()
    for k in range(60):
        moving(machine, k)
        play(pair, machine, 1)


def test_single_precision_differs_by_one_step_of_a_signal(ecu_single):
    """A value that lies between two raw numbers may be rounded to either; what is chosen may be another choice.

    Errors of single precision are below half a step of every signal (see the tests of the estimators).
    """
    python, c, machine = EcuCycle(CALIBRATION), BuiltEcu(ecu_single), FakeMachine()
    seen, off = 0, Counter()
    for k in range(400):
        moving(machine, k)
        now = machine.now_ns
        for frame in machine.frames():
            python.receive(frame, now)
            c.receive(frame, now)
        expected = python.tick(now + 5 * MS).frames
        for ours, theirs in zip(c.tick(now + 5 * MS).frames, expected, strict=True):
            assert ours.can_id == theirs.can_id
            codec = DATABASE.by_id[ours.can_id]
            for signal, a, b in zip(
                codec.layout, codec.decode(ours.data), codec.decode(theirs.data), strict=True
            ):
                seen += 1
                name = f"{codec.name}.{signal.name}"
                if (
                    a != b
                    and signal.name != "Crc"
                    and codec.name not in CHOSEN
                    and name not in CHOSEN_SIGNALS
                ):
                    off[name] += 1
                    assert abs(a - b) <= 1.01 * signal.scale, (name, a, b)
    assert off.total() < 0.002 * seen, off


def test_a_changed_threshold_is_noticed(ecu_sources, tmp_path):
    """The comparison can fail: one row of the tables changed."""
    for file in ecu_sources.iterdir():
        if file.suffix in (".c", ".h"):
            text = file.read_text()
            if file.name == "ecu_tables.h":
                text = text.replace("#define RULE_STANDING_FRAMES 5U", "#define RULE_STANDING_FRAMES 6U")
                text = text.replace("#define RULE_FROZEN_FRAMES 20U", "#define RULE_FROZEN_FRAMES 21U")
            (tmp_path / file.name).write_text(text)
    library = build(
        sorted(tmp_path.glob("*.c")), tmp_path / "changed.so", *STRICT, "-shared", "-fPIC", "-DECU_DOUBLE"
    )
    pair, machine = Pair(library), FakeMachine()
    # the articulation sensor stands still, which is noticed a frame later
    with pytest.raises(AssertionError, match="tick 19 "):
        drive_with_a_frozen_sensor(pair, machine)


def test_random_frames_meet_no_undefined_behaviour(ecu_sources, tmp_path):
    """Address and undefined-behaviour sanitizers, casts of reals that do not fit included: the process ends by itself."""
    library = build(
        sorted(ecu_sources.glob("*.c")), tmp_path / "sanitized.so", "-std=c99", "-O1", "-g", "-shared", "-fPIC",
        "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all",
    )  # fmt: skip
    runtime = subprocess.run(
        [compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    ran = subprocess.run(
        [sys.executable, "-m", "tests.deploy.c.sanitized", str(library), "1", "2500"],
        env=os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (ran.returncode, ran.stdout) == (0, "2500\n"), ran.stderr[-2000:]


@pytest.mark.parametrize("seed", [9, 19, 69])
def test_contradicting_frames_send_neither_ecu_into_fault(ecu_single, seed):
    """Random bits, signed, at times that jump: the prediction ran away, single precision lost its numbers, and the ECU went to *fault*."""
    python, c = EcuCycle(CALIBRATION), BuiltEcu(ecu_single)
    for frame, now in random_frames(seed, 5000):
        if frame is not None:
            python.receive(frame, now)
            c.receive(frame, now)
        else:
            python.tick(now)
            c.tick(now)
            assert python.state is not State.FAULT
            assert c.state == python.state
