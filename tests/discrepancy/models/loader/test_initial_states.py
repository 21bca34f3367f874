"""Initial-state uncertainty of windows counts as noise, and no parameter is fitted to it."""

import numpy as np
import pytest
from scipy.signal import lsim, periodogram
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from discrepancy.estimation.fit import fit, initial_uncertainty
from discrepancy.estimation.noise import Noise, estimate_noise, white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Parameter
from discrepancy.models.loader import model as loader
from discrepancy.models.loader.initial_states import changed_starts
from discrepancy.models.loader.nuisances import INITIAL_STATES, TILT_RAD
from discrepancy.models.loader.replay_inputs import ReplayInputs
from discrepancy.models.loader.segments import LEAD_S
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Recording, signal
from plant.physics import state as s
from plant.physics.resting import R_START, REST
from plant.plant import Plant
from plant.replay import GAIN, M_SPEED, MEASURED
from plant.sheets.machine import load_machine
from tests.discrepancy.models.loader.test_loader import recorded as recorded_drive

STEP_S, OMEGA, DAMPING = 0.02, 6.0, 0.05
SWING, SD = 0.05, 0.02
TRUE_GAIN = 1.3


def swing(window, values, extra):
    """x'' = omega^2 (g u - x) - 2 d omega x', from rest or as the window's begin says."""
    system = (
        [[0.0, 1.0], [-(OMEGA**2), -2.0 * values["damping"] * OMEGA]],
        [[0.0], [OMEGA**2]],
        [[1.0, 0.0]],
        0.0,
    )
    begin = [values.get("begin.place", 0.0), values.get("begin.rate", 0.0)]
    _, moved, _ = lsim(system, values["gain"] * window["force"], window.time_s - window.time_s[0], begin)
    return {"place": moved + values.get("offset", 0.0)}


def swinging(*, unsure: bool = True) -> Model:
    unknown = (
        Parameter(name="begin.place", unit="m", typical=SWING, prior_sd=SWING, scope="initial_uncertainty"),
        Parameter(
            name="begin.rate",
            unit="m/s",
            typical=SWING * OMEGA,
            prior_sd=SWING * OMEGA,
            scope="initial_uncertainty",
        ),
    )
    offset = Parameter(name="offset", unit="m", lower=-1.0, upper=1.0, typical=0.05)
    return Model(
        name="swing",
        sentence="a mass on a spring",
        inputs={"force": "m"},
        outputs={"place": "m"},
        nuisances=(
            Parameter(name="gain", unit="1", value=1.0, lower=0.2, upper=3.0, typical=0.1),
            Parameter(name="damping", unit="1", value=0.1, lower=0.005, upper=0.5, typical=0.01),
            *(unknown if unsure else ()),
        ),
        effects=(
            Effect(
                name="offset",
                sentence="an offset",
                equation="",
                parameters=(offset,),
                kind="physics",
                place="mass",
            ),
        ),
        simulate=swing,
        step_s=STEP_S,
        window_s=3.0,
    )


