"""Do the limits keep every wheel down? Many random drives, half of them with a calibration that is wrong as real ones are.

Every lift-off of a wheel although the limits act is explained by counterfactuals: the same ground and load driven straight with the levers
at rest (no limit of these could help), the right calibration, dry ground. What none of them explains is a failure of the limits.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ecu.calibration import load_calibration
from ecu.core import PYTHON, Core, Ecu
from ecu.findings import FaultFound
from hil import verdict
from hil.compose import calibration_of, plant_unit, standing_loads
from hil.judgement import first_warning
from hil.lockstep import Lockstep, Recording
from hil.results import Case, Suite
from hil.verdict import LIFT_MIN_S, WHEELS, Result, RunVerdict, judge
from plant.unit.scenario import Scenario
from studies.campaigns import manoeuvres, wrong_calibration
from studies.campaigns.batch import Result as Found
from studies.campaigns.batch import header, markdown_table, results_of
from studies.campaigns.manoeuvres import DRY, KINDS, Manoeuvre, drawn, even, scenario_of, straight
from studies.campaigns.memory import columns_of

Array = NDArray[np.float64]

COMMAND: Final = "loaderhil campaign prevention"
FILE: Final = "prevention.md"
CACHE: Final = Path("out/campaign/prevention")
# Drives of seeds 1 to 8 were looked at when decisions 83 to 89 were made: their page would flatter the limits.
RUNS, SEED = 1000, 9
SAME_S: Final = 0.2
"""Lift-offs so close to each other have the same cause [s]."""
# No factor of the number of kinds (6), which come in turn: every fourth drive would only be of three kinds.
FREE_EVERY: Final = 5
"""One drive of so many is also driven without limits, to see whether there is anything to prevent."""

GROUND: Final = (
    "ground and load alone: driven straight with the levers at rest it lifts the same wheel at the same time"
)
TOGETHER: Final = (
    "ground and turn together: on even ground the wheel keeps the limits' floor; straight on this ground it keeps less than the floor, "
    "or what turn and ground take of its load at that time adds up to all of it"
)
CALIBRATION: Final = "the wrong calibration: with the right one no wheel lifts but by the ground"
SLIPPERY: Final = "slippery ground: on a dry road no wheel lifts but by the ground"
UNEXPLAINED: Final = "not explained"
CAUSES: Final = (GROUND, TOGETHER, CALIBRATION, SLIPPERY, UNEXPLAINED)
BY_GROUND: Final = (GROUND, TOGETHER)
"""Causes without which no wheel would have lifted, and of which no limit knows before the wheels do."""


def ecu_of(m: Manoeuvre, scenario: Scenario, *, limits: bool, core: Core = PYTHON) -> Ecu:
    """The ECU of a drive, with the drive's calibration. Its sensors are tested, as in every run of a user."""
    name = calibration_of(scenario)
    if m.calibration_seed is None:
        return core.ecu(load_calibration(name), limits=limits, detect_faults=True)
    wrong = wrong_calibration.wrong_calibration(name, m.calibration_seed)
    return core.ecu(wrong, limits=limits, detect_faults=True)


def driven(m: Manoeuvre, *, limits: bool, core: Core = PYTHON) -> tuple[RunVerdict, Recording]:
    """One drive in lockstep, and its verdict."""
    scenario = scenario_of(m)
    # not by `lockstep`: that takes a calibration by name, and these are drawn
    bench = Lockstep(plant_unit(scenario), ecu_of(m, scenario, limits=limits, core=core), reference=False)
    recording = bench.run()
    truth = recording.truth
    judged = judge(
        time_s=np.array([row.time_s for row in truth]),
        normal_force=np.array([row.normal_force for row in truth]),
        roll=np.array([row.roll for row in truth]),
        load_transfer_ratio=np.array([row.load_transfer_ratio for row in truth]),
        warned_s=first_warning(columns_of(recording.bus)),
        standing=standing_loads(scenario),
    )
    return judged, recording


def called_faulty(recording: Recording) -> list[str]:
    """Every finding of the detection, with its moment; the sensors of all drives are sound."""
    return [
        f"{' or '.join(found.signals)} at {found.at_ns * 1e-9:.2f} s"
        for found in recording.ecu_findings
        if isinstance(found, FaultFound)
    ]


@dataclass(frozen=True, slots=True)
class LiftOff:
    """A wheel (0 to 3) in the air, from its first to its last moment [s]."""

    begin_s: float
    end_s: float
    wheel: int


