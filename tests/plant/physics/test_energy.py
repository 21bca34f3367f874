"""Momentum and energy: what goes in comes out; the integrators converge as they should."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from plant.effects import find_effect
from plant.physics import state as s
from plant.physics.parameters import P_NORMAL, P_STOP_ANGLE, P_WHEELS, W_DAMPING
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from tests.plant.oracle.loader import MujocoLoader

MACHINE = load_machine("l60")
FAR = 1000.0  # above the road: no tyre touches [m]


def airborne(integrator, step_s=1e-3, *, turning=(0.3, -0.5, 1.0)) -> Plant:
    """A loader thrown into the air: turning, wheels at different speeds, joints at rest, no oscillation stops."""
    plant = Plant(MACHINE, payload_mass=3204.0, articulation_angle=0.3, integrator=integrator, step_s=step_s)
    plant._parameters[P_STOP_ANGLE] = 100.0
    state = plant._state
    state[s.POSITION + 2] += FAR
    state[s.ANGULAR : s.ANGULAR + 3] = turning
    state[s.VELOCITY : s.VELOCITY + 3] = (3.0, -1.0, 5.0)
    state[s.JOINT_RATE + s.WHEEL : s.JOINT_RATE + s.WHEEL + 4] = (10.0, 4.0, -3.0, 0.0)
    state[s.STICK : s.STICK + 4] = 1.0
    state[s.BRAKE : s.BRAKE + 4] = 0.0
    state[s.KAPPA : s.DRIVE] = 0.0
    return plant


def totals(plant: Plant) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Kinetic plus gravitational energy, momentum, angular momentum about the CoG, and CoG: MuJoCo's, not ours."""
    oracle = MujocoLoader(plant.machine, plant._parameters, payload_mass=plant.payload_mass)
    oracle.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    oracle.set_state(plant._state)
    mujoco.mj_forward(oracle.model, oracle.data)
    mujoco.mj_subtreeVel(oracle.model, oracle.data)
    root, data = oracle.model.body("rear_frame").id, oracle.data
    mass = oracle.model.body_subtreemass[root]
    return (
        float(data.energy.sum()),
        mass * data.subtree_linvel[root],
        data.subtree_angmom[root].copy(),
        data.subtree_com[root].copy(),
    )


def test_tumbling_keeps_energy_and_angular_momentum():
    """Ten seconds of free flight with RK4: 1e-9 of the kinetic energy; driven joints at rest do no work."""
    plant = airborne("rk4")
    energy, momentum, spin, centre = totals(plant)
    kinetic = 0.5 * 15046 * 35 + 20e3
    plant.advance(Commands(), 10.0)
    energy_after, momentum_after, spin_after, centre_after = totals(plant)
    assert energy_after == pytest.approx(energy, abs=1e-9 * kinetic)
    np.testing.assert_allclose(spin_after, spin, rtol=0, atol=1e-9 * np.linalg.norm(spin))
    weight = 15046 * 9.81
    np.testing.assert_allclose(momentum_after - momentum, (0, 0, -10 * weight), rtol=0, atol=1e-9 * weight)
    fall = centre + momentum / 15046 * 10 - np.array((0, 0, 0.5 * 9.81 * 100))
    np.testing.assert_allclose(centre_after, fall, rtol=0, atol=1e-8)


def test_joints_moved_in_flight_keep_angular_momentum():
    """Inner work cannot turn the whole: articulating and lifting in flight. 1e-9: RK4's error over 2 s."""
    plant = airborne("rk4")
    spin = totals(plant)[2]
    plant.advance(
        Commands(articulation_rate=-0.4, lift_rate=0.2, tilt_rate=-0.5, wheel_torque=(3e3, -2e3, 1e3, 0.0)),
        2.0,
    )
    assert abs(plant.truth().articulation_angle - 0.3) > 0.3
    np.testing.assert_allclose(totals(plant)[2], spin, rtol=0, atol=1e-9 * np.linalg.norm(spin))


