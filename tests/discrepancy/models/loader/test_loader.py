"""The loader as a model of the engine: what it predicts of recorded runs, and what it finds in them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Model
from discrepancy.model.sensors import through_sensors
from discrepancy.models.loader import model as loader
from discrepancy.models.loader.channels import CHANNELS, INPUTS
from discrepancy.models.loader.contact_detection import SMOOTH_S
from discrepancy.models.loader.library import UNSEARCHED, library
from discrepancy.models.loader.machine_variant import Variants
from discrepancy.models.loader.parallel import shares
from discrepancy.models.loader.replay_inputs import _executed_rate
from discrepancy.models.loader.simulation import Loader
from discrepancy.models.loader.warm_up import _warm_up_runs
from discrepancy.signals.recording import Recording, signal
from plant.effects import effects, find_effect
from plant.effects.registry import python_hook
from plant.lanes.replay import replay_in_lanes
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from plant.unit.equipment import load_equipment
from plant.unit.sensor_parameters import ChannelParameters, SensorParameters
from plant.unit.sensors import SensorBank, felt_values, measured_values
from plant.unit.signals import INDEX

L60 = load_machine("l60")


def read(bank, plant):
    """One sample; the slope sensor feels accelerations, as it does in every recorded run."""
    truth = plant.truth()
    return bank.sample(measured_values(truth), felt_values(truth)).values


def recorded(*chosen, machine=L60, seconds=12.0, noise=1.0, seed=1):
    """A drive as its sensors read it, without bias: torque steps both ways, coasting, zigzag, a lift."""
    sheet = load_equipment("l60").sensors
    ideal = {
        name: replace(item, bias=0.0, scale_error=0.0, noise=noise * item.noise)
        for name, item in sheet.channels.items()
    }
    bank = SensorBank(SensorParameters(ideal), step=0.01, generator=np.random.default_rng(seed))
    plant = Plant(replace(machine, effects=chosen), speed=3.0, integrator="rk4")
    rows, lifting = [read(bank, plant)], [0.0]
    for k in range(round(seconds * 100)):
        t = 0.01 * k
        torque = 2500.0 if 0.5 < t < 2.0 else (-2000.0 if 3.0 < t < 4.0 else 300.0)
        lifting.append(0.08 if 4.5 < t < 6.0 else 0.0)
        plant.advance(
            Commands(
                wheel_torque=(torque,) * 4,
                articulation_rate=0.25 * math.sin(1.5 * t),
                lift_rate=lifting[-1],
            ),
            0.01,
        )
        rows.append(read(bank, plant))
    time_s, readings = 0.01 * np.arange(len(rows)), np.array(rows)
    signals = {
        name: signal(time_s, readings[:, INDEX[name]], unit)
        for name, unit in {**INPUTS, **{n: c.unit for n, c in CHANNELS.items()}}.items()
        if name in INDEX
    }
    signals["lift_demand"] = signal(time_s, np.array(lifting) / L60.lift.raise_rate_limit, "1")
    signals["tilt_demand"] = signal(time_s, 0.0 * time_s, "1")
    return Recording("drive", signals)


@pytest.fixture(scope="module")
def plain():
    return recorded()


def test_every_searched_effect_is_off_at_its_value():
    """At the baseline nothing is switched on; at any typical change exactly that effect is."""
    variants = Variants(L60)
    model = loader.model()
    off = {p.name: p.value for p in model.parameters}
    assert variants.having(off).effects == ()
    for item in model.effects:
        if item.kind == "sensor":
            continue
        for parameter in item.parameters:
            if not parameter.shape:
                changed = variants.having({**off, parameter.name: parameter.value + parameter.typical})
                assert [active.effect.name for active in changed.effects] == [item.name]


def test_more_lag_is_that_of_a_slower_sensor_of_the_plant():
    """The fault 'lag' on top of the sheet's: what the plant's sensor reads whose time constant is the sum, to rounding."""
    model, sheet = loader.model(), load_equipment("l60").sensors
    name, more = "yaw_rate", 0.05
    time_s = 0.01 * np.arange(400)
    true = np.sin(3.0 * time_s) + 0.2 * np.sign(np.sin(1.3 * time_s))

    def read(lag):
        only = SensorParameters({name: ChannelParameters(lag=lag)})
        bank = SensorBank(only, step=0.01, generator=np.random.default_rng(0))
        row = np.zeros(len(INDEX))
        readings = []
        for row[INDEX[name]] in true:
            readings.append(bank.sample(row).value(name))
        return np.array(readings)

    lag = sheet.of(name).lag
    seen = through_sensors({name: read(lag)}, {f"{name}.lag": more}, time_s, 0.01, 0.0, model.lags)
    np.testing.assert_allclose(seen[name], read(lag + more), atol=1e-12)


def test_the_library_has_every_effect_that_can_be_seen():
    named = {item.name for item in library()}
    physics = {name for name, item in effects().items() if python_hook(item, "sensors") is None}
    assert physics - named <= UNSEARCHED
    for channel in ("yaw_rate", "specific_force_x", "lift_pressure"):
        assert {f"{channel} delay", f"{channel} scale", f"{channel} bias"} <= named


def test_it_predicts_a_recorded_drive_to_its_noise(plain):
    """Another integrator and half the step made the truth; what is left is little more than the sensors' own noise."""
    problem = Problem(loader.model([plain]), [plain])
    residual = problem.measured - problem.predict(problem.start())
    sheet = load_equipment("l60").sensors
    for i, name in enumerate(problem.channels):
        error = float(np.std(residual[problem.row_channel == i]))
        allowed = 3.0 * sheet.of(name).noise if "wheel_speed" not in name else 0.03
        assert error < allowed, name


