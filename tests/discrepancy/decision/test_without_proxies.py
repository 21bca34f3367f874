"""A name whose size would turn about without a best proxy is no name; one that hardly changes stays."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.decision.sizes.without_proxies import hanging_on_proxies
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.problem import Problem, Values
from tests.diagnosis.cases import finding
from tests.discrepancy.toys import record, tank

VALUES = {"level.bias": -2.0, "level.scale": -0.3}


def fitted(correlation: float) -> Fit:
    """A bias of -2 m beside a scale of -0.3, known to 0.3 m and 0.02."""
    sd = np.array([0.3, 0.02])
    covariance = np.outer(sd, sd) * np.array([[1.0, correlation], [correlation, 1.0]])
    none = np.zeros((0, 2))
    return Fit(tuple(VALUES), Values(VALUES, {}), 0.0, 0.0, none[:, 0], none, np.linalg.inv(covariance))


@pytest.mark.parametrize(("correlation", "named"), [(0.9, False), (0.3, True), (0.0, True), (-0.3, True)])
def test_a_size_that_turns_about_without_a_proxy_is_no_name(correlation: float, named: bool) -> None:
    """Without the scale the bias would be -2 + 0.3 correlation 0.3 / 0.02, in metres: 2.05 m, or within 1.35 m of what it is."""
    problem = Problem(tank("level bias", "level scale"), [record(1)])
    bias, scale = (
        finding(name, "sensor", {name.replace(" ", "."): VALUES[name.replace(" ", ".")]})
        for name in ("level bias", "level scale")
    )
    proxy = replace(scale, named=False, caveats=["stops at its physical bound"])
    first, second = hanging_on_proxies(problem, fitted(correlation), [bias, proxy])
    assert first.named is named
    assert second is proxy
    if not named:
        (caveat,) = first.caveats
        assert "hangs on level scale, of which the cause is unknown" in caveat
        assert "would be 2.05 m instead of -2" in caveat
    # without a proxy there is nothing to hang on
    assert hanging_on_proxies(problem, fitted(correlation), [bias, scale]) == [bias, scale]
