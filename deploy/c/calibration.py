"""A calibration as constants in C: what the estimators know of one machine."""

from typing import Any, Final

from dbc import loader_database
from deploy.c.detection_tables import DECLARATIONS, detection_numbers
from deploy.c.translation.expressions import initialiser
from deploy.c.translation.kinds import Record, fields_of
from deploy.c.translation.names import local_name
from deploy.c.translation.program import comment
from deploy.c.translation.python_source import field_comments
from ecu.calibration import Calibration
from ecu.detection.noise import makes_of

_HEADER: Final = """\
/* What the ECU knows of the machine "{name}". Written by `loaderhil export-c`. */
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include "detection.h"

extern OF_MACHINE Parameters calibration_parameters;
extern OF_MACHINE LimitRules calibration_limits;
{detection}
#endif
"""
_SOURCE: Final = """\
/* What the ECU knows of the machine "{name}". Written by `loaderhil export-c`; SI, as the estimators need it. */
#include "calibration.h"

OF_MACHINE Parameters calibration_parameters = {{
{parts}
}};

/* How the limits answer to the margin. */
OF_MACHINE LimitRules calibration_limits = {{
{limits}
}};
{detection}"""


def calibration_files(calibration: Calibration) -> dict[str, str]:
    """File name -> text."""
    name = _safe(calibration.name)
    parts = "\n".join(lines(calibration.parameters, 1))
    return {
        "calibration.h": _HEADER.format(name=name, detection=DECLARATIONS),
        "calibration.c": _SOURCE.format(
            name=name,
            parts=parts,
            limits="\n".join(lines(calibration.limits, 1)),
            detection=detection_numbers(
                calibration,
                loader_database(),
                lines(calibration.detection.tolerances, 1),
                lines(makes_of(calibration.detection), 1),
            ),
        ),
    }


def lines(record: Any, depth: int) -> list[str]:
    """The fields of a record, one per line, with what they mean."""
    kind_of_record: type = type(record)
    indent, remarks, found = "    " * depth, field_comments(kind_of_record), []
    for field, kind in fields_of(kind_of_record).items():
        value, remark = getattr(record, field), remarks.get(field, "")
        if isinstance(kind, Record):
            if remark:
                found.append(comment(remark, indent).rstrip("\n"))
            found += [f"{indent}.{local_name(field)} = {{", *lines(value, depth + 1), f"{indent}}},"]
        else:
            beside = f" /* {remark} */" if remark else ""
            found.append(f"{indent}.{local_name(field)} = {initialiser(value)},{beside}")
    return found


def _safe(text: str) -> str:
    """A user's text inside a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").replace("\\", "/")
