"""The exported estimators against the Python ones: exact in double precision, within the rounding in single."""

import numpy as np
import pytest

from ecu.estimators.columns import estimate_columns
from ecu.estimators.live import LiveEstimator
from ecu.estimators.signals import Estimates, Inputs
from tests.deploy.c.building import STRICT, BuiltEstimators, build
from tests.deploy.c.conftest import CALIBRATION
from tests.deploy.c.drives import driven_rows

DRAWS = 12
"""Draws of the perturbed build. Single precision is one more draw of the same population: of continuous errors the chance
to lie outside of four times the hull of 12 others is below one in ten thousand (8 standard deviations of the draws)."""
MARGIN = 4.0
CHOSEN = frozenset(
    {
        "lift_off_wheel",
        "lifting_wheel",
        "time_to_lift_off",
        "predicted_margin",
        "predicted_load_transfer_ratio",
        "permitted_rate",
        "permitted_speed",
        "permitted_lever",
    }
)
"""Estimates that come from a choice: the end of a prediction at a threshold, or one of a few rates. Where a comparison is closer
than the rounding, single precision may choose the neighbour."""
FLOOR = 2.0**-23
"""Rounding of the result itself, relative."""


@pytest.fixture(scope="module")
def expected(rows):
    return estimate_columns(rows, CALIBRATION.parameters)


@pytest.fixture(scope="module")
def hull(rows, perturbed, expected):
    """Largest deviation of the perturbed draws, per cycle and estimate."""
    inputs = rows.astype(np.float32).astype(float)
    found = np.zeros_like(expected)
    for draw in range(DRAWS):
        perturbed.perturb(draw + 1)
        found = np.maximum(found, np.abs(perturbed.columns(inputs) - expected))
    return found


def test_the_translation_is_exact_in_double_precision(rows, double, expected):
    """Same operations in the same order: not a bit differs."""
    np.testing.assert_array_equal(double.columns(rows), expected)


@pytest.mark.parametrize("seed", range(4))
def test_the_translation_is_exact_on_random_inputs(double, seed):
    """Inputs that no machine gives, state carried on: branches that a drive does not take."""
    generator = np.random.default_rng(seed)
    rows = driven_rows(generator, cycles=60, failing=5)
    scale = generator.uniform(-3.0, 3.0, (len(rows), len(Inputs._fields)))
    keep = [k for k, name in enumerate(Inputs._fields) if name == "dt" or name.endswith(("usable", "limit"))]
    scale[:, keep] = 1.0
    wild = rows * scale
    state = double.initial()
    expected = LiveEstimator(CALIBRATION.parameters, "corrected")
    for row in wild:
        found, well = double.cycle(row, state)
        try:
            estimates = expected.estimate(Inputs._make(row))
        except ZeroDivisionError:
            assert not well
            break  # the ECU starts the estimators anew
        assert well
        np.testing.assert_array_equal(found, estimates)


def test_single_precision_stays_within_its_rounding(rows, single, expected, hull):
    """Continuous estimates: no further from Python than the perturbed draws say that rounding carries them."""
    off = np.abs(single.columns(rows) - expected)
    allowed = MARGIN * hull + FLOOR * np.abs(expected)
    smooth = [k for k, name in enumerate(Estimates._fields) if name not in CHOSEN]
    beyond = np.argwhere(off[:, smooth] > allowed[:, smooth])
    names = {Estimates._fields[smooth[k]] for _, k in beyond}
    assert not len(beyond), f"{len(beyond)} of {off[:, smooth].size} beyond the rounding: {sorted(names)}"


def test_choices_differ_as_rarely_as_among_draws(rows, single, expected, hull):
    """Exchangeability: single precision leaves the hull of n draws with a probability below 1 / (n + 1) per cycle."""
    off = np.abs(single.columns(rows) - expected)
    for k, name in enumerate(Estimates._fields):
        if name in CHOSEN:
            outside = np.mean(off[:, k] > MARGIN * hull[:, k] + FLOOR * np.abs(expected[:, k]))
            assert outside <= 1.0 / (DRAWS + 1), f"{name}: {outside:.2%} of the cycles"


def test_errors_of_loads_and_forces_stay_below_a_newton(rows, single, expected):
    """What the figures mean: errors far below the resolution of the bus, whose normal forces are sent in steps of 40 N."""
    off = np.abs(single.columns(rows) - expected)
    forces = [
        k
        for k, name in enumerate(Estimates._fields)
        if name.startswith(("normal_", "lateral_", "longitudinal_"))
    ]
    assert off[:, forces].max() < 1.0


def test_a_division_by_zero_fails_the_cycle_as_in_python(rows, double, single):
    """dt = 0: Python raises, C says false."""
    stopped = np.array(rows[:2])
    stopped[1, 0] = 0.0
    with pytest.raises(ZeroDivisionError):
        estimate_columns(stopped, CALIBRATION.parameters)
    for built in (double, single):
        state = built.initial()
        assert built.cycle(stopped[0], state)[1]
        assert not built.cycle(stopped[1], state)[1]


def test_a_long_run_keeps_looking_at_every_lever(double, single, rows):
    """The counter of cycles turns back before single precision stops counting, by whole turns of the four motions."""
    motion = Estimates._fields.index("permitted_motion")
    for built in (double, single):
        state = built.initial()
        built.cycle(rows[0], state)
        state[0] = 7_999_998.0
        seen = [built.cycle(row, state)[0][motion] for row in rows[1:9]]
        assert seen == [2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0]


def test_a_changed_coefficient_is_noticed(written, tmp_path, rows, expected):
    """The comparison can fail: one constant of the exported text changed by a thousandth."""
    text = (written / "estimators.c").read_text()
    assert "R(0.3333" not in text
    changed = text.replace("(R(3.0) * w", "(R(3.003) * w", 1)
    assert changed != text
    (tmp_path / "estimators.c").write_text(changed)
    library = build(
        [tmp_path / "estimators.c"],
        tmp_path / "changed.so",
        *STRICT,
        "-shared",
        "-fPIC",
        "-DECU_DOUBLE",
        f"-I{written}",
    )
    assert not np.array_equal(
        BuiltEstimators(library, np.float64, CALIBRATION.parameters).columns(rows), expected
    )
