"""Roll-over off the level road: abrupt turns on grades, side slopes and slippery ground, with loads at several heights."""

import random
from collections.abc import Sequence
from pathlib import Path

from ecu.core import PYTHON, Core
from hil.results import Suite
from hil.verdict import JUSTIFIED_MARGIN
from studies.campaigns.batch import Result, header, results_of
from studies.campaigns.false_alarms import SLIDING, by_cause, explain
from studies.campaigns.roll_over import CACHE, LEVEL, Case, Grid, Ground, Load, run_case
from studies.campaigns.roll_over_document import COLUMNS, Cell, failures, lifting_table, summary
from studies.campaigns.verdicts import roll_over

COMMAND = "loaderhil campaign roll-over --extended"
FILE = "rollover_extended.md"
EXTENDED = Grid(
    "extended",
    (10.0, 16.0, 22.0),
    (
        Load("empty, carry", 0.0, None),
        Load("3204 kg, carry", 3204.0, None),
        Load("3204 kg, arm level", 3204.0, 0.0),
        Load("3204 kg, arm up", 3204.0, 46.0),
    ),
    (22.5,),
    (39.0, -39.0),
    (
        LEVEL,
        Ground("uphill 15 %", grade_percent=15.0),
        Ground("downhill 15 %", grade_percent=-15.0),
        Ground("left side up 6°", bank_deg=6.0),
        Ground("friction 0.45", friction=0.45),
        Ground("downhill 15 %, left side up 6°", grade_percent=-15.0, bank_deg=6.0),
        Ground("left side up 6°, friction 0.45", bank_deg=6.0, friction=0.45),
    ),
)

SPLIT_SEED = 8  # fixed once: drawing again until the confirmation looks good would make it worthless

INTRODUCTION = f"""
Abrupt turns of the L60 to either side with every combination of speed, load and its height, grade, bank and friction. What the
limits need to know of slopes (`turn_ahead_s`, `turn_floor`, `braking_m_s2`, `braking_slack_s`) was chosen on one half of them, drawn
with seed {SPLIT_SEED}, both sides of a turn together; the *other half*
confirms it, though its failures, too, were looked at while their causes were sought. No threshold of a warning was chosen here. Words as on the page of the [level grid](rollover_grid.md): a wheel *lifts* when its true normal force
is zero for more than 50 ms; *warned* is a warning ahead of that; *prevented*: with the limits on no wheel lifts; a *false alarm* is a
warning although no wheel lifts and every wheel keeps more than {100 * JUSTIFIED_MARGIN:.0f} % of its standing load.

"""

FRICTION_WORDS = f"""The ECU foresees a turn with the friction of its calibration, that of a dry road. How slippery the ground is shows only once an axle
slides, here: pushes with more than {100 * SLIDING:.0f} % of what the ground gives. Then a warning is not withheld either: a machine that
slides sideways tips where it comes to better ground, which can be a machine's length ahead.
"""


def run_campaign(out: Path, jobs: int | None = None, core: Core = PYTHON) -> tuple[Path, list[Suite]]:
    """Run the grid and write its page; returns it, and what was aimed at."""
    cases = EXTENDED.cases()
    results = results_of(cases, run_case, core, cache=CACHE, jobs=jobs, title="turns off the level")
    false = [case for case, result in zip(cases, results, strict=True) if result["false_alarm"]]
    reasons = results_of(false, explain, cache=CACHE, jobs=jobs, title="false alarms")
    out.mkdir(parents=True, exist_ok=True)
    (out / FILE).write_text(page(cases, results, reasons))
    return out / FILE, [roll_over(EXTENDED.name, results, JUSTIFIED_MARGIN)]


def tuning_half(cases: Sequence[Case]) -> set[Case]:
    """Half of the speeds and loads of every ground, both sides of a turn together."""
    # Ground by ground, so that neither half lacks one. The sides stay together: the confirming half would else hold the mirror
    # images of the turns that the values were chosen on.
    draw = random.Random(SPLIT_SEED)
    chosen = set()
    for ground in dict.fromkeys(case.ground for case in cases):
        here = [case for case in cases if case.ground == ground]
        places = list(dict.fromkeys((case.load, case.speed_kmh) for case in here))
        half = draw.sample(places, len(places) // 2)
        chosen |= {case for case in here if (case.load, case.speed_kmh) in half}
    return chosen


def unanswered(result: Result) -> bool:
    """Whether a wheel lifts although the limits are on, and no warning came ahead of it."""
    lead_s = result["limited_lead_s"]
    return bool(result["limited_lifts"]) and not (lead_s is not None and lead_s > 0)


def page(cases: Sequence[Case], results: Sequence[Result], reasons: Sequence[Result]) -> str:
    """The document; reasons: what explains the false alarms."""
    lifting = [result for result in results if result["lift_off_s"] is not None]
    left, named = sum(map(unanswered, results)), sum(r["named_wheel"] == r["wheel"] for r in lifting)
    seeds = sorted({result["seed"] for result in results})
    pairs, tuned = list(zip(cases, results, strict=True)), tuning_half(cases)
    halves = {
        "tuning half": [r for case, r in pairs if case in tuned],
        "other half": [r for case, r in pairs if case not in tuned],
    }
    by_ground = {
        ground.name: [r for case, r in pairs if case.ground == ground]
        for ground in dict.fromkeys(case.ground for case in cases)
    }
    columns: dict[str, Cell] = {"ground": lambda case, _: case.ground.name, **COLUMNS}
    return "\n".join(
        (
            header("Roll-over off the level road", COMMAND, f"seed {', '.join(map(str, seeds))}")
            + INTRODUCTION
            + f"Neither prevented nor warned of: **{left} of {len(results)}** turns. The wheel that lifts first is the one the ECU "
            f"named in {named} of {len(lifting)} turns that lift one.\n",
            summary({"all": results, **halves}),
            summary(by_ground),
            "## False alarms by cause\n",
            FRICTION_WORDS,
            by_cause(reasons),
            "## Turns that lift a wheel\n",
            lifting_table(cases, results, columns),
            "## Failures\n",
            failures(cases, results),
        )
    )
