"""Laws of the moving machine: symmetry, kinematics, brakes, stops, and what a caller may rely on."""

import math

import numpy as np
import pytest

from plant.physics import state as s
from plant.physics.dynamics import stop_moment
from plant.physics.surface import Surface
from plant.plant import Commands, DivergedError, Plant
from plant.sheets.machine import load_machine

MACHINE = load_machine("l60")
BRAKE = Commands(brake_torque=(30e3,) * 4)
FOUR = np.arange(4)
SWAPPED = [1, 0, 3, 2]


def drive(plant: Plant, side: int, seconds: float) -> Plant:
    """A drive with drive torque, braking, steering; side -1 is its mirror image."""
    for tick in range(round(seconds / 0.01)):
        t = tick * 0.01
        left, right = 3e3 + 2e3 * math.sin(t), 3e3 - 1e3 * math.sin(2 * t)
        torque = np.array((left, right, right, left))
        brake = np.array((4e3, 1e3, 2e3, 3e3)) if 1.5 < t < 2.0 else np.zeros(4)
        if side < 0:
            torque, brake = torque[SWAPPED], brake[SWAPPED]
        rate = side * 0.5 * math.cos(1.5 * t)
        plant.advance(
            Commands(
                wheel_torque=tuple(torque), brake_torque=tuple(brake), articulation_rate=rate, lift_rate=0.1
            ),
            0.01,
        )
    return plant


def test_left_and_right_are_mirror_images():
    """The mirrored machine under mirrored commands, through lift, spin and lock; 1e-9: sums in another order."""
    this = drive(Plant(MACHINE, Surface(bank=0.05), speed=3.0, articulation_angle=0.2), 1, 3.0).truth()
    that = drive(Plant(MACHINE, Surface(bank=-0.05), speed=3.0, articulation_angle=-0.2), -1, 3.0).truth()
    assert abs(this.yaw) > 0.1
    for name in ("normal_force", "longitudinal_force", "wheel_speed", "slip", "wheel_torque"):
        np.testing.assert_allclose(getattr(this, name), getattr(that, name)[SWAPPED], rtol=1e-7, atol=1e-6)
    for name in ("lateral_force", "aligning_moment", "slip_angle"):
        np.testing.assert_allclose(getattr(this, name), -getattr(that, name)[SWAPPED], rtol=1e-7, atol=1e-6)
    for name in (
        "yaw",
        "roll",
        "articulation_angle",
        "oscillation_angle",
        "joint_torque",
        "yaw_moment",
        "load_transfer_ratio",
    ):
        assert getattr(this, name) == pytest.approx(-getattr(that, name), rel=1e-7, abs=1e-6), name
    for name in ("speed", "pitch", "lift_pressure", "tilt_pressure"):
        assert getattr(this, name) == pytest.approx(getattr(that, name), rel=1e-9), name
    np.testing.assert_allclose(this.position, that.position * (1, -1, 1), rtol=0, atol=1e-9)


@pytest.mark.parametrize("heading", [-2.0, 1.1, 3.0])
def test_heading_and_place_do_not_matter_on_level_ground(heading):
    """The same drive elsewhere in another direction; 1e-8: rounding of a turned world."""
    here = drive(Plant(MACHINE, speed=3.0), 1, 3.0).truth()
    moved = Plant(MACHINE, speed=3.0, heading=heading)
    moved._state[:2] += (120.0, -45.0)
    there = drive(moved, 1, 3.0).truth()
    c, sn = math.cos(heading), math.sin(heading)
    turned = np.array(((c, -sn), (sn, c))) @ here.position[:2] + (120.0, -45.0)
    np.testing.assert_allclose(there.position[:2], turned, rtol=0, atol=1e-8)
    np.testing.assert_allclose(there.normal_force, here.normal_force, rtol=1e-8)
    np.testing.assert_allclose(there.imu_specific_force, here.imu_specific_force, rtol=0, atol=1e-8)
    assert there.joint_torque == pytest.approx(here.joint_torque, rel=1e-7, abs=1e-4)


