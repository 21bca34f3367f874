"""The ring on its sidewalls and the cams that envelop: statics, modes, relaxation, dissipation, geometry."""

import math

import numpy as np
import pytest

from configuration import ConfigurationError
from plant.effects import find_effect
from plant.effects.dispatch import _first_states
from plant.effects.library.enveloped_step import cam_lift, enveloped
from plant.effects.registry import modules
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.parameters import P_WHEELS, W_LONGITUDINAL_STIFFNESS, WHEEL_SIZE
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from tests.plant.effects.trial import L60, machine

RING = machine("wheel_rigid_ring")
OWN = _first_states(modules())["wheel_rigid_ring"]
MASS, INERTIA, IN_PLANE, LATERAL, WIND_UP, DAMPING = (
    p.typical for p in find_effect("wheel_rigid_ring").parameters
)
LOCKED = Commands(brake_torque=(30e3,) * 4)


def omega(hertz):
    return 2.0 * math.pi * hertz


@pytest.mark.parametrize("payload", [0.0, 3204.0])
@pytest.mark.parametrize("surface", [Surface(), Surface(grade=0.15, bank=-0.1)])
def test_at_rest_the_tyre_is_the_plain_one_and_stays_at_rest(payload, surface):
    """Loads, and what each tyre is pressed in: 1e-6, the rest that the solver finds; in a second after it less than 0.02 mm."""
    plain, ring = (Plant(given, surface, payload_mass=payload) for given in (L60, RING))
    for name in ("normal_force", "tyre_deflection", "lateral_force", "longitudinal_force"):
        a, b = getattr(plain.truth(), name), getattr(ring.truth(), name)
        scale = np.abs(plain.truth().normal_force).max() if name.endswith("force") else 0.05
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-6 * scale)
    before = ring.truth().position.copy()
    ring.advance(LOCKED, 1.0)
    np.testing.assert_allclose(ring.truth().position, before, rtol=0, atol=2e-5)


def test_the_belts_weigh_with_the_machine():
    """Its centre of gravity and its loads are those of the plain machine."""
    seen = []
    for given in (L60, RING):
        plant = Plant(given, payload_mass=1000.0)
        state, p, work, active, _ = plant.inside()
        derivative(state, plant._command, p, 0.0, work, active)
        seen.append(work.whole.copy())
    np.testing.assert_allclose(seen[1], seen[0], rtol=1e-9, atol=1e-9)


def jacobian(plant, indices, lift=0.0):
    """Derivative of the rates of these states by themselves, about the state with all rings just moving."""
    state, p, work, active, _ = plant.inside()
    state[s.POSITION + 2] += lift
    state[OWN + 3 : OWN + 32 : 8] = 1e-9
    state[s.STICK : s.STICK + 4] = 0.0
    command = np.zeros(s.COMMANDS)

    def rates(change):
        trial = state.copy()
        trial[indices] += change
        derivative(trial, command, p, 0.0, work, active)
        return work.rate[indices].copy()

    steps = np.eye(len(indices)) * 1e-7
    return np.column_stack([(rates(step) - rates(-step)) / 2e-7 for step in steps])


def modes(matrix):
    """Frequency [Hz] and damping ratio of the oscillating modes, lowest first."""
    roots = np.linalg.eigvals(matrix)
    kept = sorted((root for root in roots if root.imag > 1.0), key=abs)
    return [(abs(root) / (2.0 * math.pi), -root.real / abs(root)) for root in kept]


def test_a_wheel_in_the_air_rings_at_the_frequencies_that_were_asked_for():
    """Rim held by its brake: wind-up to 0.2 %. The rim's body gives way to the rest: at most 8 % above, never below."""
    found = modes(jacobian(Plant(RING), list(range(OWN, OWN + 8)), lift=2.0))
    assert len(found) == 4
    frequencies = np.array([frequency for frequency, _ in found])
    assert np.abs(frequencies[:2] / WIND_UP - 1.0).min() < 2e-3  # one of the two lowest
    for frequency in (LATERAL, IN_PLANE):
        assert np.any((frequencies >= 0.999 * frequency) & (frequencies <= 1.08 * frequency))
    for frequency, ratio in found:
        assert ratio == pytest.approx(DAMPING, rel=0.1), frequency


