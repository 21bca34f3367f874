"""The estimators as one C file with its header, and the detection of faults as another: `ecu.estimators.estimate.corrected` translated."""

from pathlib import Path
from typing import Final

from deploy.c.detection import ENTRIES, detection_files, translate
from deploy.c.translation.program import File, Translation
from ecu import alarms, limits
from ecu.estimators.estimate import corrected

RULES: Final = (limits.unlimited, limits.safe, limits.next_limits, alarms.after, alarms.below)
"""Translated beside the estimators: what decides limits and alarms."""
ROOT: Final = Path(__file__).resolve().parents[2]

_HEADER: Final = """\
/* Estimators of the ECU. Written by `loaderhil export-c` from ecu/estimators, ecu/limits.py and ecu/alarms.py; edit the Python source, not this file. */
#ifndef ESTIMATORS_H
#define ESTIMATORS_H

#include "real.h"

#define NEVER_NS (-9223372036854775807LL) /* a time that has not come */

{types}
/*
 * One cycle: inputs and state in, estimates and new state out.
 *
 * False where Python would have raised: a division by zero. Estimates and state are then without meaning.
 */
bool estimators_cycle(const Inputs *inputs, State *state, const Parameters *parameters, Estimates *estimates);

/* Limits and alarms, and what the detection of faults uses as well; what they do is said at their definitions. */
{rules}

extern bool divided_by_zero; /* since it was last set to false */

#endif
"""
_SOURCE: Final = """\
/* Estimators of the ECU. Written by `loaderhil export-c` from ecu/estimators, ecu/limits.py and ecu/alarms.py; edit the Python source, not this file. */
#include "estimators.h"

{divided}{extra}
{constants}
{functions}
bool estimators_cycle(const Inputs *inputs, State *state, const Parameters *parameters, Estimates *estimates)
{{
    divided_by_zero = false;
    const {result} found = {entry}(inputs, state, parameters);
    *estimates = found.item0;
    *state = found.item1;
    return !divided_by_zero;
}}
"""
NOTED: Final = """\
/* A division by zero raises in Python and ends the cycle. Here it is noted, and the cycle's results are not used. */
bool divided_by_zero;
"""
DIVIDED: Final = """\

static inline real_t divided(real_t numerator, real_t denominator)
{
    if (denominator == R(0.0)) {
        divided_by_zero = true;
        return R(0.0);
    }
    return numerator / denominator;
}
"""
MODULO: Final = """
/* The remainder with the sign of the divisor, as in Python. */
static inline int32_t modulo(int32_t number, int32_t divisor)
{
    const int32_t rest = number % divisor;
    return (rest < 0) ? (rest + divisor) : rest;
}
"""
_PERTURBED: Final = """
/*
 * Monte Carlo arithmetic: a result changed by a random amount up to the rounding of single precision, 2^-24 of its value.
 */
static uint64_t perturbed_seed = 1U;

void perturbed_start(uint64_t seed)
{
    perturbed_seed = (seed * 2862933555777941757U) + 3037000493U;
}

real_t PERTURBED(real_t exact)
{
    if ((double)(float)exact == exact) {
        return exact; /* single precision holds it: nothing would be rounded */
    }
    perturbed_seed ^= perturbed_seed << 13;
    perturbed_seed ^= perturbed_seed >> 7;
    perturbed_seed ^= perturbed_seed << 17;
    const double share = ((double)(perturbed_seed >> 11) / 4503599627370496.0) - 1.0;
    return exact * (1.0 + (share / 16777216.0));
}
"""


def estimator_files(*, perturbed: bool = False) -> dict[str, str]:
    """File name -> text. perturbed: the build that measures what rounding does to the results, for tests only."""
    # numba's wrapper has no source; the functions in it have
    entries = [getattr(entry, "py_func", entry) for entry in ENTRIES]
    translation = Translation(ROOT, exported=(*RULES, *entries), perturbed=perturbed)
    entry = translation.add(getattr(corrected, "py_func", corrected))
    for rule in RULES:
        translation.add(rule)
    file = translation.file
    translate(translation)
    return {
        "estimators.h": _HEADER.format(types=file.types, rules="\n".join(file.prototypes)),
        "estimators.c": _SOURCE.format(
            divided=NOTED + _helpers(file),
            extra=_PERTURBED if perturbed else "",
            constants=file.definitions,
            functions="\n".join(file.functions),
            entry=entry,
            result="EstimatesAndState",
        ),
    } | detection_files(
        translation.file,
        _helpers(translation.file) + ("\nreal_t PERTURBED(real_t exact);\n" if perturbed else ""),
    )


def _helpers(file: File) -> str:
    """The arithmetic that the functions of a file need: an unused static function is a warning, and warnings are errors."""
    functions = "\n".join(file.functions)
    return DIVIDED + (MODULO if "modulo(" in functions else "")