def test_segments_remember_the_pile_dug_into_before_them():
    """Whether its values come with the warm-up run or with the call: segments start with the depth dug so far."""
    pile = {"pile_entry.distance_m": 8.0, "pile_entry.most_N": 30e3, "pile_entry.depth_m": 0.5}
    recording = recorded(find_effect("pile_entry").of(distance_m=8.0, most_N=30e3), seconds=16.0)
    problem = Problem(loader.model([recording]), [recording])
    there = problem.start().with_shared(pile)
    warmed = problem.warmed_up(problem.start(), there)
    found = [
        problem.predict(there),
        problem.predict(there.warmed_up_as(warmed)),
        problem.predict(warmed),
    ]
    rows = (problem.row_window > 0) & (
        problem.row_channel == problem.channels.index("wheel_speed_front_left")
    )
    early, settled, without = (predicted[rows] for predicted in found)
    assert np.std(early - settled) < 0.02 * np.std(without - settled)


@pytest.mark.parametrize("distance_m", [7.0, 9.0])
def test_a_piles_distance_starts_at_the_contact(distance_m):
    """At 3 m/s, early by the width of the filter that differentiates speed."""
    recording = recorded(find_effect("pile_entry").of(distance_m=distance_m), seconds=8.0)
    distance = loader.model([recording]).parameter("pile_entry.distance_m")
    assert distance.value + distance.typical == pytest.approx(distance_m, abs=3.0 * SMOOTH_S)


def test_without_contact_a_piles_distance_starts_at_its_default(plain):
    assert loader.model([plain]).parameter("pile_entry.distance_m") == loader.model().parameter(
        "pile_entry.distance_m"
    )


@pytest.mark.parametrize(
    ("edges", "count", "parts"),
    [
        ((0, 400, 800, 1200, 1600), 2, ([0, 2], [2, 4])),
        ((0, 500), 2, ([0], [1])),
        ((0, 900, 1000), 2, ([0, 1], [1, 2])),
    ],
)
def test_processors_share_whole_segments(edges, count, parts):
    assert shares(np.array(edges, np.intp), count) == parts


def test_the_number_of_threads_does_not_change_a_simulation(plain, monkeypatch):
    predicted = []
    for cores in (1, 3):
        monkeypatch.setattr("discrepancy.models.loader.parallel.CORES", cores)
        problem = Problem(loader.model([plain]), [plain])
        predicted.append(problem.predict(problem.start()))
    np.testing.assert_array_equal(*predicted)


def test_a_segment_without_solution_leaves_the_others(plain, monkeypatch):
    problem = Problem(loader.model([plain]), [plain])
    whole = problem.predict(problem.start())
    broken = float(problem.model.simulate._common_start(problem.windows).inputs.measured[0, 0])

    def failing(starts, rests, measured, *rest):
        if len(starts) > 1 or measured[0, 0] == broken:
            raise np.linalg.LinAlgError
        replay_in_lanes(starts, rests, measured, *rest)

    monkeypatch.setattr("discrepancy.models.loader.parallel.replay_in_lanes", failing)
    found = problem.predict(problem.start().having(rear_mass=1e-9))
    first = problem.row_window == 0
    assert not np.allclose(found[first], whole[first])
    np.testing.assert_allclose(found[~first], whole[~first], rtol=1e-6, atol=1e-6)


