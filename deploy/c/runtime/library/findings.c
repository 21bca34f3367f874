/* The findings of a shared library that a bench loads: kept until the bench has read them after each call. */
#include "library.h"

EcuFinding library_findings[MOST_FINDINGS];
const uint32_t library_most_findings = MOST_FINDINGS;
const uint32_t library_most_frames = ECU_MOST_FRAMES;
uint32_t library_finding_count; /* the bench sets it back */

void ecu_found(const EcuFinding *finding)
{
    if (library_finding_count < MOST_FINDINGS) {
        library_findings[library_finding_count] = *finding;
        library_finding_count += 1U;
    }
}
