"""Roll-over on grids of speed, load and articulation rate: is it announced, how early, and is it prevented?

Each case is an abrupt turn from straight driving, driven three times: with the corrected and with the printed estimators that only warn
(the same drive for both), and with the corrected ones that also limit. The thresholds were chosen on one grid; another grid, with other
speeds, loads and rates, confirms them.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbc.columns import Columns
from ecu.core import PYTHON, Core, Form
from hil.compose import lockstep, standing_loads
from hil.judgement import first_warning, warning_flickers
from hil.results import Suite
from hil.verdict import JUSTIFIED_MARGIN, RunVerdict, judge
from plant.physics.surface import Surface
from plant.unit.profile import Profile
from plant.unit.scenario import Scenario, load_scenario
from studies.campaigns.batch import Result, results_of
from studies.campaigns.memory import columns_of
from studies.campaigns.roll_over_document import FILE, document
from studies.campaigns.roll_over_picture import draw
from studies.campaigns.verdicts import roll_over

BASE = "abrupt_articulation"
KMH = 1 / 3.6
TURN_AT_S = 1.5  # start of the turn
AFTER_S = 4.0
"""Simulated time after the turn: a machine that tips lies on its side 1.8 s after lift-off."""
CACHE = Path("out/campaign/roll-over")


@dataclass(frozen=True, slots=True)
class Load:
    """Payload [kg] and lift-arm angle [degrees above the horizontal]; None is the carry position."""

    name: str
    payload_kg: float
    arm_deg: float | None


@dataclass(frozen=True, slots=True)
class Ground:
    """The ground of a turn, in directions of the machine at the start of the turn."""

    name: str
    grade_percent: float = 0.0  # uphill ahead
    bank_deg: float = 0.0  # left side up
    friction: float = 0.75  # dry asphalt


LEVEL = Ground("level")


@dataclass(frozen=True, slots=True)
class Case:
    """One turn."""

    speed_kmh: float
    load: Load
    rate_deg_s: float  # of the articulation
    to_deg: float  # articulation at its end, left positive
    ground: Ground = LEVEL

    @property
    def turn(self) -> str:
        """The turn as text: '39° left'."""
        return f"{abs(self.to_deg):g}° {'left' if self.to_deg > 0 else 'right'}"


@dataclass(frozen=True, slots=True)
class Grid:
    """Every combination of its lists."""

    name: str
    speeds_kmh: tuple[float, ...]
    loads: tuple[Load, ...]
    rates_deg_s: tuple[float, ...]
    turns_deg: tuple[float, ...]
    grounds: tuple[Ground, ...] = (LEVEL,)

    @property
    def picture(self) -> str:
        """Name of the picture's file."""
        return f"rollover_grid_{self.name}.svg"

    def cases(self) -> list[Case]:
        """Every case, by ground, then turn, then load, then rate, then speed."""
        return [
            Case(speed, load, rate, turn, ground)
            for ground in self.grounds
            for turn in self.turns_deg
            for load in self.loads
            for rate in self.rates_deg_s
            for speed in self.speeds_kmh
        ]


TUNING = Grid(
    "tuning",
    (10.0, 13.0, 16.0, 19.0, 22.0, 25.0),
    (
        Load("empty, carry", 0.0, None),
        Load("3204 kg, carry", 3204.0, None),
        Load("3204 kg, arm level", 3204.0, 0.0),
        Load("3204 kg, arm up", 3204.0, 46.0),
    ),
    (9.0, 13.5, 18.0, 22.5, 27.0),
    (39.0,),
)
# Speeds, loads and rates between those of tuning, and turns to both sides: no case is in both.
CONFIRMATION = Grid(
    "confirmation",
    (11.5, 14.5, 17.5, 20.5, 23.5),
    (
        Load("1600 kg, carry", 1600.0, None),
        Load("2400 kg, arm -20°", 2400.0, -20.0),
        Load("800 kg, arm level", 800.0, 0.0),
        Load("1600 kg, arm 40°", 1600.0, 40.0),
    ),
    (11.0, 16.0, 24.0),
    (-39.0, 28.0),
)
GRIDS = (TUNING, CONFIRMATION)


