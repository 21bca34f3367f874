"""`loaderhil identify score`: an identification against the sealed truth of a made recording."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from bus.user_error import UserError
from identify.ends import NORMAL_95
from identify.tyre.rig_problem import CARCASS_NAME

OF_TRUTH = {"carcass_stiffness": CARCASS_NAME, "gain": "gain"}
"""Names of the measurement's truths as an identification has them, where they are called otherwise."""


class NotScored(UserError, ValueError):
    """The identification and the truth do not belong together, or one of them cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """One quantity: its truth, its estimate, and its 95 % interval."""

    name: str
    truth: float
    value: float
    lower: float
    upper: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth."""
        return self.lower <= self.truth <= self.upper


def scored(identification: Path, sealed: Path) -> list[Scored]:
    """All quantities that both know, in the order of the identification. Raises NotScored, BrokenSeal."""
    from diagnosis.blind.seal import digest, unseal

    opened = unseal(sealed)
    if not opened.truth.model.startswith("identify "):
        raise NotScored(f"{sealed}: is the truth of '{opened.truth.model}'; open it with `loaderhil score`")
    for name, expected in opened.files.items():
        file = next(sealed.parent.rglob(name), None)
        if file is not None and digest(file) != expected:
            raise NotScored(
                f"{file}: was changed after it was made: the sealed truth is that of another recording"
            )
    try:
        content = json.loads(identification.read_text(encoding="utf-8"))
        found = [
            (name, *(float(row[key]) for key in ("value", "lower", "upper")))
            for name, row in content["parameters"].items()
        ]
        if "clock" in content:
            found += _of_clock(content["clock"])
    except (OSError, RecursionError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise NotScored(
            f"{identification}: is no identification.json of `loaderhil identify`: {error}"
        ) from error
    truths = _truths(opened.truth.effects)
    rows = [
        Scored(name=name, truth=truths[name], value=value, lower=lower, upper=upper)
        for name, value, lower, upper in found
        if name in truths
    ]
    if not rows:
        raise NotScored(f"{identification}: has no quantity of {sealed}: an identification of another kind?")
    return rows


def _of_clock(clock: Mapping[str, float]) -> list[tuple[str, float, float, float]]:
    return [
        (name, clock[key], clock[key] - NORMAL_95 * clock[sd], clock[key] + NORMAL_95 * clock[sd])
        for name, key, sd in (("offset", "offset_s", "offset_sd_s"), ("drift", "drift", "drift_sd"))
    ]


def _truths(effects: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """By the names of an identification. A run's zero and a field log's zero are estimated about another zero, and are left out."""
    out = dict(effects.get("tyre", {}))
    for group in ("rig", "measurement"):
        for name, value in effects.get(group, {}).items():
            if name in OF_TRUTH or name in ("offset", "drift"):
                out[OF_TRUTH.get(name, name)] = value
    return out | {f"tare {run}": value for run, value in effects.get("tares", {}).items()}


def score_command(
    identification: Annotated[
        Path,
        typer.Argument(metavar="IDENTIFICATION.json", help="Written by `identify rig` or `identify field`."),
    ],
    truth: Annotated[
        Path,
        typer.Argument(
            metavar="TRUTH.sealed", help="Written by `make-rig` or `make-field` beside the recording."
        ),
    ],
) -> None:
    """An identification against the sealed truth of a made recording: which intervals hold.

    Example: `loaderhil identify score out/tyre/identification.json out/rig/truth.sealed`
    """
    rows = scored(identification, truth)
    for r in rows:
        mark = "inside" if r.inside else "OUTSIDE"
        print(
            f"{r.name:24} truth {r.truth:12.5g}   found {r.value:12.5g}   95 % {r.lower:.5g} to {r.upper:.5g}   {mark}"
        )
    print(f"{sum(r.inside for r in rows)} of {len(rows)} intervals hold the truth; 95 % of them should")
