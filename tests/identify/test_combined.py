"""Combined slip: the law against the plant's, its derivatives, and a field test with slip angles."""

from dataclasses import replace

import numpy as np
import pytest

from bench.identify_coverage import any_machine
from identify.field.chain import processed
from identify.field.fit import HEADING, fit_points
from identify.make.field import make_field
from identify.tyre.combined import weight
from identify.tyre.parameters import COMBINED
from plant.physics.tyre import weight as weight_of_plant

LAW = {"rbx1": 11.1, "rbx2": 12.5, "rcx1": 0.975, "rex1": -0.37}
KAPPA = np.array([-0.3, -0.05, 0.0, 0.02, 0.1, 0.6])
TAN_ALPHA = np.array([0.1, -0.2, 0.05, -0.01, 0.25, 0.15])


@pytest.fixture(scope="module")
def made():
    return make_field(any_machine(3), 3, slip_angle=np.radians(8.0))


@pytest.fixture(scope="module")
def result(made):
    return processed(made[0])


@pytest.fixture(scope="module")
def fitted(result):
    return fit_points(result)


def test_no_slip_angle_takes_nothing():
    share, by = weight(KAPPA, np.zeros(KAPPA.size), **LAW)
    assert np.all(share == 1.0)
    assert all(np.all(d == 0.0) for d in by.values())


def test_both_sides_are_alike_and_a_larger_angle_takes_more():
    share, _ = weight(KAPPA, TAN_ALPHA, **LAW)
    assert share == pytest.approx(weight(KAPPA, -TAN_ALPHA, **LAW)[0])
    assert np.all(weight(KAPPA, 1.1 * TAN_ALPHA, **LAW)[0] < share)


def test_the_law_is_that_of_the_plant():
    share, _ = weight(KAPPA, TAN_ALPHA, **LAW)
    narrowed = LAW["rbx1"] * np.cos(np.arctan(LAW["rbx2"] * KAPPA))
    wanted = [
        weight_of_plant(s, b, LAW["rcx1"], LAW["rex1"]) for s, b in zip(TAN_ALPHA, narrowed, strict=True)
    ]
    assert share == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("name", [*COMBINED, "kappa", "tan_alpha"])
def test_derivatives_are_those_of_differences(name):
    at = {"kappa": KAPPA, "tan_alpha": TAN_ALPHA, **LAW}
    key = name if name in at else name.lower()
    up, down = (weight(**{**at, key: at[key] + s})[0] for s in (1e-6, -1e-6))
    assert weight(**at)[1][name] == pytest.approx((up - down) / 2e-6, rel=1e-5, abs=1e-8)


def test_derivatives_of_points_at_slip_angles_are_those_of_differences(fitted):
    problem, found = fitted
    values = {**found.values, "RCX1": 0.95}  # away from its bound
    typical = {u.name: u.typical for u in problem.unknowns}
    (part,) = problem.parts(values)
    for i, name in enumerate(values):
        step = 1e-3 * typical[name]
        up, down = (problem.parts({**values, name: values[name] + s})[0].residual for s in (step, -step))
        wanted = (up - down) / (2.0 * step)
        assert part.by[:, i] == pytest.approx(wanted, rel=1e-3, abs=2e-3 * float(np.max(np.abs(wanted))))


def test_tyre_and_heading_are_inside_their_intervals(made, fitted):
    _, truth = made
    problem, found = fitted
    assert set(COMBINED) <= set(problem.tyre)
    for name in ("PCX1", "PDX1", "PEX1", "PKX1", *COMBINED):
        i = found.interval(name)
        assert abs(i.value - truth.tyre[name]) < 3.5 * i.sd
    assert found.interval("RBX2").sd < 0.05 * truth.tyre["RBX2"]
    assert found.values[HEADING] == pytest.approx(-truth.heading, abs=1e-3)


def test_side_force_follows_the_side_of_the_slip_angle(made, result):
    log, _ = made
    clock = result.sync.other(log.somat.time)
    for event in result.events:
        side = float(np.median(-event.speed[1] / np.abs(event.speed[0])))
        within = (clock > event.time[0] + 2.0) & (clock < event.time[-1] - 2.0)
        if abs(side) > 0.05 and event.number not in result.sync.lost:
            assert np.sign(float(np.median(log.somat.fy[within]))) == np.sign(side)


def test_without_slip_angles_the_weight_is_no_unknown(result):
    straight = np.abs(result.points.side_slip) < 0.01
    points = replace(
        result.points, **{f: getattr(result.points, f)[straight] for f in result.points.__dataclass_fields__}
    )
    problem, found = fit_points(replace(result, points=points))
    assert not set(COMBINED) & set(problem.tyre)
    assert HEADING not in found.names


def test_a_slip_angle_that_changes_makes_no_point(result):
    from identify.field.chain import _points

    event = next(e for e in result.events if np.median(np.abs(e.speed[1] / e.speed[0])) > 0.1)
    ramp = np.linspace(0.0, 1.0, event.time.size)
    turning = replace(event, speed=np.stack([event.speed[0], event.speed[1] * ramp]))
    kept, _ = _points(event)
    fewer, counts = _points(turning)
    assert len(kept) > 5
    assert len(fewer) < 0.3 * len(kept)
    assert counts["slip angle not settled"] > 500


def test_an_interval_holds_every_optimum_that_the_data_do_not_distinguish():
    """A recording whose likelihood has two optima of the same height: about one of them the truth lay 48 standard deviations off."""
    log, truth = make_field(any_machine(2019), 2019, slip_angle=np.radians(8.0))
    _, found = fit_points(processed(log))
    for name in ("PCX1", "PEX1"):
        i = found.interval(name)
        assert found.by(name) == "likelihood"
        assert i.lower < truth.tyre[name] < i.upper
    assert found.interval("PCX1").upper - found.interval("PCX1").lower > 0.3


def test_one_optimum_keeps_the_interval_of_its_curvature(fitted):
    _, found = fitted
    assert found.profiled == {}
