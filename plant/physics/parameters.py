"""The plant's parameters as one vector with named indices, made from machine, road and payload.

The compiled dynamics read numbers only here. Per-body and per-wheel values come in blocks, so that
each wheel may have its own tyre. Lengths are from the articulation joint (z = 0 at its reference
height) or, for bodies that turn, from the origin of their own axes.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.effects.registry import python_hook
from plant.physics.linkage import LINKAGE, linkage_of
from plant.physics.relief_guard import GUARD, guard_of
from plant.physics.steering import STEERING, cylinders_of
from plant.physics.surface import Surface
from plant.sheets.machine import Body, Machine, Tyre

GRAVITY_VALUE: Final = 9.81  # the value of the thesis, not 9.80665 [m/s2]

# Body block: mass, centre (3), inertia about the centre xx, yy, zz, xy, xz, yz.
BODY_SIZE: Final = 10
B_REAR_FRAME: Final = 0
B_FRONT_FRAME: Final = 10
B_REAR_AXLE: Final = 20
B_LIFT_ARM: Final = 30
B_BUCKET: Final = 40

P_GRAVITY: Final = 50
P_NORMAL: Final = 51  # road normal in the world (3)
P_FRICTION: Final = 54  # friction over the tyre's nominal one
P_OSCILLATION_X: Final = 55
P_OSCILLATION_Z: Final = 56
P_STOP_ANGLE: Final = 57
P_STOP_STIFFNESS: Final = 58
P_STOP_DAMPING: Final = 59
P_LIFT_X: Final = 60
P_LIFT_Z: Final = 61
P_ARM_LENGTH: Final = 62
P_CARRY_TILT: Final = 63
# Rate servo block: lower and upper limit, lowering and raising rate limit, lag, cushion lag, relief pressure.
SERVO_LOWER: Final = 0
SERVO_UPPER: Final = 1
SERVO_LAG: Final = 4
SERVO_RELIEF: Final = 6
SERVO_SIZE: Final = 7
P_STEERING: Final = 64
P_LIFT: Final = 71
P_TILT: Final = 78
P_DRIVE_LAG: Final = 85
P_DRIVE_RATE: Final = 86
P_BRAKE_LAG: Final = 87
P_BRAKE_CAPACITY: Final = 88
P_SHAFT: Final = 89  # 1 where a shaft drives both axles, 0 with a motor at each wheel
P_SHAFT_STIFFNESS: Final = 90
P_SHAFT_DAMPING: Final = 91

# Wheel block.
P_WHEELS: Final = 92
W_MASS: Final = 0
W_SPIN: Final = 1
W_TRANSVERSE: Final = 2
W_CENTRE: Final = 3  # (3) in its carrier's axes: front frame from the joint, rear axle from the pivot
W_PEAK_TORQUE: Final = 6
W_RADIUS: Final = 7
W_NOMINAL_LOAD: Final = 8
W_QFZ1: Final = 9  # with the pressure's effect, as W_QFZ2 and both stiffnesses of the carcass
W_QFZ2: Final = 10
W_DAMPING: Final = 11
W_PRESSURE: Final = 12  # relative change from nominal
W_PKX1: Final = 13
W_PKX2: Final = 14
W_PKX3: Final = 15
W_PCX1: Final = 16
W_PDX1: Final = 17
W_PDX2: Final = 18
W_PEX1: Final = 19
W_PPX1: Final = 20
W_PPX2: Final = 21
W_PPX3: Final = 22
W_PPX4: Final = 23
W_PKY1: Final = 24
W_PKY2: Final = 25
W_PCY1: Final = 26
W_PDY1: Final = 27
W_PDY2: Final = 28
W_PEY1: Final = 29
W_RBX1: Final = 30
W_RBX2: Final = 31
W_RCX1: Final = 32
W_REX1: Final = 33
W_RBY1: Final = 34
W_RBY2: Final = 35
W_RCY1: Final = 36
W_QBZ1: Final = 37
W_QCZ1: Final = 38
W_QDZ1: Final = 39
W_QDZ2: Final = 40
W_LONGITUDINAL_STIFFNESS: Final = 41
W_LATERAL_STIFFNESS: Final = 42
W_SHORTEST_RELAXATION: Final = 43
W_CARCASS_DAMPING: Final = 44
W_CARCASS_DAMPING_SPEED: Final = 45
W_ADDED_LOAD: Final = 46  # radial force beside spring and damper [N]
W_PEX2: Final = 47
W_PEX3: Final = 48
W_PEX4: Final = 49
W_PEY2: Final = 50
W_ADDED_SLIDING_X: Final = 51  # of the contact patch beside the rigid wheel's, along the heading [m/s]
W_ADDED_SLIDING_Y: Final = 52  # and across it
W_PPY1: Final = 53
W_PPY2: Final = 54
W_PPY3: Final = 55
W_PPY4: Final = 56
WHEEL_SIZE: Final = 57

P_LINKAGE: Final = P_WHEELS + 4 * WHEEL_SIZE  # plant.physics.linkage
P_CYLINDERS: Final = P_LINKAGE + LINKAGE  # plant.physics.steering
P_GUARD: Final = P_CYLINDERS + STEERING  # plant.physics.relief_guard
PARAMETERS: Final = P_GUARD + GUARD

_FROM_TYRE = {
    W_RADIUS: "radius",
    W_NOMINAL_LOAD: "nominal_load",
    W_DAMPING: "damping",
    **{
        W_PKX1 + i: name
        for i, name in enumerate(
            ["pkx1", "pkx2", "pkx3", "pcx1", "pdx1", "pdx2", "pex1", "ppx1", "ppx2", "ppx3", "ppx4"]
        )
    },
    **{W_PKY1 + i: name for i, name in enumerate(["pky1", "pky2", "pcy1", "pdy1", "pdy2", "pey1"])},
    **{
        W_RBX1 + i: name
        for i, name in enumerate(
            ["rbx1", "rbx2", "rcx1", "rex1", "rby1", "rby2", "rcy1", "qbz1", "qcz1", "qdz1", "qdz2"]
        )
    },
    **{W_PEX2 + i: name for i, name in enumerate(["pex2", "pex3", "pex4", "pey2"])},
    **{W_PPY1 + i: name for i, name in enumerate(["ppy1", "ppy2", "ppy3", "ppy4"])},
    W_LONGITUDINAL_STIFFNESS: "longitudinal_stiffness",
    W_LATERAL_STIFFNESS: "lateral_stiffness",
    W_QFZ1: "qfz1",
    W_QFZ2: "qfz2",
    W_SHORTEST_RELAXATION: "shortest_relaxation",
    W_CARCASS_DAMPING: "carcass_damping",
    W_CARCASS_DAMPING_SPEED: "carcass_damping_speed",
}


def parameter_vector(machine: Machine, surface: Surface, payload_mass: float) -> NDArray[np.float64]:
    """All parameters of the compiled dynamics, shape (PARAMETERS,)."""
    p = np.zeros(PARAMETERS)
    _bodies(p, machine, payload_mass)
    p[P_GRAVITY] = GRAVITY_VALUE
    p[P_NORMAL : P_NORMAL + 3] = surface.axes()[:, 2]
    p[P_FRICTION] = surface.friction / machine.tyre.nominal_friction
    joint = machine.geometry.joint_height
    p[P_OSCILLATION_X] = machine.geometry.rear_axle_x
    p[P_OSCILLATION_Z] = machine.oscillation.pivot_height - joint
    p[P_STOP_ANGLE] = machine.oscillation.limit
    p[P_STOP_STIFFNESS] = machine.oscillation.stop_stiffness
    p[P_STOP_DAMPING] = machine.oscillation.stop_damping
    p[P_LIFT_X] = machine.lift.pivot_x
    p[P_LIFT_Z] = machine.lift.pivot_z - joint
    p[P_ARM_LENGTH] = machine.lift.arm_length
    p[P_CARRY_TILT] = machine.tilt.carry_angle
    _servos(p, machine)
    p[P_LINKAGE : P_LINKAGE + LINKAGE] = linkage_of(machine.lift, machine.tilt)
    p[P_CYLINDERS : P_CYLINDERS + STEERING] = cylinders_of(machine.steering)
    p[P_DRIVE_LAG] = machine.drive.time_constant
    p[P_DRIVE_RATE] = machine.drive.rate_limit
    p[P_SHAFT] = 1.0 if machine.driveline.layout == "shaft" else 0.0
    p[P_SHAFT_STIFFNESS] = machine.driveline.stiffness
    p[P_SHAFT_DAMPING] = machine.driveline.damping
    p[P_BRAKE_LAG] = machine.brake.time_constant
    p[P_BRAKE_CAPACITY] = machine.brake.capacity
    for wheel in range(4):
        _wheel(p[P_WHEELS + wheel * WHEEL_SIZE : P_WHEELS + (wheel + 1) * WHEEL_SIZE], machine, wheel)
    for item in machine.effects:
        prepare = python_hook(item.effect, "prepare")
        if prepare is not None:
            prepare(item.named, p, machine)
    servos = p[P_STEERING : P_STEERING + 3 * SERVO_SIZE].reshape(3, SERVO_SIZE)
    p[P_GUARD : P_GUARD + GUARD] = guard_of(
        servos[:, SERVO_LOWER : SERVO_UPPER + 1],
        servos[:, SERVO_RELIEF],
        p[P_LINKAGE : P_LINKAGE + LINKAGE],
        p[P_CYLINDERS : P_CYLINDERS + STEERING],
    )
    return p


def _block(body: Body, origin: tuple[float, float]) -> NDArray[np.float64]:
    """The block of one body whose axes start at `origin` (x, z)."""
    x, z = body.x - origin[0], body.z - origin[1]
    return np.array([body.mass, x, 0.0, z, body.ixx, body.iyy, body.izz, 0.0, 0.0, 0.0])


def joined(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The block of two bodies that are fixed to each other, by the parallel axis theorem."""
    mass = a[0] + b[0]
    centre = (a[0] * a[1:4] + b[0] * b[1:4]) / mass
    out = np.concatenate(([mass], centre, a[4:] + b[4:]))
    for part in (a, b):
        x, y, z = part[1:4] - centre
        out[4:] += part[0] * np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
    return out


