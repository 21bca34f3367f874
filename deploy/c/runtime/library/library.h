/* What a bench reads and sets in the shared library, by these names. */
#ifndef LIBRARY_H
#define LIBRARY_H

#include "calibration.h"
#include "ecu.h"
#include "ecu_tables.h"

#define MOST_FINDINGS 64U /* of one call: a frame has some ten signals, a cycle some ten input groups */

extern EcuFinding library_findings[MOST_FINDINGS];
extern const uint32_t library_most_findings;
extern const uint32_t library_most_frames;
extern uint32_t library_finding_count; /* the bench sets it back */
extern const uint32_t library_parameter_count; /* the bench compares it with what it has to set */

#endif
