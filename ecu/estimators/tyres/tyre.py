"""Tyre: rolling radius, slip, steady force (Magic Formula, brush), single contact point.

Source: thesis sections 2.1-2.2.4 and appendix C; equation numbers are the thesis'. Corrected forms.
Holds on a flat, hard surface without camber. Forces act from the road
on the tyre along the wheel's own axes.
"""

import math

from ecu.estimators.compiled import compiled, inlined
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
def radial_force(rho: float, stiffening: float, wheel: Wheel) -> float:
    """Normal force [N] at the deflection `rho` [m] (118); the reference length is R0, not r (E-07)."""
    ratio = rho / wheel.unloaded_radius
    load = wheel.radial_linear * ratio + wheel.radial_quadratic * ratio * ratio
    return wheel.nominal_load * stiffening * load


@compiled
def radial_stiffness(normal_force: float, stiffening: float, wheel: Wheel) -> float:
    """Slope of (118) [N/m] at the deflection that `normal_force` [N] gives."""
    ratio = deflection(normal_force, stiffening, wheel) / wheel.unloaded_radius
    slope = wheel.radial_linear + 2.0 * wheel.radial_quadratic * ratio
    return wheel.nominal_load * stiffening * slope / wheel.unloaded_radius


@compiled
def effective_radius(loaded_radius: float, unloaded_radius: float) -> float:
    """Free-rolling radius r_e [m] (112); lies between the loaded and the unloaded radius (3)."""
    return 3.0 * loaded_radius / (1.0 + 2.0 * loaded_radius / unloaded_radius)


@compiled
def slip(wheel_speed: float, radius: float, speed: float, low_speed: float) -> float:
    """Longitudinal slip kappa (5): positive driving, -1 locked, unbounded for a spinning wheel.

    wheel_speed [rad/s], effective radius [m], speed of the wheel centre [m/s]; below `low_speed` the
    slip is taken against `low_speed`, so that it stays finite at standstill.
    """
    return (wheel_speed * radius - speed) / max(abs(speed), low_speed)


@compiled
def driving_slip(wheel_speed: float, radius: float, speed: float, low_speed: float) -> float:
    """Slip against the rolling speed (6), for a driven wheel: kappa / (1 + kappa), below 1.

    Arguments as in `slip`; a wheel that hardly turns is taken to roll with `low_speed`.
    """
    rolling = wheel_speed * radius
    return (rolling - speed) / max(abs(rolling), low_speed)


@compiled
def slip_angle(longitudinal: float, lateral: float, low_speed: float) -> float:
    """Slip angle alpha [rad] from the speed of the wheel centre along the wheel's x and y [m/s].

    tan alpha = -V_y / |V_x| (E-03): a tyre that moves to its left is pushed to the right by
    F_y = C alpha, against its sliding; printed (7) with (9) would push it along.
    """
    return math.atan2(-lateral, max(abs(longitudinal), low_speed))


@compiled
def magic_formula_shape(x: float, B: float, C: float, D: float, E: float) -> float:
    """y = D sin(C arctan(B x - E (B x - arctan(B x)))), (11) with its closing bracket."""
    bx = B * x
    return D * math.sin(C * math.atan(bx - E * (bx - math.atan(bx))))


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
    E = min(E, 1.0)  # beyond it the curve turns over and changes its sign at large slip
    if D <= 0.0:  # extrapolated so far that no friction is left: the vertical shift alone
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
def brush(slip: float, normal_force: float, friction: float, stiffness: float) -> float:
    """Longitudinal force [N] of the brush model (28)-(32) for slip above -1.

    friction mu, stiffness C_Fkappa [N]; adhesion up to |sigma_x| = 1/theta_x, then mu F_z.
    """
    if normal_force <= 0.0:
        return 0.0
    sliding = friction * normal_force
    if slip <= -1.0:
        return -sliding
    s = stiffness / (3.0 * friction * normal_force) * slip / (1.0 + slip)
    if abs(s) >= 1.0:
        return sliding if s > 0.0 else -sliding
    return 3.0 * sliding * s * (1.0 - abs(s) + s * s / 3.0)


@compiled
def lateral_force(slip_angle: float, normal_force: float, wheel: Wheel) -> float:
    """Lateral force [N] of the brush model in the lateral direction; initial slope C_Falpha."""
    return sideways(math.tan(slip_angle), normal_force, wheel)


@inlined
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
def cornering_stiffness(normal_force: float, wheel: Wheel) -> float:
    """Cornering stiffness [N/rad] under a load [N]: it grows less than the load, as sin(2 arctan(load / load of the largest))."""
    largest = wheel.cornering_load * wheel.nominal_load
    load, nominal = max(normal_force, 0.0) / largest, 1.0 / wheel.cornering_load
    # sin(2 arctan x) = 2 x / (1 + x^2)
    grown = load / (1.0 + load * load) * (1.0 + nominal * nominal) / nominal
    return wheel.cornering_stiffness * wheel.nominal_load * grown


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
