"""The tyre of the printed form: radius, slip, Magic Formula and single contact point of thesis 2.1-2.2.4.

What the cycle uses carries the repairs without which the formulae give no force at all or one of the wrong sign:
E-01 and E-02 (Magic Formula), E-03 (slip angle), E-06 (contact point), E-07 (reference length). The letter of the
print stands beside it, named `printed`.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import MagicFormula, Wheel


@compiled
def deflection(normal_force: float, stiffening: float, wheel: Wheel) -> float:
    """Radial deflection rho [m] under `normal_force` [N]: (118) with R0, solved for rho; 0 without load.

    stiffening: factor on (118) that the inflation pressure gives.
    """
    if normal_force <= 0.0:
        return 0.0
    q1, q2 = wheel.radial_linear, wheel.radial_quadratic
    load = normal_force / (wheel.nominal_load * stiffening)
    return 2.0 * load / (q1 + math.sqrt(q1 * q1 + 4.0 * q2 * load)) * wheel.unloaded_radius


@compiled
def effective_radius(loaded_radius: float, unloaded_radius: float) -> float:
    """Free-rolling radius r_e [m] (112); lies between the loaded and the unloaded radius (3)."""
    return 3.0 * loaded_radius / (1.0 + 2.0 * loaded_radius / unloaded_radius)


@compiled
def radius(normal: float, stiffening: float, wheel: Wheel) -> float:
    """Effective radius [m] under a normal force [N]."""
    loaded = wheel.unloaded_radius - deflection(normal, stiffening, wheel)
    return effective_radius(loaded, wheel.unloaded_radius)


@compiled
def slip(wheel_speed: float, radius: float, speed: float, low_speed: float) -> float:
    """Longitudinal slip kappa (5): positive driving, -1 locked, unbounded for a spinning wheel.

    wheel_speed [rad/s], effective radius [m], speed of the wheel centre [m/s]; below `low_speed` the
    slip is taken against `low_speed`, so that it stays finite at standstill.
    """
    return (wheel_speed * radius - speed) / max(abs(speed), low_speed)


@compiled
def magic_formula_shape(x: float, B: float, C: float, D: float, E: float) -> float:
    """y = D sin(C arctan(B x - E (B x - arctan(B x)))), (11) with its closing bracket."""
    bx = B * x
    return D * math.sin(C * math.atan(bx - E * (bx - math.atan(bx))))


@compiled
def shape_of_asymptote(asymptote: float, D: float) -> float:
    """C by (17) from the force that the curve goes to at large slip [N], on the branch above 1, which has a peak before it."""
    return 1.0 + (1.0 - 2.0 / math.pi * math.asin(asymptote / D))


@compiled
def curvature_of_peak(peak: float, B: float, C: float) -> float:
    """E by (20) that puts the largest force at the slip `peak`; C above 1, since a flatter curve has no peak."""
    bx = B * peak
    return (bx - math.tan(math.pi / (2.0 * C))) / (bx - math.atan(bx))


@compiled
def side_force_left_printed(longitudinal: float, friction: float, mass: float, gravity: float) -> float:
    """Lateral force [N] beside a longitudinal one by (10) as printed: every wheel has the grip of the whole machine's weight (E-04)."""
    most = friction * mass * gravity
    return math.sqrt(max(most * most - longitudinal * longitudinal, 0.0))


@compiled
def _longitudinal(
    slip: float, normal_force: float, df: float, dp: float, stiffness: float, m: MagicFormula
) -> float:
    """Force of (12)-(24) from the normalised changes of load and pressure and the slip stiffness."""
    shift = m.PHx1 + m.PHx2 * df
    x = slip + shift
    D = (m.PDx1 + m.PDx2 * df) * (1.0 + m.Ppx3 * dp + m.Ppx4 * dp * dp) * normal_force
    C = m.PCx1
    sign = (x > 0.0) - (x < 0.0)
    E = (m.PEx1 + m.PEx2 * df + m.PEx3 * df * df) * (1.0 - m.PEx4 * sign)
    if D == 0.0:  # (22) divides by it; where no friction is left only the vertical shift remains
        return normal_force * (m.PVx1 + m.PVx2 * df)
    B = stiffness / (C * D)
    return magic_formula_shape(x, B, C, D, E) + normal_force * (m.PVx1 + m.PVx2 * df)


@compiled
def magic_formula(slip: float, normal_force: float, pressure: float, m: MagicFormula) -> float:
    """Longitudinal force [N] at steady slip, load [N] and inflation pressure [Pa]; 0 without load.

    (11)-(24); df_z and dp_i are taken over the nominal values (E-01), the slip stiffness is linear
    in df_z and has both pressure terms (E-02).
    """
    if normal_force <= 0.0:
        return 0.0
    df = (normal_force - m.nominal_load) / m.nominal_load
    dp = (pressure - m.nominal_pressure) / m.nominal_pressure
    pressure_factor = 1.0 + m.Ppx1 * dp + m.Ppx2 * dp * dp
    stiffness = normal_force * (m.PKx1 + m.PKx2 * df) * math.exp(m.PKx3 * df) * pressure_factor
    return _longitudinal(slip, normal_force, df, dp, stiffness, m)


@compiled
def magic_formula_printed(slip: float, normal_force: float, pressure: float, m: MagicFormula) -> float:
    """The same as printed: df_z over the actual load, dp_i over the actual pressure, (16) with the
    square on df_z and P_px1 in both pressure terms. Parameters of one form are invalid in the other."""
    if normal_force <= 0.0:
        return 0.0
    df = (normal_force - m.nominal_load) / normal_force
    dp = (pressure - m.nominal_pressure) / pressure
    pressure_factor = 1.0 + m.Ppx1 * dp + m.Ppx1 * dp * dp
    stiffness = normal_force * (m.PKx1 + m.PKx2 * df * df) * math.exp(m.PKx3 * df) * pressure_factor
    return _longitudinal(slip, normal_force, df, dp, stiffness, m)


@compiled
def sideways(tangent: float, normal_force: float, wheel: Wheel) -> float:
    """`lateral_force` by the tangent of the slip angle."""
    if normal_force <= 0.0:
        return 0.0
    sliding = wheel.lateral_peak * normal_force
    s = wheel.cornering_stiffness / (3.0 * wheel.lateral_peak) * tangent
    if abs(s) >= 1.0:
        return sliding if s > 0.0 else -sliding
    return 3.0 * sliding * s * (1.0 - abs(s) + s * s / 3.0)


@compiled
def contact_point(u: float, slip_speed: float, speed: float, relaxation: float, dt: float) -> float:
    """Deflection u [m] after `dt` [s] of constant `slip_speed` = Omega r_e - V_x and `speed` [m/s].

    Exact solution of (33), regular at standstill; the transient slip is u / sigma (34).
    """
    x = abs(speed) * dt / relaxation
    if x < 1e-9:
        return u + slip_speed * dt
    decay = math.exp(-x)
    return u * decay + slip_speed * dt * (1.0 - decay) / x


@compiled
def contact_point_rate_printed(u: float, slip: float, speed: float, relaxation: float) -> float:
    """Rate by the middle member of (33) as printed: the slip that follows has the wrong sign."""
    return -abs(speed) * (slip + u / relaxation)
