/* What a bench reads, sets and calls in the shared library, by these names. */
#ifndef LIBRARY_H
#define LIBRARY_H

#include "calibration.h"
#include "ecu.h"
#include "ecu_tables.h"

#define MOST_RECEIVED 32U /* frames of one call */
/* of one call: a frame has some ten signals, a cycle some ten input groups */
#define MOST_FINDINGS ((MOST_RECEIVED + 1U) * 64U)

typedef struct {
    int64_t at_ns;
    uint32_t id;
    uint8_t length;
    uint8_t data[8];
} LibraryFrame;

extern EcuFinding library_findings[MOST_FINDINGS];
extern uint8_t library_finding_frames[MOST_FINDINGS]; /* `library_frame` of each */
extern const uint32_t library_most_findings;
extern const uint32_t library_most_frames;
extern const uint32_t library_most_received;
extern uint32_t library_finding_count; /* the bench sets it back */
extern uint32_t library_frame; /* which of the frames of a call is received now; their number: the cycle */
extern const uint32_t library_parameter_count; /* the bench compares it with what it has to set */

/* Take `count` frames, at most MOST_RECEIVED, then run one cycle if `frames` is given; returns how many frames are to be sent. */
uint8_t library_cycle(const LibraryFrame *received, uint32_t count, int64_t now_ns, EcuFrame *frames);

#endif
