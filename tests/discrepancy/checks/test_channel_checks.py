"""Zero points and clocks of channels."""

from dataclasses import replace

from discrepancy.checks.channel_checks import failing_channels
from discrepancy.estimation.problem import Problem
from tests.discrepancy.toys import record, tank


def test_a_zero_point_that_is_off_is_no_other_clock() -> None:
    """The level is known at the start, so nothing takes the offset away before prediction and reading are compared."""
    model = tank("level bias")
    area, level = model.nuisances
    known = replace(model, nuisances=(area, replace(level, scope="all", guess=None, value=0.5)))
    for seed in range(1, 7):
        assert failing_channels(Problem(known, [record(seed, bias=-3.0)])) == []
    late = record(2)
    level_late = replace(late.signals["level"], time_s=late.signals["level"].time_s + 9.0)
    shifted = replace(late, signals={**late.signals, "level": level_late})
    (complaint,) = failing_channels(Problem(known, [shifted]))
    assert "another clock" in complaint.text