def _bodies(p: NDArray[np.float64], machine: Machine, payload_mass: float) -> None:
    joint = (0.0, machine.geometry.joint_height)
    p[B_REAR_FRAME : B_REAR_FRAME + BODY_SIZE] = _block(machine.rear_frame, joint)
    p[B_FRONT_FRAME : B_FRONT_FRAME + BODY_SIZE] = joined(
        _block(machine.front_frame, joint), _block(machine.front_axle, joint)
    )
    pivot = (machine.geometry.rear_axle_x, machine.oscillation.pivot_height)
    p[B_REAR_AXLE : B_REAR_AXLE + BODY_SIZE] = _block(machine.rear_axle, pivot)
    p[B_LIFT_ARM : B_LIFT_ARM + BODY_SIZE] = _block(machine.lift_arm, (0.0, 0.0))
    bucket = _block(machine.bucket, (0.0, 0.0))
    if payload_mass > 0.0:
        load = machine.payload
        share = payload_mass / load.reference_mass
        block = np.array([payload_mass, load.x, 0.0, load.z, load.ixx, load.iyy, load.izz, 0.0, 0.0, 0.0])
        block[4:] *= share
        bucket = joined(bucket, block)
    p[B_BUCKET : B_BUCKET + BODY_SIZE] = bucket


