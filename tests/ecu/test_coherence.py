"""A sensor that stands still while the others move, and wheels in each other's sockets, are found; an idle machine and a slipping wheel are neither."""

import numpy as np
import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from ecu.calibration import load_calibration
from ecu.coherence import AxleSides
from ecu.findings import Implausible
from ecu.inputs import EXCHANGED, FROZEN, InputReceiver, sources

MS = 1_000_000
CALIBRATION = load_calibration("l60")
DATABASE = loader_database()
FRAMES = round(CALIBRATION.inputs.frozen_frames)
RADIUS = CALIBRATION.parameters.wheel.unloaded_radius
PRESSURE_KPA = 5000.0
TRACK = CALIBRATION.parameters.geometry.front_track


class Drive:
    """Sensor frames of a machine that drives a circle of yaw rate 0.2 rad/s, with noise well above the resolutions."""

    def __init__(self, noise: float = 1.0) -> None:
        self.hearing = InputReceiver(CALIBRATION, DATABASE)
        self._random = np.random.default_rng(5)
        self._noise = noise
        self._protectors = {
            source.message: Protector(DATABASE.by_name[source.message])
            for source in sources(CALIBRATION.inputs)
            if DATABASE.by_name[source.message].e2e_data_id is not None
        }
        self.frozen: dict[tuple[str, str], float] = {}
        self.exchanged: set[str] = set()
        self.vertical = 9.81
        self.now_ns = 0

    def _values(self, message: str) -> dict[str, float]:
        codec = DATABASE.by_name[message]
        values = dict.fromkeys(codec.signals, 0.0)
        for source in sources(CALIBRATION.inputs):
            if source.message == message:
                for signal in (field.row.signal for field in source.fields if field.row.sensed):
                    step = codec.by_signal[signal].scale
                    values[signal] = float(self._noise * self._random.normal(0.0, 4.0) * step)
        if message.startswith("WheelSpeeds"):
            apart = 0.2 * TRACK / RADIUS
            values["Left"] += 5.0 - apart / 2
            values["Right"] += 5.0 + apart / 2
            if message in self.exchanged:
                values["Left"], values["Right"] = values["Right"], values["Left"]
        if "Pressure" in message:
            for signal in values:
                values[signal] += PRESSURE_KPA if codec.by_signal[signal].unit == "kPa" else 0.0
        if message == "BodyAcceleration":
            values["Vertical"] += self.vertical
        if message == "BodyRates":
            values["YawRate"] += np.degrees(0.2)
        for (of, signal), value in self.frozen.items():
            if of == message:
                values[signal] = value
        return values

    def run(self, ticks: int) -> list[Implausible]:
        """So many frames of every message; what was implausible in them."""
        found = []
        for _ in range(ticks):
            self.now_ns += 10 * MS
            for source in sources(CALIBRATION.inputs):
                codec = DATABASE.by_name[source.message]
                data = codec.encode_dict(self._values(source.message))
                if source.message in self._protectors:
                    data = self._protectors[source.message].protect(data)
                found += self.hearing.receive(Frame(codec.can_id, data, self.now_ns), self.now_ns)
        return [finding for finding in found if isinstance(finding, Implausible)]

    def unusable(self) -> frozenset[str]:
        return self.hearing.gather(self.now_ns).unusable


@pytest.fixture
def drive():
    made = Drive()
    assert made.run(100) == []
    return made


@pytest.mark.parametrize(
    ("message", "signal", "target"),
    [
        ("BodyRates", "PitchRate", "pitch_rate"),
        ("SlopeSensor", "RollAngle", "roll"),
        ("LiftPressure", "LiftCylinderPressure", "lift_pressure"),
        ("LinkageAngles", "LiftArmAngle", "lift_arm_angle"),
    ],
)
def test_a_frozen_signal_is_found_alone_and_good_again_when_it_moves(drive, message, signal, target):
    drive.frozen[message, signal] = PRESSURE_KPA if message.endswith("Pressure") else 0.0
    assert drive.run(FRAMES - 1) == []
    assert [(f.message, f.signal, f.reason) for f in drive.run(3)] == [(message, signal, FROZEN)]
    assert drive.unusable() == {target}
    drive.frozen.clear()
    assert drive.run(1) == []
    assert drive.unusable() == frozenset()


def test_sensors_without_noise_on_a_machine_that_stands_are_not_frozen():
    """Everything is the same to the bit: that says nothing of one of them."""
    still = Drive(noise=0.0)
    assert still.run(10 * FRAMES) == []


@pytest.mark.parametrize(("message", "wheels"), [("WheelSpeedsFront", (1, 2)), ("WheelSpeedsRear", (3, 4))])
def test_exchanged_wheels_are_found_on_their_axle_and_good_again_once_put_right(drive, message, wheels):
    drive.exchanged.add(message)
    found = drive.run(FRAMES + 5)
    assert {(f.message, f.reason) for f in found} == {(message, EXCHANGED)}
    assert drive.unusable() == {f"wheel_speed_{n}" for n in wheels}
    drive.exchanged.clear()
    drive.run(FRAMES + 5)
    assert drive.unusable() == frozenset()


def test_wheels_that_may_be_in_the_air_are_not_taken_for_exchanged(drive):
    """After a kerb both rear wheels keep their speeds while the machine turns the other way; on the ground that looks like an exchange."""
    drive.exchanged.add("WheelSpeedsRear")
    drive.vertical = 0.7 * 9.81
    assert drive.run(5 * FRAMES) == []
    drive.vertical = 9.81
    assert {f.reason for f in drive.run(FRAMES + 5)} == {EXCHANGED}


def test_frames_before_and_after_a_flight_are_not_in_a_row(drive):
    drive.exchanged.add("WheelSpeedsRear")
    few = round(CALIBRATION.inputs.exchanged_frames) - 5
    for _ in range(4):
        drive.vertical = 9.81
        assert drive.run(few) == []
        drive.vertical = 0.7 * 9.81
        assert drive.run(1) == []


def axle(frames: float = 20) -> AxleSides:
    return AxleSides(lever=0.5, turning=0.1, frames=frames)


def test_straight_ahead_nothing_can_be_said():
    sides = axle()
    for yaw_rate in 30 * [0.09, -0.09]:
        assert not sides.look(5.0, 5.0 - yaw_rate / 0.5, yaw_rate)


@pytest.mark.parametrize(("slip", "exchanged"), [(2.0, False), (-0.5, False), (-0.8, True), (-1.1, False)])
def test_a_slipping_wheel_is_taken_for_the_other_only_where_both_read_alike(slip, exchanged):
    """Yaw rate 0.2: right should be faster by 0.4; slower by 0.4, within half of that, is what an exchange looks like."""
    sides = axle()
    assert any(sides.look(5.0, 5.4 + slip, 0.2) for _ in range(100)) is exchanged


def test_it_takes_that_many_frames_in_a_row():
    sides = axle(frames=3)
    assert [sides.look(5.4, 5.0, 0.2) for _ in range(2)] == [False, False]
    assert not sides.look(5.0, 5.4, 0.2)
    assert [sides.look(5.4, 5.0, 0.2) for _ in range(3)] == [False, False, True]
    assert sides.look(5.0, 5.0, 0.0)  # straight ahead it stays as it was
    assert [sides.look(5.0, 5.4, 0.2) for _ in range(3)] == [True, True, False]
    assert not any(axle(frames=0).look(5.4, 5.0, 0.2) for _ in range(100))
