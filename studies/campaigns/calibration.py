"""What a calibration that is wrong as real ones are does to the estimates: a Monte Carlo over drive cases and turns.

Each drive is driven once without limits, so that its motion does not depend on the calibration. Then the ECU's part is computed from the
frames of the recorded bus once with the right calibration and once with each wrong one (`studies.campaigns.wrong_calibration`).
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from ecu.calibration import Calibration, load_calibration
from ecu.cycle import EcuCycle
from ecu.estimators.columns import estimate_columns
from ecu.estimators.parameters import GRAVITY
from ecu.estimators.signals import Estimates
from ecu.outputs import TICK_NS
from hil.compose import Choice, calibration_of, lockstep, standing_loads
from hil.judgement import first_warning
from hil.lockstep import ECU_PHASE_NS
from hil.results import Suite
from hil.verdict import first_lift_off, judge
from plant.truth import Truth
from plant.unit.scenario import list_scenarios
from studies.campaigns import normal_force, roll_over, wrong_calibration
from studies.campaigns.ablation import ON_THE_BUS_S, inputs_of
from studies.campaigns.batch import Result, results_of
from studies.campaigns.calibration_page import page, suites
from studies.campaigns.memory import columns_of
from studies.campaigns.normal_force import Series, errors_of
from studies.campaigns.roll_over import CONFIRMATION, Ground, Load
from studies.campaigns.wrong_calibration import wrong_calibration as wrong

Floats = NDArray[np.float64]

COMMAND: Final = "loaderhil campaign calibration"
FILE: Final = "calibration.md"
CACHE: Final = Path("out/campaign/calibration")
CALIBRATIONS, TURNS, SEED = 100, 40, 1
PAYLOAD: Final = Estimates._fields.index("payload")
SHOWN: Final = [
    Estimates._fields.index(name)
    for name in ("normal_1", "normal_2", "normal_3", "normal_4", "load_transfer_ratio", "payload")
]
"""Estimates that come with a standard deviation."""
DEVIATIONS: Final = [Estimates._fields.index(f"{Estimates._fields[k]}_sd") for k in SHOWN]
PILE: Final = "pile_entry"
"""The scenario in which ground is dug."""
HALF_WIDTH: Final = 1.96
"""Of a 95 % interval, in standard deviations."""
SETTLED_S: Final = 1.0
"""From here on the payload counts: its filter begins at the first sample."""
EXECUTION_NS: Final = 1_000_000
"""Time from the start of a cycle to the arrival of its frames."""


@dataclass(frozen=True, slots=True)
class DriveCase:
    """A scenario, and the calibrations it is estimated with: the right one, and `count` wrong ones from `first` on."""

    scenario: str
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class TurnCase:
    """A turn of the roll-over grid and its calibrations, likewise."""

    speed_kmh: float
    load: Load
    rate_deg_s: float
    to_deg: float
    ground: Ground
    first: int
    count: int


def calibrations(name: str, first: int, count: int) -> list[Calibration]:
    """The right calibration, then the wrong ones."""
    return [load_calibration(name), *(wrong(name, seed) for seed in range(first, first + count))]


def run_drive(case: DriveCase) -> Result:
    """Per calibration: RMS of the normal forces over the standing load at the worst wheel, RMS of the payload [kg], and what its 95 % intervals cover."""
    scenario = Choice(scenario=case.scenario).load()
    recording = lockstep(scenario, limits=False, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.normal_force for truth in recording.truth])
    lift = first_lift_off(time, force)
    until = lift[0] if lift else float(time[-1])
    name = calibration_of(scenario)
    # the checks of the inputs do not depend on what is drawn: one set of inputs serves all calibrations
    times, inputs = inputs_of(recording.bus, load_calibration(name))
    load = (
        carried(recording.truth, scenario.payload_mass)
        if case.scenario == PILE
        else np.full(time.shape, scenario.payload_mass)
    )
    load = np.interp(times + ON_THE_BUS_S, time, load)
    worst, payload, covered = [], [], []
    judged = (times > SETTLED_S) & (times <= until)
    true = np.stack([np.interp(times + ON_THE_BUS_S, time, force[:, k]) for k in range(4)], axis=-1)
    true = np.column_stack((true, transfer(true), load))[judged]
    for calibration in calibrations(name, case.first, case.count):
        found = estimate_columns(inputs, calibration.parameters, prediction=False)
        series = Series(times + ON_THE_BUS_S, found[:, :4], np.ones((len(times), 4), bool))
        errors = errors_of(series, time, force)
        worst.append(float(np.max(np.array(errors["rms"]) / errors["standing"])))
        error = found[judged, PAYLOAD] - load[judged]
        payload.append(float(np.sqrt(np.mean(error**2))))
        off = np.abs(found[judged][:, SHOWN] - true)
        covered.append(np.mean(off <= HALF_WIDTH * found[judged][:, DEVIATIONS], axis=0).tolist())
    return {"worst": worst, "payload": payload, "covered": covered, "until": until}


def carried(truth: Sequence[Truth], payload: float) -> Floats:
    """What lies in the bucket [kg], with the ground that a pile has left in it: what the wheels bear beside the machine's own weight.

    On level ground, by the acceleration of the articulation joint, which is 0.2 m from the centre of gravity. The first moment is before the pile.
    """
    borne = np.array([moment.normal_force.sum() for moment in truth])
    felt = GRAVITY + np.array([moment.acceleration[2] for moment in truth])
    return np.asarray(payload + borne / felt - borne[0] / felt[0], float)


def transfer(normal: Floats) -> Floats:
    """Load-transfer ratio of normal forces (n, 4)."""
    right, left = normal[:, 1] + normal[:, 3], normal[:, 0] + normal[:, 2]
    return np.asarray((right - left) / (right + left), float)


def run_turn(case: TurnCase) -> Result:
    """When a wheel lifts, and when the ECU warns with each calibration [s]; margin of the turn."""
    turn = roll_over.Case(case.speed_kmh, case.load, case.rate_deg_s, case.to_deg, case.ground)
    scenario = roll_over.scenario_of(turn)
    recording = lockstep(scenario, limits=False, reference=False).run()
    truth, name = recording.truth, calibration_of(scenario)
    verdicts = [
        judge(
            time_s=np.array([row.time_s for row in truth]),
            normal_force=np.array([row.normal_force for row in truth]),
            roll=np.array([row.roll for row in truth]),
            load_transfer_ratio=np.array([row.load_transfer_ratio for row in truth]),
            warned_s=first_warning(columns_of(heard(recording.bus, EcuCycle(each, limits_enabled=False)))),
            standing=standing_loads(scenario),
        )
        for each in calibrations(name, case.first, case.count)
    ]
    return {
        "lift_off_s": verdicts[0].lift_off_s,
        "margin": verdicts[0].margin,
        "leads_s": [verdict.lead_s for verdict in verdicts],
        "false_alarms": [verdict.false_alarm for verdict in verdicts],
    }


def heard(bus: Sequence[Frame], ecu: EcuCycle) -> list[Frame]:
    """What an ECU sends on a recorded bus, with the phase and the duration of a lockstep run's cycles."""
    sent: list[Frame] = []
    waiting = iter(bus)
    frame = next(waiting, None)
    for now_ns in range(ECU_PHASE_NS, bus[-1].at_ns + TICK_NS, TICK_NS):
        while frame is not None and frame.at_ns <= now_ns:
            ecu.receive(frame, frame.at_ns)
            frame = next(waiting, None)
        sent += [each._replace(at_ns=now_ns + EXECUTION_NS) for each in ecu.tick(now_ns).frames]
    return sent


