"""Statics of the loader written again from the machine file: bodies, potential energy, closed forms."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from plant.sheets.machine import Machine

G = 9.81


def with_tyre(machine: Machine, **changes: float) -> Machine:
    """The machine on other tyres."""
    return replace(machine, tyre=replace(machine.tyre, **changes))


def linear_tyre(machine: Machine) -> Machine:
    """The machine on linear tyres: 750 kN/m in front, 600 kN/m behind (2.5 bar), as machine sheet 4 assumes."""
    stiffness = 750e3 * machine.tyre.radius / machine.tyre.nominal_load
    at_rear = machine.tyre.rear_pressure / machine.tyre.nominal_pressure - 1.0
    return with_tyre(machine, qfz1=stiffness, qfz2=0.0, pfz1=(600.0 / 750.0 - 1.0) / at_rear)


def _pitched(angle: float) -> np.ndarray:
    return Rotation.from_euler("y", -angle).as_matrix()


def bodies(machine: Machine, payload_mass: float, delta: float, lift: float, tilt: float, oscillation: float):
    """(mass, centre, inertia about the centre, rolls with the frame?) in rear-frame axes, from the ground below the joint."""
    g, zp = machine.geometry, machine.oscillation.pivot_height
    turn = Rotation.from_euler("z", delta).as_matrix()
    roll = Rotation.from_euler("x", oscillation).as_matrix()
    pivot = np.array((g.rear_axle_x, 0.0, zp))
    arm, bucket = turn @ _pitched(lift), turn @ _pitched(tilt - machine.tilt.carry_angle)
    foot = turn @ np.array((machine.lift.pivot_x, 0.0, machine.lift.pivot_z))
    pin = foot + arm @ np.array((machine.lift.arm_length, 0.0, 0.0))
    share = payload_mass / machine.payload.reference_mass

    def inertia(part, scale=1.0):
        return scale * np.diag((part.ixx, part.iyy, part.izz))

    def at(part):
        return np.array((part.x, 0.0, part.z))

    out = [(machine.rear_frame.mass, at(machine.rear_frame), inertia(machine.rear_frame), True)]
    fixed = (machine.front_frame, machine.front_axle)
    out += [(part.mass, turn @ at(part), turn @ inertia(part) @ turn.T, True) for part in fixed]
    out.append(
        (
            machine.lift_arm.mass,
            foot + arm @ at(machine.lift_arm),
            arm @ inertia(machine.lift_arm) @ arm.T,
            True,
        )
    )
    out.append(
        (
            machine.bucket.mass,
            pin + bucket @ at(machine.bucket),
            bucket @ inertia(machine.bucket) @ bucket.T,
            True,
        )
    )
    if payload_mass:
        load = machine.payload
        out.append((payload_mass, pin + bucket @ at(load), bucket @ inertia(load, share) @ bucket.T, True))
    axle = machine.rear_axle
    out.append((axle.mass, pivot + roll @ (at(axle) - pivot), roll @ inertia(axle) @ roll.T, False))
    w = machine.wheel
    symmetric = np.diag((w.transverse_inertia, w.spin_inertia, w.transverse_inertia))
    for i, centre in enumerate(wheel_centres(machine, delta, oscillation)):
        out.append((w.mass, centre, symmetric, i < 2))
    return out


def wheel_centres(machine: Machine, delta: float, oscillation: float) -> np.ndarray:
    """Wheel centres (4, 3), rear-frame axes, from the ground below the joint."""
    g, zp = machine.geometry, machine.oscillation.pivot_height
    turn = Rotation.from_euler("z", delta).as_matrix()
    roll = Rotation.from_euler("x", oscillation).as_matrix()
    sides = (g.track / 2, -g.track / 2)
    front = [turn @ np.array((g.front_axle_x, y, g.wheel_centre_height)) for y in sides]
    rear = [
        np.array((g.rear_axle_x, 0, zp)) + roll @ np.array((0, y, g.wheel_centre_height - zp)) for y in sides
    ]
    return np.array(front + rear)


def resting_loads(
    machine: Machine, payload_mass: float, delta: float, lift: float, tilt: float
) -> np.ndarray:
    """Normal forces (4) of the least potential energy over height, roll, pitch and oscillation."""
    tyre = machine.tyre
    axles = [Rotation.from_euler("z", delta).as_matrix()[:, 1]] * 2

    def deflections(x):
        height, roll, pitch, oscillation = x
        attitude = Rotation.from_euler("ZYX", (0.0, pitch, roll)).as_matrix()
        centres = wheel_centres(machine, delta, oscillation) @ attitude.T + (0, 0, height)
        leans = [attitude @ axle for axle in axles]
        leans += [attitude @ Rotation.from_euler("x", oscillation).as_matrix()[:, 1]] * 2
        upright = np.sqrt(1.0 - np.array([lean[2] for lean in leans]) ** 2)
        return tyre.radius - centres[:, 2] / upright, upright

    pressure = np.array([tyre.front_pressure] * 2 + [tyre.rear_pressure] * 2)
    scale = tyre.nominal_load * (1 + tyre.pfz1 * (pressure / tyre.nominal_pressure - 1))

    def energy(x):
        height, roll, pitch, oscillation = x
        attitude = Rotation.from_euler("ZYX", (0.0, pitch, roll)).as_matrix()
        gravity = sum(
            m * G * ((attitude @ c)[2] + height)
            for m, c, _, _ in bodies(machine, payload_mass, delta, lift, tilt, oscillation)
        )
        d = np.maximum(deflections(x)[0], 0.0) / tyre.radius
        return gravity + float(np.sum(scale * tyre.radius * (tyre.qfz1 * d**2 / 2 + tyre.qfz2 * d**3 / 3)))

    start = np.array((tyre.radius - 0.045 - machine.geometry.wheel_centre_height, 0, 0, 0))
    base = energy(start)
    found = minimize(
        lambda x: (energy(x) - base) / 1e3, start, method="BFGS", options={"gtol": 1e-9, "xrtol": 1e-12}
    )
    deflection, upright = deflections(found.x)
    d = np.maximum(deflection, 0.0) / tyre.radius
    return scale * (tyre.qfz1 * d + tyre.qfz2 * d**2) / upright