def _servos(p: NDArray[np.float64], machine: Machine) -> None:
    steering, lift, tilt = machine.steering, machine.lift, machine.tilt
    rest = (
        (part.time_constant, part.cushion_time_constant, part.relief_pressure)
        for part in (steering, lift, tilt)
    )
    p[P_STEERING : P_STEERING + SERVO_SIZE] = (
        -steering.limit,
        steering.limit,
        steering.rate_limit,
        steering.rate_limit,
        *next(rest),
    )
    p[P_LIFT : P_LIFT + SERVO_SIZE] = (
        lift.lower_limit,
        lift.upper_limit,
        lift.lower_rate_limit,
        lift.raise_rate_limit,
        *next(rest),
    )
    p[P_TILT : P_TILT + SERVO_SIZE] = (
        tilt.lower_limit,
        tilt.upper_limit,
        tilt.rate_limit,
        tilt.rate_limit,
        *next(rest),
    )


def _wheel(w: NDArray[np.float64], machine: Machine, wheel: int) -> None:
    front, left = wheel < 2, wheel % 2 == 0
    geometry, tyre = machine.geometry, machine.tyre
    w[W_MASS] = machine.wheel.mass
    w[W_SPIN] = machine.wheel.spin_inertia
    w[W_TRANSVERSE] = machine.wheel.transverse_inertia
    origin = geometry.joint_height if front else machine.oscillation.pivot_height
    x = geometry.front_axle_x if front else 0.0
    y = geometry.track / 2.0 if left else -geometry.track / 2.0
    w[W_CENTRE : W_CENTRE + 3] = (x, y, geometry.wheel_centre_height - origin)
    w[W_PEAK_TORQUE] = machine.drive.front_peak_torque if front else machine.drive.rear_peak_torque
    _tyre(w, tyre, tyre.front_pressure if front else tyre.rear_pressure)


def _tyre(w: NDArray[np.float64], tyre: Tyre, pressure: float) -> None:
    for index, name in _FROM_TYRE.items():
        w[index] = getattr(tyre, name)
    change_pressure(w, tyre, pressure - tyre.nominal_pressure)


def change_pressure(w: NDArray[np.float64], tyre: Tyre, change: float) -> None:
    """Change the inflation pressure of a wheel's block by `change` [bar]: radial and carcass stiffness follow linearly."""
    # relative to the pressure before, because several effects may change the pressure one after the other
    before = w[W_PRESSURE]
    w[W_PRESSURE] += change / tyre.nominal_pressure
    for index, slope in (
        (W_QFZ1, tyre.pfz1),
        (W_QFZ2, tyre.pfz1),
        (W_LONGITUDINAL_STIFFNESS, tyre.pcfx3),
        (W_LATERAL_STIFFNESS, tyre.pcfy3),
    ):
        w[index] *= (1.0 + slope * w[W_PRESSURE]) / (1.0 + slope * before)
