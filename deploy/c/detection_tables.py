"""Tables in C around the detection of sensor faults: which signals it watches, and its numbers for one machine."""

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np

from dbc.database import Database
from deploy.c.tables import Received, constant, numbered, real, rows
from ecu.calibration import Calibration
from ecu.detection import layout
from ecu.detection.live import MESSAGE_PLACES, REPLACED_S, rules_of
from ecu.detection.machine import HALF_CYCLE
from ecu.detection.noise import makes_of
from ecu.watched import LIFT, NAMES, TILT


def detection_constants(inputs: Sequence[Received]) -> str:
    """Macros of the runtime around it: places in its arrays, and modes."""
    names = (
        "RESIDUALS", "FAULTY", "SUSPECTED", "JUMPED", "MODE", "SINCE", "SIZE", "FILTERS", "F_COUPLE", "JUMP", "SAMPLE",
        "REJECTED", "BY_JUMP", "BY_FREEZE", "UNDECIDED",
    )  # fmt: skip
    found = [numbered("WATCHED", len(NAMES)), numbered("WATCHED_LIFT", LIFT), numbered("WATCHED_TILT", TILT)]
    found += [numbered(constant("DETECTION", name), getattr(layout, name)) for name in names]
    place = {each.name: k for k, each in enumerate(inputs)}
    watched = sum(1 << place[name] for name in NAMES)
    pose = sum(1 << NAMES.index(name) for name in ("lift_arm_angle", "tilt_angle"))
    return (
        "/* Fault detection: the signals that it watches, and places in its arrays */\n"
        + "".join(found)
        + f"#define WATCHED_INPUTS {watched:#x}ULL\n#define WATCHED_POSE {pose:#x}U\n"
        + f"#define DETECTION_REPLACED {real(REPLACED_S - HALF_CYCLE)} /* s, to the nearest cycle */\n"
    )


def detection_tables(inputs: Sequence[Received]) -> tuple[str, str]:
    """Declarations and definitions of the tables that are the same for every machine."""
    place = {each.name: k for k, each in enumerate(inputs)}
    tables = {
        ("uint8_t", "watched_inputs"): [f"{place[name]}U /* {name} */" for name in NAMES],
        ("int32_t", "watched_messages"): [str(number) for number in MESSAGE_PLACES],
        ("uint8_t", "watched_by_name"): [f"{NAMES.index(name)}U" for name in sorted(NAMES)],
    }
    header = "".join(f"extern const {kind} {name}[WATCHED];\n" for kind, name in tables)
    source = "\n".join(rows(kind, name, items, "WATCHED") for (kind, name), items in tables.items())
    return header, source


def machine_detection(calibration: Calibration, database: Database) -> dict[str, list[float]]:
    """The numbers that depend on the machine, by their names in C."""
    rules, height = rules_of(calibration, database)
    return {
        "detection_tolerances": list(calibration.detection.tolerances),
        "detection_makes": [
            number for make in makes_of(calibration.detection) for number in dataclasses.astuple(make)
        ],
        "detection_rules": np.ravel(rules).tolist(),
        "detection_height": [height],
    }


def detection_numbers(
    calibration: Calibration, database: Database, tolerances: Sequence[str], makes: Sequence[str]
) -> str:
    """Their definitions; tolerances, makes: lines of the records."""
    rules, height = rules_of(calibration, database)
    body = "\n".join("        {" + ", ".join(real(number) for number in row) + "}," for row in rules.tolist())
    return f"""
/* What is uncertain of the machine, by the calibration's [detection]. */
OF_MACHINE Tolerances detection_tolerances = {{
{chr(10).join(tolerances)}
}};

/* The sensors, by the calibration's [sensor_FAMILY]. */
OF_MACHINE Makes detection_makes = {{
{chr(10).join(makes)}
}};

/* Thresholds of the signals and of the residuals, by the noise of the sensors. */
OF_MACHINE Reals{layout.RULES}x{layout.WIDTH} detection_rules = {{
    {{
{body}
    }},
}};

#ifndef ECU_WITHOUT_DETECTION
/* How far a sequential test goes before it has fired [standard deviations]. */
OF_MACHINE real_t detection_height = {real(height)};
#endif
"""


DECLARATIONS: Final = f"""\
extern OF_MACHINE Tolerances detection_tolerances;
extern OF_MACHINE Makes detection_makes;
extern OF_MACHINE Reals{layout.RULES}x{layout.WIDTH} detection_rules;
#ifndef ECU_WITHOUT_DETECTION
extern OF_MACHINE real_t detection_height;
#endif
"""