@pytest.mark.parametrize("delta_deg", [10, 20, 35])
def test_steady_turn_follows_the_kinematics(delta_deg):
    """Creeping, the yaw velocity is u sin(d)/(l_f + l_r cos d), docs/explanation/estimators.md. 1 %: side slip at 0.5 m/s2 and less."""
    delta = math.radians(delta_deg)
    plant = Plant(MACHINE, speed=1.0, articulation_angle=delta)
    plant.advance(Commands(wheel_torque=(100.0,) * 4), 6.0)
    truth = plant.truth()
    expected = truth.speed * math.sin(delta) / (1.5 + 1.5 * math.cos(delta))
    assert truth.angular_velocity[2] == pytest.approx(expected, rel=0.01)


def test_articulating_on_the_spot_turns_both_halves():
    """Free wheels, level ground: frames turn in opposite directions, the wheels roll, nothing slides far."""
    plant = Plant(MACHINE)
    plant.advance(Commands(), 0.5)
    plant.advance(Commands(articulation_rate=0.3), 1.5)
    truth = plant.truth()
    assert truth.articulation_angle > 0.4
    assert -truth.articulation_angle < truth.yaw < 0.0
    assert np.abs(truth.lateral_force).max() < 0.5 * 35e3


@pytest.mark.parametrize("integrator", ["semi-implicit", "rk4"])
def test_locked_wheels_stay_locked_and_let_go(integrator):
    """Hard braking locks every wheel; held to rest; drive torque then turns them again."""
    plant = Plant(MACHINE, speed=5.0, integrator=integrator)
    plant.advance(BRAKE, 0.4)
    sliding = plant.truth()
    np.testing.assert_array_equal(sliding.wheel_speed, np.zeros(4))
    np.testing.assert_allclose(
        sliding.slip, -1.0, rtol=0, atol=0.1
    )  # locked to a frame that pitches at 0.2 rad/s
    assert sliding.speed > 0.5
    # friction at slip 1 on the nominal surface, within the tyre's load and pressure terms
    assert -sliding.longitudinal_force.sum() / sliding.normal_force.sum() == pytest.approx(0.75, abs=0.04)
    plant.advance(BRAKE, 19.6)  # it stops within a second and rocks on its tyres: 1.6 Hz, damping ratio 0.05
    rest = plant.truth()
    assert abs(rest.speed) < 1e-3
    plant.advance(BRAKE, 5.0)
    assert np.linalg.norm(plant.truth().position - rest.position) < 1e-3
    plant.advance(Commands(wheel_torque=(3000.0,) * 4), 1.0)
    assert (plant.truth().wheel_speed > 0.5).all()


def test_brake_slips_when_it_is_too_weak_for_the_slope():
    """30 % downhill: weak brakes let the machine go and act against the motion; strong ones hold it."""
    surface = Surface(grade=-math.atan(0.3))
    held, slipping = Plant(MACHINE, surface), Plant(MACHINE, surface)
    held.advance(Commands(brake_torque=(10e3,) * 4), 2.0)
    slipping.advance(Commands(brake_torque=(2e3,) * 4), 2.0)
    assert held.truth().speed == pytest.approx(0.0, abs=1e-6)
    truth = slipping.truth()
    assert truth.speed > 0.5
    np.testing.assert_allclose(truth.wheel_torque, -2e3, rtol=1e-6)


def test_brake_never_gives_more_than_it_has():
    plant = Plant(MACHINE, speed=4.0)
    for _ in range(300):
        plant.advance(Commands(brake_torque=(12e3, 12e3, 8e3, 8e3)), 0.01)
        assert (np.abs(plant.truth().wheel_torque) <= np.array((12e3, 12e3, 8e3, 8e3)) + 1e-6).all()


def test_drive_torque_lags_and_saturates():
    """15 ms lag under 50 kN m/s: 0.1 s after a step of 3 kN m it has 3 kN m (1 - e^-..), a demand beyond peak gives peak."""
    plant = Plant(MACHINE, speed=3.0)
    plant.advance(Commands(wheel_torque=(100e3,) * 4), 0.1)
    np.testing.assert_allclose(plant.truth().wheel_torque, 5e3, rtol=1e-9)
    plant.advance(Commands(wheel_torque=(100e3,) * 4), 0.8)
    np.testing.assert_allclose(plant.truth().wheel_torque, (25e3, 25e3, 18e3, 18e3), rtol=1e-3)


