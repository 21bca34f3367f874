"""A motion of the loader with MuJoCo's bodies and integration: an independent truth for the loader's diagnosis.

The tyre's force law, the servo law, and the lags of motor and brake are ours, called at MuJoCo's state. A brake's friction is smoothed
about standstill, whereas the plant's own holds the wheel. Possible effects are those that change the plant's parameter vector or the payload,
and the drag of released brakes; others raise ValueError.
"""

import math
from dataclasses import replace
from typing import Final

import mujoco
import numpy as np

from plant.effects.registry import python_hook
from plant.physics import state as s
from plant.physics.linkage import linkage_of, pressures
from plant.physics.parameters import P_FRICTION
from plant.physics.steering import cylinders_of, steering_pressures
from plant.plant import Commands, Plant
from plant.sheets.machine import Machine
from plant.truth import Truth
from tests.plant.oracle.loader import MujocoLoader

# The plant's own step: the comparison is of bodies and integration, not of steps.
STEP_S: Final = 1e-3
OURS: Final = ("payload_mass", "brake_drag", "surface_friction")
"""Effects that are not the machine's parameters and that MuJoCo's loader can have."""
SMOOTHED: Final = 0.3  # wheel speed below which a brake's friction fades [rad/s]
DRAG_SMOOTHED: Final = 0.05  # the same of a dragging brake, as the effect has it


