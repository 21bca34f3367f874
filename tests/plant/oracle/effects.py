"""The rigid-body and joint effects once more in MuJoCo: as other bodies, other places and other forces, written out anew.

INCLUDED lists them with how they are made there. Left out, because both engines would be given the same law: tyre effects, ground
under the tyres (frame torsion acts by it too), actuators, brakes' capacity, sensors. Left out, because it is not a rigid body's law:
payload slosh, whose pendulum feels the mean of the tyres' forces instead of its own acceleration. Steering play is the compliance's
spring with a dead zone and excludes it.
"""

import math
from dataclasses import replace

import mujoco
import numpy as np

from plant.physics import state as s
from plant.physics.parameters import P_STEERING
from plant.sheets.machine import Body, Machine
from tests.plant.oracle.loader import DRIVEN, MujocoLoader

INCLUDED = {
    "mass_split": "other masses of the two frames, another height of the rear frame's centre",
    "axle_position": "wheels and oscillation pivot at other places",
    "payload_mass": "another payload body",
    "lift_arm_inertia": "another inertia and centre of the arm",
    "roll_inertia": "other inertias of the frames",
    "yaw_inertia": "other inertias of the frames",
    "wheel_spin_inertia": "another inertia of the wheels",
    "wheel_gyroscopics": "a moment on each wheel, from MuJoCo's angular velocities",
    "oscillation_stops": "a joint force by the stops' law at another angle",
    "pivot_friction": "a joint force",
    "steering_friction": "a joint force",
    "brake_drag": "joint forces",
    "driveline_torsion": "joint forces from a shaft with a state of its own",
    "steering_compliance": "a free joint and a spring to a cylinder with a state of its own",
    "aerodynamic_drag": "a force on the rear frame at its height",
    "pile_entry": "a force at the bucket's edge, from MuJoCo's pose, with a depth of its own",
}

FRICTION_RATE = 0.005  # [rad/s]
DRAG_RATE = 0.05  # [rad/s]
PILE_STIFFNESS, PILE_LOSS, PILE_FOLLOWS = 2e6, 1.0, 10e-3  # [N/m], [s/m], [s]

Effects = dict[str, dict[str, float]]


def changed(machine: Machine, e: Effects) -> Machine:
    """The machine with what the effects change of its bodies and places, front frame apart."""
    spread = e.get("axle_position", {"front_mm": 0.0, "rear_mm": 0.0})
    split = e.get("mass_split", {"forward_kg": 0.0, "higher_mm": 0.0})
    arm = e.get("lift_arm_inertia", {"inertia_kg_m2": 0.0, "higher_mm": 0.0})
    back = spread["rear_mm"] * 1e-3
    rear, stops = machine.rear_frame, e.get("oscillation_stops", {"narrower_deg": 0.0, "stiffness": 1.0})
    return replace(
        machine,
        effects=(),
        geometry=replace(
            machine.geometry,
            front_axle_x=machine.geometry.front_axle_x + spread["front_mm"] * 1e-3,
            rear_axle_x=machine.geometry.rear_axle_x - back,
        ),
        rear_axle=replace(machine.rear_axle, x=machine.rear_axle.x - back),
        rear_frame=replace(
            rear,
            mass=rear.mass - split["forward_kg"],
            z=rear.z + split["higher_mm"] * 1e-3,
            ixx=rear.ixx * e.get("roll_inertia", {"rear": 1.0})["rear"],
            izz=rear.izz * e.get("yaw_inertia", {"rear": 1.0})["rear"],
        ),
        lift_arm=replace(
            machine.lift_arm,
            iyy=machine.lift_arm.iyy + arm["inertia_kg_m2"],
            izz=machine.lift_arm.izz + arm["inertia_kg_m2"],
            z=machine.lift_arm.z + arm["higher_mm"] * 1e-3,
        ),
        wheel=replace(
            machine.wheel,
            spin_inertia=machine.wheel.spin_inertia
            + e.get("wheel_spin_inertia", {"extra_kg_m2": 0.0})["extra_kg_m2"],
        ),
        oscillation=replace(
            machine.oscillation,
            limit=machine.oscillation.limit - math.radians(stops["narrower_deg"]),
            stop_stiffness=machine.oscillation.stop_stiffness * stops["stiffness"],
        ),
    )


