"""Field chain: laws of its frames, one clock with and without a pulse, and a tyre inside its intervals."""

from dataclasses import replace

import numpy as np
import pytest

from identify.field.chain import Unusable, processed, time_base
from identify.field.files import read_field, write_field
from identify.field.fit import SHIFT, fit_points
from identify.field.frames import effective_radius, ground_height, rotated, slip
from identify.make.field import make_field
from identify.signals.clock_sync import first_pulse
from plant.sheets.machine import load_machine


@pytest.fixture(scope="module")
def made():
    return make_field(load_machine("l60"), 1)


@pytest.fixture(scope="module")
def result(made):
    return processed(made[0])


@pytest.fixture(scope="module")
def fitted(result):
    return fit_points(result)


def test_ground_is_exact_on_a_plane_inside_and_a_parabola_outside():
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0.0, 10.0), np.arange(0.0, 5.0)))
    ground = np.stack([x, y, 0.1 + 0.02 * x - 0.01 * y], axis=1)
    px, py = np.array([2.3, 14.0, -3.0]), np.array([1.7, 2.0, 7.0])
    assert ground_height(ground, px, py) == pytest.approx(0.1 + 0.02 * px - 0.01 * py, abs=1e-9)


def test_rotation_keeps_length_and_turns_with_the_wheel():
    along, across = rotated(np.array([np.cos(0.3)]), np.array([np.sin(0.3)]), np.array([0.3]))
    assert (along[0], across[0]) == (pytest.approx(1.0), pytest.approx(0.0))


def test_effective_radius_lies_between_loaded_and_unloaded():
    r = np.array([0.60, 0.70, 0.743])
    got = effective_radius(r, 0.743)
    assert np.all((got >= r) & (got <= 0.743 + 1e-12))


def test_slip_is_the_definition_and_nan_at_rest():
    assert slip(np.array([2.0, 0.1]), np.array([2.2 / 0.7, 1.0]), np.array([0.7, 0.7]))[0] == pytest.approx(
        0.1
    )
    assert np.isnan(slip(np.array([0.1]), np.array([1.0]), np.array([0.7]))[0])


def test_repeated_stamps_leave_one_reading_each():
    time, (value,), repeated = time_base(np.array([0.0, 0.1, 0.1, 0.2]), np.array([1.0, 2.0, 2.0, 3.0]))
    assert (time.tolist(), value.tolist(), repeated) == ([0.0, 0.1, 0.2], [1.0, 2.0, 3.0], 1)


def test_first_pulse_is_the_first_rising_edge():
    t = np.arange(0.0, 5.0, 0.005)
    assert first_pulse(t, np.where((t % 1.0) < 0.5, 5.0, 0.0) * (t > 2.2)) == pytest.approx(2.205, abs=0.006)
    assert first_pulse(t, np.zeros(t.size)) is None


def test_clocks_agree_within_half_a_sample_without_a_pulse(made, result):
    _, truth = made
    clock = np.array([5.0, 90.0, 180.0])
    error = result.sync.other(clock) - (truth.offset + clock * (1.0 + truth.drift))
    assert np.max(np.abs(error)) < 1e-3  # a sample of the transducer is 2 ms


def test_the_event_that_was_not_synchronised_is_found_and_rejected(made, result):
    _, truth = made
    assert result.sync.lost == (truth.lost_event,)
    assert truth.lost_event not in result.points.event
    assert any("common clock" in w for w in result.warnings)
    assert result.rejected["event not synchronised"] > 1000


def test_pulse_and_content_differ_by_the_delay_of_the_positions():
    log, truth = make_field(load_machine("l60"), 2, replace_without("no_pulse"))
    found = processed(log)
    assert found.sync.by_pulse is not None
    assert found.sync.offset == pytest.approx(truth.offset, abs=1e-3)


def replace_without(*names):
    from identify.make.defects import FIELD, chosen

    return chosen(FIELD, list(names))


def test_15_hz_is_seen(result):
    assert result.oscillation_hz == pytest.approx(15.0, abs=1.0)


def test_tyre_is_inside_its_intervals(made, fitted):
    _, truth = made
    _, found = fitted
    for name in ("PCX1", "PDX1", "PEX1", "PKX1", "PDX2", "PKX3"):
        i = found.interval(name)
        assert abs(i.value - truth.tyre[name]) < 3.5 * i.sd
    assert found.interval("PKX1").sd < 0.03 * truth.tyre["PKX1"]
    assert abs(found.values[SHIFT]) < 0.01


def test_every_event_keeps_its_speed_and_the_tyre_its_intervals():
    from bench.identify_coverage import JUDGED, any_machine

    log, truth = make_field(any_machine(9), 9)  # a recording in which two events lost their marker
    result = processed(log)
    driven = np.array(truth.slips)[result.points.event]
    # a smoother that lost a marker gave half the speed and a slip of 1
    assert np.max(np.minimum(np.abs(result.points.slip - driven), np.abs(result.points.slip))) < 0.02
    _, found = fit_points(result)
    for name in JUDGED[:5]:
        i = found.interval(name)
        assert abs(i.value - truth.tyre[name]) < 3.0 * i.sd


def test_points_of_an_event_that_err_together_widen_the_intervals(result, fitted):
    _, before = fitted
    shared = np.random.default_rng(1).normal(0.0, 400.0, 14)[result.points.event]
    _, after = fit_points(replace(result, points=replace(result.points, force=result.points.force + shared)))
    assert before.inflation < 3.0
    assert after.inflation > 4.0
    ratio = after.interval("PKX1").sd / before.interval("PKX1").sd
    assert ratio > 3.0


def test_derivatives_of_points_are_those_of_differences(fitted):
    problem, found = fitted
    values = dict(found.values)
    typical = {u.name: u.typical for u in problem.unknowns}
    (part,) = problem.parts(values)
    for i, name in enumerate(values):
        step = 1e-3 * typical[name]
        up, down = (problem.parts({**values, name: values[name] + s})[0].residual for s in (step, -step))
        wanted = (up - down) / (2.0 * step)
        got = part.by[:, list(part.columns).index(i)]
        assert got == pytest.approx(wanted, rel=1e-3, abs=2e-3 * float(np.max(np.abs(wanted))))


def test_small_slips_give_the_stiffness_alone(result):
    small = np.abs(result.points.slip) < 0.05
    points = replace(
        result.points, **{f: getattr(result.points, f)[small] for f in result.points.__dataclass_fields__}
    )
    problem, found = fit_points(replace(result, points=points))
    assert problem.tyre == ("PKX1", "PKX3")
    assert found.values["PKX1"] == pytest.approx(7.5, rel=0.06)


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_a_field_log_reads_back_as_it_was_written(tmp_path, made, kind):
    log, _ = made
    read = read_field(write_field(log, tmp_path, kind)[0])
    np.testing.assert_allclose(read.somat.fx, log.somat.fx, rtol=1e-12)
    np.testing.assert_allclose(read.vicon.time, log.vicon.time, rtol=1e-12)
    np.testing.assert_allclose(read.vicon.pitch, log.vicon.pitch, rtol=1e-12)


def test_a_marker_that_is_never_in_the_scope_is_refused(made):
    log, _ = made
    with pytest.raises(Unusable, match="never inside the scope"):
        processed(replace(log, vicon=replace(log.vicon, y=np.zeros(log.vicon.y.size))))
