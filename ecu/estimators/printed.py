"""One cycle of the estimators as the thesis has them, for comparison."""

import math

from ecu.estimators import normal_force, rollover, turning, tyre
from ecu.estimators.acceleration import printed_acceleration, yaw_rate
from ecu.estimators.cog import front_unit_printed, machine_centre
from ecu.estimators.compiled import compiled
from ecu.estimators.contact import Tilt
from ecu.estimators.motion import motion
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.estimators.payload import BucketLoad, standing_payload
from ecu.estimators.rollover import NEVER
from ecu.estimators.signals import Estimates, Inputs, State
from ecu.estimators.state import next_state
from ecu.estimators.turning import WheelForces
from ecu.estimators.wheels import radius, transient_forces, wheel_slips


@compiled
def printed(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle of the estimators as the thesis has them, for comparison.

    Centre of gravity by (36)-(42) (its sign clash and its y balance repaired, E-09, E-10), acceleration
    as in 2.5, normal forces by the printed balances (71)-(87), tyre forces from slip, turning moment by
    (93), (94). There is no prediction: lift-off is reported when the estimate has got there.
    """
    g, w = p.geometry, p.wheel
    m = motion(i, s, p)
    d = i.articulation_angle
    load = s.payload
    if i.pressure_usable != 0.0:
        fresh = standing_payload(i, GRAVITY, p)
        share = i.dt / (p.cylinders.settling_time + i.dt) if s.cycles != 0.0 else 1.0
        load += (fresh - load) * share
    front = front_unit_printed(i.lift_arm_angle, load, p.front, p.arm, p.bucket)
    centre = machine_centre(d, front, p.rear)

    radius_nominal = radius(w.nominal_load, 1.0, w)
    v = (i.wheel_speed_1 + i.wheel_speed_2 + i.wheel_speed_3 + i.wheel_speed_4) / 4.0 * radius_nominal
    rate = (
        m.wheel_acceleration_1 + m.wheel_acceleration_2 + m.wheel_acceleration_3 + m.wheel_acceleration_4
    ) / 4.0
    dv = rate * radius_nominal
    ax, ay = printed_acceleration(dv, -d)  # y to the right, as delta in the thesis
    arms = normal_force.printed_arms(centre, d, g)
    n = normal_force.printed_normal_forces(
        centre.mass, centre.z, arms, ax, ay, -i.pitch, -i.roll, GRAVITY,
        p.axle.mass, p.axle.height, g.rear_track / 2.0, g.pivot_height,
    )  # fmt: skip

    standing_arms = normal_force.printed_arms(centre, 0.0, g)
    straight = normal_force.printed_normal_forces(
        centre.mass, centre.z, standing_arms, 0.0, 0.0, 0.0, 0.0, GRAVITY,
        p.axle.mass, p.axle.height, g.rear_track / 2.0, g.pivot_height,
    )  # fmt: skip
    now = rollover.margin(n, straight)
    lift_off = 0.0 if now.ratio <= 0.0 else NEVER

    yaw = yaw_rate(v, d, 0.0, g)
    slips = wheel_slips(i, yaw, v, 0.0, n, w, g)
    deflections, x = transient_forces(s, slips, v, n, i.dt, w, p.magic_formula)
    y1 = tyre.sideways(slips.y1, n.front_left, w)
    y2 = tyre.sideways(slips.y2, n.front_right, w)
    y3 = tyre.sideways(slips.y3, n.rear_left, w)
    y4 = tyre.sideways(slips.y4, n.rear_right, w)
    forces = WheelForces(x.x1, x.x2, x.x3, x.x4, y1, y2, y3, y4)
    turn = turning.yaw_moment_printed(forces, centre.x, centre.y, d, g)

    transfer = rollover.load_transfer_ratio(n)
    estimates = Estimates(
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        x.x1, x.x2, x.x3, x.x4, y1, y2, y3, y4, slips.x1, slips.x2, slips.x3, slips.x4, x.x1, x.x2, x.x3, x.x4,
        transfer, transfer, now.ratio, now.wheel, now.ratio, lift_off, now.wheel, turn, turn, yaw, v,
        ax - GRAVITY * math.sin(i.pitch), -ay + GRAVITY * math.sin(i.roll), GRAVITY * math.cos(i.pitch) * math.cos(i.roll),
        load, p.prediction.largest_rate, p.prediction.largest_speed,
    )  # fmt: skip
    none = Tilt(0.0, 0.0)
    on_bucket = BucketLoad(load, 0.0, load, 0.0, 0.0, 0.0, 0.0, 0.0)
    return estimates, next_state(i, s, m, on_bucket, v, v, dv, n, forces, deflections, 0.0, none, none)
