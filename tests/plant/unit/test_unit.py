"""The machine on the bus: what its frames say, which limits it obeys, and that runs repeat bit for bit."""

import math
from dataclasses import replace
from pathlib import Path

import cantools
import pytest

import dbc
from bus.frame import Frame
from dbc import loader_database, reference_database
from dbc.protection import Checker, Finding, Protector
from plant.plant import Plant
from plant.sheets.machine import load_machine
from plant.truth import Truth
from plant.unit.limits import FREE
from plant.unit.profile import Profile
from plant.unit.scenario import Scenario, load_scenario
from plant.unit.sensor_parameters import SensorParameters
from plant.unit.unit import TICK_NS, PlantUnit

DBC_FOLDER = Path(dbc.__file__).parent
MACHINE = load_machine("l60")
DATABASE = loader_database()


def unit_of(scenario: Scenario, *, seed: int = 1, obey_limits: bool = True) -> PlantUnit:
    return PlantUnit(MACHINE, scenario, seed=seed, obey_limits=obey_limits)


def driving(*, speed: float, rate: float = 0.0, ideal: bool = False) -> Scenario:
    """At constant speed [m/s], from 0.2 s on with the joystick at `rate` [rad/s]."""
    base = load_scenario("standstill")
    held = Profile(((0.0, speed),))
    stick = Profile(((0.2, 0.0), (0.2, rate)))
    script = replace(base.script, brake=None, speed=held, articulation_rate=stick)
    equipment = replace(base.equipment, sensors=SensorParameters()) if ideal else base.equipment
    return replace(base, start=replace(base.start, speed=speed), script=script, equipment=equipment)


class Ecu:
    """The sender of Limits frames, independent of any real ECU."""

    def __init__(
        self, *, torque_kn_m: float = 50.0, speed_kmh: float = 50.0, rate_deg_s: float = 50.0
    ) -> None:
        codec = DATABASE.by_name["Limits"]
        values = dict.fromkeys(codec.signals, 0.0)
        for wheel in ("FrontLeft", "FrontRight", "RearLeft", "RearRight"):
            values[f"{wheel}Torque"] = torque_kn_m
        values |= {"Speed": speed_kmh, "ArticulationRate": rate_deg_s}
        self._data = codec.encode_dict(values)
        self._can_id = codec.can_id
        self._protector = Protector(codec)

    def frame(self) -> Frame:
        return Frame(self._can_id, self._protector.protect(self._data))