def served(demand, lag_s, step_s=0.01):
    """The rate of a first-order cylinder, row by row; a row's demand has acted since the row before."""
    rate = np.zeros(demand.size)
    for k in range(1, demand.size):
        rate[k] = demand[k] + (rate[k - 1] - demand[k]) * math.exp(-step_s / lag_s)
    return rate


def test_an_executed_rate_is_the_demand_where_it_is_followed():
    """Swings of 1.6 Hz, which half a second of smoothing alone would flatten."""
    t = 0.01 * np.arange(600)
    demand = 0.2 * np.sin(10.0 * t)
    found = _executed_rate(demand, served(demand, 0.05), 0.05, 0.01)
    inner = slice(50, -50)
    np.testing.assert_allclose(found[inner], demand[inner], atol=1e-3)  # half a per cent: the hold of a tick


def test_an_executed_rate_is_what_limits_leave_of_the_demand():
    t = 0.01 * np.arange(1000)
    demand, given = 0.3 * np.sin(1.5 * t), 0.15 * np.sin(1.5 * t)
    found = _executed_rate(demand, served(given, 0.05), 0.05, 0.01)
    inner = slice(50, -50)
    np.testing.assert_allclose(found[inner], given[inner], atol=2e-3)


def restricted(*names, recordings=()) -> Model:
    """The model with a short library, so that a search takes seconds."""
    model = loader.model(recordings)
    return replace(model, effects=tuple(item for item in model.effects if item.name in names))


LIBRARY = (
    "rolling_resistance",
    "grade",
    "brake_drag",
    "payload_mass",
    "yaw_rate delay",
    "specific_force_x scale",
)


@pytest.mark.slow
def test_a_concealed_effect_is_named_with_its_size():
    from discrepancy.examine import examine
    from discrepancy.selection.state import Settings

    drive = recorded(find_effect("payload_mass").of(extra_kg=700.0))
    found = examine(restricted(*LIBRARY, recordings=[drive]), [drive], Settings(open_ended=False))
    assert found.status == "explained"
    (first,) = found.findings
    assert first.effect == "payload_mass"
    (extra,) = first.parameters
    assert extra.value == pytest.approx(700.0, rel=0.1)


@pytest.mark.slow
def test_nothing_is_found_where_nothing_was_concealed(plain):
    from discrepancy.examine import examine
    from discrepancy.selection.state import Settings

    model = restricted(*LIBRARY, recordings=[plain])
    assert examine(model, [plain], Settings(open_ended=False)).status == "nothing missing"


@pytest.mark.slow
def test_tyres_of_another_stiffness_are_no_effect():
    """Nobody knows a tyre's slopes to a few percent; taken for exact, they were called yaw inertia or the places of the axles."""
    from discrepancy.examine import examine
    from discrepancy.selection.assess import assess
    from discrepancy.selection.state import Settings

    true = {"slip_stiffness": -0.12, "cornering_stiffness": 0.13}
    tyre = replace(L60.tyre, pkx1=0.88 * L60.tyre.pkx1, pky1=1.13 * L60.tyre.pky1)
    drive = recorded(machine=replace(L60, tyre=tyre))
    model = restricted("yaw_inertia", "axle_position", "lateral_relaxation", recordings=[drive])
    problem = Problem(model, [drive])
    fitted = assess(problem, (), problem.start(), Settings()).fit
    for name, value in true.items():
        assert fitted.sd(name) < 0.03
        assert abs(fitted.values.shared[name] - value) < 3.0 * fitted.sd(name)
    assert examine(model, [drive], Settings(open_ended=False)).status == "nothing missing"


