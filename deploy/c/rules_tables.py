"""Tables in C of what the cycle decides by: validity, reasons, states, trouble codes, thresholds and times."""

import math
from collections.abc import Callable, Sequence
from typing import Final

from dbc.database import Database
from dbc.protection import Finding as Check
from deploy.c.tables import Received, constant, enumeration, real, rows
from ecu import reasons
from ecu.calibration import Calibration
from ecu.codes import ACTIVE, ESTIMATORS, HOLD_NS, NO_CODE, NO_FROZEN
from ecu.coherence import LIGHT
from ecu.consistency import DOUBTFUL, FRICTION, FROM_LOADS, FROM_SPEED, PULL, SETTLING_NS, Consistency
from ecu.detection.troubles import Troubles
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.estimators.signals import NEVER, Estimates
from ecu.estimators.tyres.contact import CONTRADICTION
from ecu.inputs import FLAGS, GROUP_OF, OUTSIDE_ESTIMATES
from ecu.states import TRANSITIONS, Event, State
from ecu.validity import DEVIATIONS, NEEDS, conditions

EVENTS: Final = tuple(Event)
CHECKS: Final = (
    Check.OK, Check.LOST, Check.RESTARTED, Check.REPEATED, Check.REORDERED, Check.WRONG_COUNTER, Check.WRONG_CRC,
    Check.WRONG_LENGTH,
)  # fmt: skip
"""In the order of `Check` in ecu_internal.h."""


def needs_table(inputs: Sequence[Received]) -> tuple[str, str]:
    """Definitions and table of the validity: the inputs of each condition, and the conditions that each entry needs, as bits."""
    place = {each.name: k for k, each in enumerate(inputs)}
    asked: list[tuple[str, ...]] = []

    def usable(*names: str) -> bool:
        asked.append(names)
        return True

    found = list(conditions(usable))
    masks = [sum(1 << place[name] for name in names) for names in asked]
    # the order in which `conditions` asks; a change of it must not go unnoticed
    wheels = [f"wheel_{n}" for n in (1, 2, 3, 4)]
    expected = [*wheels, "inertial", "slope", "articulation", "mass", "torque"]
    if len(masks) != len(expected) or found != [*wheels, "articulation", "mass", "motion", "speed", "torque"]:
        raise TypeError("ecu.validity.conditions has changed: the C runtime's validity.c has to follow it")
    lines = [
        f"#define {constant('USABLE', name)} {mask:#x}ULL" for name, mask in zip(expected, masks, strict=True)
    ]
    needed = [sum(1 << found.index(need) for need in needs) for needs in NEEDS.values()]
    bits = enumeration(
        "Conditions of the validity table", (constant("CONDITION", name) for name in found), "CONDITIONS"
    )
    table = rows(
        "uint16_t",
        "validity_needs",
        [f"{mask:#x}U /* {name} */" for name, mask in zip(NEEDS, needed, strict=True)],
        "VALIDITIES",
    )
    return "\n".join([*lines, "", bits]), table


def flag_masks(inputs: Sequence[Received]) -> list[str]:
    """The inputs that each usable-flag of the estimators vouches for."""
    place = {each.name: k for k, each in enumerate(inputs)}
    return [f"{sum(1 << place[name] for name in names):#x}ULL /* {flag} */" for flag, names in FLAGS]


def ranges(calibration: Calibration, database: Database) -> list[str]:
    """Estimates whose signal cannot carry every value."""
    consistency = Consistency(calibration.parameters.wheel, database)
    names = list(NEEDS)
    return [
        f"{{.validity = {names.index(r.validity)}U, .estimate = {r.place}U, .least = {real(r.least)}, .most = {real(r.most)}}}"
        for r in consistency.ranges
    ]


def deviations() -> list[str]:
    """Standard deviations with the entry of the validity table whose estimate they belong to."""
    names = list(NEEDS)
    return [
        f"{{.validity = {names.index(of)}U, .estimate = {Estimates._fields.index(name)}U}} /* {name} */"
        for name, of in DEVIATIONS.items()
    ]


def alarm_rows(calibration: Calibration) -> list[str]:
    """Delays and level of every reason, then of every roll-over state."""
    times = reasons.times(calibration.alarms)
    found = []
    for name in (*reasons.REASONS, *(state.name for state in reasons.STATES)):
        level = int(reasons.REASONS[name].level) if name in reasons.REASONS else 0
        found.append(f"{{.on_delay_ns = {times[name].on_delay_ns}LL, .level = {level}U}} /* {name} */")
    return found


def transitions() -> list[str]:
    """The next state, a row per state, a column per event."""
    return [
        "{" + ", ".join(f"{int(TRANSITIONS[state][event])}U" for event in EVENTS) + f"}} /* {state.name} */"
        for state in State
    ]


def suspects(inputs: Sequence[Received], calibration: Calibration, database: Database) -> list[str]:
    """Suspect parameters: every input, every message, the estimators."""
    troubles = Troubles(calibration.inputs, database)
    signal = database.by_name[ACTIVE].by_signal["Spn"]
    spns = {name: int(raw * signal.scale + signal.offset) for raw, name in signal.choices.items()}
    found = [
        f"{{.spn = {spns[each.name]}, .full = {real(troubles.full[each.name])}}} /* {each.name} */"
        for each in inputs
    ]
    found += [
        f"{{.spn = {spns[f'message_{name}']}, .full = R(1.0)}} /* message {name} */" for name in GROUP_OF
    ]
    return [*found, f"{{.spn = {spns[ESTIMATORS]}, .full = R(1.0)}} /* estimators */"]