def run(unit: PlantUnit, seconds: float, ecu: Ecu | None = None) -> list[list[Frame]]:
    """The frames of each tick; the ECU, if there is one, answers in the middle between ticks."""
    sent = []
    for tick in range(round(seconds / 0.01) + 1):
        now_ns = tick * TICK_NS
        sent.append(unit.tick(now_ns))
        if ecu:
            assert unit.receive(ecu.frame(), now_ns + TICK_NS // 2) == []
    return sent


def test_equal_seeds_give_equal_bytes_and_others_do_not():
    scenario = driving(speed=3.0, rate=0.2)
    first, second, third = (run(unit_of(scenario, seed=seed), 1.0, Ecu()) for seed in (5, 5, 6))
    assert first == second
    assert first != third


def test_the_first_tick_samples_the_start():
    unit = unit_of(driving(speed=3.0))
    unit.tick(123)
    assert unit.truth.time_s == 0.0
    assert unit.truth.speed == pytest.approx(3.0, rel=1e-4)  # the rear axle, a little pitched
    unit.tick(456)
    assert unit.truth.time_s == pytest.approx(0.01)


def test_it_finishes_at_its_duration():
    scenario = replace(load_scenario("standstill"), duration_s=0.5)
    unit = unit_of(scenario)
    ticks = 0
    while not unit.finished:
        unit.tick(ticks * TICK_NS)
        ticks += 1
    assert unit.truth.time_s == pytest.approx(0.5)


def test_frames_read_by_cantools_say_what_is_true():
    """Ideal sensors: every signal within half a step of the DBC; sign and axis mistakes show at once."""
    reader = cantools.database.load_file(DBC_FOLDER / "loader.dbc")
    unit = unit_of(driving(speed=4.0, rate=0.3, ideal=True))
    run(unit, 1.0, Ecu())
    truth_signals = {
        ("Articulation", "ArticulationAngle"): lambda t: math.degrees(t.articulation_angle),
        ("Articulation", "ArticulationRate"): lambda t: math.degrees(t.articulation_rate),
        **{
            (f"WheelSpeeds{axle}", side): lambda t, i=2 * a + s: t.wheel_speed[i]
            for a, axle in enumerate(("Front", "Rear"))
            for s, side in enumerate(("Left", "Right"))
        },
        **{
            (f"WheelTorques{axle}", side): lambda t, i=2 * a + s: t.wheel_torque[i]
            for a, axle in enumerate(("Front", "Rear"))
            for s, side in enumerate(("Left", "Right"))
        },
        **{
            ("BodyAcceleration", name): lambda t, i=i: t.imu_specific_force[i]
            for i, name in enumerate(("Longitudinal", "Lateral", "Vertical"))
        },
        **{
            ("BodyRates", name): lambda t, i=i: math.degrees(t.angular_velocity[i])
            for i, name in enumerate(("RollRate", "PitchRate", "YawRate"))
        },
        ("SlopeSensor", "PitchAngle"): lambda t: math.degrees(t.pitch),
        ("SlopeSensor", "RollAngle"): lambda t: math.degrees(t.roll),
        ("SlopeSensor", "PitchRate"): lambda t: math.degrees(t.angular_velocity[1]),
        ("LiftPressure", "LiftCylinderPressure"): lambda t: t.lift_pressure / 1e3,
        ("TiltPressure", "TiltCylinderPressure"): lambda t: t.tilt_pressure / 1e3,
        **{
            ("SteeringPressures", line): lambda t, i=i: t.steering_pressure[i] / 1e3
            for i, line in enumerate(("LeftLine", "RightLine"))
        },
        ("LinkageAngles", "LiftArmAngle"): lambda t: math.degrees(t.lift_arm_angle),
        ("LinkageAngles", "TiltAngle"): lambda t: math.degrees(t.tilt_angle),
    }
    seen = set()
    for tick in range(101, 103):  # one of each cycle of 20 ms
        for frame in unit.tick(tick * TICK_NS):
            message = reader.get_message_by_frame_id(frame.identifier)
            values = message.decode(frame.data, decode_choices=False)
            for name, value in values.items():
                if true := truth_signals.get((message.name, name)):
                    step = message.get_signal_by_name(name).scale
                    assert value == pytest.approx(true(unit.truth), abs=0.5001 * step), (message.name, name)
                    seen.add((message.name, name))
    assert seen == set(truth_signals)
    assert unit.truth.angular_velocity[2] > 0.1  # it was a left turn indeed


def test_reference_frames_read_by_cantools_say_what_is_true():
    reader = cantools.database.load_file(DBC_FOLDER / "reference.dbc")
    unit = unit_of(driving(speed=4.0, rate=0.3))
    run(unit, 1.0, Ecu())
    unit.tick(101 * TICK_NS)
    truth = unit.truth
    frames = {}
    for frame in unit.reference_frames():
        message = reader.get_message_by_frame_id(frame.identifier)
        frames[message.name] = message.decode(frame.data)
    for i, wheel in enumerate(("FrontLeft", "FrontRight", "RearLeft", "RearRight")):
        assert frames[f"WheelForce{wheel}"]["Normal"] == pytest.approx(truth.normal_force[i] / 1e3, abs=0.003)
        assert frames[f"WheelForce{wheel}"]["Lateral"] == pytest.approx(
            truth.lateral_force[i] / 1e3, abs=0.003
        )
    assert frames["BodyAttitude"]["Yaw"] == pytest.approx(math.degrees(truth.yaw), abs=0.006)
    assert frames["BodyVelocity"]["Lateral"] == pytest.approx(truth.velocity[1], abs=0.0003)
    assert frames["BodyAccelerationReference"]["Lateral"] == pytest.approx(truth.acceleration[1], abs=0.0011)
    assert frames["JointLoad"]["JointTorque"] == pytest.approx(truth.joint_torque / 1e3, abs=0.006)


def test_protected_frames_pass_their_check_and_samples_count_up():
    unit = unit_of(driving(speed=3.0))
    checkers = {c.can_id: Checker(c) for c in DATABASE.by_name.values() if c.e2e_data_id is not None}
    articulation = DATABASE.by_name["Articulation"]
    findings, sequences = [], []
    for tick, frames in enumerate(run(unit, 2.0, Ecu())):
        for frame in frames:
            if checker := checkers.get(frame.can_id):
                findings.append(checker.check(frame.data, tick * TICK_NS))
            if frame.can_id == articulation.can_id:
                sequences.append(articulation.decode_dict(frame.data)["SampleSequence"])
    assert set(findings) == {Finding.OK, Finding.INITIAL}
    assert sequences == list(range(201))


def test_a_broken_sensor_says_so_in_its_frame():
    scenario = driving(speed=3.0, ideal=True)
    dead = replace(scenario.equipment.sensors.of("yaw_rate"), dropout=1.0)
    scenario = replace(
        scenario, equipment=replace(scenario.equipment, sensors=SensorParameters({"yaw_rate": dead}))
    )
    states = {}
    for frame in run(unit_of(scenario), 0.05)[-1]:
        codec = DATABASE.by_id[frame.can_id]
        states[codec.name] = codec.decode_dict(frame.data).get("State")
    assert states["BodyRates"] == 2  # error
    assert states["Articulation"] == states["BodyAcceleration"] == 0


def test_the_articulation_rate_limit_is_obeyed():
    unit = unit_of(driving(speed=2.0, rate=0.4))
    run(unit, 2.0, Ecu(rate_deg_s=5.0))
    assert math.degrees(unit.truth.articulation_rate) == pytest.approx(5.0, abs=0.05)
    free = unit_of(driving(speed=2.0, rate=0.4))
    run(free, 1.0, Ecu())
    assert free.truth.articulation_rate == pytest.approx(0.4, abs=0.005)


def test_the_speed_limit_slows_the_machine_down_and_holds_it_there():
    unit = unit_of(driving(speed=5.0))
    run(unit, 4.0, Ecu(speed_kmh=9.0))
    assert unit.truth.speed * 3.6 <= 9.0 + 0.2
    assert unit.truth.speed * 3.6 >= 9.0 - 1.0  # within the fading band
    assert unit.demand.torque > 0  # the driver still wants more


def test_the_torque_limit_is_obeyed_by_every_wheel():
    base = driving(speed=1.0)
    scenario = replace(base, script=replace(base.script, speed=None, torque=Profile(((0.0, 0.8),))))
    unit = unit_of(scenario)
    run(unit, 1.0, Ecu(torque_kn_m=2.0))
    assert unit.truth.wheel_torque == pytest.approx(4 * [2000.0], rel=1e-3)


def test_without_limits_frames_the_machine_falls_back_on_its_safe_values():
    """8 km/h and 10 deg/s of the equipment file, 50 ms after the last good frame."""
    unit = unit_of(driving(speed=5.0, rate=0.4))
    run(unit, 4.0)
    assert unit.truth.speed * 3.6 <= 8.2
    assert math.degrees(unit.truth.articulation_rate) == pytest.approx(10.0, abs=0.1)


def test_with_obedience_off_limits_and_silence_are_ignored():
    unit = unit_of(driving(speed=5.0, rate=0.4), obey_limits=False)
    run(unit, 1.0, Ecu(speed_kmh=5.0, rate_deg_s=1.0))
    assert unit.truth.speed > 4.5
    assert unit.truth.articulation_rate == pytest.approx(0.4, abs=0.005)


def test_the_limits_in_force_by_age():
    unit = unit_of(driving(speed=2.0))
    unit.tick(0)
    unit.receive(Ecu(speed_kmh=12.0).frame(), 1000)
    assert unit.limits_in_force(1000 + 50_000_000).speed == pytest.approx(12 / 3.6)
    assert unit.limits_in_force(1000 + 50_000_001).speed == pytest.approx(8 / 3.6)


@pytest.mark.parametrize(
    ("damage", "finding"),
    [
        (lambda data: data[:4] + bytes([data[4] ^ 1]) + data[5:], Finding.WRONG_CRC),
        (lambda data: data[:7], Finding.WRONG_LENGTH),
    ],
)
def test_a_damaged_limits_frame_is_a_finding_and_is_not_used(damage, finding):
    unit = unit_of(driving(speed=2.0))
    unit.tick(0)
    frame = Ecu(speed_kmh=12.0).frame()
    (found,) = unit.receive(frame._replace(data=damage(frame.data)), 1000)
    assert (found.message, found.what, found.at_ns) == ("Limits", finding, 1000)
    assert unit.limits_in_force(2000).speed == math.inf


def test_a_repeated_limits_frame_is_a_finding_and_does_not_keep_the_limits_fresh():
    unit = unit_of(driving(speed=2.0))
    unit.tick(0)
    frame = Ecu(speed_kmh=12.0).frame()
    assert unit.receive(frame, 0) == []
    for k in range(1, 6):
        (found,) = unit.receive(frame, k * TICK_NS)
        assert found.what is Finding.REPEATED
    assert unit.limits_in_force(51_000_000).speed == pytest.approx(8 / 3.6)


def linkage_frame(protector: Protector, *, down_deg_s: float) -> Frame:
    """A frame that permits the arm to fall at `down_deg_s` and everything else."""
    codec = DATABASE.by_name["LinkageLimits"]
    free = dict.fromkeys(("LiftUpRate", "TiltBackRate", "TiltForwardRate"), 102.2)
    values = dict.fromkeys(codec.signals, 0.0) | free | {"LiftDownRate": down_deg_s}
    return Frame(codec.can_id, protector.protect(codec.encode_dict(values)))


def test_the_arm_falls_no_faster_than_the_ecu_permits():
    base = load_scenario("standstill")
    start = replace(base.start, lift_arm_angle=0.6)
    scenario = replace(base, start=start, script=replace(base.script, lift=Profile(((0.0, -1.0),))))
    falls = {}
    for down_deg_s in (5.0, 102.2):
        unit, protector = unit_of(scenario), Protector(DATABASE.by_name["LinkageLimits"])
        for tick in range(100):
            unit.tick(tick * TICK_NS)
            assert unit.receive(linkage_frame(protector, down_deg_s=down_deg_s), tick * TICK_NS + 1) == []
        falls[down_deg_s] = math.degrees(unit.truth.lift_arm_rate)
    assert falls[5.0] == pytest.approx(-5.0, abs=0.2)
    assert falls[102.2] < -10.0


def test_limits_not_available_are_safe_values():
    unit = unit_of(driving(speed=2.0))
    unit.tick(0)
    codec = DATABASE.by_name["Limits"]
    data = Protector(codec).protect(b"\x00\xf0" + b"\xff" * 6)  # every signal at its highest raw value
    unit.receive(Frame(codec.can_id, data), 1000)
    limits = unit.limits_in_force(2000)
    safe = load_scenario("standstill").equipment.obedience.safe
    assert limits == safe._replace(linkage=FREE)  # no LinkageLimits came


def test_frames_that_are_not_for_the_machine_are_ignored():
    unit = unit_of(driving(speed=2.0))
    unit.tick(0)
    assert unit.receive(Frame(0x123, b""), 0) == []
    assert unit.receive(Frame(reference_database().by_name["JointLoad"].can_id, bytes(8)), 0) == []


def decoded(frames: list[Frame]) -> dict[str, dict[str, float]]:
    """Signals by message, read by cantools."""
    reader = cantools.database.load_file(DBC_FOLDER / "loader.dbc")
    messages = [(reader.get_message_by_frame_id(frame.identifier), frame.data) for frame in frames]
    return {message.name: message.decode(data, decode_choices=False) for message, data in messages}


def held(value: float) -> Profile:
    return Profile(((0.0, value),))


def test_the_driver_demand_is_on_the_bus_before_any_limit():
    base = driving(speed=2.0)
    script = replace(
        base.script,
        speed=None,
        torque=held(0.2),
        articulation_rate=held(math.radians(6.0)),
        lift=held(0.5),
        tilt=held(-0.3),
    )
    sent = run(unit_of(replace(base, script=script)), 1.0, Ecu(torque_kn_m=1.0, rate_deg_s=1.0))
    values = decoded(sent[-1] + sent[-2])["DriverDemand"]
    assert values["TorqueDemand"] == pytest.approx(20.0)
    assert values["BrakeDemand"] == 0
    assert values["ArticulationRateDemand"] == pytest.approx(6.0)
    assert (values["LiftDemand"], values["TiltDemand"]) == (50, -30)
    braking = unit_of(replace(base, script=replace(base.script, brake=held(0.4))))
    sent = run(braking, 1.0, Ecu())
    assert decoded(sent[-1] + sent[-2])["DriverDemand"]["BrakeDemand"] == pytest.approx(40.0)


def test_the_speed_for_displays_is_the_magnitude_from_the_wheels():
    unit = unit_of(driving(speed=-2.0, ideal=True))
    sent = run(unit, 0.2, Ecu())
    values = decoded([frame for frames in sent for frame in frames])
    assert values["VehicleSpeed"]["WheelBasedVehicleSpeed"] == pytest.approx(
        2.0 * 3.6, rel=0.03
    )  # 0.72 m is nominal


def test_healthy_sensors_say_ok():
    sent = run(unit_of(driving(speed=2.0)), 0.05, Ecu())
    states = [
        value
        for values in decoded(sent[-1] + sent[-2]).values()
        for name, value in values.items()
        if name.endswith("State")
    ]
    assert states == [0] * 14


def test_reference_frames_of_many_ticks_are_those_of_each():
    """A tick whose motion lacks a value has none, and the others keep number and stamp."""
    unit, truths, expected = unit_of(driving(speed=4.0, rate=0.3)), [], []
    for tick in range(30):
        unit.tick(tick * TICK_NS)
        truths.append(unit.truth)
        expected += unit.reference_frames() if tick != 11 else []
    row = truths[11].row.copy()
    row[Truth.lateral_force.at] = math.nan
    truths[11] = Truth(row)
    assert len(expected) > 60
    assert unit.reference_of(truths, 0, 0) == expected
    later = [frame for frame in expected if frame.at_ns >= 20 * TICK_NS]
    assert unit.reference_of(truths[20:], 20, 20 * TICK_NS) == later


def test_the_satellite_course_is_the_direction_of_travel_over_ground():
    """Independent: the direction of the change of position between two ticks."""
    reader = cantools.database.load_file(DBC_FOLDER / "reference.dbc")
    unit = unit_of(driving(speed=4.0, rate=0.3))
    run(unit, 1.5, Ecu())
    checked = 0
    for tick in range(151, 171):
        before = unit.truth.position
        unit.tick(tick * TICK_NS)
        for frame in unit.reference_frames():
            message = reader.get_message_by_frame_id(frame.identifier)
            if message.name == "SatelliteSpeed":
                east, north, _ = unit.truth.position - before
                values = message.decode(frame.data)
                assert values["Course"] == pytest.approx(math.degrees(math.atan2(north, east)) % 360, abs=1.0)
                assert values["GroundSpeed"] == pytest.approx(math.hypot(east, north) / 0.01, rel=0.01)
                assert math.degrees(unit.truth.yaw) + 5.0 < values["Course"]  # the joint moves into the turn
                checked += 1
    assert checked == 1


@pytest.mark.parametrize(
    ("lift", "tilt", "lift_rate", "tilt_rate"),
    [(0.5, -0.25, 0.5 * 16.7, -0.25 * 80), (-0.1, 0.0, -0.1 * 31.7, 0.0)],
)
def test_lift_and_tilt_move_at_their_share_of_full_speed(lift, tilt, lift_rate, tilt_rate):
    base = driving(speed=0.0)
    script = replace(base.script, lift=held(lift), tilt=held(tilt))
    unit = unit_of(replace(base, script=script))
    run(unit, 1.0, Ecu())
    assert math.degrees(unit.truth.lift_arm_rate) == pytest.approx(lift_rate, rel=0.01)
    assert math.degrees(unit.truth.tilt_rate) == pytest.approx(tilt_rate, rel=0.01)


def test_the_grace_before_the_first_limits_counts_from_the_start_on_any_clock():
    unit = unit_of(driving(speed=2.0))
    start_ns = 10**15
    unit.tick(start_ns)
    assert unit.limits_in_force(start_ns + 50_000_000).speed == math.inf
    assert unit.limits_in_force(start_ns + 50_000_001).speed == pytest.approx(8 / 3.6)


def test_a_unit_moves_with_the_motion_it_is_given():
    """Its sensors and frames come from that motion's truth: here of a laden plant in place of an empty one."""
    scenario = load_scenario("unloaded")
    machine = load_machine(scenario.machine)
    laden = Plant(machine, payload_mass=2000.0, speed=scenario.start.speed)
    unit = PlantUnit(machine, scenario, seed=1, motion=laden)
    unit.tick(0)
    assert unit.truth.payload_mass == 2000.0
