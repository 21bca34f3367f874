"""The detection of sensor faults as one C file with its header: `ecu.detection.detector.step` translated."""

from typing import Final

from deploy.c.translation.kinds import INT, REAL, Array
from deploy.c.translation.program import File, Translation
from ecu.detection import layout
from ecu.detection.bucket import pressure_from_other
from ecu.detection.detector import step
from ecu.detection.noise import of_residuals
from ecu.watched import COUNT

ENTRIES: Final = (step, pressure_from_other, of_residuals)
_SIGNALS, _RESIDUALS = (COUNT,), (layout.RESIDUALS,)
ARRAYS: Final = {
    "m": Array(REAL, _SIGNALS),
    "heard": Array(INT, _SIGNALS),
    "usable": Array(REAL, _SIGNALS),
    "message": Array(INT, _SIGNALS),
    "rules": Array(REAL, (layout.RULES, layout.WIDTH)),
    "state": Array(REAL, (layout.ROWS, layout.WIDTH)),
    "r": Array(REAL, _RESIDUALS),
    "bound": Array(REAL, _RESIDUALS),
}
"""The arrays of the entries, by the names of their arguments."""

_NOTE: Final = "/* Detection of faulty sensors. Written by `loaderhil export-c` from ecu/detection; edit the Python source, not this file. */\n"
_HEADER: Final = """\
#ifndef DETECTION_H
#define DETECTION_H

#include "estimators.h"

{types}
typedef Reals{rows}x{columns} DetectionState; /* zeros before the first cycle */

/* What they do is said at their definitions. `divided_by_zero` says whether Python would have raised. */
{prototypes}

#endif
"""


def translate(translation: Translation) -> None:
    """Add the detection to what has been translated, in a file of its own."""
    translation.next_file()
    for entry in ENTRIES:
        function = getattr(entry, "py_func", entry)
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        translation.add(function, {name: kind for name, kind in ARRAYS.items() if name in names})


def detection_files(file: File, divided: str) -> dict[str, str]:
    """File name -> text. divided: the division that takes a note of a zero."""
    source = ['#include "detection.h"\n\n#include <string.h>\n', divided, file.definitions, *file.functions]
    return {
        "detection.h": _NOTE
        + _HEADER.format(
            types=file.types, prototypes="\n".join(file.prototypes), rows=layout.ROWS, columns=layout.WIDTH
        ),
        "detection.c": _NOTE + "\n".join(source),
    }
