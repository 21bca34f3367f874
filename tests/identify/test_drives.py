"""Machines from drives: runs of the bench with known differences from the sheet are identified, and what they do not show stays open."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from diagnosis.apply.machine_files import baseline
from discrepancy.models.loader import model as loader
from discrepancy.models.loader.channels import REFERENCE
from discrepancy.models.loader.machine_variant import Variants
from identify.machine.balances import balances, derivatives, weighed_prior
from identify.machine.coordinates import Coordinates
from identify.machine.drives import fitted, identified
from identify.machine.made import changes, drawn, make_run
from identify.machine.parameters import identification_model, quantities
from identify.machine.profile import profile
from identify.machine.results import machine_files
from identify.machine.weighing import G, Geometry, Weighing, weighed
from plant.physics.parameters import parameter_vector
from plant.physics.surface import Surface
from plant.plant import Plant
from plant.sheets.changes import Changes
from plant.sheets.machine import load_machine
from tests.identify.test_weighing import positions

MACHINE = load_machine("l60")
WELL = (
    "rear_mass",
    "rear_x",
    "rear_height",
    "rear_yaw_inertia",
    "rear_roll_inertia",
    "tyre_stiffness",
    "wheel_radius",
    "wheel_spin",
    "torque_scale",
)
"""What a drive cycle with turns, braking and accelerating determines."""


STRAIGHT = ("driver.articulation_deg.points=[[0.0, 0.0]]",)
"""Makes a scenario a straight drive. Its driver still corrects what the noise of the angle's sensor shows him."""
HANDS_OFF = (*STRAIGHT, "equipment.driver.articulation_gain_per_s=0.0")
"""The same by a driver who does not steer."""


def build(recordings):
    return identification_model(loader.model(recordings))


def read(folder, *, instruments=True):
    r = loader.load_run(folder)
    kept = {name: s for name, s in r.signals.items() if instruments or name not in REFERENCE}
    return replace(r, signals=kept)


def truth_of(**changed):
    return {q.parameter: p.value for q in quantities(MACHINE, build([])) for p in [build([]).parameter(q.parameter)]} | changed  # fmt: skip


def inside(found, truth):
    """Names of parameters whose interval holds the truth, and of the others."""
    good = {
        e.quantity.parameter: e.lower <= e.quantity.value(truth[e.quantity.parameter]) <= e.upper
        for e in found.estimates
    }
    return [n for n, held in good.items() if held], [n for n, held in good.items() if not held]


# --- laws without a run


def test_balances_are_those_of_the_standing_plant():
    """Axle loads times their distances from the joint are the first moments."""
    loads = Plant(MACHINE).truth().normal_force
    g = MACHINE.geometry
    mass, rear, front, _ = balances(MACHINE)
    assert np.sum(loads) == pytest.approx(mass * 9.81, rel=1e-6)
    moment = g.front_axle_x * (loads[0] + loads[1]) + g.rear_axle_x * (loads[2] + loads[3])
    # the machine leans on its tyres by some milliradians, which moves the centre by its height times that
    assert moment / 9.81 == pytest.approx(rear + front, abs=0.01 * mass)


