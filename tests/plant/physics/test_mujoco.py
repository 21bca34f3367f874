"""The multibody equations against MuJoCo: accelerations, joint efforts, sensors, whole manoeuvres."""

import mujoco
import numpy as np
import pytest

from plant.observer import Observer
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.parameters import parameter_vector
from plant.physics.surface import Surface
from plant.physics.workspace import new_workspace
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from tests.plant.oracle.loader import DRIVEN, MujocoLoader, without_reliefs

MACHINE = load_machine("l60")
SHAFT = load_machine("l60_shaft")
PAYLOADS = [0.0, 3204.0]


def random_state(rng: np.random.Generator, payload_mass: float) -> tuple[np.ndarray, np.ndarray]:
    """A loader tumbling through the air or deep in its tyres, everything moving, and random commands."""
    state = np.zeros(s.STATES)
    state[:3] = rng.uniform(-20, 20, 3)
    state[2] = rng.uniform(0.6, 0.9)
    attitude = np.array((1.0, *rng.uniform(-0.1, 0.1, 2), rng.uniform(-2, 2)))
    state[s.ATTITUDE : s.ATTITUDE + 4] = attitude / np.linalg.norm(attitude)
    state[s.JOINT + s.FRONT_FRAME] = rng.uniform(-0.6, 0.6)
    state[s.JOINT + s.REAR_AXLE] = rng.uniform(-0.3, 0.3)
    state[s.JOINT + s.LIFT_ARM] = rng.uniform(-0.7, 0.7)
    state[s.JOINT + s.BUCKET] = rng.uniform(-0.7, 0.8)
    state[s.VELOCITY : s.VELOCITY + 6] = rng.uniform(-1, 1, 6) * (8, 2, 1, 0.5, 0.5, 1.0)
    state[s.JOINT_RATE + 1 : s.JOINT_RATE + 9] = rng.uniform(-1, 1, 8) * (0.5, 0.5, 13, 13, 13, 13, 0.3, 1.0)
    state[s.KAPPA : s.KAPPA + 8] = rng.uniform(-0.5, 0.5, 8)
    state[s.DRIVE : s.DRIVE + 4] = rng.uniform(-15e3, 15e3, 4)
    state[s.BRAKE : s.BRAKE + 4] = rng.uniform(0, 10e3, 4)
    state[s.STICK : s.STICK + 4] = rng.choice([-1.0, 1.0], 4)
    command = np.concatenate((rng.uniform(-1e4, 1e4, 4), rng.uniform(0, 1e4, 4), rng.uniform(-0.5, 0.5, 3)))
    return state, command


def axle_difference(wheel_speed: np.ndarray) -> float:
    """How much faster the front differential turns than the rear one [rad/s]."""
    return float(wheel_speed[:2].mean() - wheel_speed[2:].mean())


def through_the_shaft(machine, wound: float, wheel_speed: np.ndarray) -> np.ndarray:
    """Torque on each wheel [N m]: what the shaft bears is taken from the front axle and given to the rear one, by halves."""
    if machine.driveline.layout != "shaft":
        return np.zeros(4)
    line = machine.driveline
    borne = line.stiffness * wound + line.damping * axle_difference(wheel_speed)
    return np.array((-0.5, -0.5, 0.5, 0.5)) * borne


@pytest.mark.parametrize("machine", [MACHINE, SHAFT, load_machine("compact")], ids=lambda m: m.name)
@pytest.mark.parametrize("payload_mass", PAYLOADS)
def test_accelerations_efforts_and_sensor_agree_in_random_states(machine, payload_mass):
    """Two engines, one set of bodies. Tolerance 1e-9 of the largest value: rounding of two different algorithms."""
    rng = np.random.default_rng(3)
    surface = Surface(grade=0.1, bank=-0.05)
    p = without_reliefs(parameter_vector(machine, surface, payload_mass))
    work, oracle = new_workspace(), MujocoLoader(machine, p, payload_mass=payload_mass)
    observer = Observer(machine, payload_mass)
    loaded = 0
    for _ in range(100):
        state, command = random_state(rng, payload_mass)
        state[s.SHAFT] = rng.uniform(-0.05, 0.05)
        derivative(state, command, p, 0.0, work, None)
        loaded += int(np.count_nonzero(work.tyres[:, s.T_NORMAL]))
        oracle.set_state(state)
        oracle.locate()
        wheels = slice(s.JOINT_RATE + s.WHEEL, s.JOINT_RATE + s.WHEEL + 4)
        torque = state[s.DRIVE : s.DRIVE + 4] - state[s.STICK : s.STICK + 4] * state[s.BRAKE : s.BRAKE + 4]
        torque += through_the_shaft(machine, state[s.SHAFT], state[wheels])
        qacc, efforts = oracle.solve(
            oracle.applied(torque, in_world(work, state)), oracle.demanded(*command[s.C_ARTICULATION_RATE :])
        )
        ours = np.zeros_like(qacc)
        ours[:6] = work.rate[s.VELOCITY : s.VELOCITY + 6]
        for body, dof in oracle.dof.items():
            ours[dof] = work.tree.joint_acceleration[body]
        np.testing.assert_allclose(ours, qacc, rtol=0, atol=1e-9 * np.abs(qacc).max())
        np.testing.assert_allclose(
            work.tree.effort[list(DRIVEN)], efforts, rtol=0, atol=1e-9 * np.abs(efforts).max()
        )
        oracle.data.qacc[:] = qacc
        mujoco.mj_rnePostConstraint(oracle.model, oracle.data)
        mujoco.mj_sensorAcc(oracle.model, oracle.data)
        truth = observer.truth(0.0, state, command, p, work, None)
        reading = oracle.data.sensordata
        np.testing.assert_allclose(
            truth.imu_specific_force, reading, rtol=0, atol=1e-9 * np.abs(reading).max()
        )
    assert loaded > 150, "too few of the 400 wheels touched the road"


