"""The detection matrix: every class of faults tried on one drive, and the table of who detected it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from configuration import CheckedTable
from dbc import loader_database
from hil.faults.passage import Fault
from hil.faults.table import SECOND, read_fault
from plant.unit.scenario import Scenario, load_scenario
from studies.soak.watch import Mechanism, Watch, Witness

DRIVE = Path(__file__).parent / "detection_matrix.toml"
BEGINS_S, LASTS_S = 0.8, 0.6  # of every fault
AFTERWARDS_S = 0.3
"""How long after its end a fault may still be detected."""
SETTLED_S = 0.5
"""By then every node has received every message at least once; earlier detections are start-up effects."""
SEED = 1
DEGRADED, SAFE_VALUES = 2, 3  # EcuStatus.State, and Limits.Cause, as in the DBC
UNDETECTED = "**undetected**"

Table = Mapping[str, object]

CASES: tuple[Table, ...] = (
    {"kind": "drop", "message": "WheelSpeedsFront", "probability": 0.1},
    {"kind": "drop", "message": "BodyRates"},
    {"kind": "drop", "message": "SlopeSensor", "probability": 0.1},
    {"kind": "drop", "message": "SlopeSensor"},
    {"kind": "drop", "message": "Limits"},
    {"kind": "drop", "message": "SteeringPressures"},
    {"kind": "delay", "message": "BodyRates", "delay_ms": 15.0},
    {"kind": "delay", "message": "BodyRates", "delay_ms": 100.0},
    {"kind": "delay", "message": "Limits", "delay_ms": 100.0},
    {"kind": "jitter", "message": "Articulation", "jitter_ms": 4.0},
    {"kind": "jitter", "message": "Articulation", "jitter_ms": 40.0},
    {"kind": "corrupt", "message": "BodyRates", "probability": 0.1},
    {"kind": "corrupt", "message": "Limits", "probability": 0.1},
    {"kind": "corrupt", "message": "BodyRates", "probability": 0.1, "valid_crc": True},
    {"kind": "corrupt", "message": "Articulation", "probability": 0.1, "valid_crc": True},
    {"kind": "corrupt", "message": "WheelSpeedsRear", "probability": 0.1, "valid_crc": True},
    {"kind": "corrupt", "message": "SlopeSensor", "probability": 0.1},
    {"kind": "corrupt", "message": "LiftPressure", "probability": 0.1},
    {"kind": "repeat", "message": "BodyRates", "probability": 0.1},
    {"kind": "repeat", "message": "SlopeSensor", "probability": 0.1},
    {"kind": "reorder", "message": "BodyRates", "probability": 0.1},
    {"kind": "reorder", "message": "SlopeSensor", "probability": 0.1},
    {"kind": "freeze", "message": "Articulation", "signal": "ArticulationAngle"},
    {"kind": "freeze", "message": "BodyRates", "signal": "YawRate"},
    {"kind": "freeze", "message": "WheelSpeedsFront", "signal": "Left"},
    {"kind": "freeze", "message": "LiftPressure", "signal": "LiftCylinderPressure"},
    {
        "kind": "offset",
        "message": "Articulation",
        "signal": "ArticulationAngle",
        "offset": 5.0,
        "unit": "deg",
    },
    {"kind": "offset", "message": "BodyRates", "signal": "YawRate", "offset": 5.0, "unit": "deg/s"},
    {"kind": "offset", "message": "BodyAcceleration", "signal": "Lateral", "offset": 2.0, "unit": "m/s2"},
    {"kind": "offset", "message": "WheelSpeedsFront", "signal": "Left", "offset": 1.0, "unit": "rad/s"},
    {
        "kind": "offset",
        "message": "LiftPressure",
        "signal": "LiftCylinderPressure",
        "offset": 3000.0,
        "unit": "kPa",
    },
    {
        "kind": "spike",
        "message": "Articulation",
        "signal": "ArticulationAngle",
        "height": 10.0,
        "unit": "deg",
    },
    {"kind": "spike", "message": "BodyRates", "signal": "YawRate", "height": 50.0, "unit": "deg/s"},
    {"kind": "spike", "message": "WheelSpeedsFront", "signal": "Left", "height": 5.0, "unit": "rad/s"},
    {"kind": "swap", "message": "WheelSpeedsFront", "signals": ["Left", "Right"]},
    {"kind": "swap", "message": "BodyAcceleration", "signals": ["Longitudinal", "Lateral"]},
    {"kind": "babble", "interval_us": 250.0},
    {"kind": "babble", "interval_us": 1000.0},
    {"kind": "bus_off", "node": "ecu"},
    {"kind": "kill", "process": "plant"},
    {"kind": "kill", "process": "ecu"},
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """The result of one fault."""

    fault: Fault
    # from the first affected frame to the first detection
    first_ms: Mapping[tuple[Witness, Mechanism], float]
    degraded: bool  # the ECU went into its degraded state
    safe_values: bool  # the ECU sent its safe limits

    @property
    def detected(self) -> bool:
        """Whether anybody detected anything."""
        return bool(self.first_ms)


def try_all(cases: Sequence[Table] = CASES) -> list[Tried]:
    """The result of every fault alone on the same drive. Raises ValueError if anything is detected without a fault."""
    scenario = load_scenario(DRIVE)
    # the proof that what is seen later comes from the fault
    quiet = _run(scenario, None)
    if quiet.first_ms or quiet.degraded:
        raise ValueError(
            f"{DRIVE.name}: without a fault there is {list(quiet.first_ms)}; the matrix would then mean nothing"
        )
    return [_run(scenario, {**case, "at_s": BEGINS_S, "for_s": LASTS_S}) for case in cases]


def _run(scenario: Scenario, table: Table | None) -> Tried:
    fault = read_fault(
        # a fault that never acts: `Tried` names one in any case
        CheckedTable(table or {"kind": "drop", "probability": 0.0}, file="case"),
        loader_database(),
    )
    watch = Watch(scenario, [fault] if table else [], seed=SEED)
    while watch.now_ns < SETTLED_S * SECOND:
        watch.step()
    watch.forget()
    while watch.now_ns < (BEGINS_S + LASTS_S + AFTERWARDS_S) * SECOND and not watch.finished:
        watch.step()
    # from the first affected frame: a fault of a rare message begins to act later than it is switched on
    struck_ns = watch.injector.first_struck_ns(1) or round(BEGINS_S * SECOND)
    return Tried(
        fault=fault,
        first_ms=watch.detected(struck_ns),
        degraded=any(answer.state == DEGRADED for answer in watch.answers),
        safe_values=any(answer.limits["Cause"] == SAFE_VALUES for answer in watch.answers),
    )


def markdown(tried: Sequence[Tried]) -> str:
    """The table, one line per fault."""
    head = "| fault | ECU | machine | bench | the ECU then |\n|---|---|---|---|---|\n"
    return head + "".join(f"| {' | '.join(_cells(each))} |\n" for each in tried)


def _cells(each: Tried) -> tuple[str, ...]:
    found = [_found(each, who) for who in Witness]
    if not each.detected:
        found[0] = UNDETECTED
    reaction = ["degraded"] * each.degraded + ["safe limits"] * each.safe_values
    return each.fault.label, *found, ", ".join(reaction) or "goes on"


def _found(each: Tried, who: Witness) -> str:
    mechanisms = [
        mechanism if mechanism is Mechanism.DEADLINE else f"{mechanism} ({after_ms:.0f} ms)"
        for (witness, mechanism), after_ms in sorted(each.first_ms.items(), key=lambda item: item[1])
        if witness is who
    ]
    return ", ".join(mechanisms) or "–"