def test_free_fall_reads_nothing():
    """An accelerometer at the CoG in flight reads zero; one off it reads the turning."""
    truth = airborne("rk4").truth()
    assert not truth.cog_specific_force.any()
    assert np.linalg.norm(truth.imu_specific_force) > 0.01
    still = airborne("rk4", turning=(0, 0, 0))
    still._state[s.JOINT_RATE + s.WHEEL :][:4] = 0.0
    np.testing.assert_allclose(still.truth().imu_specific_force, 0.0, atol=1e-12)


def smooth_ride(integrator, step_s, seconds) -> np.ndarray:
    """Driving with all laws in their smooth range: no servo or torque limit is passed."""
    plant = Plant(
        MACHINE, payload_mass=1000.0, speed=4.0, articulation_angle=0.1, integrator=integrator, step_s=step_s
    )
    plant._state[s.BRAKE : s.BRAKE + 4] = 0.0
    plant.advance(Commands(wheel_torque=(300.0,) * 4, articulation_rate=0.1), seconds)
    return plant._state[s.POSITION : s.KAPPA].copy()


@pytest.mark.parametrize(
    ("integrator", "order", "steps"), [("semi-implicit", 1, (1e-3, 5e-4)), ("rk4", 4, (5e-4, 2.5e-4))]
)
def test_order_of_convergence(integrator, order, steps):
    """Halving the step divides the error by 2^order: within 0.1, for the next term still shows."""
    exact = smooth_ride("rk4", 5e-5, 0.6)
    errors = [np.linalg.norm(smooth_ride(integrator, step, 0.6) - exact) for step in steps]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


UNEVEN = (
    find_effect("washboard").of(amplitude_mm=5.0),
    find_effect("kerb").of(distance_m=3.0, length_m=2.0, left_m=0.04, right_m=0.0),
    find_effect("ditch").of(distance_m=2.5, length_m=2.0, left_m=-0.01, right_m=0.02),
)


