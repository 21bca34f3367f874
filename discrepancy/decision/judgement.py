"""A verdict with what lies behind it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from discrepancy.decision.groups import Alternative
from discrepancy.estimation.problem import Problem
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import State
from discrepancy.signals import findings as f


@dataclass(frozen=True, slots=True)
class Judgement:
    """The findings, and the states of the search behind them."""

    findings: f.Findings
    problem: Problem
    sheet: Problem  # the same with the priors of the model, where `problem` trusts some of them less
    baseline: State  # without effects, and without an equation
    state: State  # with all accepted effects
    left: OpenEnded  # an equation for what the model of `problem` with the accepted effects does not explain
    # by finding: it, and what the recordings cannot distinguish from it
    groups: Mapping[str, Sequence[Alternative]]