def test_on_the_road_the_modes_are_those_of_belt_and_contact_patch():
    """Eigen-analysis by hand of belt ahead and wind-up on sidewalls and on the patch's spring and damper, rim held.

    3 %: the machine gives way a little, and the radius that rolls is taken from the loaded one.
    """
    plant = Plant(RING)
    found = modes(jacobian(plant, [OWN, OWN + 3, OWN + 6, OWN + 7, s.KAPPA]))
    block = plant._parameters[P_WHEELS : P_WHEELS + WHEEL_SIZE]
    patch, damp = block[W_LONGITUDINAL_STIFFNESS], L60.tyre.carcass_damping
    loaded = L60.tyre.radius - plant.truth().tyre_deflection[0]
    r = 3.0 * loaded / (1.0 + 2.0 * loaded / L60.tyre.radius)
    k, k_t = MASS * omega(IN_PLANE) ** 2, INERTIA * omega(WIND_UP) ** 2
    c, c_t = 2 * DAMPING * MASS * omega(IN_PLANE), 2 * DAMPING * INERTIA * omega(WIND_UP)
    touch = np.array(((1.0, -r), (-r, r * r)))
    m = np.diag((MASS, INERTIA))
    stiff = np.diag((k, k_t)) + patch * touch
    lossy = np.diag((c, c_t)) + damp * touch
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(m, stiff), -np.linalg.solve(m, lossy)]])
    expected = modes(a)
    assert len(found) == len(expected) == 2
    for (frequency, ratio), (by_hand, ratio_by_hand) in zip(found, expected, strict=True):
        assert frequency == pytest.approx(by_hand, rel=0.03)
        assert ratio == pytest.approx(ratio_by_hand, rel=0.08)


def build_up(given, which):
    """Way [m] over which a wheel's force reaches 1 - 1/e of its end, at a constant slip of 0.3 %.

    A brake that holds keeps a rim at its rate, whatever that is; the machine's speed is set anew every millisecond.
    """
    plant = Plant(given, speed=1.5)
    plant._state[s.STICK : s.STICK + 4], plant._state[s.BRAKE : s.BRAKE + 4] = 0.0, 30e3
    rates = s.JOINT_RATE + s.WHEEL
    plant._state[rates : rates + 4] *= 1.003
    motion = plant._state[s.VELOCITY : s.VELOCITY + 5].copy()
    forces, way = [], []
    for _ in range(1500):
        plant._state[s.VELOCITY : s.VELOCITY + 5] = motion
        plant.advance(LOCKED, 1e-3)
        truth = plant.truth()
        forces.append(truth.longitudinal_force[which])
        way.append(truth.position[0])
    top = int(np.argmax(forces))
    assert way[top] > 0.8
    return float(np.interp(forces[top] * (1.0 - math.exp(-1.0)), forces[: top + 1], way[: top + 1]))


@pytest.mark.parametrize("which", [0, 2])
def test_the_relaxation_length_emerges_from_ring_and_patch(which):
    """The plain tyre's, though the patch alone has less than three quarters of it. 3 %: the belt's own swing."""
    plain, ring = build_up(L60, which), build_up(RING, which)
    assert ring == pytest.approx(plain, rel=0.03)
    own = Plant(RING)._parameters[P_WHEELS + W_LONGITUDINAL_STIFFNESS]
    assert L60.tyre.longitudinal_stiffness / own < 0.75


def energy(plant, wheel=0):
    """Of one ring against its rim [J]."""
    d, v, turn, rate = (
        plant._state[OWN + 8 * wheel + i : OWN + 8 * wheel + j] for i, j in ((0, 3), (3, 6), (6, 7), (7, 8))
    )
    stiff = MASS * omega(np.array((IN_PLANE, LATERAL, IN_PLANE))) ** 2
    return float(
        (MASS * v @ v + stiff @ d**2 + INERTIA * rate @ rate + INERTIA * omega(WIND_UP) ** 2 * turn @ turn)
        / 2.0
    )


