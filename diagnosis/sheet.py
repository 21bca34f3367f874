"""How well the machine's sheet is known: a scale on the priors of all baseline parameters."""

from dataclasses import replace
from enum import StrEnum
from typing import Final

from discrepancy.model.description import Model


class Sheet(StrEnum):
    """Where the values of the baseline come from."""

    ROUGH = "rough"  # a brochure, a similar machine
    DATASHEET = "datasheet"  # the sheet that the model's priors were written for
    WEIGHED = "weighed"  # measured on this machine


SCALE: Final = {Sheet.ROUGH: 3.0, Sheet.DATASHEET: 1.0, Sheet.WEIGHED: 1.0 / 3.0}
"""Of the standard deviation of every prior. A brochure's errors are about those that the engine calls a conflict: three times the prior."""


def with_sheet(model: Model, sheet: Sheet) -> Model:
    """The model with the priors of its shared baseline parameters scaled; initial states keep theirs."""
    scale = SCALE[sheet]
    return replace(
        model,
        nuisances=tuple(
            replace(p, prior_sd=scale * p.prior_sd) if p.prior_sd is not None and p.scope == "all" else p
            for p in model.nuisances
        ),
    )
