"""Page and verdicts of the Monte Carlo over wrong calibrations."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil.results import Case, Suite
from hil.verdict import JUSTIFIED_MARGIN
from hil.verdict import Result as Verdict
from studies.campaigns.batch import Result, header, markdown_table
from studies.campaigns.normal_force import PILE_AND_LOCK

DRIVES, PILE = 0.08, 0.13
"""Aims of the 95th percentile of the worst wheel's RMS over its standing load: in all drive cases, and with a pile or locked wheels. The aims with the
right calibration, and 5 % for masses 3 % off and centres of gravity 5 cm off on a wheelbase of 3 m."""
HIGH: Final = 95.0


def page(
    names: Sequence[str],
    driven: Sequence[Result],
    turned: Sequence[Result],
    command: str,
    count: int,
    seed: int,
) -> str:
    """The document."""
    text = header(
        "Estimates with a wrong calibration",
        command,
        f"{count} calibrations, seeds {seed} to {seed + count - 1}",
    )
    return (
        text
        + INTRODUCTION
        + markdown_table(
            ("drive case", "normal forces, right", "wrong, median", "wrong, 95 %", "payload, right", "wrong, median", "wrong, 95 %"),
            [drive_row(name, result) for name, result in zip(names, driven, strict=True)],
        )
        + COVERAGE
        + coverage_table(names, driven)
        + TURNS
        + turn_table(turned)
    )  # fmt: skip


INTRODUCTION: Final = """
Masses of all parts drawn evenly within ±3 % (inertias with them), places of all centres of gravity ±5 cm, tyre radius ±1 %, stiffnesses of the
tyres ±15 %; the friction of the ground stays unknown. Every drive is driven once, without limits and with noisy sensors; the ECU's part is computed from its frames
with the right calibration and with every wrong one. Thresholds, delays and sensor biases stay as they are.

## Normal forces and payload

Normal forces: RMS error of the worst wheel up to the first lift-off, in % of the load that it carries standing. Payload: RMS error after the first
second [kg]; in the pile the ground that lies in the bucket counts, by what the wheels truly bear.

"""
COVERAGE: Final = """
## What the 95 % intervals cover

Each cycle gives a standard deviation beside these estimates (`ecu.estimators.uncertainty`). Share of the samples after the first second whose
true value lies within 1.96 of it, over all wrong calibrations; *right*: with the right one. Aim: 92 to 98 % over all drive cases.

"""
COVERED: Final = ("front left", "front right", "rear left", "rear right", "load-transfer ratio", "payload")
TURNS: Final = f"""
## Warnings of roll-over

Turns drawn from the confirmation grid (`loaderhil campaign roll-over`), on level ground. Lead: from the first warning to the lift-off. A false
alarm: a warning in a turn in which every wheel keeps more than {100 * JUSTIFIED_MARGIN:.0f} % of its standing load.

"""


def drive_row(name: str, result: Result) -> list[str]:
    """One drive case."""
    worst, payload = 100.0 * np.array(result["worst"]), np.array(result["payload"])
    forces = (worst[0], np.median(worst[1:]), np.percentile(worst[1:], HIGH))
    loads = (payload[0], np.median(payload[1:]), np.percentile(payload[1:], HIGH))
    return [name.replace("_", " "), *(f"{x:.1f} %" for x in forces), *(f"{x:.0f} kg" for x in loads)]


def coverage(driven: Sequence[Result]) -> NDArray[np.float64]:
    """Share covered by wrong calibrations, (drives, estimates)."""
    return np.array([np.mean(np.array(result["covered"])[1:], axis=0) for result in driven])


def coverage_table(names: Sequence[str], driven: Sequence[Result]) -> str:
    """One row per drive case, and all of them."""
    wrong = coverage(driven)
    right = np.array([result["covered"][0] for result in driven])
    rows = [[name.replace("_", " "), *percents(row)] for name, row in zip(names, wrong, strict=True)]
    rows += [["all", *percents(wrong.mean(axis=0))], ["all, right", *percents(right.mean(axis=0))]]
    return markdown_table(("drive case", *COVERED), rows)


def percents(shares: NDArray[np.float64]) -> list[str]:
    """Shares in %."""
    return [f"{100.0 * share:.0f} %" for share in shares]


def lifting(turned: Sequence[Result]) -> list[Result]:
    """Turns in which a wheel lifts."""
    return [r for r in turned if r["lift_off_s"] is not None]


def calm(turned: Sequence[Result]) -> list[Result]:
    """Turns without need of a warning."""
    return [r for r in turned if r["lift_off_s"] is None and r["margin"] > JUSTIFIED_MARGIN]


def turn_table(turned: Sequence[Result]) -> str:
    """Leads and false alarms, right beside wrong."""
    lifts, quiet = lifting(turned), calm(turned)

    def column(of: slice) -> list[str]:
        leads = [lead for r in lifts for lead in r["leads_s"][of]]
        known = np.array([lead for lead in leads if lead is not None])
        late = len(leads) - int((known > 0.0).sum())
        alarms = [alarm for r in quiet for alarm in r["false_alarms"][of]]
        shown = ["–"] * 3
        if known.size:
            figures = (np.median(known), np.percentile(known, 100.0 - HIGH), known.min())
            shown = [f"{x:.2f} s" for x in figures]
        return [f"{late} of {len(leads)}", *shown, f"{sum(alarms)} of {len(alarms)}"]

    rows = ("lift-offs announced late or never", "lead, median", "lead, 5 %", "lead, least", "false alarms")
    right, wrong = column(slice(0, 1)), column(slice(1, None))
    return markdown_table(("", "right", "wrong"), [list(row) for row in zip(rows, right, wrong, strict=True)])


def suites(names: Sequence[str], driven: Sequence[Result], turned: Sequence[Result]) -> list[Suite]:
    """What is aimed at with wrong calibrations, as test cases."""
    forces = [accuracy(name, result) for name, result in zip(names, driven, strict=True)]
    leads = [lead for r in lifting(turned) for lead in r["leads_s"]]
    alarms = [alarm for r in calm(turned) for alarm in r["false_alarms"]]
    late = sum(lead is None or lead <= 0.0 for lead in leads)
    warnings = [
        none("a warning ahead of every lift-off", late, len(leads), "come late or never"),
        none("no false alarm", sum(alarms), len(alarms), "turns without need are warned of"),
    ]
    return [
        Suite(name="normal forces, wrong calibrations", cases=tuple(forces)),
        Suite(name="roll-over warnings, wrong calibrations", cases=tuple(warnings)),
    ]


def accuracy(name: str, result: Result) -> Case:
    """Whether 95 of 100 wrong calibrations keep the aim."""
    aim = PILE if name in PILE_AND_LOCK else DRIVES
    high = float(np.percentile(result["worst"][1:], HIGH))
    return Case(
        name=f"{name}: normal forces within {100 * aim:.0f} % RMS",
        result=Verdict.PASSED if high <= aim else Verdict.FAILED,
        reason=f"95th percentile of the worst wheel {100 * high:.1f} % of the standing load",
    )


def none(question: str, broken: int, among: int, what: str) -> Case:
    """A question whose answer is no as soon as one is broken."""
    if not among:
        return Case(name=question, result=Verdict.INCONCLUSIVE, reason="no such turn was drawn")
    result = Verdict.FAILED if broken else Verdict.PASSED
    return Case(name=question, result=result, reason=f"{broken} of {among} {what}")