def lift_offs(m: Manoeuvre, core: Core = PYTHON, least_s: float = LIFT_MIN_S) -> list[LiftOff]:
    """Every lift-off of a drive with the limits on that lasts longer than `least_s` [s]."""
    return _lift_offs(driven(m, limits=True, core=core)[1], least_s)


def _lift_offs(recording: Recording, least_s: float = LIFT_MIN_S) -> list[LiftOff]:
    times = np.array([row.time_s for row in recording.truth])
    forces = np.array([row.normal_force for row in recording.truth])
    return [LiftOff(*found) for found in verdict.lift_offs(times, forces, least_s)]


def beside(lifted: LiftOff, others: Sequence[LiftOff]) -> bool:
    """Whether the same wheel is in the air in one of the others when this lift-off begins, or nearly so."""
    return any(
        other.wheel == lifted.wheel and other.begin_s - SAME_S <= lifted.begin_s <= other.end_s + SAME_S
        for other in others
    )


@dataclass(frozen=True, slots=True)
class Driven:
    """A drive as far as causes ask for it: time (n,) [s], normal forces as shares of the standing ones (n, 4)."""

    time_s: Array
    share: Array

    def least(self, lifted: LiftOff) -> float:
        """The smallest share of its standing load that the lifted wheel has here while it is in the air there, or nearly then."""
        then = (self.time_s > lifted.begin_s - SAME_S) & (self.time_s < lifted.end_s + SAME_S)
        return float(self.share[then, lifted.wheel].min()) if then.any() else 1.0


def shares(m: Manoeuvre, core: Core = PYTHON) -> Driven:
    """A drive with the limits on."""
    truth = driven(m, limits=True, core=core)[1].truth
    force = np.array([row.normal_force for row in truth])
    return Driven(np.array([row.time_s for row in truth]), force / np.array(standing_loads(scenario_of(m))))


def adds_up(lifted: LiftOff, on_even: Driven, by_ground: Driven, floor: float) -> bool:
    """Whether a turn in which the limits keep their floor and the ground take the wheel's load together.

    The floor is what the limits keep for all that they do not foresee. A step that alone takes more than they leave, or all but the floor, is beyond it.
    """
    left_by_turn, left_by_ground = on_even.least(lifted), by_ground.least(lifted)
    return left_by_turn >= floor and (left_by_ground < floor or left_by_turn + left_by_ground <= 1.0)


def together(
    m: Manoeuvre, lifted: Sequence[LiftOff], causes: Sequence[str], core: Core = PYTHON
) -> list[str]:
    """The causes, with those named that are ground and turn together; a drive on even ground has none."""
    if UNEXPLAINED not in causes or not (m.left_m or m.right_m):
        return list(causes)
    floor = load_calibration(calibration_of(scenario_of(m))).parameters.prediction.margin_floor
    on_even, by_ground = shares(even(m), core), shares(straight(m), core)
    return [
        TOGETHER if cause == UNEXPLAINED and adds_up(each, on_even, by_ground, floor) else cause
        for each, cause in zip(lifted, causes, strict=True)
    ]


def causes_of(m: Manoeuvre, lifted: Sequence[LiftOff], core: Core = PYTHON) -> list[str]:
    """Why each of these lift-offs came although the limits acted: the first of the counterfactuals below that explains it.

    The ground explains a lift-off of the same wheel that it makes by itself at the same time. Where it does not, it may still take so much of
    the wheel's load that a turn in which the limits keep their floor takes the rest: no limit knows of a step before the wheels do. Calibration and friction explain what is left if nothing is left without them.
    """
    if not lifted:
        return []
    # limits stay on here too, so that only steering and levers differ; a wheel that the ground takes off for 40 ms counts as well
    by_ground = lift_offs(straight(m), core, 0.0)
    causes = [GROUND if beside(each, by_ground) else UNEXPLAINED for each in lifted]
    causes = together(m, lifted, causes, core)
    for cause, applies, changed in (
        # the order matters: a drive that would lift with the right calibration too is not the calibration's fault
        (CALIBRATION, m.calibration_seed is not None, dataclasses.replace(m, calibration_seed=None)),
        (SLIPPERY, m.friction < DRY, dataclasses.replace(m, friction=DRY)),
    ):
        if applies and UNEXPLAINED in causes:
            left = [each for each in lift_offs(changed, core) if not beside(each, by_ground)]
            if not left:
                return [cause if each == UNEXPLAINED else each for each in causes]
    return causes


