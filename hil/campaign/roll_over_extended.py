"""Roll-over beyond the level road: abrupt turns on grades, banks and slippery ground with loads at several heights."""

from collections.abc import Sequence
from pathlib import Path

from hil.campaign.batch import Result, header, results_of
from hil.campaign.roll_over import CACHE, LEVEL, Case, Grid, Ground, Load, run_case
from hil.campaign.roll_over_document import COLUMNS, Cell, failures, lifting_table, summary
from hil.verdict import JUSTIFIED_MARGIN

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

INTRODUCTION = f"""
Abrupt turns of the L60 to either side with every combination of speed, load and its height, grade, bank and friction. None of
them was used to choose a threshold. Words as on the page of the [level grid](rollover_grid.md): a wheel *lifts* when its true normal force
is zero for more than 50 ms; *warned* is a warning ahead of that; *prevented*: with the limits on no wheel lifts; a *false alarm* is a
warning although no wheel lifts and every wheel keeps more than {100 * JUSTIFIED_MARGIN:.0f} % of its standing load.

"""


def run_campaign(out: Path, jobs: int | None = None) -> Path:
    """Run the grid and write its page."""
    cases = EXTENDED.cases()
    results = results_of(cases, run_case, cache=CACHE, jobs=jobs, title="turns off the level")
    out.mkdir(parents=True, exist_ok=True)
    (out / FILE).write_text(page(cases, results))
    return out / FILE


def unanswered(result: Result) -> bool:
    """Whether a wheel lifts although the limits are on, and no warning came ahead of it."""
    lead_s = result["limited_lead_s"]
    return bool(result["limited_lifts"]) and not (lead_s is not None and lead_s > 0)


def page(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """The document."""
    lifting = [result for result in results if result["lift_off_s"] is not None]
    left, named = sum(map(unanswered, results)), sum(r["named_wheel"] == r["wheel"] for r in lifting)
    seeds = sorted({result["seed"] for result in results})
    by_ground = {
        ground.name: [r for case, r in zip(cases, results, strict=True) if case.ground == ground]
        for ground in dict.fromkeys(case.ground for case in cases)
    }
    columns: dict[str, Cell] = {"ground": lambda case, _: case.ground.name, **COLUMNS}
    return "\n".join(
        (
            header("Roll-over off the level road", COMMAND, f"seed {', '.join(map(str, seeds))}")
            + INTRODUCTION
            + f"Neither prevented nor warned of: **{left} of {len(results)}** turns. The wheel that lifts first is the one the ECU "
            f"named in {named} of {len(lifting)} turns that lift one.\n",
            summary({"all": results, **by_ground}),
            "## Turns that lift a wheel\n",
            lifting_table(cases, results, columns),
            "## Failures\n",
            failures(cases, results),
        )
    )