def recorded(seed: int) -> Recording:
    """Every three seconds a blow that no model knows of sets it swinging anew."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(3000)
    force = np.repeat(rng.uniform(-0.1, 0.1, 60), 50)
    system = ([[0.0, 1.0], [-(OMEGA**2), -2.0 * DAMPING * OMEGA]], [[0.0], [OMEGA**2]], [[1.0, 0.0]], 0.0)
    parts = []
    for part in np.split(np.arange(time_s.size), 20):
        begin = rng.normal(0.0, 1.0, 2) * (SWING, SWING * OMEGA)
        parts.append(lsim(system, TRUE_GAIN * force[part], time_s[part] - time_s[part[0]], begin)[1])
    place = np.concatenate(parts) + rng.normal(0.0, SD, time_s.size)
    return Recording("swing", {"force": signal(time_s, force, "m"), "place": signal(time_s, place, "m")})


def known_noise(problem: Problem) -> Noise:
    """Of two readings in a row: white, with the begins of the model; the residual that it was made from."""
    start = problem.start()
    base = problem.predict(start)
    return white_noise(problem, problem.measured - base, initial_uncertainty(problem, start, base))


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(swinging(), [recorded(1)])


def covariance_of(noise: Noise, rows: np.ndarray) -> np.ndarray:
    """What the rows (raw numbers, in one window) scatter by, said plainly: sensor, and begins."""
    one = 1.0 / noise.whiteners[0].inverse_factor[0, 0]
    return one**2 * np.eye(rows.size) + noise.initial_uncertainty[rows] @ noise.initial_uncertainty[rows].T


def test_what_is_whitened_is_white(problem):
    noise = known_noise(problem)
    own = np.flatnonzero(problem.row_window == 3)
    columns = np.zeros((problem.measured.size, own.size))
    columns[own, np.arange(own.size)] = 1.0
    W = noise.whiten(columns)[own]
    np.testing.assert_allclose(W @ covariance_of(noise, own) @ W.T, np.eye(own.size), atol=1e-8)
    assert not noise.whiten(columns)[problem.row_window != 3].any()


def test_the_likelihood_is_that_of_the_gaussian(problem):
    noise = known_noise(problem)
    residual = problem.measured - problem.predict(problem.start())
    each = [np.flatnonzero(problem.row_window == w) for w in range(len(problem.windows))]
    plain = sum(multivariate_normal.logpdf(residual[own], cov=covariance_of(noise, own)) for own in each)
    found = noise.log_density() - 0.5 * float(np.sum(noise.whiten(residual) ** 2))
    assert found == pytest.approx(plain + 0.5 * np.log(2.0 * np.pi) * residual.size, rel=1e-9)


def test_what_stems_from_a_begin_is_its_conditional_mean(problem):
    noise = known_noise(problem)
    residual = problem.measured - problem.predict(problem.start())
    own = np.flatnonzero(problem.row_window == 5)
    L = noise.initial_uncertainty[own]
    expected = L @ L.T @ np.linalg.solve(covariance_of(noise, own), residual[own])
    found, used = noise.initial_part(residual)
    np.testing.assert_allclose(found[own], expected, atol=1e-9)
    assert 1.9 * len(problem.windows) < used < 2.0 * len(problem.windows)


@pytest.mark.parametrize("seed", range(4))
def test_no_parameter_pays_for_how_windows_begin(seed):
    problem = Problem(swinging(), [recorded(seed)])
    state = assess(problem, (), problem.start(), Settings())
    values = state.fit.values.shared
    assert abs(values["gain"] - TRUE_GAIN) < 4.0 * state.fit.sd("gain")
    assert abs(values["damping"] - DAMPING) < 4.0 * state.fit.sd("damping")
    sd = state.noise.innovation_sd(problem)["place"]
    assert sd == pytest.approx(SD, rel=0.05)  # of 3000 readings: known to 1.3 %


def test_taken_to_begin_as_the_model_says_noise_is_what_swings():
    """The peer of the law above."""
    problem = Problem(swinging(unsure=False), [recorded(0)])
    state = assess(problem, (), problem.start(), Settings())
    known = Problem(swinging(), [recorded(0)])
    assert state.fit.sd("gain") > 1.5 * assess(known, (), known.start(), Settings()).fit.sd("gain")


def test_noise_is_learned_anew_beside_what_is_known_of_begins(problem):
    noise = known_noise(problem)
    fitted = fit(problem, noise, problem.nuisance_names, problem.start())
    residual = problem.measured - problem.predict(fitted.values)
    beside, alone = (estimate_noise(problem, residual, 2.0, known) for known in (noise, None))
    assert beside.innovation_sd(problem)["place"] < alone.innovation_sd(problem)["place"]
    assert beside.initial_uncertainty is noise.initial_uncertainty


# Of the loader.

L60 = load_machine("l60")


def a_start() -> tuple[np.ndarray, np.ndarray, ReplayInputs]:
    state = Plant(L60, speed=2.0, articulation_angle=0.2).inside()[0]
    inputs = ReplayInputs(
        np.zeros((6, MEASURED)), {}, np.array([0, 2, 6]), (False, False, False), 0.0, 0.01, np.zeros((6, 2))
    )
    return np.stack([state, state]), np.zeros((2, REST)), inputs


@pytest.mark.parametrize(("name", "axis"), [("roll", [1.0, 0.0, 0.0]), ("pitch", [0.0, 1.0, 0.0])])
def test_initial_roll_and_pitch_turn_about_the_machines_axes(name, axis):
    starts, rests, inputs = a_start()
    level = Rotation.from_euler("zyx", [0.7, 0.05, -0.04])
    starts[:, s.ATTITUDE : s.ATTITUDE + 4] = level.as_quat()[[3, 0, 1, 2]]
    starts, _, _ = changed_starts({f"initial.{name}": 1e-3}, starts, rests, inputs, 0.7)
    found = Rotation.from_quat(starts[0, [s.ATTITUDE + 1, s.ATTITUDE + 2, s.ATTITUDE + 3, s.ATTITUDE]])
    np.testing.assert_allclose((level.inv() * found).as_rotvec(), 1e-3 * np.array(axis), atol=1e-9)


def test_initial_errors_of_height_and_speed_are_added():
    starts, rests, inputs = a_start()
    given = {
        "initial.height": 0.01,
        "initial.height_rate": 0.2,
        "initial.pitch_rate": 0.1,
        "initial.speed": 0.07,
    }
    was = starts
    starts, rests, changed_inputs = changed_starts(given, starts, rests, inputs, 0.7)
    measured = changed_inputs.measured
    changed = np.flatnonzero((starts != was).any(axis=0))
    assert changed.tolist() == [s.POSITION + 2, s.VELOCITY + 2, s.ANGULAR + 1]
    np.testing.assert_allclose((starts - was)[:, changed], [[0.01, 0.2, 0.1]] * 2, atol=1e-12)
    assert rests[:, R_START].tolist() == [0.01, 0.01]
    assert np.argwhere(measured).tolist() == [[0, M_SPEED], [2, M_SPEED]]
    assert measured[0, M_SPEED] == pytest.approx(0.1)
    assert not inputs.measured.any()


def test_zero_initial_errors_change_nothing():
    starts, rests, inputs = a_start()
    found = changed_starts({p.name: 0.0 for p in INITIAL_STATES}, starts, rests, inputs, 0.7)
    assert all(a is b for a, b in zip(found, (starts, rests, inputs), strict=True))


@pytest.fixture(scope="module")
def driven() -> Problem:
    plain = recorded_drive(seconds=8.0)
    return Problem(loader.model([plain]), [plain])


def moved(problem: Problem, name: str, channel: str) -> list[np.ndarray]:
    """Change of a channel in each segment when its initial state differs by one standard deviation."""
    start, sd = problem.start(), problem.model.parameter(name).prior_sd
    plain, other = (
        problem.motions(problem.windows, values) for values in (start, start.having(**{name: sd}))
    )
    return [b[channel] - a[channel] for a, b in zip(plain, other, strict=True)]


def since_begin(problem: Problem) -> list[np.ndarray]:
    return [window.time_s - window.time_s[0] for window in problem.windows]


def test_an_initial_error_of_speed_decays_by_the_feedback(driven):
    """At the rate of plant.replay; a quarter of it is left where scoring starts."""
    asked = driven.model.parameter("initial.speed").prior_sd / L60.tyre.radius
    for late, speed in zip(
        since_begin(driven), moved(driven, "initial.speed", "wheel_speed_rear_left"), strict=True
    ):
        soon = (late > 0.3) & (late < 0.7)  # tyres have taken it up, torque does not yet answer
        np.testing.assert_allclose(speed[soon], asked * np.exp(-GAIN * late[soon]), rtol=0.05)
        assert np.max(np.abs(speed[late >= LEAD_S])) < 0.3 * asked


def test_an_initial_bounce_still_swings_where_it_is_scored(driven):
    for late, pitch in zip(since_begin(driven), moved(driven, "initial.pitch", "pitch_angle"), strict=True):
        early, scored = pitch[late < 1.0], pitch[late >= LEAD_S]
        assert 0.1 * TILT_RAD < np.max(np.abs(scored)) < np.max(np.abs(early)) < 1.1 * TILT_RAD
        step = float(late[1] - late[0])
        frequency, power = periodogram(pitch, 1.0 / step, nfft=8192)
        assert 1.0 < frequency[np.argmax(power)] < 3.0  # of a machine on its tyres [Hz]


def test_initial_states_are_not_fitted():
    problem = Problem(swinging(), [recorded(0)])
    assert not set(problem.initial_uncertainty_names) & set(problem.nuisance_names)
    state = assess(problem, (), problem.start(), Settings())
    assert [state.fit.values.shared[name] for name in problem.initial_uncertainty_names] == [0.0, 0.0]