def turns(count: int, seed: int) -> list[roll_over.Case]:
    """So many turns of the grid, drawn without repetition."""
    cases = CONFIRMATION.cases()
    return random.Random(seed).sample(cases, min(count, len(cases)))


def run_campaign(
    out: Path,
    *,
    count: int = CALIBRATIONS,
    some_turns: int = TURNS,
    seed: int = SEED,
    jobs: int | None = None,
) -> tuple[Path, list[Suite]]:
    """Run all drives with all calibrations and write the page; with a verdict per question."""
    modules = [Path(m.__file__) for m in (normal_force, roll_over, wrong_calibration) if m.__file__]
    drives = [DriveCase(summary.name, seed, count) for summary in list_scenarios()]
    turning = [
        TurnCase(t.speed_kmh, t.load, t.rate_deg_s, t.to_deg, t.ground, seed, count)
        for t in turns(some_turns, seed)
    ]
    cases = [case.scenario for case in drives]
    driven = results_of(drives, run_drive, cache=CACHE, jobs=jobs, title="drive cases", also=modules)
    turned = results_of(turning, run_turn, cache=CACHE / "turns", jobs=jobs, title="turns", also=modules)
    out.mkdir(parents=True, exist_ok=True)
    command = f"{COMMAND} --calibrations {count} --turns {some_turns} --seed {seed}"
    (out / FILE).write_text(page(cases, driven, turned, command, count, seed), encoding="utf-8")
    return out / FILE, suites(cases, driven, turned)
