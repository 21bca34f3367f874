"""The roll-over campaign as a Markdown document: counts, lead times, and a table of cases."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hil.verdict import JUSTIFIED_MARGIN, WHEELS
from studies.campaigns.batch import Result, header, markdown_table

COMMAND = "loaderhil campaign roll-over"
FILE = "rollover_grid.md"

INTRODUCTION = f"""
Abrupt turns of the L60 from straight driving, on level ground, with every combination of speed, load and articulation
rate. Corrected and printed estimators watch the very same drive. The ECU's thresholds were chosen on the grid
*tuning* alone; the grid *confirmation* has other speeds, loads and rates and turns to both sides. No number was fitted
to it, though it was watched while the prediction was written.

- *Lifts*: a wheel's true normal force is zero for more than 50 ms.
- *Warning*: RollOver.State at warning or above, or a roll-over reason in Warnings, for at least 50 ms.
- *Lead*: true lift-off minus the first warning; positive is ahead, negative is late.
- *False alarm*: a warning in a turn in which no wheel lifts and every wheel keeps more than
  {100 * JUSTIFIED_MARGIN:.0f} % of its standing load.
- *Prevented*: with the limits on no wheel lifts.

"""

Found = tuple[str, str, Sequence[Any], Sequence[Result]]
"""A grid's name, its picture, its cases and their results."""


def document(found: Sequence[Found]) -> str:
    """The whole document."""
    # of the scenarios as they were run, not of the options: a kept result has its own
    seeds = sorted({result["seed"] for *_, results in found for result in results})
    head = header("Roll-over: announced and prevented", COMMAND, f"seed {', '.join(map(str, seeds))}")
    sections = [section(*grid) for grid in found]
    return "\n".join(
        (head + INTRODUCTION, summary({name: results for name, *_, results in found}), *sections)
    )


def section(name: str, picture: str, cases: Sequence[Any], results: Sequence[Result]) -> str:
    """One grid: picture, turns that lift, failures."""
    return "\n".join(
        (
            f"## Grid: {name}\n",
            f"![Lead over speed and articulation rate]({picture})\n",
            "### Turns that lift a wheel\n",
            lifting_table(cases, results),
            "### Failures\n",
            failures(cases, results),
        )
    )


def summary(found: Mapping[str, Sequence[Result]]) -> str:
    """Counts and lead times, a column per grid."""
    columns = [counts(results) for results in found.values()]
    rows = [[label, *(column[label] for column in columns)] for label in columns[0]]
    return markdown_table(("", *found), rows)


def counts(results: Sequence[Result]) -> dict[str, str]:
    """Counts and lead times of one grid."""
    # with the limits off; a turn that the limits prevent is a turn that lifts
    lifting = [result for result in results if result["lift_off_s"] is not None]
    calm = [result for result in results if result["lift_off_s"] is None]
    # a warning near lift-off is right even where no wheel lifts; only far from it is it a false alarm
    comfortable = [result for result in calm if result["margin"] > JUSTIFIED_MARGIN]
    near = [result for result in calm if result["margin"] <= JUSTIFIED_MARGIN]
    return {
        "turns": str(len(results)),
        "lift a wheel with the limits off": f"{len(lifting)}, of which {_count(lifting, 'rolls_over')} roll over",
        "corrected warning ahead of lift-off": _of(sum(_ahead(r["lead_s"]) for r in lifting), lifting),
        "corrected lead: least, median, most": spread(r["lead_s"] for r in lifting),
        "printed warning ahead of lift-off": _of(sum(_ahead(r["printed_lead_s"]) for r in lifting), lifting),
        "printed lead: least, median, most (negative is late)": spread(r["printed_lead_s"] for r in lifting),
        "printed: never warns": _of(sum(r["printed_lead_s"] is None for r in lifting), lifting),
        "false alarms among turns that keep more than 30 %": _share(
            _count(comfortable, "false_alarm"), comfortable
        ),
        "warned among turns that keep less, without lift-off": _of(_count(near, "warned"), near),
        "flicker: warnings shorter than 50 ms, not counted": _flicker(results),
        "prevented with the limits on": _of(sum(not r["limited_lifts"] for r in lifting), lifting),
        "roll over with the limits on": _of(_count(results, "limited_rolls_over"), results),
    }