class MujocoMotion:
    """The loader from rest or rolling, as the plant starts it, then moved by MuJoCo."""

    def __init__(self, machine: Machine, *, payload_mass: float, speed: float) -> None:
        extra, self._drag, grip = 0.0, np.zeros(4), 1.0
        for item in machine.effects:
            if item.effect.name == "payload_mass":
                extra += item.named["extra_kg"]
            elif item.effect.name == "brake_drag":
                front, rear = item.named["front_N_m"], item.named["rear_N_m"]
                self._drag += (front, front, rear, rear)
            # one friction for all four tyres: sides that differ cannot be had here
            elif item.effect.name == "surface_friction" and item.named["left"] == item.named["right"]:
                grip *= item.named["left"]  # that of the whole road
            elif python_hook(item.effect, "prepare") is None or item.effect.name in (
                "mass_split",
                "yaw_inertia",
                "roll_inertia",
            ):
                raise ValueError(f"MuJoCo's loader cannot have the effect {item.effect.name}")
        # MuJoCo's bodies come from the machine; the content of the bucket is passed as payload
        parametric = tuple(e for e in machine.effects if e.effect.name not in OURS)
        self._machine = replace(machine, effects=parametric)
        self._payload = payload_mass + extra
        _, p, *_ = Plant(self._machine, payload_mass=self._payload, speed=speed).inside()
        # a rolling start balances every effect of the machine, also those that MuJoCo has in another form
        state, *_ = Plant(machine, payload_mass=payload_mass, speed=speed).inside()
        p[P_FRICTION] *= grip
        self._oracle = MujocoLoader(self._machine, p, payload_mass=self._payload, step=STEP_S)
        self._oracle.set_state(state)
        self._stated_payload = payload_mass
        self._drive, self._brake = state[s.DRIVE : s.DRIVE + 4].copy(), state[s.BRAKE : s.BRAKE + 4].copy()
        self._rates = np.zeros(3)
        self._steps = 0

    def advance(self, commands: Commands, duration_s: float) -> Truth:
        """Move on by a whole number of steps with constant commands; returns what is true then."""
        drive, brake, oracle = self._machine.drive, self._machine.brake, self._oracle
        # limits of the drive are ours, not MuJoCo's: motors with their peak torques
        demanded = np.clip(
            commands.wheel_torque,
            *(sign * np.repeat((drive.front_peak_torque, drive.rear_peak_torque), 2) for sign in (-1, 1)),
        )
        available = np.clip(commands.brake_torque, 0.0, brake.capacity)
        self._rates[:] = commands.articulation_rate, commands.lift_rate, commands.tilt_rate
        for _ in range(round(duration_s / STEP_S)):
            # tyres are rolled at the state before the step, as the plant does it
            oracle.locate()
            oracle.roll_tyres()
            applied, _, efforts = self._solved()
            oracle.step(applied, efforts)
            change = (demanded - self._drive) / drive.time_constant
            # first-order lag with a limited rate, explicit: the time constants are far above a step
            self._drive += STEP_S * np.clip(change, -drive.rate_limit, drive.rate_limit)
            self._brake += STEP_S * (available - self._brake) / brake.time_constant
            self._steps += 1
        return self.truth()

    def _spins(self) -> np.ndarray:
        return np.array([self._oracle.data.qvel[self._oracle.dof[s.WHEEL + i]] for i in range(4)])

    def _torque(self) -> np.ndarray:
        """Of motors and brakes, as the machine measures it."""
        return self._drive - self._brake * np.tanh(self._spins() / SMOOTHED)

    def _solved(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generalised forces, accelerations, and efforts of the cylinders, at the state as it is."""
        oracle = self._oracle
        torque = self._torque() - self._drag * np.tanh(self._spins() / DRAG_SMOOTHED)
        applied = oracle.applied(torque, oracle.tyres[:, s.T_WRENCH : s.T_WRENCH + 6])
        return applied, *oracle.solve(applied, oracle.demanded(*self._rates))

    def truth(self) -> Truth:
        """Everything the bench's sensors and instruments read, from MuJoCo's state and its accelerometer."""
        oracle, d, machine = self._oracle, self._oracle.data, self._machine
        # reading must not move the tyres: `roll_tyres` steps their relaxation
        slips = oracle.slips.copy()
        oracle.locate()
        oracle.roll_tyres()
        oracle.slips[:] = slips
        _, qacc, efforts = self._solved()
        d.qacc[:] = qacc
        # fills the accelerations from which MuJoCo computes its accelerometer
        mujoco.mj_rnePostConstraint(oracle.model, d)
        mujoco.mj_sensorAcc(oracle.model, d)
        world = np.empty(9)
        mujoco.mju_quat2Mat(world, d.qpos[3:7])
        world = world.reshape(3, 3)
        velocity, turning = world.T @ d.qvel[:3], d.qvel[3:6]
        height = machine.geometry.wheel_centre_height - machine.geometry.joint_height
        lift, lift_rate = oracle.joint(s.LIFT_ARM)
        linkage, tilt = linkage_of(machine.lift, machine.tilt), oracle.joint(s.BUCKET)[0]
        in_lift, in_tilt = pressures(linkage, lift, tilt, float(efforts[1]), float(efforts[2]))
        articulation = oracle.joint(s.FRONT_FRAME)[0]
        steering = steering_pressures(cylinders_of(machine.steering), articulation, float(efforts[0]))
        ahead, aside, up = d.sensordata[:3]
        values = {
            "time_s": self._steps * STEP_S,
            "position": d.qpos[:3],
            "attitude": d.qpos[3:7],
            "roll": math.atan2(world[2, 1], world[2, 2]),
            "pitch": -math.asin(world[2, 0]),
            "yaw": math.atan2(world[1, 0], world[0, 0]),
            "velocity": velocity,
            "angular_velocity": turning,
            "acceleration": world.T @ qacc[:3],
            "imu_specific_force": d.sensordata[:3],
            "speed": velocity[0] + turning[1] * height,
            "lift_arm_angle": lift,
            "lift_arm_rate": lift_rate,
            "wheel_speed": self._spins(),
            "wheel_torque": self._torque(),
            # brakes are smoothed here, and none holds a wheel: what motors and brakes are known to give is what acts
            "known_torque": self._torque(),
            "inclination": (math.atan2(-ahead, math.hypot(aside, up)), math.atan2(aside, up)),
            "normal_force": oracle.tyres[:, s.T_NORMAL],
            "longitudinal_force": oracle.tyres[:, s.T_LONGITUDINAL],
            "lateral_force": oracle.tyres[:, s.T_LATERAL],
            "aligning_moment": oracle.tyres[:, s.T_ALIGNING],
            "tyre_deflection": oracle.tyres[:, s.T_DEFLECTION],
            "joint_torque": efforts[0],
            "lift_pressure": in_lift,
            "tilt_pressure": in_tilt,
            "steering_pressure": steering,
            "payload_mass": self._stated_payload,
        }
        for name, body in (
            ("articulation", s.FRONT_FRAME),
            ("oscillation", s.REAR_AXLE),
            ("tilt", s.BUCKET),
        ):
            values[f"{name}_angle"], values[f"{name}_rate"] = oracle.joint(body)
        row = np.full(Truth.size, np.nan)  # what MuJoCo is not asked for is not 0
        for name, value in values.items():
            field = Truth.fields[name]
            row[field.at : field.at + field.size] = value
        return Truth(row)
