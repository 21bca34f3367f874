"""The loader in MuJoCo: built from the machine file, every lumped body a body of its own.

MuJoCo supplies kinematics, inertia matrix, bias forces, the Jacobians of the applied forces and the
integration of its own state. Ours are only the tyre's force law and the servo law, called at
MuJoCo's state. Bodies that our plant merges (axle and front frame, bucket and payload) stay apart here.
"""

import mujoco
import numpy as np

from plant.physics import state as s
from plant.physics.dynamics import servo, stop_moment
from plant.physics.parameters import (
    P_FRICTION,
    P_LIFT,
    P_NORMAL,
    P_STEERING,
    P_TILT,
    P_WHEELS,
    SERVO_RELIEF,
    SERVO_SIZE,
    WHEEL_SIZE,
)
from plant.physics.tyre import wheel_contact
from plant.sheets.machine import Body, Machine

JOINTS = {
    s.FRONT_FRAME: "articulation",
    s.REAR_AXLE: "oscillation",
    s.WHEEL: "spin_fl",
    s.WHEEL + 1: "spin_fr",
    s.WHEEL + 2: "spin_rl",
    s.WHEEL + 3: "spin_rr",
    s.LIFT_ARM: "lift",
    s.BUCKET: "tilt",
}
DRIVEN = (s.FRONT_FRAME, s.LIFT_ARM, s.BUCKET)


def _inertial(mass, x, z, ixx, iyy, izz):
    return f'<inertial mass="{mass!r}" pos="{x!r} 0 {z!r}" diaginertia="{ixx!r} {iyy!r} {izz!r}"/>'


def _body(body: Body, x0: float, z0: float) -> str:
    return _inertial(body.mass, body.x - x0, body.z - z0, body.ixx, body.iyy, body.izz)


def mjcf(machine: Machine, payload_mass: float, step: float, front: str = "") -> str:
    """The model file; front: an inertial element for front frame and axle as one body, instead of the two."""
    g, lift, zj, zp = (
        machine.geometry,
        machine.lift,
        machine.geometry.joint_height,
        machine.oscillation.pivot_height,
    )
    w, load = machine.wheel, machine.payload
    share = payload_mass / load.reference_mass

    def wheel(name: str, x: float, y: float, z: float) -> str:
        return (
            f'<body name="{name}" pos="{x!r} {y!r} {z!r}"><joint name="spin_{name}" type="hinge" axis="0 1 0"/>'
            + _inertial(w.mass, 0.0, 0.0, w.transverse_inertia, w.spin_inertia, w.transverse_inertia)
            + "</body>"
        )

    two = (
        _body(machine.front_frame, 0.0, zj)
        + f'<body name="front_axle">{_body(machine.front_axle, 0.0, zj)}</body>'
    )
    half, front_z, rear_z = g.track / 2, g.wheel_centre_height - zj, g.wheel_centre_height - zp
    payload = (
        f'<body name="payload">{_inertial(payload_mass, load.x, load.z, *(share * i for i in (load.ixx, load.iyy, load.izz)))}</body>'
        if payload_mass > 0.0
        else ""
    )
    return f"""
<mujoco>
  <option timestep="{step!r}" gravity="0 0 -9.81" integrator="Euler"><flag contact="disable" constraint="disable"/></option>
  <compiler angle="radian" boundinertia="0" balanceinertia="false"/>
  <worldbody>
    <body name="rear_frame"><freejoint name="root"/>{_body(machine.rear_frame, 0.0, zj)}
      <site name="imu" pos="{g.imu_x!r} 0 {g.imu_z - zj!r}"/>
      <body name="front_frame"><joint name="articulation" type="hinge" axis="0 0 1"/>{front or two}
        {wheel("fl", g.front_axle_x, half, front_z)}{wheel("fr", g.front_axle_x, -half, front_z)}
        <body name="lift_arm" pos="{lift.pivot_x!r} 0 {lift.pivot_z - zj!r}"><joint name="lift" type="hinge" axis="0 -1 0"/>
          {_body(machine.lift_arm, 0.0, 0.0)}
          <body name="bucket" pos="{lift.arm_length!r} 0 0"><joint name="tilt" type="hinge" axis="0 -1 0"/>
            {_body(machine.bucket, 0.0, 0.0)}{payload}
          </body>
        </body>
      </body>
      <body name="rear_axle" pos="{g.rear_axle_x!r} 0 {zp - zj!r}"><joint name="oscillation" type="hinge" axis="1 0 0"/>
        {_body(machine.rear_axle, g.rear_axle_x, zp)}
        {wheel("rl", 0.0, half, rear_z)}{wheel("rr", 0.0, -half, rear_z)}
      </body>
    </body>
  </worldbody>
  <sensor><accelerometer name="imu" site="imu"/></sensor>
</mujoco>"""


