"""`ecu_tables.h` and `ecu_tables.c`: all tables of the cycle for one calibration."""

from typing import Final

from dbc.database import Database
from deploy.c.detection_tables import detection_constants, detection_tables
from deploy.c.rules_tables import (
    EVENTS,
    alarm_rows,
    deviations,
    flag_masks,
    needs_table,
    ranges,
    rule_constants,
    settable_tables,
    suspects,
    transitions,
)
from deploy.c.tables import (
    all_values,
    constant,
    counters,
    enumeration,
    inputs_of,
    numbered,
    received_tables,
    rows,
    sent_order,
    sent_tables,
)
from ecu import reasons
from ecu.bus_signals import Received
from ecu.bus_signals import rows as bus_rows
from ecu.calibration import Calibration
from ecu.codes import Mode
from ecu.estimators.signals import Estimates, Inputs
from ecu.inputs import GROUP_OF
from ecu.limits import Cause
from ecu.outputs import MOST_TICKS, TICK_NS, messages
from ecu.states import State
from ecu.validity import NEEDS

_NOTE: Final = "/* Written by `loaderhil export-c` from the ECU's tables, the DBC and the calibration; edit those, not this file. */\n"


def table_files(calibration: Calibration, database: Database) -> dict[str, str]:
    """File name -> text."""
    inputs = inputs_of(calibration)
    estimates = list(Estimates._fields)
    validities = [f"{name} valid" for name in NEEDS]
    named = [f"reason {name}" for name in reasons.REASONS]
    others = [name for name in all_values() if name not in {*estimates, *validities, *named}]
    # Estimates, validities and reasons come first and without gaps: the runtime copies each of these blocks in one loop.
    values = {name: constant("VALUE", name) for name in (*estimates, *validities, *named, *others)}
    conditions, validity_rows = needs_table(inputs)
    received, (sent, most) = received_tables(calibration, database), sent_tables(messages(), values, database)
    signals = [constant("INPUT", name) for name, _ in bus_rows(Inputs, Received)]
    sizes = {
        "SENSOR_STATES": received.split("sensor_states")[1].count(".inputs"),
        "OUTPUT_SIGNALS": sent.count(".value ="),
        "RANGES": len(ranges(calibration, database)),
        "DEVIATIONS": len(deviations()),
        "FLAGS": len(flag_masks(inputs)),
        "MOST_FRAMES": most,
        "ESTIMATOR_SIGNALS": len(signals),
        "ESTIMATOR_INPUTS": len(Inputs._fields),
        "EVENTS": len(EVENTS),
        "STATES": len(State),
    }
    enums = [
        enumeration("Inputs from the bus", (constant("INPUT", each.name) for each in inputs), "INPUTS"),
        enumeration(
            "Messages that the ECU hears", (constant("HEARS", name) for name in GROUP_OF), "LISTENERS"
        ),
        enumeration(
            "Messages that it sends",
            (constant("SENDS", codec.name) for codec in sent_order(messages(), database)),
            "OUTPUT_FRAMES",
        ),
        enumeration("Values that go into frames", values.values(), "VALUES"),
        enumeration("Estimates", (constant("ESTIMATE", name) for name in estimates), "ESTIMATES"),
        enumeration(
            "Entries of the validity table", (constant("VALID", name) for name in NEEDS), "VALIDITIES"
        ),
        enumeration(
            "Alarms: reasons of the warnings, then roll-over states",
            (
                *(constant("REASON", name) for name in reasons.REASONS),
                *(constant("ROLL_OVER", state.name) for state in reasons.STATES),
            ),
            "ALARMS",
        ),
        enumeration("States", (constant("STATE", state.name) for state in State), "ALL_STATES"),
        enumeration("Events", (constant("EVENT", event.name) for event in EVENTS), "ALL_EVENTS"),
        "".join(numbered(constant("CAUSE", cause.name), cause) for cause in Cause),
        "".join(numbered(constant("MODE", mode.name), mode) for mode in Mode),
        "".join(numbered(name, size) for name, size in sizes.items()),
        numbered("REASONS", len(reasons.REASONS)) + "#define SUSPECTS (INPUTS + LISTENERS + 1U)\n",
        f"#define TICK_NS {TICK_NS}LL\n",
        f"#define MOST_TICKS {MOST_TICKS}LL\n",
        counters(),
    ]
    watched_header, watched_source = detection_tables(inputs)
    header = "\n".join(
        [_NOTE + "#ifndef ECU_TABLES_H\n#define ECU_TABLES_H\n\n#include \"ecu_types.h\"\n", *enums, conditions,
         rule_constants(calibration), detection_constants(inputs), _EXTERN + watched_header, "#endif\n"]
    )  # fmt: skip
    source = "\n".join(
        [
            _NOTE + '#include "ecu_tables.h"\n',
            received,
            sent,
            validity_rows,
            rows("uint64_t", "flag_inputs", flag_masks(inputs), "FLAGS"),
            rows("uint8_t", "estimator_signals", signals, "ESTIMATOR_SIGNALS"),
            *_judging(calibration, database),
            settable_tables(calibration),
            "const uint8_t state_after[STATES][EVENTS] = {\n"
            + "".join(f"    {row},\n" for row in transitions())
            + "};\n",
            rows("Suspect", "suspects", suspects(inputs, calibration, database), "SUSPECTS"),
            rows("uint8_t", "listeners_by_name", _by_name(), "LISTENERS"),
            watched_source,
        ]
    )
    return {"ecu_tables.h": header, "ecu_tables.c": source}


def _judging(calibration: Calibration, database: Database) -> list[str]:
    """Tables of what makes an estimate or its standard deviation mean nothing, and of the alarms."""
    alarms = rows("AlarmTimes", "alarm_times", alarm_rows(calibration), "ALARMS")
    return [
        rows("ValueRange", "value_ranges", ranges(calibration, database), "RANGES"),
        rows("Deviation", "deviations", deviations(), "DEVIATIONS"),
        alarms.replace("const", "OF_MACHINE", 1),
    ]


def _by_name() -> list[str]:
    """The messages in the order of names: those that fall silent in one cycle get their codes in it, as in Python."""
    return [f"{k}U" for k in sorted(range(len(GROUP_OF)), key=lambda k: list(GROUP_OF)[k])]


_EXTERN: Final = """\
extern const InputField input_fields[INPUTS];
extern const Listener listeners[LISTENERS];
extern const SensorState sensor_states[SENSOR_STATES];
extern const OutputSignal output_signals[OUTPUT_SIGNALS];
extern const OutputFrame output_frames[OUTPUT_FRAMES];
extern const uint16_t validity_needs[VALIDITIES];
extern const uint64_t flag_inputs[FLAGS];
/* the estimators' inputs from the bus, in their order */
extern const uint8_t estimator_signals[ESTIMATOR_SIGNALS];
extern const ValueRange value_ranges[RANGES];
extern const Deviation deviations[DEVIATIONS];
extern OF_MACHINE AlarmTimes alarm_times[ALARMS];
extern const uint8_t state_after[STATES][EVENTS];
extern const Suspect suspects[SUSPECTS];
/* the messages in the order of their names */
extern const uint8_t listeners_by_name[LISTENERS];
"""