def test_a_mass_moves_the_balances_by_its_place():
    slopes = derivatives(MACHINE, truth_of(), ("rear_mass", "front_x", "rear_yaw_inertia"))
    frame = MACHINE.rear_frame
    np.testing.assert_allclose(slopes[:, 0], [1.0, frame.x, 0.0, frame.z], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(slopes[:, 1], [0.0, 0.0, MACHINE.front_frame.mass, 0.0], rtol=1e-9, atol=1e-6)
    np.testing.assert_array_equal(slopes[:, 2], 0.0)


def test_a_machine_file_and_the_replay_change_the_same_values():
    """For every parameter: the machine with the changes of the file is the replay's variant."""
    model = build([])
    truth = drawn(model, np.random.default_rng(3))
    words = tuple(changes(model, truth))
    filed = load_machine("l60", Changes.of(words).machine)
    replayed = Variants(MACHINE).having(truth)
    assert filed != MACHINE
    # all that the plant computes with: a frame is joined to its axle there
    one, other = (parameter_vector(m, Surface(), 0.0) for m in (filed, replayed))
    np.testing.assert_allclose(one, other, rtol=1e-12)
    assert replayed.effects == filed.effects == ()


def weighings_of(machine, sd=0.0, random=None):
    """Weighings of a machine by its balances, straight and articulated, facing up and down a grade."""
    mass, rear, front, height = balances(machine)
    g = machine.geometry
    geometry = Geometry(front=g.front_axle_x, rear=-g.rear_axle_x, track=g.track)
    found = []
    for angle in (-0.6, 0.0, 0.6):
        for grade in (-0.12, 0.0, 0.12):
            place, down = positions(geometry, angle), G * np.cos(grade)
            A = np.array([np.ones(4), place[:, 0], place[:, 1], [0.0, 0.0, 1.0, -1.0]])
            b = [
                mass * down,
                down * (rear + front * np.cos(angle)) - G * np.sin(grade) * height,
                down * front * np.sin(angle),
                0.0,
            ]
            noise = sd * random.standard_normal(4) if random is not None else 0.0
            found.append(Weighing(loads=np.linalg.solve(A, b) + noise, articulation=angle, grade=grade))
    return found, geometry


def test_weighings_fix_sums_and_leave_their_shares_to_the_sheet():
    """The prior by weighings has the weighed mass; frames that share it are nearly opposite."""
    heavier = Variants(MACHINE).having(truth_of(rear_mass=150.0, front_mass=-40.0))
    scales = weighed(*weighings_of(heavier), 20.0)
    prior = weighed_prior(MACHINE, build([]), scales)
    at = truth_of(**dict(zip(prior.names, prior.mean.tolist(), strict=True)))
    np.testing.assert_allclose(balances(Variants(MACHINE).having(at)), balances(heavier), rtol=2e-3)
    i, j = prior.names.index("rear_mass"), prior.names.index("front_mass")
    C = prior.covariance
    sum_sd = np.sqrt(C[i, i] + C[j, j] + 2.0 * C[i, j])
    # the sheet knows the sum to 134 kg, which adds nothing to the scales
    assert sum_sd == pytest.approx(scales.sd[0], rel=0.02)
    assert sum_sd < 0.4 * np.sqrt(C[i, i])
    assert np.sqrt(C[i, i]) < 60.0  # the sheet alone: 120 kg


def test_coordinates_are_independent_with_the_first_parameter_alone():
    heavier = Variants(MACHINE).having(truth_of(rear_mass=150.0))
    joint = weighed_prior(MACHINE, build([]), weighed(*weighings_of(heavier), 20.0)).beginning_with("front_x")
    coordinates = Coordinates(joint)
    names = [p.name for p in build([]).nuisances if p.scope == "all"]
    back = coordinates.jacobian(names)
    at = [names.index(n) for n in joint.names]
    np.testing.assert_allclose((back @ back.T)[np.ix_(at, at)], joint.covariance, rtol=1e-9)
    values = truth_of(rear_mass=30.0, front_x=0.02)
    known = coordinates.of_model(coordinates.to_fitted(values))
    assert known == pytest.approx(values)
    moved = coordinates.to_fitted(truth_of() | dict(zip(joint.names, joint.mean.tolist(), strict=True)))
    moved[coordinates.fitted(["front_x"])[0]] = 1.0
    first = dict(zip(joint.names, joint.mean.tolist(), strict=True))["front_x"]
    assert coordinates.of_model(moved)["front_x"] - first == pytest.approx(np.sqrt(joint.covariance[0, 0]))


# --- laws of runs


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs of one machine that differs from its sheet, made once by scenario and seed."""
    folder, made = tmp_path_factory.mktemp("drives"), {}
    truth = truth_of(
        rear_mass=180.0, rear_height=0.06, rear_yaw_inertia=0.2, tyre_stiffness=0.06, rear_x=-0.03,
        **{"wheel_spin": 0.12, "zero.yaw_rate": 0.004, "zero.pitch_angle": -0.003, "torque_scale": 0.02},
        **{"articulation_zero": 0.0035, "zero.specific_force_x": 0.05, "zero.specific_force_y": -0.04},
    )  # fmt: skip

    def run(scenario, seed, more=()):
        if (scenario, seed, more) not in made:
            name = f"{scenario}{seed}_{len(more)}"
            made[scenario, seed, more] = make_run(folder / name, scenario, seed, build([]), truth, more=more)
        return made[scenario, seed, more]

    run.truth = truth
    return run


@pytest.fixture(scope="module")
def known(runs):
    """What one of these runs says of the machine, each identified once: that takes half a minute."""

    @cache
    def of(seed, more=(), *, instruments=True):
        return identified(MACHINE, build, [read(runs("unloaded", seed, more), instruments=instruments)])

    return of


@pytest.mark.slow
def test_masses_centres_inertia_and_stiffness_are_identified(runs, known):
    found = known(71)
    assert found.inadequate == []
    _, missed = inside(found, runs.truth)
    assert set(WELL) & set(missed) == set(), missed
    # not by wide intervals: the drives take away at least three quarters of the prior's variance of each
    assert max(e.remaining for e in found.estimates if e.quantity.parameter in WELL) < 0.5
    # the truth lies far from the sheet in what was changed most
    at = found.values
    assert at["rear_yaw_inertia"] - 4.0 * found.sd("rear_yaw_inertia") > 0.0
    mass = found.sums[0]
    assert abs(mass[2] - MACHINE.mass - 180.0) < 3.0 * mass[3] < 60.0


@pytest.mark.slow
def test_a_straight_drive_does_not_determine_yaw_inertia(known):
    found = known(72, HANDS_OFF)
    found_of = {e.quantity.parameter: (e.remaining, e.status) for e in found.estimates}
    for name in ("rear_yaw_inertia", "front_yaw_inertia"):
        assert found_of[name][0] > 0.95
        assert found_of[name][1] == "not determined"
    assert found_of["rear_height"][1] == "determined"  # braking shows the height


@pytest.mark.slow
def test_noise_of_the_inputs_is_not_taken_for_motion(runs, known):
    """Without the correction the inertia of a straight drive is drawn far below the truth, with an interval that looks sure."""
    found = known(73, STRAIGHT)
    noise, naive = fitted(found.problem)
    truth = runs.truth["rear_yaw_inertia"]
    assert naive.values.shared["rear_yaw_inertia"] + 1.96 * naive.sd("rear_yaw_inertia") < truth
    at, sd = found.values["rear_yaw_inertia"], found.sd("rear_yaw_inertia")
    assert abs(at - truth) < 1.96 * sd
    assert np.all(noise.keep == found.noise.keep)


@pytest.mark.slow
def test_two_drives_are_narrower_by_the_root_of_two(runs, known):
    """The information of drives adds. What only the sheet shares out between the frames does not narrow."""
    one, other = known(71), known(73)
    both = identified(MACHINE, build, [read(runs("unloaded", seed)) for seed in (71, 73)])
    first, second, joint = (np.sum(f.of_parameters.columns**2, axis=0) for f in (one, other, both))
    shares = joint / (first + second)
    # the noise is estimated again from both, which moves single channels
    assert float(np.median(shares)) == pytest.approx(1.0, abs=0.08)
    assert shares.min() > 0.7
    for name in ("rear_height", "tyre_stiffness", "wheel_radius", "torque_scale", "zero.yaw_rate"):
        narrower = (one.sd(name) + other.sd(name)) / (2.0 * both.sd(name))
        assert narrower == pytest.approx(np.sqrt(2.0), rel=0.1), name
    assert both.sd("rear_mass") > 0.95 * one.sd("rear_mass")


@pytest.mark.slow
def test_without_instruments_the_mass_is_less_certain_and_still_held(runs, known):
    full, bus = known(71), known(71, instruments=False)
    assert not set(bus.problem.channels) & REFERENCE
    # wheel forces weigh the machine; without them its mass comes from torque and acceleration
    assert bus.sums[0][3] > 3.0 * full.sums[0][3]
    assert bus.sd("torque_scale") > 2.0 * full.sd("torque_scale")
    _, missed = inside(bus, runs.truth)
    assert len(missed) <= 3, missed


@pytest.mark.slow
def test_profile_and_linear_intervals_agree_where_the_model_is_nearly_linear(known):
    found = known(71)
    assert profile(found, "rear_yaw_inertia").asymmetry < 0.2
    p = profile(found, "wheel_radius")
    assert p.lower < found.values["wheel_radius"] < p.upper


@pytest.mark.slow
def test_weighings_make_the_mass_and_the_torque_scale_certain(runs, known):
    """Without instruments a drive determines force over mass: a weighed mass makes the scale of the torque certain too."""
    recording = read(runs("unloaded", 71), instruments=False)
    machine = Variants(MACHINE).having({n: runs.truth[n] for n in ("rear_mass", "rear_height", "rear_x")})
    prior = weighed_prior(
        MACHINE, build([]), weighed(*weighings_of(machine, 50.0, np.random.default_rng(5)), 50.0)
    )
    alone, weighed_too = known(71, instruments=False), identified(MACHINE, build, [recording], prior)
    assert weighed_too.sums[0][3] < 0.4 * alone.sums[0][3]
    assert weighed_too.sd("torque_scale") < 0.5 * alone.sd("torque_scale")
    _, missed = inside(weighed_too, runs.truth)
    assert not set(WELL) & set(missed)
    # the interval by profile is in kilograms again, though the fit had coordinates
    p = profile(weighed_too, "rear_mass")
    assert p.lower < weighed_too.values["rear_mass"] < p.upper
    assert p.asymmetry < 0.3


@pytest.mark.slow
def test_physics_that_is_left_out_is_reported(runs, tmp_path):
    """On wet ground locked wheels are not those of the replay: the model is not adequate, and the result says so."""
    folder = make_run(tmp_path / "wet", "wheel_lock", 74, build([]), runs.truth)
    found = identified(MACHINE, build, [read(folder)])
    assert found.inadequate != []


@pytest.mark.slow
def test_the_written_machine_is_the_estimate(known, tmp_path):
    found = known(71)
    for path, text in machine_files(found, "l60", tmp_path / "machine.toml", "test").items():
        path.write_text(text, encoding="utf-8")
    machine = load_machine(tmp_path / "machine.toml")
    assert machine.rear_frame.mass == found.values["rear_mass"] + MACHINE.rear_frame.mass
    assert machine.rear_frame.izz == pytest.approx(
        (1.0 + found.values["rear_yaw_inertia"]) * MACHINE.rear_frame.izz
    )
    # a diagnosis reads the zero points of the equipment beside it as its baseline
    again = baseline(tmp_path / "machine.toml", [])
    assert again.parameter("yaw_rate.bias").value == pytest.approx(found.values["zero.yaw_rate"])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_intervals_hold_the_truth_on_fresh_machines(tmp_path):
    """Machines and sensors drawn from their priors: at least 88 of 100 intervals of what drives determine hold the truth."""
    held = missed = 0
    for seed in (301, 302, 303, 304):
        model = build([])
        truth = drawn(model, np.random.default_rng(seed))
        folder = make_run(tmp_path / str(seed), "unloaded", seed, model, truth)
        found = identified(MACHINE, build, [read(folder)])
        good, bad = inside(found, truth)
        sure = {e.quantity.parameter for e in found.estimates if e.status == "determined"}
        held, missed = held + len(sure & set(good)), missed + len(sure & set(bad))
    assert held + missed > 80
    assert held >= 0.88 * (held + missed), (held, missed)