def _ahead(lead_s: float | None) -> bool:
    # 0 is no lead: a warning at the very frame of lift-off prevents nothing
    return lead_s is not None and lead_s > 0


def _count(results: Iterable[Result], key: str) -> int:
    return sum(bool(result[key]) for result in results)


def _flicker(results: Sequence[Result]) -> str:
    return f"{sum(r['flickers'] for r in results)} in {_count(results, 'flickers')} turns"


def _of(count: int, among: Sequence[Result]) -> str:
    return f"{count} of {len(among)}"


def _share(count: int, among: Sequence[Result]) -> str:
    return f"{_of(count, among)} ({100 * count / len(among):.0f} %)" if among else _of(count, among)


def spread(leads: Iterable[float | None]) -> str:
    """Smallest, median and largest lead time [s] as text."""
    # turns without a warning have a row of their own: as a lead they would be minus infinity
    known = [lead for lead in leads if lead is not None]
    if not known:
        return "–"
    return f"{min(known):.2f}, {float(np.median(known)):.2f}, {max(known):.2f} s"


Cell = Callable[[Any, Result], str]
COLUMNS: dict[str, Cell] = {
    "load": lambda case, _: case.load.name,
    "turn": lambda case, _: case.turn,
    "rate [°/s]": lambda case, _: f"{case.rate_deg_s:g}",
    "speed [km/h]": lambda case, _: f"{case.speed_kmh:g}",
    "first wheel": lambda _, result: WHEELS[result["wheel"]],
    "rolls over": lambda _, result: "yes" if result["rolls_over"] else "no",
    "lead [s]": lambda _, result: _lead(result["lead_s"]),
    "printed lead [s]": lambda _, result: _lead(result["printed_lead_s"]),
    "least load, limits on": lambda _, result: f"{100 * result['limited_margin']:.0f} %",
}


def _lead(lead_s: float | None) -> str:
    return "never" if lead_s is None else f"{lead_s:.2f}"


def _place(case: Any) -> str:
    return f"{case.ground.name}, " if case.ground.name != "level" else ""


def lifting_table(
    cases: Sequence[Any], results: Sequence[Result], columns: Mapping[str, Cell] = COLUMNS
) -> str:
    """One row per turn that lifts a wheel when nothing limits it."""
    rows = [
        [cell(case, result) for cell in columns.values()]
        for case, result in zip(cases, results, strict=True)
        if result["lift_off_s"] is not None
    ]
    return markdown_table(tuple(columns), rows)


def failures(cases: Sequence[Any], results: Sequence[Result]) -> str:
    """Every turn in which the ECU failed: no warning ahead, lift-off with limits on, or a false alarm."""
    lines = []
    for case, result in zip(cases, results, strict=True):
        wrong = []
        if result["lift_off_s"] is not None and not _ahead(result["lead_s"]):
            wrong.append(f"warning {_lead(result['lead_s'])} s ahead of lift-off")
        if result["limited_lifts"]:
            wrong.append(
                "a wheel lifts with the limits on"
                + (" and it rolls over" if result["limited_rolls_over"] else "")
            )
        if result["false_alarm"]:
            wrong.append(f"false alarm, every wheel keeps {100 * result['margin']:.0f} %")
        if wrong:
            lines.append(
                f"- {_place(case)}{case.load.name}, {case.turn}, {case.rate_deg_s:g} °/s, {case.speed_kmh:g} km/h: {'; '.join(wrong)}"
            )
    return ("\n".join(lines) if lines else "None.") + "\n"