def in_world(work, state) -> np.ndarray:
    """Our tyre wrenches, moved to world axes and the world's origin."""
    world, position = work.places.world, state[:3]
    wrenches = work.tyres[:, s.T_WRENCH : s.T_WRENCH + 6]
    forces = wrenches[:, 3:] @ world.T
    return np.hstack((wrenches[:, :3] @ world.T + np.cross(position, forces), forces))


def manoeuvre(t: float, speed: float) -> Commands:
    """Zigzag between 2 and 5 m/s, one braking without locking, arm and bucket at work."""
    swing = 0.35 * np.sin(2 * np.pi * t / 8.0)
    brake = 2500.0 if 30.0 < t % 60.0 < 31.5 else 0.0
    target = 3.5 + 1.5 * np.sin(2 * np.pi * t / 11.0)
    torque = 4000.0 * (target - speed) if brake == 0.0 else 0.0
    return Commands(
        wheel_torque=(torque, torque, 0.8 * torque, 0.9 * torque),
        brake_torque=(brake,) * 4,
        articulation_rate=float(swing),
        lift_rate=0.15 * float(np.sign(np.sin(2 * np.pi * t / 20.0))),
        tilt_rate=0.3 * float(np.sin(2 * np.pi * t / 7.0)),
    )


@pytest.mark.parametrize(
    ("machine", "seconds", "way"), [(MACHINE, 60, 25.0), (SHAFT, 20, 15.0)], ids=("motors", "shaft")
)
def test_a_drive_is_the_same_in_both_engines(machine, seconds, way):
    """MuJoCo integrates its own bodies under the same tyre law, commands and semi-implicit step.

    Tolerance 1e-6 m: rounding, amplified over up to 60 000 steps by a motion that forgets in part (tyres)
    and remembers in part (path); a force wrong by 1e-4 of itself shows as more than a centimetre.
    """
    surface = Surface(grade=0.03)
    plant = Plant(machine, surface, payload_mass=3204.0, speed=3.0)
    p = without_reliefs(plant._parameters)
    oracle = MujocoLoader(machine, p, payload_mass=3204.0)
    oracle.set_state(plant._state)
    wheels = [oracle.dof[s.WHEEL + wheel] for wheel in range(4)]
    wound, drive, brake = 0.0, np.zeros(4), plant._state[s.BRAKE : s.BRAKE + 4].copy()
    worst_position = worst_angle = worst_spin = 0.0
    slowest, furthest = np.inf, 0.0
    truth = plant.truth()
    for tick in range(100 * seconds):
        command = manoeuvre(tick * 0.01, truth.speed)
        vector = command.vector()
        demand = vector[:4] if machine is MACHINE else np.full(4, vector[:4].mean())
        plant.advance(command, 0.01)
        for _ in range(10):
            oracle.locate()
            oracle.roll_tyres()
            speeds = oracle.data.qvel[wheels]
            torque = drive - brake + through_the_shaft(machine, wound, speeds)
            wound += 1e-3 * axle_difference(speeds)
            applied = oracle.applied(torque, oracle.tyres[:, s.T_WRENCH : s.T_WRENCH + 6])
            _, efforts = oracle.solve(applied, oracle.demanded(*vector[s.C_ARTICULATION_RATE :]))
            oracle.step(applied, efforts)
            drive += 1e-3 * np.clip((demand - drive) / 0.015, -50e3, 50e3)
            brake += 1e-3 * (vector[4:8] - brake) / 0.05
        truth = plant.truth()
        worst_position = max(worst_position, float(np.abs(oracle.data.qpos[:3] - truth.position).max()))
        worst_angle = max(worst_angle, abs(float(oracle.joint(s.REAR_AXLE)[0]) - truth.oscillation_angle))
        worst_spin = max(
            worst_spin, float(np.abs(oracle.data.qvel[oracle.dof[s.WHEEL]] - truth.wheel_speed[0]))
        )
        slowest = min(slowest, truth.speed)
        furthest = max(furthest, float(np.hypot(*truth.position[:2])))
    assert slowest > 0.5
    assert furthest > way
    assert worst_position < 1e-9
    assert worst_angle < 1e-9
    assert worst_spin < 1e-9