def run_case(m: Manoeuvre, core: Core = PYTHON) -> Found:
    """One drive with the limits on, as plain values; with the cause of every lift-off."""
    judged, recording = driven(m, limits=True, core=core)
    lifted = _lift_offs(recording)
    causes = causes_of(m, lifted, core)
    return {
        "lifts": judged.lifted,
        "rolls_over": judged.rolled_over,
        "wheel": judged.lifting_wheel,
        "lead_s": judged.lead_s,
        "margin": judged.margin,
        "lift_offs": [
            [each.begin_s, each.end_s, each.wheel, cause] for each, cause in zip(lifted, causes, strict=True)
        ],
        "cause": max(causes, key=CAUSES.index, default=""),
        "called_faulty": called_faulty(recording),
    }


def run_free(m: Manoeuvre, core: Core = PYTHON) -> Found:
    """Whether the same drive lifts a wheel without limits."""
    return {"lifts": driven(m, limits=False, core=core)[0].lifted}


def run_campaign(
    out: Path, *, runs: int = RUNS, seed: int = SEED, jobs: int | None = None, core: Core = PYTHON
) -> tuple[Path, Suite]:
    """Drive them all and write the page; with one verdict per kind of drive for machines that read them."""
    cases = drawn(runs, seed)
    modules = [Path(module.__file__) for module in (manoeuvres, wrong_calibration) if module.__file__]
    found = results_of(
        cases, run_case, core, cache=CACHE, jobs=jobs, title="drives with limits", also=modules
    )
    some = cases[::FREE_EVERY]
    free = results_of(
        some, run_free, core, cache=CACHE / "free", jobs=jobs, title="without limits", also=modules
    )
    out.mkdir(parents=True, exist_ok=True)
    (out / FILE).write_text(page(cases, found, free, seed), encoding="utf-8")
    return out / FILE, suite_of(cases, found)


def suite_of(cases: Sequence[Manoeuvre], found: Sequence[Found]) -> Suite:
    """One question per kind of drive: does a wheel lift that a limit could have kept down?"""
    kept = tuple(_question(kind, cases, found) for kind in KINDS)
    return Suite(name="prevention", cases=(*kept, _sound(found)))


def _sound(found: Sequence[Found]) -> Case:
    wrong = sum(bool(r["called_faulty"]) for r in found)
    return Case(
        name="no sound sensor is called faulty",
        result=Result.FAILED if wrong else Result.PASSED,
        reason=f"in {wrong} of {len(found)} drives one is",
    )


def _question(kind: str, cases: Sequence[Manoeuvre], found: Sequence[Found]) -> Case:
    of_kind = [r for c, r in zip(cases, found, strict=True) if c.kind == kind]
    # a wrong calibration and slippery ground are what the limits have to bear, so they count as failures
    failed = sum(bool(r["lifts"]) and r["cause"] not in BY_GROUND for r in of_kind)
    question = f"{kind}: no wheel lifts that a limit could keep down"
    if not of_kind:
        return Case(name=question, result=Result.INCONCLUSIVE, reason="no drive of this kind was drawn")
    result = Result.FAILED if failed else Result.PASSED
    return Case(name=question, result=result, reason=f"{failed} of {len(of_kind)} drives lift a wheel")


INTRODUCTION = """
Random drives of the L60 with the limits on. A drive starts straight at 6 to 24 km/h (reverse up to 18), with 0 to 3204 kg, the arm low or up to
its top. Its kind says what comes then: a *lever* moved in a turn, steering one way and the other (*counter-steer*), a turn in *reverse*, a step of 5 to 20 cm up
(*kerb*) or down (*drop*) under one side with steering both ways after it, a turn on a *slope* (grade up to 18 %, bank up to 9°). Half of the drives have a *wrong
calibration*: masses ±3 %, centres of gravity ±5 cm, tyre radius ±1 %, stiffnesses ±15 %, each drawn evenly. The friction of the ground is 0.4 to 0.85, which the ECU does not know.
Sensors are sound, and tested against each other as in every run: a signal that is called faulty is no longer used.
A wheel *lifts* when its true load is zero for more than 50 ms. *Margin*: smallest load of a wheel over what it carries on level ground.

"""


