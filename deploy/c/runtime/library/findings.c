/* The findings of a shared library that a bench loads: kept until the bench has read them after each call. */
#include "library.h"

EcuFinding library_findings[MOST_FINDINGS];
uint8_t library_finding_frames[MOST_FINDINGS];
const uint32_t library_most_findings = MOST_FINDINGS;
const uint32_t library_most_frames = ECU_MOST_FRAMES;
const uint32_t library_most_received = MOST_RECEIVED;
uint32_t library_finding_count;
uint32_t library_frame;

void ecu_found(const EcuFinding *finding)
{
    if (library_finding_count < MOST_FINDINGS) {
        library_findings[library_finding_count] = *finding;
        library_finding_frames[library_finding_count] = (uint8_t)library_frame;
        library_finding_count += 1U;
    }
}