def scenario_of(case: Case) -> Scenario:
    """The abrupt turn of a case."""
    base = load_scenario(BASE)
    turn_s = abs(case.to_deg) / case.rate_deg_s
    angle = Profile(((TURN_AT_S, 0.0), (TURN_AT_S + turn_s, math.radians(case.to_deg))))
    speed = case.speed_kmh * KMH
    arm = None if case.load.arm_deg is None else math.radians(case.load.arm_deg)
    return dataclasses.replace(
        base,
        duration_s=TURN_AT_S + turn_s + AFTER_S,
        payload_mass=case.load.payload_kg,
        surface=Surface(
            friction=case.ground.friction,
            grade=math.atan(case.ground.grade_percent / 100),
            bank=math.radians(case.ground.bank_deg),
        ),
        start=dataclasses.replace(base.start, speed=speed, lift_arm_angle=arm),
        script=dataclasses.replace(base.script, speed=Profile(((0.0, speed),)), articulation_angle=angle),
    )


def run_case(case: Case, core: Core = PYTHON) -> Result:
    """The three drives of a case as plain values; core: what computes the corrected estimators. The printed ones are Python only."""
    scenario = scenario_of(case)
    # the free drive is the truth for both forms: they only watch, so it is one and the same motion
    free, messages = observed(scenario, "corrected", limits=False, core=core)
    limited, _ = observed(scenario, "corrected", limits=True, core=core)
    printed, _ = observed(scenario, "printed", limits=False)
    return {
        "seed": scenario.seed,
        "lift_off_s": free.lift_off_s,
        "wheel": free.lifting_wheel,
        "named_wheel": named_wheel(messages, free.lift_off_s),
        "rolls_over": free.rolled_over,
        "margin": free.margin,
        "lead_s": free.lead_s,
        "warned": free.warned_s is not None,
        "false_alarm": free.false_alarm,
        "flickers": warning_flickers(messages),
        "printed_lead_s": printed.lead_s,
        "limited_lifts": limited.lifted,
        "limited_lead_s": limited.lead_s,
        "limited_rolls_over": limited.rolled_over,
        "limited_margin": limited.margin,
    }


def drive(scenario: Scenario, form: Form, *, limits: bool) -> tuple[RunVerdict, int]:
    """Run a scenario in lockstep and judge it; with the number of warnings too short to count."""
    verdict, messages = observed(scenario, form, limits=limits)
    return verdict, warning_flickers(messages)


def observed(
    scenario: Scenario, form: Form, *, limits: bool, core: Core = PYTHON
) -> tuple[RunVerdict, dict[str, Columns]]:
    """Run a scenario in lockstep and judge it; with what was on the bus."""
    recording = lockstep(scenario, form=form, limits=limits, reference=False, core=core).run()
    truth, messages = recording.truth, columns_of(recording.bus)
    verdict = judge(
        time_s=np.array([row.time_s for row in truth]),
        normal_force=np.array([row.normal_force for row in truth]),
        roll=np.array([row.roll for row in truth]),
        load_transfer_ratio=np.array([row.load_transfer_ratio for row in truth]),
        warned_s=first_warning(messages),
        standing=standing_loads(scenario),
    )
    return verdict, messages


def named_wheel(messages: Mapping[str, Columns], lift_off_s: float | None) -> int | None:
    """Index (front left, front right, rear left, rear right) of the wheel that RollOver names last before the lift-off, or None."""
    if lift_off_s is None:
        return None
    roll_over = messages["RollOver"]
    # the last word before the lift-off: earlier ones may name the wheel of an earlier danger
    before = roll_over.signals["LiftingWheel"][roll_over.time_s < lift_off_s]
    return int(before[-1]) - 1 if before.size and 1 <= before[-1] <= 4 else None


def run_campaign(out: Path, jobs: int | None = None, core: Core = PYTHON) -> tuple[Path, list[Suite]]:
    """Run the grids; write the tables and the pictures beside them. Returns the page, and a suite per grid."""
    out.mkdir(parents=True, exist_ok=True)
    found = []
    for grid in GRIDS:
        cases = grid.cases()
        results = results_of(cases, run_case, core, cache=CACHE, jobs=jobs, title=f"turns for {grid.name}")
        draw(cases, results, out / grid.picture)
        found.append((grid.name, grid.picture, cases, results))
    (out / FILE).write_text(document(found))
    return out / FILE, [roll_over(name, results, JUSTIFIED_MARGIN) for name, _, _, results in found]