def page(cases: Sequence[Manoeuvre], found: Sequence[Found], free: Sequence[Found], seed: int) -> str:
    """The document."""
    command = f"{COMMAND} --runs {len(cases)} --seed {seed}"
    without = sum(bool(r["lifts"]) for r in free)
    lifted = [(c, r) for c, r in zip(cases, found, strict=True) if r["lifts"]]
    return "\n".join(
        (
            header("Prevention: random drives with the limits on", command, f"seed {seed}") + INTRODUCTION,
            f"Of {len(cases)} drives **{len(lifted)}** lift a wheel. Of {len(free)} that were also driven without limits {without} lift one.\n",
            kinds_table(cases, found),
            "## Why the others lift a wheel\n",
            "The first of these that holds when the drive is driven again, for every lift-off. A drive counts with the last of them that one of its lift-offs has.\n",
            causes_table([r for _, r in lifted]),
            "## Sound sensors that were called faulty\n",
            faulty_text(cases, found),
            "## Drives that lift a wheel\n",
            lifted_table(lifted),
        )
    )


def faulty_text(cases: Sequence[Manoeuvre], found: Sequence[Found]) -> str:
    """In how many drives the detection was wrong, and what it said there; it is what the limits then lived with."""
    said = [
        f"- {m.kind}, drive {k}, {'lifts a wheel' if r['lifts'] else 'all wheels down'}: {'; '.join(r['called_faulty'])}"
        for k, (m, r) in enumerate(zip(cases, found, strict=True), 1)
        if r["called_faulty"]
    ]
    return f"In {len(said)} of {len(found)} drives.\n\n" + "".join(f"{line}\n" for line in said)


def kinds_table(cases: Sequence[Manoeuvre], found: Sequence[Found]) -> str:
    """Drives, lift-offs and margins by kind and by calibration."""
    pairs = list(zip(cases, found, strict=True))
    groups = {kind: [r for c, r in pairs if c.kind == kind] for kind in KINDS}
    groups |= {
        "right calibration": [r for c, r in pairs if c.calibration_seed is None],
        "wrong calibration": [r for c, r in pairs if c.calibration_seed is not None],
        "all": list(found),
    }
    rows = [_kind_row(name, group) for name, group in groups.items() if group]
    heads = (
        "drives",
        "number",
        "lift a wheel",
        "... by ground and turn together",
        "... that a limit could keep down",
        "roll over",
        "margin, median",
        "5 %",
    )
    return markdown_table(heads, rows)


def _kind_row(name: str, group: Sequence[Found]) -> list[str]:
    lifted = [r for r in group if r["lifts"]]
    margins = np.array([r["margin"] for r in group])
    return [
        name,
        str(len(group)),
        str(len(lifted)),
        str(sum(r["cause"] == TOGETHER for r in lifted)),
        str(sum(r["cause"] not in BY_GROUND for r in lifted)),
        str(sum(bool(r["rolls_over"]) for r in group)),
        f"{np.median(margins):.2f}",
        f"{np.quantile(margins, 0.05):.2f}",
    ]


def causes_table(lifted: Sequence[Found]) -> str:
    """How many lift-offs each cause explains, and how many drives have no other left."""
    single = [cause for r in lifted for *_, cause in r["lift_offs"]]
    rows = [
        [cause, str(single.count(cause)), str(sum(r["cause"] == cause for r in lifted))] for cause in CAUSES
    ]
    return markdown_table(("cause", "lift-offs", "drives"), rows)


def lifted_table(lifted: Sequence[tuple[Manoeuvre, Found]]) -> str:
    """Every drive that lifts a wheel, with what repeats it."""
    rows = [
        [
            m.kind,
            f"{m.speed_kmh:g}",
            f"{m.payload_kg:g}",
            f"{m.arm_deg:g}",
            f"{m.angle_deg:g} at {m.rate_deg_s:g}",
            f"{m.lift_percent:g}, {m.tilt_percent:g}",
            f"{m.left_m:g}, {m.right_m:g}",
            f"{m.grade_percent:g} %, {m.bank_deg:g}°",
            f"{m.friction:g}",
            "right" if m.calibration_seed is None else str(m.calibration_seed),
            WHEELS[r["wheel"]],
            "none" if r["lead_s"] is None else f"{r['lead_s']:.2f}",
            r["cause"],
        ]
        for m, r in lifted
    ]
    heads = (
        "kind", "km/h", "kg", "arm [°]", "turn [°, °/s]", "lift, tilt [%]", "step left, right [m]", "slope", "friction",
        "calibration", "wheel", "warned before [s]", "cause",
    )  # fmt: skip
    return markdown_table(heads, rows)