@pytest.mark.slow
def test_a_centre_further_behind_is_no_effect():
    """Taken for exact, it was called the place of the axles and yaw inertia on a drive of 40 s."""
    from discrepancy.examine import examine
    from discrepancy.selection.assess import assess
    from discrepancy.selection.state import Settings

    drive = recorded(machine=replace(L60, rear_frame=replace(L60.rear_frame, x=L60.rear_frame.x + 0.05)))
    model = restricted("yaw_inertia", "axle_position", "mass_split", recordings=[drive])
    problem = Problem(model, [drive])
    fitted = assess(problem, (), problem.start(), Settings()).fit
    assert fitted.sd("rear_x") < 0.02
    assert abs(fitted.values.shared["rear_x"] - 0.05) < 3.0 * fitted.sd("rear_x")
    assert examine(model, [drive], Settings(open_ended=False)).status == "nothing missing"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "distance_m", "most_N", "depth_m"),
    [(9, 7.0, 60e3, 0.5), (23, 5.0, 45e3, 0.25)],
)
def test_the_pile_of_a_scenario_is_found_where_it_is(tmp_path, seed, distance_m, most_N, depth_m):
    """Without it the machine pushes forward for seconds where the recorded one stands: nothing of the baseline is near."""
    from discrepancy.examine import examine
    from discrepancy.selection.state import Settings
    from hil.compose import Choice
    from hil.runs import run_lockstep

    pile = {"distance_m": distance_m, "most_N": most_N, "depth_m": depth_m}
    changes = tuple(f"effects.pile_entry.{name}={value}" for name, value in pile.items())
    run_lockstep(Choice(scenario="pile_entry", seed=seed, changes=changes), tmp_path / "run")
    drive = loader.load_run(tmp_path / "run")
    found = examine(
        restricted(*LIBRARY, "pile_entry", recordings=[drive]), [drive], Settings(open_ended=False)
    )
    assert (found.status, found.named) == ("explained", ["pile_entry"])
    size = {e.name: e.value for e in found.findings[0].parameters}
    assert size["pile_entry.distance_m"] == pytest.approx(distance_m, abs=0.02)
    assert size["pile_entry.most_N"] == pytest.approx(most_N, rel=0.02)
    assert size["pile_entry.depth_m"] == pytest.approx(depth_m, rel=0.05)


def test_long_steps_agree_with_short_ones(plain, monkeypatch):
    """Exactly for the machine of the warm-up runs; for another one to 2 % of the difference between the two."""
    predicted = {}
    for step_s in (1e-3, 5e-3):
        monkeypatch.setattr("discrepancy.models.loader.simulation.STEP_S", step_s)
        problem = Problem(loader.model([plain]), [plain])
        start = problem.start()
        predicted[step_s] = [problem.predict(v) for v in (start, start.having(rear_mass=300.0))]
    (short, changed), (long, changed_long) = predicted[1e-3], predicted[5e-3]
    np.testing.assert_allclose(long, short, rtol=1e-9, atol=1e-9)
    size = np.array([CHANNELS[problem.channels[i]].typical for i in problem.row_channel])
    assert np.std((changed_long - changed) / size) < 0.02 * np.std((changed - short) / size)


@pytest.mark.parametrize(
    ("rows", "length", "runs"),
    [
        ((100, 400), 100, [range(101), range(300, 401)]),
        ((400, 100), 1000, [range(401)]),
        ((100, 150, 260), 100, [range(151), range(160, 261)]),
        ((0,), 100, [range(1)]),
    ],
)
def test_warm_up_runs_cover_every_row_once(rows, length, runs):
    assert _warm_up_runs(rows, length) == runs


def test_a_short_warm_up_gives_the_outputs_of_a_whole_one(monkeypatch):
    """Except for the angles of the wheels, which no output depends on."""
    drive = recorded(noise=0.0, seconds=24.0)
    arrived = []
    for warm_up_s in (15.0, 1e3):
        monkeypatch.setattr("discrepancy.models.loader.warm_up.WARM_UP_S", warm_up_s)
        simulate = Loader(L60, load_equipment("l60"), [drive])
        problem = Problem(loader.model([drive]), [drive])
        late = [window for window in problem.windows if window.time_s[0] > 17.0]
        arrived.append(
            np.concatenate([np.stack(list(seen.values())) for seen in simulate.together(late, {})], axis=1)
        )
    size = np.array([channel.typical for channel in CHANNELS.values()])[:, None]
    assert np.max(np.abs(arrived[0] - arrived[1]) / size) < 0.02


@pytest.mark.parametrize("channel", ["pitch_rate", "specific_force_z"])
def test_warm_up_with_fitted_values_gets_the_swing_in_phase(channel):
    """Torque steps make it bounce; on tyres of another stiffness the swing would be out of phase by the second segment."""
    softer = replace(L60, tyre=replace(L60.tyre, qfz1=0.85 * L60.tyre.qfz1, qfz2=0.85 * L60.tyre.qfz2))
    bounced = recorded(machine=softer, noise=0.0)
    problem = Problem(loader.model([bounced]), [bounced])
    second = (problem.row_window == 1) & (problem.row_channel == problem.channels.index(channel))
    known = problem.start().having(tyre_stiffness=-0.15)
    before = np.std((problem.measured - problem.predict(known))[second])
    after = np.std((problem.measured - problem.predict(problem.warmed_up(known, known)))[second])
    assert after < 0.5 * before
