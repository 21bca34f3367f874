"""One cycle of the estimators as the thesis prints them: inputs and state in, estimates and new state out."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.inclination import Slope, lean_at_start, leaned, without
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.estimators.printed import normal_force, turning, tyre
from ecu.estimators.printed.centre import front_unit_printed, machine_centre_repaired
from ecu.estimators.printed.motion import printed_acceleration, wheel_acceleration, yaw_rate_of_angle
from ecu.estimators.printed.payload import standing_payload
from ecu.estimators.printed.rollover import four_wheel_load_transfer, front_load_transfer, printed_margin
from ecu.estimators.printed.state import PrintedState
from ecu.estimators.printed.wheels import force_of_slip, slips_of_rolling
from ecu.estimators.quantities import Centre, NormalForces, WheelForces
from ecu.estimators.signals import NEVER, Estimates, Inputs


@compiled
def followed_payload(i: Inputs, s: PrintedState, p: Parameters) -> float:
    """Payload [kg] through a first-order filter; the last one while the pressures are not usable."""
    if i.pressure_usable == 0.0:
        return s.payload
    share = i.dt / (p.cylinders.settling_time + i.dt) if s.cycles != 0.0 else 1.0
    return s.payload + (standing_payload(i, p) - s.payload) * share


@compiled
def wheel_accelerations(i: Inputs, s: PrintedState, time: float) -> tuple[float, float, float, float]:
    """Angular accelerations of the wheels [rad/s2]; 0 in the first cycle."""
    if s.cycles == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return (
        wheel_acceleration(s.wheel_speed_1, i.wheel_speed_1, s.wheel_acceleration_1, i.dt, time),
        wheel_acceleration(s.wheel_speed_2, i.wheel_speed_2, s.wheel_acceleration_2, i.dt, time),
        wheel_acceleration(s.wheel_speed_3, i.wheel_speed_3, s.wheel_acceleration_3, i.dt, time),
        wheel_acceleration(s.wheel_speed_4, i.wheel_speed_4, s.wheel_acceleration_4, i.dt, time),
    )


@compiled
def loads(
    centre: Centre, angle: float, ax: float, ay_right: float, pitch: float, roll: float, p: Parameters
) -> NormalForces:
    """Normal forces by the printed balances, on wheels at this articulation angle [rad]."""
    g = p.geometry
    return normal_force.printed_normal_forces(
        centre.mass, centre.z, normal_force.printed_arms(centre, angle, g), ax, ay_right, pitch, roll, GRAVITY,
        p.axle.mass, p.axle.height, g.rear_track / 2.0, g.pivot_height,
    )  # fmt: skip


@compiled
def slope_without_lean(
    i: Inputs, s: PrintedState, v: float, ahead: float, time: float
) -> tuple[Slope, Slope]:
    """The slope, and what accelerations add to the sensor's next reading. The thesis has no such sensor: its slope is known."""
    aside = v * i.yaw_rate
    lean = lean_at_start(aside) if s.cycles == 0.0 else Slope(s.pitch_lean, s.roll_lean)
    slope = without(Slope(i.pitch, i.roll), lean)
    return slope, leaned(lean, slope, ahead, aside, i.dt, time)


@compiled
def forces_of_slips(
    s: PrintedState, slips: WheelForces, v: float, n: NormalForces, dt: float, p: Parameters
) -> tuple[WheelForces, WheelForces]:
    """Deflections of the contact points [m], as x1..x4, and forces of the tyres."""
    w, m = p.wheel, p.magic_formula
    front, rear = w.front_pressure, w.rear_pressure
    u1, x1 = force_of_slip(s.deflection_1, slips.x1, v, n.front_left, front, dt, w, m)
    u2, x2 = force_of_slip(s.deflection_2, slips.x2, v, n.front_right, front, dt, w, m)
    u3, x3 = force_of_slip(s.deflection_3, slips.x3, v, n.rear_left, rear, dt, w, m)
    u4, x4 = force_of_slip(s.deflection_4, slips.x4, v, n.rear_right, rear, dt, w, m)
    y1 = tyre.sideways(slips.y1, n.front_left, w)
    y2 = tyre.sideways(slips.y2, n.front_right, w)
    y3 = tyre.sideways(slips.y3, n.rear_left, w)
    y4 = tyre.sideways(slips.y4, n.rear_right, w)
    return WheelForces(u1, u2, u3, u4, 0.0, 0.0, 0.0, 0.0), WheelForces(x1, x2, x3, x4, y1, y2, y3, y4)


