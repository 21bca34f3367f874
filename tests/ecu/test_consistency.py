"""An estimate that breaks a law is not valid, whatever its inputs say; one that obeys them all is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.consistency import DOUBTFUL, SETTLING_NS, Consistency
from ecu.estimators.signals import NEVER, Estimates
from ecu.estimators.tyres.contact import CONTRADICTION
from ecu.validity import NEEDS, WHEELS

WHEEL = load_calibration().parameters.wheel
RULES = Consistency(WHEEL, loader_database())
KNOWN = dict.fromkeys(NEEDS, True)
STANDING = Estimates(*([0.0] * len(Estimates._fields)))._replace(
    **{f"normal_{n}": 28e3 for n in WHEELS}, lift_off_margin=1.0, predicted_margin=1.0, time_to_lift_off=NEVER
)


TICK_NS = 10_000_000


def invalid(**changes):
    rules = Consistency(WHEEL, loader_database())
    return {name for name, flag in rules.valid(STANDING._replace(**changes), KNOWN, 0).items() if not flag}


def test_a_standing_machine_breaks_no_rule():
    assert invalid() == set()


def test_a_tyre_that_would_have_to_pull_makes_all_loads_invalid():
    """The balance of forces beyond a lift-off is one of a machine held down, and so is all that comes from it."""
    assert invalid(normal_1=-20e3) == set(NEEDS) - {"speed"}


@pytest.mark.parametrize("gap", [-8e3, 8e3])
def test_loads_that_do_not_add_up_are_invalid(gap):
    assert invalid(load_gap=gap) == set(NEEDS) - {"speed"}
    assert invalid(load_gap=0.1 * gap) == set()


def test_loads_are_invalid_while_the_balance_contradicts_the_gyro():
    assert invalid(load_contradiction=1.01 * CONTRADICTION) == set(NEEDS) - {"speed"}
    assert invalid(load_contradiction=0.99 * CONTRADICTION) == set()


def test_a_doubtful_speed_takes_the_slips_with_it():
    assert invalid(speed_doubt=1.01 * DOUBTFUL) == {"speed"} | {f"slip_{n}" for n in WHEELS}
    assert invalid(speed_doubt=0.99 * DOUBTFUL) == set()


@pytest.mark.parametrize("name", ["load_transfer_ratio", "predicted_load_transfer_ratio"])
@pytest.mark.parametrize("value", [-2.046, 1.01])
def test_a_ratio_beyond_one_is_invalid(name, value):
    assert invalid(**{name: value}) == {"roll_over"}


@pytest.mark.parametrize("n", WHEELS)
def test_a_force_beyond_friction_is_invalid_for_that_wheel_alone(n):
    assert invalid(**{f"lateral_{n}": 40e3}) == {f"force_{n}"}
    assert invalid(**{f"longitudinal_{n}": -40e3}) == {f"force_{n}"}


@pytest.mark.parametrize("n", WHEELS)
def test_a_slip_beyond_its_signal_is_invalid(n):
    """The frame would carry 5.05, the largest it can."""
    assert invalid(**{f"slip_{n}": 6.0}) == {f"slip_{n}"}


@given(
    st.lists(st.floats(0.0, 8e4), min_size=4, max_size=4),
    st.lists(st.floats(-0.7, 0.7), min_size=8, max_size=8),
)
def test_forces_within_the_friction_of_a_dry_road_are_valid(loads, shares):
    found = STANDING._replace(**{f"normal_{n}": load for n, load in zip(WHEELS, loads, strict=True)})
    for n in WHEELS:
        load, along, across = loads[n - 1], shares[n - 1], shares[n + 3]
        found = found._replace(**{f"longitudinal_{n}": along * load, f"lateral_{n}": across * load})
    assert RULES.contradicted(found) == frozenset()


def test_what_its_inputs_make_invalid_stays_so():
    assert RULES.valid(STANDING, KNOWN | {"payload": False}, 0)["payload"] is False


@given(st.lists(st.booleans(), min_size=1, max_size=200))
def test_an_estimate_is_valid_again_after_the_settling_time_and_not_before(pulls):
    """Whatever the wheel's load does: valid is what broke no rule in the last 0.2 s."""
    rules = Consistency(WHEEL, loader_database())
    for k, pulling in enumerate(pulls):
        e = STANDING._replace(normal_1=-20e3) if pulling else STANDING
        lately = pulls[max(k - SETTLING_NS // TICK_NS + 1, 0) : k + 1]
        assert rules.valid(e, KNOWN, k * TICK_NS)["roll_over"] is not any(lately)


def test_a_lifted_wheel_has_landed_only_when_it_bears_load_again():
    """Its estimated load swings about zero for a second; then it carries 5 kN."""
    rules = Consistency(WHEEL, loader_database())
    loads = [-5e3, *np.tile([-500.0, 300.0], 50), *np.full(SETTLING_NS // TICK_NS, 5e3), 5e3]
    flags = [
        rules.valid(STANDING._replace(normal_1=load), KNOWN, k * TICK_NS)["normal"]
        for k, load in enumerate(loads)
    ]
    assert flags == [False] * (len(loads) - 2) + [True, True]


def test_a_wheel_that_hardly_bears_load_is_valid_while_no_rule_was_broken():
    rules = Consistency(WHEEL, loader_database())
    assert all(
        rules.valid(STANDING._replace(normal_1=300.0), KNOWN, k * TICK_NS)["normal"] for k in range(50)
    )


def test_a_restart_forgets_that_a_rule_was_broken():
    rules = Consistency(WHEEL, loader_database())
    assert not rules.valid(STANDING._replace(normal_1=-20e3), KNOWN, 0)["normal"]
    rules.forget()
    assert rules.valid(STANDING, KNOWN, TICK_NS)["normal"]