@pytest.mark.parametrize(("index", "rate", "hertz"), [(4, 0.5, LATERAL), (7, 1.5, WIND_UP)])
def test_a_ring_that_was_struck_loses_energy_as_its_damping_says(index, rate, hertz):
    """In the air, rim held: E falls as exp(-2 zeta omega t); never above where it was a period before.

    The brake holds the wind-up that was chosen; the fall swings the belt by a quarter of a millimetre, which costs the 8 %.
    """
    plant = Plant(RING, step_s=2e-4, integrator="rk4")
    plant._state[s.POSITION + 2] += 3.0
    plant._state[OWN : OWN + 8] = 0.0
    plant._state[OWN + index] = rate
    left = [energy(plant)]
    period = round(1.0 / hertz / 2e-4)
    for _ in range(6):
        plant.advance(LOCKED, period * 2e-4)
        left.append(energy(plant))
    assert np.all(np.diff(left) < 0.0)
    lasting = np.log(left[0] / left[6]) / (6 * period * 2e-4)
    assert lasting == pytest.approx(2.0 * DAMPING * omega(hertz), rel=0.08)


def test_what_was_struck_comes_to_rest_on_the_road():
    plant = Plant(RING)
    plant._state[OWN + 3] = plant._state[OWN + 7] = 0.4
    plant.advance(LOCKED, 2.0)
    assert np.abs(plant._state[OWN + 3 : OWN + 6]).max() < 1e-3
    assert abs(plant._state[OWN + 7]) < 1e-3


def test_both_integrators_agree_on_a_brake_step():
    """1 ms semi-implicit beside 0.25 ms Runge-Kutta: 3 % of the largest load change."""
    loads = []
    for integrator, step in (("semi-implicit", 1e-3), ("rk4", 2.5e-4)):
        plant = Plant(RING, speed=4.0, integrator=integrator, step_s=step)
        seen = []
        for _ in range(40):
            plant.advance(Commands(brake_torque=(6e3,) * 4), 0.01)
            seen.append(plant.truth().normal_force)
        loads.append(np.array(seen))
    change = np.abs(loads[1] - loads[1][0]).max()
    assert np.abs(loads[0] - loads[1]).max() < 0.03 * change


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"belt_mass_kg": 430.0}, "belt_mass_kg = 430 kg is not less than the wheel's own 426 kg"),
        ({"belt_inertia_kg_m2": 120.0}, "belt_inertia_kg_m2 = 120 kg m2 is not less"),
        ({"wind_up_Hz": 10.0}, "no compliance of the tyre's longitudinal stiffness"),
        ({"lateral_Hz": 9.0}, "no compliance of the tyre's lateral stiffness"),
    ],
)
def test_a_ring_that_cannot_be_is_refused(values, message):
    with pytest.raises(ConfigurationError, match=message):
        Plant(machine("wheel_rigid_ring", **values))


def traced(ahead, step, radius, length, height, exponent):
    """The cam lowered onto a step, point by point along its lower side."""
    x = np.linspace(-length * radius, length * radius, 40_001)
    side = -height * radius * (1.0 - np.abs(x / (length * radius)) ** exponent) ** (1.0 / exponent)
    ground = np.where(x + ahead >= 0.0, step, 0.0)
    return float((ground - side).max() - height * radius)


@pytest.mark.parametrize("step", [0.12, -0.12])
@pytest.mark.parametrize("shape", [(0.743, 1.0, 1.0, 1.8), (0.5, 1.2, 0.9, 2.0)])
@pytest.mark.parametrize("ahead", [-0.6, -0.3, -0.1, -0.02, 0.0, 0.02, 0.2, 0.5])
def test_a_cam_rolls_over_a_step_as_geometry_says(step, shape, ahead):
    assert cam_lift(ahead, step, *shape) == pytest.approx(traced(ahead, step, *shape), abs=2e-5)


def test_a_round_cam_is_a_disc():
    """Exponent 2: the centre goes along a circle about the edge."""
    radius, step, ahead = 0.7, 0.1, -0.2
    assert cam_lift(ahead, step, radius, 1.0, 1.0, 2.0) == pytest.approx(
        step - radius + math.sqrt(radius**2 - ahead**2)
    )


def test_two_cams_give_mean_height_and_slope():
    q = np.array((0.0, 0.1, 0.1, 0.26, 1.0, 1.0, 1.8))
    height, slope = enveloped(-0.05, 0.1, 0.743, q)
    front, behind = (cam_lift(-0.05 + e, 0.1, 0.743, 1.0, 1.0, 1.8) for e in (0.13, -0.13))
    assert (height, slope) == pytest.approx(((front + behind) / 2, (front - behind) / 0.26))
    assert enveloped(-2.0, 0.1, 0.743, q) == (0.0, 0.0)
    assert enveloped(2.0, 0.1, 0.743, q) == pytest.approx((0.1, 0.0))