@compiled
def printed(i: Inputs, s: PrintedState, p: Parameters) -> tuple[Estimates, PrintedState]:
    """One cycle.

    Centre of gravity by (36)-(42) (its sign clash and its y balance repaired, E-09, E-10), acceleration
    as in 2.5, normal forces by the printed balances (71)-(87), tyre forces from slip, turning moment by
    (93), (94). There is no prediction: lift-off is reported when the estimate has got there, and nothing is limited.
    """
    g, w, d, drive = p.geometry, p.wheel, i.articulation_angle, p.linkage_drive
    load = followed_payload(i, s, p)
    w1, w2, w3, w4 = wheel_accelerations(i, s, p.sensors.wheel_time)
    rolling = tyre.radius(w.nominal_load, 1.0, w)
    v = (i.wheel_speed_1 + i.wheel_speed_2 + i.wheel_speed_3 + i.wheel_speed_4) / 4.0 * rolling
    ax, ay_right = printed_acceleration((w1 + w2 + w3 + w4) / 4.0 * rolling, -d)

    unit = front_unit_printed(i.lift_arm_angle, load, p.front, p.arm, p.bucket)
    centre = machine_centre_repaired(d, unit, p.rear)
    slope, lean = slope_without_lean(i, s, v, ax, p.sensors.slope_levelling)
    n = loads(centre, d, ax, ay_right, -slope.pitch, -slope.roll, p)
    # the reference: straight wheels, but the centre of gravity of the present articulation
    margin = printed_margin(n, loads(centre, 0.0, 0.0, 0.0, 0.0, 0.0, p))
    lift_off = 0.0 if margin.ratio <= 0.0 else NEVER
    transfer = four_wheel_load_transfer(n)

    yaw = yaw_rate_of_angle(v, d, g)
    slips = slips_of_rolling(i, yaw, v, n, w, g)
    u, forces = forces_of_slips(s, slips, v, n, i.dt, p)
    turn = turning.yaw_moment_printed(forces, centre.x, centre.y, d, g)

    estimates = Estimates(
        normal_1=n.front_left,
        normal_2=n.front_right,
        normal_3=n.rear_left,
        normal_4=n.rear_right,
        longitudinal_1=forces.x1,
        longitudinal_2=forces.x2,
        longitudinal_3=forces.x3,
        longitudinal_4=forces.x4,
        lateral_1=forces.y1,
        lateral_2=forces.y2,
        lateral_3=forces.y3,
        lateral_4=forces.y4,
        slip_1=slips.x1,
        slip_2=slips.x2,
        slip_3=slips.x3,
        slip_4=slips.x4,
        tyre_model_1=forces.x1,
        tyre_model_2=forces.x2,
        tyre_model_3=forces.x3,
        tyre_model_4=forces.x4,
        load_transfer_ratio=transfer,
        front_load_transfer_ratio=front_load_transfer(n),
        predicted_load_transfer_ratio=transfer,
        lift_off_margin=margin.ratio,
        lift_off_wheel=margin.wheel,
        predicted_margin=margin.ratio,
        time_to_lift_off=lift_off,
        lifting_wheel=margin.wheel,
        yaw_moment=turn,
        joint_torque=turn,  # the thesis compares one with the other
        yaw_rate=yaw,
        speed=v,
        specific_force_x=ax - GRAVITY * math.sin(slope.pitch),
        specific_force_y=-ay_right + GRAVITY * math.sin(slope.roll),
        specific_force_z=GRAVITY * math.cos(slope.pitch) * math.cos(slope.roll),
        slope_pitch=slope.pitch,
        slope_roll=slope.roll,
        payload=load,
        permitted_rate=p.prediction.largest_rate,
        permitted_direction=0.0,
        permitted_speed=p.prediction.largest_speed,
        # The thesis does not limit the linkage: every motion in its turn gets more than its drive can do.
        permitted_lever=max(drive.lift_up, drive.lift_down, drive.tilt_back, drive.tilt_forward),
        permitted_motion=s.cycles % 4.0,
        load_gap=0.0,  # the thesis does not ask whether its loads agree with each other
        load_contradiction=0.0,
        speed_doubt=0.0,  # the thesis takes wheels to roll
        normal_1_sd=0.0,
        normal_2_sd=0.0,
        normal_3_sd=0.0,
        normal_4_sd=0.0,
        load_transfer_ratio_sd=0.0,
        payload_sd=0.0,
    )
    return estimates, PrintedState(
        s.cycles + 1.0, load, i.wheel_speed_1, i.wheel_speed_2, i.wheel_speed_3, i.wheel_speed_4,
        w1, w2, w3, w4, u.x1, u.x2, u.x3, u.x4, lean.pitch, lean.roll,
    )  # fmt: skip