@pytest.mark.parametrize(("name", "chosen"), [("l60", ()), ("compact", ()), ("l60", UNEVEN)])
def test_energy_balance_of_a_drive(name, chosen):
    """Kinetic, gravitational and tyre energy change by the work of motors, brakes and cylinders less what tyres
    dissipate, over 4 s of driving, steering, lifting and braking uphill; on uneven ground too, which gives nothing.

    Work is integrated here by Simpson's rule over 0.5 ms samples; 1e-5 of the energy turned over.
    """
    machine = replace(load_machine(name), effects=chosen)
    size = machine.mass / 11842  # of the torques below
    load = 0.6 * machine.payload.reference_mass
    plant = Plant(machine, Surface(grade=0.1), payload_mass=load, speed=3.0, integrator="rk4", step_s=5e-4)
    tyre, power, turnover = machine.tyre, [], []
    radius = tyre.radius
    pressure = np.array((tyre.front_pressure,) * 2 + (tyre.rear_pressure,) * 2) / tyre.nominal_pressure - 1
    scale = tyre.nominal_load * radius * (1 + tyre.pfz1 * pressure)

    def stored():
        d = np.maximum(plant.truth().tyre_deflection, 0.0) / radius
        return totals(plant)[0] + float(np.sum(scale * (tyre.qfz1 * d**2 / 2 + tyre.qfz2 * d**3 / 3)))

    def flows(truth):
        out, work = plant._work.tyres, plant._work
        normal = plant._parameters[P_NORMAL : P_NORMAL + 3] @ work.places.world
        ahead = np.cross(work.places.axles, normal)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        along = work.places.world[0]  # the world's x axis, along which uneven ground pushes back
        back = -truth.normal_force * work.ground[:, s.G_SLOPE]
        slip_force = out[:, s.T_LONGITUDINAL] - back * (ahead @ along)
        side_force = out[:, s.T_LATERAL] - back * (np.cross(normal, ahead) @ along)
        sliding = slip_force * out[:, s.T_SLIDING_X] + side_force * out[:, s.T_SLIDING_Y]
        turning = work.tree.motion[s.WHEEL : s.WHEEL + 4, :3] @ normal
        d = truth.tyre_deflection / radius
        spring = scale / radius * (tyre.qfz1 * d + tyre.qfz2 * d**2)
        upright = np.sqrt(1 - (work.places.axles @ normal) ** 2)
        damper = truth.normal_force * upright - spring  # what the damper adds in the wheel plane
        sinking = damper / plant._parameters[P_WHEELS + W_DAMPING]
        effort, rate = work.tree.effort, plant._state[s.JOINT_RATE : s.JOINT_RATE + s.BODIES]
        cylinders = effort[s.FRONT_FRAME] * rate[s.FRONT_FRAME] + effort[s.LIFT_ARM] * rate[s.LIFT_ARM]
        cylinders += effort[s.BUCKET] * (rate[s.BUCKET] - rate[s.LIFT_ARM])
        wheels = truth.wheel_torque @ truth.wheel_speed
        return np.array(
            (cylinders, wheels, sliding.sum(), truth.aligning_moment @ turning, -(damper @ sinking))
        )

    before = stored()
    for tick in range(8001):
        truth = plant.truth()
        parts = flows(truth)
        assert parts[4] <= 0.0
        assert truth.normal_force.min() > 0.0, "the balance assumes that no wheel lifts"
        power.append(parts.sum())
        turnover.append(np.abs(parts).sum())
        t = tick * 5e-4
        braking = t > 2.5
        torque = 0.0 if braking else 4000.0 * size
        if tick < 8000:
            plant.advance(
                Commands(
                    wheel_torque=(torque,) * 4,
                    brake_torque=(3000.0 * size * braking,) * 4,
                    articulation_rate=0.2 if t < 1.5 else -0.1,
                    lift_rate=0.1,
                    tilt_rate=-0.1,
                ),
                5e-4,
            )
    work_done = 5e-4 / 3 * (power[0] + power[-1] + 4 * sum(power[1:-1:2]) + 2 * sum(power[2:-1:2]))
    assert stored() - before == pytest.approx(work_done, abs=1e-5 * 5e-4 * sum(turnover))


def test_forces_are_the_rate_of_momentum():
    """Newton and Euler for the whole machine: tyres and gravity against differences of MuJoCo's momentum.

    Central differences over 2 us of the plant's own RK4 motion: 1e-6 of the force.
    """
    plant = Plant(MACHINE, payload_mass=3204.0, speed=5.0, articulation_angle=0.3)
    plant.advance(Commands(wheel_torque=(5e3,) * 4, articulation_rate=-0.3, lift_rate=0.2), 0.5)
    command = Commands(wheel_torque=(5e3,) * 4, articulation_rate=-0.3, lift_rate=0.2)
    fine = plant.copy()
    fine.step_s, fine.integrator, fine._steps = 1e-6, "rk4", 0
    before = totals(fine)
    fine.advance(command, 1e-6)
    truth, work = fine.truth(), fine._work
    world, centre = work.places.world.copy(), work.whole[1:].copy()
    wrench = work.tyres[:, s.T_WRENCH : s.T_WRENCH + 6].sum(axis=0)
    force = world @ wrench[3:]
    moment = world @ (wrench[:3] - np.cross(centre, wrench[3:]))
    fine.advance(command, 1e-6)
    after = totals(fine)
    weight = np.array((0, 0, -work.whole[0] * 9.81))
    np.testing.assert_allclose((after[1] - before[1]) / 2e-6, force + weight, rtol=0, atol=1e-5 * 150e3)
    np.testing.assert_allclose((after[2] - before[2]) / 2e-6, moment, rtol=0, atol=1e-5 * 150e3)
    assert truth.yaw_moment == pytest.approx((world.T @ moment)[2], abs=1e-6)