def least_ns(holds: Callable[[int], bool]) -> int:
    """The smallest whole number of nanoseconds for which a comparison of Python's holds."""
    # Python compares seconds as floats. The runtime compares whole nanoseconds, so it needs the number at which that comparison turns.
    low, high = -1, 1 << 50
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _entries(names: frozenset[str]) -> int:
    """Entries of the validity table as bits."""
    return sum(1 << k for k, name in enumerate(NEEDS) if name in names)


def rule_constants(calibration: Calibration) -> str:
    """Thresholds and times of one machine as macros."""
    inputs = calibration.inputs
    found: dict[str, str] = {
        # > or >= as in the Python source of each rule
        "RULE_RECOVERY_NS": f"{least_ns(lambda ns: ns * 1e-9 >= inputs.recovery)}LL",
        "RULE_START_UP_NS": f"{least_ns(lambda ns: ns * 1e-9 > inputs.start_up)}LL",
        "RULE_CODE_HOLD_NS": f"{HOLD_NS}LL",
        "RULE_SETTLING_NS": f"{SETTLING_NS}LL",
        # counted in frames: rounding down would call a signal frozen one frame too early
        "RULE_FROZEN_FRAMES": f"{math.ceil(inputs.frozen_frames)}U",
        "RULE_STANDING_FRAMES": f"{math.ceil(inputs.frozen_frames / 4)}U",
        "RULE_EXCHANGED_FRAMES": f"{math.ceil(inputs.exchanged_frames)}U",
        "RULE_TURNING": real(inputs.turning),
        "RULE_CARRIED": real(inputs.carried),
        "RULE_LIGHT": real(LIGHT * GRAVITY),
        "RULE_LEAST_SPECIFIC_FORCE": real(inputs.least_specific_force),
        "RULE_NEVER": real(NEVER),
        "RULE_CONTRADICTION": real(CONTRADICTION),
        "RULE_FROM_LOADS": f"{_entries(FROM_LOADS):#x}U",
        "RULE_DOUBTFUL": real(DOUBTFUL),
        "RULE_FROM_SPEED": f"{_entries(FROM_SPEED):#x}U",
        "RULE_NO_CODE": real(NO_CODE),
        "RULE_NO_FROZEN": real(NO_FROZEN),
        "RULE_COUNTED_GROUPS": f"{sum(1 << g for g in set(GROUP_OF.values()) - OUTSIDE_ESTIMATES):#x}U",
    }
    return "\n".join(
        [
            *(f"#define {name} {value}" for name, value in found.items()),
            "",
            "#ifdef ECU_SETTABLE",
            *(
                f"#define {array.upper()} {len(numbers)}U\nextern {kind} {array}[{array.upper()}];"
                for array, (kind, numbers) in settable_rules(calibration).items()
            ),
            *(
                f"#define {name} {array}[{k}]"
                for array, (_, numbers) in settable_rules(calibration).items()
                for k, name in enumerate(numbers)
            ),
            "#else",
            *(
                f"#define {name} {value}"
                for _, numbers in settable_rules(calibration).values()
                for name, value in numbers.items()
            ),
            "#endif\n",
        ]
    )


def settable_rules(calibration: Calibration) -> dict[str, tuple[str, dict[str, str]]]:
    """What is a number of its own with ECU_SETTABLE, and a constant without: array -> C type, and name -> value."""
    times = reasons.times(calibration.alarms)[reasons.PREVENTION]
    warnings = calibration.warnings
    return {
        "machine_rules": (
            "real_t",
            {name: real(value) for name, value in machine_rules(calibration.parameters).items()},
        ),
        "warning_rules": (
            "real_t",
            {
                constant("WARNING", name): real(getattr(warnings, name))
                for name in type(warnings).__dataclass_fields__
            },
        ),
        "alarm_holds": (
            "int64_t",
            {"RULE_LEAST_ON_NS": f"{times.least_on_ns}LL", "RULE_OFF_DELAY_NS": f"{times.off_delay_ns}LL"},
        ),
    }


def settable_tables(calibration: Calibration) -> str:
    """These numbers as the calibration has them."""
    tables = (
        f"{kind} {array}[{array.upper()}] = {{{', '.join(numbers.values())}}};"
        for array, (kind, numbers) in settable_rules(calibration).items()
    )
    return "\n".join(["#ifdef ECU_SETTABLE", *tables, "#endif\n"])


def machine_rules(parameters: Parameters) -> dict[str, float]:
    """Thresholds that follow from what the estimators know of the machine, by their names in C."""
    wheel, geometry = parameters.wheel, parameters.geometry
    return {
        "RULE_FRONT_LEVER": wheel.unloaded_radius / geometry.front_track,
        "RULE_REAR_LEVER": wheel.unloaded_radius / geometry.rear_track,
        "RULE_PULL": PULL * wheel.nominal_load,
        "RULE_FRICTION": FRICTION * max(wheel.friction, wheel.lateral_peak),
    }


ESTIMATE_COUNT: Final = len(Estimates._fields)