def front_unit(machine: Machine, e: Effects) -> str:
    """Front frame and axle as one body about the joint's height: parallel axes, then the effects' factors."""
    parts: list[Body] = [machine.front_frame, machine.front_axle]
    mass = sum(part.mass for part in parts)
    places = [np.array((part.x, 0.0, part.z - machine.geometry.joint_height)) for part in parts]
    centre = sum(part.mass * at for part, at in zip(parts, places, strict=True)) / mass
    inertia = np.zeros((3, 3))
    for part, at in zip(parts, places, strict=True):
        arm = at - centre
        inertia += np.diag((part.ixx, part.iyy, part.izz))
        inertia += part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    inertia[0, 0] *= e.get("roll_inertia", {"front": 1.0})["front"]
    inertia[2, 2] *= e.get("yaw_inertia", {"front": 1.0})["front"]
    mass += e.get("mass_split", {"forward_kg": 0.0})["forward_kg"]
    full = (inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2])
    numbers = " ".join(repr(float(value)) for value in full)
    at = " ".join(repr(float(value)) for value in centre)
    return f'<inertial mass="{mass!r}" pos="{at}" fullinertia="{numbers}"/>'


class MujocoWithEffects(MujocoLoader):
    """The loader in MuJoCo with effects: parameters by effect and name, in their own units.

    p: parameters of the plant without effects, but for the stops.
    """

    def __init__(
        self, machine: Machine, p: np.ndarray, effects: Effects, *, payload_mass: float, step: float = 1e-3
    ) -> None:
        self.effects = effects
        more = effects.get("payload_mass", {"extra_kg": 0.0})["extra_kg"]
        other = changed(machine, effects)
        super().__init__(
            other, p, payload_mass=payload_mass + more, step=step, front=front_unit(machine, effects)
        )
        self.spin_inertia = other.wheel.spin_inertia
        self.stops = other.oscillation
        self.cylinder = np.zeros(2)  # angle and rate of the steering cylinders
        self.dug = 0.0
        self.wound = self.winding = 0.0  # the shaft between the axles [rad, rad/s]
        if "steering_compliance" in effects:
            self._driven = np.array([self.dof[body] for body in DRIVEN if body != s.FRONT_FRAME])
            self._free = np.setdiff1d(np.arange(self.model.nv), self._driven)
            self._free_free = np.ix_(self._free, self._free)
            self._free_driven = np.ix_(self._free, self._driven)

    def applied(self, wheel_torque: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
        """Generalised force of everything, effects included."""
        total = super().applied(wheel_torque, wrenches)
        e = self.effects
        _, turning = self.joint(s.REAR_AXLE)
        angle, rate = self.joint(s.FRONT_FRAME)
        if "pivot_friction" in e:
            total[self.dof[s.REAR_AXLE]] -= e["pivot_friction"]["torque_N_m"] * math.tanh(
                turning / FRICTION_RATE
            )
        if "brake_drag" in e:
            for wheel in range(4):
                drag = e["brake_drag"]["front_N_m" if wheel < 2 else "rear_N_m"]
                total[self.dof[s.WHEEL + wheel]] -= drag * math.tanh(
                    self.joint(s.WHEEL + wheel)[1] / DRAG_RATE
                )
        if "steering_compliance" in e:
            spring = e["steering_compliance"]
            total[self.dof[s.FRONT_FRAME]] += spring["stiffness_N_m_per_rad"] * (self.cylinder[0] - angle)
            total[self.dof[s.FRONT_FRAME]] += spring["damping_N_m_s_per_rad"] * (self.cylinder[1] - rate)
            total[self.dof[s.FRONT_FRAME]] -= self.joint_friction(rate)
        self._shaft(total)
        self._gyroscopic(total)
        self._drag(total)
        self._pile(total)
        return total

    def _shaft(self, total: np.ndarray) -> None:
        rates = [self.joint(s.WHEEL + wheel)[1] for wheel in range(4)]
        self.winding = (rates[0] + rates[1] - rates[2] - rates[3]) / 2.0
        if "driveline_torsion" not in self.effects:
            return
        shaft = self.effects["driveline_torsion"]
        torque = shaft["stiffness_N_m_per_rad"] * self.wound + shaft["damping_N_m_s_per_rad"] * self.winding
        for wheel, share in enumerate((-0.5, -0.5, 0.5, 0.5)):
            total[self.dof[s.WHEEL + wheel]] += share * torque

    def joint_friction(self, rate: float) -> float:
        """Friction of the articulation joint [N m]."""
        torque = self.effects.get("steering_friction", {"torque_N_m": 0.0})["torque_N_m"]
        return torque * math.tanh(rate / FRICTION_RATE)

    def velocity(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity of a body and velocity of its origin, world axes."""
        out = np.zeros(6)
        body = self.model.body(name).id
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, body, out, 0)
        return out[:3].copy(), out[3:].copy()

    def _force(
        self, name: str, force: np.ndarray, moment: np.ndarray, point: np.ndarray, total: np.ndarray
    ) -> None:
        body = self.model.body(name).id
        mujoco.mj_applyFT(self.model, self.data, force, moment, point, body, total)

    def _gyroscopic(self, total: np.ndarray) -> None:
        if "wheel_gyroscopics" not in self.effects:
            return
        share = self.effects["wheel_gyroscopics"]["share"]
        for name in ("fl", "fr", "rl", "rr"):
            omega, _ = self.velocity(name)
            axle = self.data.body(name).xmat.reshape(3, 3)[:, 1]
            moment = -share * np.cross(omega, self.spin_inertia * (omega @ axle) * axle)
            self._force(name, np.zeros(3), moment, self.data.body(name).xpos.copy(), total)

    def _drag(self, total: np.ndarray) -> None:
        if "aerodynamic_drag" not in self.effects:
            return
        drag = self.effects["aerodynamic_drag"]
        _, velocity = self.velocity("rear_frame")
        frame = self.data.body("rear_frame")
        force = -0.5 * drag["air_density_kg_per_m3"] * drag["drag_area_m2"] * velocity
        force *= np.linalg.norm(velocity)
        point = frame.xpos + drag["height_m"] * frame.xmat.reshape(3, 3)[:, 2]
        self._force("rear_frame", force, np.zeros(3), point, total)

    def _pile(self, total: np.ndarray) -> None:
        """The pile's force, and into `digging` how fast its depth grows."""
        self.digging = 0.0
        if "pile_entry" not in self.effects:
            return
        pile, bucket = self.effects["pile_entry"], self.data.body("bucket")
        turned = bucket.xmat.reshape(3, 3)
        point = bucket.xpos + turned @ np.array((pile["edge_x_m"], 0.0, pile["edge_z_m"]))
        omega, velocity = self.velocity("bucket")
        speed = float((velocity + np.cross(omega, point - bucket.xpos))[0])
        depth = float(point[0]) - pile["distance_m"]
        deepest = max(self.dug, depth, 0.0)
        self.digging = (deepest - self.dug) / PILE_FOLLOWS
        borne = pile["most_N"] * (1.0 - math.exp(-deepest / pile["depth_m"]))
        back = borne - PILE_STIFFNESS * (deepest - depth)
        push = float(np.clip(back * (1.0 + PILE_LOSS * speed), 0.0, borne)) if back > 0.0 else 0.0
        force = np.array((-push, 0.0, -pile["weight_share"] * borne))
        self._force("bucket", force, np.zeros(3), point, total)

    def answer(
        self, applied: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, dict[int, float], np.ndarray]:
        """Accelerations, efforts by driven body, and generalised forces on them; rates: demanded of the three cylinders."""
        demanded = self.demanded(*rates)
        free = "steering_compliance" in self.effects
        self.cylinder_rate = demanded[0]
        if free:
            lag = self.p[P_STEERING + 4]
            _, rate = self.joint(s.FRONT_FRAME)
            self.cylinder_rate = (rate + lag * demanded[0] - self.cylinder[1]) / lag
            qacc, given = self.solve(applied, demanded[1:])
            return qacc, dict(zip(DRIVEN[1:], given, strict=True)), given
        qacc, given = self.solve(applied, demanded)
        efforts = dict(zip(DRIVEN, given, strict=True))
        efforts[s.FRONT_FRAME] += self.joint_friction(self.joint(s.FRONT_FRAME)[1])
        return qacc, efforts, given

    def move_on(self) -> None:
        """The states of cylinder, pile and shaft one step later; angle with the rate before, as the plant integrates its own."""
        before = self.cylinder[1]
        self.cylinder += self.step_s * np.array((before, self.cylinder_rate))
        self.dug += self.step_s * self.digging
        self.wound += self.step_s * self.winding