def test_spinning_wheels_from_standstill():
    """Peak torque spins the wheels up without driving the machine faster than friction allows; then they grip again."""
    plant = Plant(MACHINE, Surface(friction=0.3))
    plant.advance(Commands(wheel_torque=(25e3, 25e3, 18e3, 18e3)), 0.8)
    truth = plant.truth()
    assert truth.slip.max() > 1.0
    assert (
        0.0 < truth.acceleration[0] < 0.3 * 0.80 / 0.75 * 1.1 * 9.81
    )  # peak over sliding, load and pressure terms
    plant.advance(Commands(), 6.0)
    assert np.abs(plant.truth().slip).max() < 0.02


@pytest.mark.parametrize(("name", "command", "field", "limit"), [
    ("articulation", {"articulation_rate": 1.0}, "articulation_angle", math.radians(40)),
    ("articulation", {"articulation_rate": -1.0}, "articulation_angle", math.radians(-40)),
    ("lift", {"lift_rate": 1.0}, "lift_arm_angle", math.radians(46)),
    ("lift", {"lift_rate": -1.0}, "lift_arm_angle", math.radians(-46)),
    ("tilt", {"tilt_rate": -2.0}, "tilt_angle", math.radians(-48)),
])  # fmt: skip
def test_cylinders_stop_softly_at_their_ends(name, command, field, limit):
    """Full rate into the stop: rate within the machine's limit, no overshoot, no rebound; 0.1 mrad short after 12 s."""
    plant = Plant(MACHINE)
    steering, lift = MACHINE.steering, MACHINE.lift
    held = (
        0.0 if name == "articulation" else 20e3
    )  # against locked wheels steering stalls at its relief pressure
    top = {
        "articulation": steering.rate_limit,
        "lift": lift.lower_rate_limit,
        "tilt": MACHINE.tilt.rate_limit,
    }[name]
    before = getattr(plant.truth(), field)
    for _ in range(120):
        plant.advance(Commands(brake_torque=(held,) * 4, **command), 0.1)
        now = getattr(plant.truth(), field)
        assert abs(now) <= abs(limit) + 1e-9 or math.copysign(1, now) != math.copysign(1, limit)
        assert (now - before) * math.copysign(1, limit - before) >= -1e-9
        assert abs(now - before) <= top * 0.1 + 1e-9
        before = now
    assert before == pytest.approx(limit, abs=1e-4)


def test_level_bucket_while_the_arm_moves():
    """No tilt demand: the bucket keeps its angle against the front frame."""
    plant = Plant(MACHINE)
    before = plant.truth()
    plant.advance(Commands(brake_torque=(2e4,) * 4, lift_rate=0.25), 3.0)
    assert plant.truth().tilt_angle == pytest.approx(before.tilt_angle, abs=1e-12)
    assert plant.truth().lift_arm_angle > before.lift_arm_angle + 0.5


def test_oscillation_stops_push_and_never_pull():
    p = Plant(MACHINE)._parameters
    limit = math.radians(13.0)
    assert stop_moment(0.99 * limit, 5.0, p) == stop_moment(-0.99 * limit, -5.0, p) == 0.0
    assert stop_moment(limit + 0.01, 0.0, p) == pytest.approx(-2.0e6 * 0.01)
    assert stop_moment(-limit - 0.01, 0.0, p) == pytest.approx(2.0e6 * 0.01)
    assert stop_moment(limit + 0.01, -10.0, p) == 0.0, (
        "leaving fast, the damper would pull: it lets go instead"
    )


def test_oscillation_stop_catches_the_axle():
    """An axle swung at 1 rad/s in flight goes past 13 degrees by less than rate sqrt(I/k), and comes back slower.

    I by hand: axle 130, two wheels 2 (60 + 426 x 0.965^2) kg m2, all 0.1 m below the pivot.
    """
    plant = Plant(MACHINE)
    plant._state[s.POSITION + 2] += 100.0
    plant._state[s.JOINT_RATE + s.REAR_AXLE] = 1.0
    inertia = 130 + 2 * (60 + 426 * 0.965**2) + (590 + 2 * 426) * 0.1**2
    angles = []
    for _ in range(500):
        plant.advance(Commands(), 0.001)
        angles.append(plant.truth().oscillation_angle)
    assert math.radians(13.0) < max(angles) < math.radians(13.0) + math.sqrt(inertia / 2.0e6)
    assert -1.0 < plant.truth().oscillation_rate < -0.2