def without_reliefs(p: np.ndarray) -> np.ndarray:
    """The parameters, changed: cylinders that give whatever their rate takes, as the joints here do."""
    for servo_block in (P_STEERING, P_LIFT, P_TILT):
        p[servo_block + SERVO_RELIEF] = np.inf
    return p


class MujocoLoader:
    """The loader with MuJoCo's bodies, and the tyres of the parameter vector `p` where asked for."""

    def __init__(
        self,
        machine: Machine,
        p: np.ndarray,
        *,
        payload_mass: float = 0.0,
        step: float = 1e-3,
        front: str = "",
    ) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf(machine, payload_mass, step, front))
        self.data = mujoco.MjData(self.model)
        self.p = p
        self.step_s = step
        self.carry = machine.tilt.carry_angle
        self.tyres = np.zeros((4, s.T_OUTPUTS))
        self.slips = np.zeros((2, 4))
        self._wheel_bodies = [self.model.body(name).id for name in ("fl", "fr", "rl", "rr")]
        self.dof = {body: int(self.model.joint(name).dofadr[0]) for body, name in JOINTS.items()}
        self._qpos = {body: int(self.model.joint(name).qposadr[0]) for body, name in JOINTS.items()}
        self._driven = np.array([self.dof[body] for body in DRIVEN])
        free = np.setdiff1d(np.arange(self.model.nv), self._driven)
        self._free, self._free_free, self._free_driven = free, np.ix_(free, free), np.ix_(free, self._driven)
        self._origin, self._m = np.zeros(3), np.zeros((self.model.nv, self.model.nv))

    def set_state(self, state: np.ndarray) -> None:
        """Take over a state vector of the plant."""
        d = self.data
        d.qpos[:3] = state[s.POSITION : s.POSITION + 3]
        d.qpos[3:7] = state[s.ATTITUDE : s.ATTITUDE + 4]
        d.qvel[:3] = state[s.VELOCITY : s.VELOCITY + 3]
        d.qvel[3:6] = state[s.ANGULAR : s.ANGULAR + 3]
        for body in JOINTS:
            angle, rate = state[s.JOINT + body], state[s.JOINT_RATE + body]
            if body == s.BUCKET:  # here against the arm, and 0 as carried
                angle -= self.carry + state[s.JOINT + s.LIFT_ARM]
                rate -= state[s.JOINT_RATE + s.LIFT_ARM]
            d.qpos[self._qpos[body]], d.qvel[self.dof[body]] = angle, rate
        self.slips[0] = state[s.KAPPA : s.KAPPA + 4]
        self.slips[1] = state[s.TAN_ALPHA : s.TAN_ALPHA + 4]

    def joint(self, body: int) -> tuple[float, float]:
        """Angle and rate of a joint in the plant's convention."""
        angle, rate = self.data.qpos[self._qpos[body]], self.data.qvel[self.dof[body]]
        if body == s.BUCKET:
            arm_angle, arm_rate = self.joint(s.LIFT_ARM)
            return angle + self.carry + arm_angle, rate + arm_rate
        return float(angle), float(rate)

    def locate(self) -> None:
        """MuJoCo's kinematics, inertia and bias at its state."""
        mujoco.mj_step1(self.model, self.data)

    def roll_tyres(self, ahead: float | None = None) -> None:
        """Tyre forces at MuJoCo's state, in world axes; the transient slips move on by `ahead` [s], one step if not given.

        As in the plant, the forces belong to the slips at the end of `ahead`: with 0 they are the true ones of now.
        """
        d, p = self.data, self.p
        ahead = self.step_s if ahead is None else ahead
        normal = p[P_NORMAL : P_NORMAL + 3]
        velocity = np.zeros(6)
        for i, body in enumerate(self._wheel_bodies):
            centre = d.xpos[body].copy()
            mujoco.mj_objectVelocity(self.model, d, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            motion = velocity.copy()
            (wx, wy, wz), (x, y, z) = velocity[:3], centre
            motion[3:] -= wy * z - wz * y, wz * x - wx * z, wx * y - wy * x  # to the world's origin
            axle = d.xmat[body].reshape(3, 3)[:, 1].copy()
            block = p[P_WHEELS + i * WHEEL_SIZE : P_WHEELS + (i + 1) * WHEEL_SIZE]
            kappa, tan_alpha = self.slips[:, i]
            out = self.tyres[i]
            height = float(normal @ centre)
            wheel_contact(
                block,
                p[P_FRICTION],
                0.0,
                centre,
                height,
                axle,
                normal,
                motion,
                kappa,
                tan_alpha,
                ahead,
                out,
            )
        self.slips[0] += ahead * self.tyres[:, s.T_KAPPA_RATE]
        self.slips[1] += ahead * self.tyres[:, s.T_TAN_ALPHA_RATE]

    def applied(self, wheel_torque: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
        """Generalised force of wheel torques, oscillation stops and wrenches (moment about the world's origin, force)."""
        d = self.data
        total = np.zeros(self.model.nv)
        for i, body in enumerate(self._wheel_bodies):
            mujoco.mj_applyFT(self.model, d, wrenches[i, 3:], wrenches[i, :3], self._origin, body, total)
            total[self.dof[s.WHEEL + i]] += wheel_torque[i]
        total[self.dof[s.REAR_AXLE]] += stop_moment(*self.joint(s.REAR_AXLE), self.p)
        return total

    def demanded(self, articulation: float, lift: float, tilt: float) -> np.ndarray:
        """Accelerations of the driven joints, by the servo law at MuJoCo's state."""
        blocks = (
            (s.FRONT_FRAME, articulation, P_STEERING),
            (s.LIFT_ARM, lift, P_LIFT),
            (s.BUCKET, tilt, P_TILT),
        )
        turn, up, back = (
            servo(*self.joint(body), rate, self.p[at : at + SERVO_SIZE]) for body, rate, at in blocks
        )
        return np.array((turn, up, back - up))

    def solve(self, applied: np.ndarray, demanded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations of all joints and efforts of the driven ones, from MuJoCo's inertia and bias."""
        m = self._m
        mujoco.mj_fullM(self.model, self.data, m)
        rest = applied - self.data.qfrc_bias
        free, driven = self._free, self._driven
        qacc = np.zeros(self.model.nv)
        qacc[driven] = demanded
        qacc[free] = np.linalg.solve(m[self._free_free], rest[free] - m[self._free_driven] @ demanded)
        return qacc, m[driven] @ qacc - rest[driven]

    def step(self, applied: np.ndarray, efforts: np.ndarray) -> None:
        """MuJoCo's own step under these generalised forces."""
        self.data.qfrc_applied[:] = applied
        self.data.qfrc_applied[self._driven] += efforts
        mujoco.mj_step2(self.model, self.data)