def test_roll_over_lifts_the_inner_front_wheel_first():
    """Abrupt left turn at speed: front left leaves the road first, while the rest still carry."""
    plant = Plant(MACHINE, speed=7.0)
    for _ in range(300):
        plant.advance(Commands(articulation_rate=0.45), 0.01)
        if plant.truth().lifted:
            break
    assert plant.truth().lifted == (0,)
    assert plant.truth().load_transfer_ratio > 0.3


def test_rolling_over_to_the_end_stays_finite():
    """On its side the machine has no contact left; numbers stay numbers."""
    plant = Plant(MACHINE, payload_mass=3204.0, lift_arm_angle=0.8, speed=8.0)
    plant.advance(Commands(articulation_rate=0.45), 3.0)
    assert abs(plant.truth().roll) > math.radians(60)
    assert np.isfinite(plant._state).all()


def test_truth_is_consistent_with_itself():
    """Specific force at rest reads gravity; wheels' forces sum to the CoG's; joint and IMU differ by the lever."""
    plant = Plant(MACHINE, speed=4.0, articulation_angle=0.3)
    plant.advance(Commands(wheel_torque=(4e3,) * 4, articulation_rate=-0.2), 1.0)
    truth = plant.truth()
    here = truth.position.copy()
    ahead = plant.copy()
    ahead.step_s, ahead._steps = 1e-6, 0
    ahead.advance(Commands(wheel_torque=(4e3,) * 4, articulation_rate=-0.2), 1e-6)
    moved = (ahead.truth().position - here) / 1e-6
    world = plant._work.places.world
    np.testing.assert_allclose(world @ truth.velocity, moved, rtol=0, atol=1e-4)
    assert math.atan2(moved[1], moved[0]) == pytest.approx(
        truth.yaw + math.atan2(truth.velocity[1], truth.velocity[0]), abs=1e-2
    )
    assert truth.speed == pytest.approx(truth.velocity[0], abs=0.05)


def test_pieces_of_an_advance_are_the_whole():
    command = Commands(wheel_torque=(2e3,) * 4, articulation_rate=0.2)
    whole, pieces = Plant(MACHINE, speed=2.0), Plant(MACHINE, speed=2.0)
    whole.advance(command, 1.0)
    for _ in range(100):
        pieces.advance(command, 0.01)
        pieces.truth()
    np.testing.assert_array_equal(whole._state, pieces._state)
    assert whole.time_s == pieces.time_s == 1.0


def test_a_copy_goes_its_own_way():
    plant = Plant(MACHINE, speed=2.0)
    twin = plant.copy()
    twin.advance(Commands(), 0.1)
    assert plant.time_s == 0.0
    assert twin.truth().position[0] > 0.1 > plant.truth().position[0]
    plant.advance(Commands(), 0.1)
    np.testing.assert_array_equal(plant._state, twin._state)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"payload_mass": -1.0}, "payload_mass=-1.0 kg is outside 0"),
        ({"articulation_angle": 40.0}, "articulation_angle=40.0 rad is outside -0.6981"),
        ({"lift_arm_angle": math.nan}, "lift_arm_angle=nan rad"),
        ({"speed": 99.0}, "speed=99.0 m/s"),
        ({"integrator": "euler"}, "'euler' is neither"),
        ({"surface": None, "step_s": 0.1}, "step_s=0.1 s"),
    ],
)
def test_bad_start_is_refused(change, words):
    with pytest.raises(ValueError, match=r"outside|neither") as caught:
        Plant(MACHINE, **change)
    assert words in str(caught.value)


def test_bad_surface_and_commands_are_refused():
    with pytest.raises(ValueError, match=r"grade=30.*degrees"):
        Surface(grade=30.0)
    with pytest.raises(ValueError, match="lift_rate=nan is not finite"):
        Commands(lift_rate=math.nan)
    with pytest.raises(ValueError, match="cannot be negative"):
        Commands(brake_torque=(0.0, -1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="whole number of steps"):
        Plant(MACHINE).advance(Commands(), 0.0125e-1)


def test_divergence_is_reported():
    plant = Plant(MACHINE, speed=2.0)
    plant._state[s.VELOCITY] = 1e200
    with np.errstate(all="ignore"), pytest.raises(DivergedError, match="diverged"):
        plant.advance(Commands(), 0.1)
