/* What the parts of the ECU know of one another. */
#ifndef ECU_INTERNAL_H
#define ECU_INTERNAL_H

#include "calibration.h"
#include "ecu.h"
#include "ecu_tables.h"

/* -- findings: nothing of them is compiled where nobody asked for them */

#ifdef ECU_FINDINGS
static inline void announced_value(uint8_t kind, uint8_t subject, uint8_t detail, uint8_t other, real_t value, real_t before)
{
    const EcuFinding finding = {kind, subject, detail, other, (double)value, (double)before};
    ecu_found(&finding);
}
#else
static inline void announced_value(uint8_t kind, uint8_t subject, uint8_t detail, uint8_t other, real_t value, real_t before)
{
    (void)kind;
    (void)subject;
    (void)detail;
    (void)other;
    (void)value;
    (void)before;
}
#endif
#define announced(kind, subject, detail, other) announced_value((kind), (subject), (detail), (other), R(0.0), R(0.0))

/* -- frames (ecu_frames.c) */

typedef enum {
    CHECK_OK,
    CHECK_LOST, /* usable, but frames are missing before it */
    CHECK_RESTARTED, /* usable: the counter jumped and goes on from there */
    CHECK_REPEATED, /* not usable, as are those below */
    CHECK_REORDERED,
    CHECK_WRONG_COUNTER,
    CHECK_WRONG_CRC,
    CHECK_WRONG_LENGTH
} Check;

typedef struct {
    bool heard;
    uint8_t counter; /* of the newest frame accepted */
    int64_t heard_ns; /* when a frame with a good checksum last came */
    bool has_stale;
    uint8_t stale_counter; /* of the frame before, if that was a step back */
} Checker;

uint64_t frame_bits(const uint8_t *data, uint8_t length);
int32_t raw_value(uint64_t bits, uint8_t first_bit, uint8_t count, bool is_signed);
bool is_usable(Check check);
Check frame_checked(Checker *checker, const Listener *listener, const uint8_t *data, uint8_t length, int64_t now_ns);
int64_t ratio_rounded(int64_t numerator, int64_t denominator);
void frame_packed(const OutputFrame *frame, const real_t *values, uint8_t *counter, EcuFrame *out);

/* -- inputs (ecu_inputs.c) */

typedef struct {
    real_t values[INPUTS]; /* the last good value of every input, SI */
    uint64_t unusable; /* inputs that must not be relied on, a bit each */
    uint16_t stale; /* groups without a fresh frame, a bit each */
    uint16_t implausible; /* groups with an implausible signal */
    uint32_t silent; /* messages that have fallen silent */
} CycleInputs;

void inputs_start(void);
bool inputs_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns); /* whether a protection failed */
const CycleInputs *inputs_gathered(int64_t now_ns);

/* -- trouble codes (ecu_codes.c) */

void codes_start(void);
void codes_noted(uint16_t suspect, uint8_t mode); /* a fault that the next tick turns into a code */
void codes_stepped(const CycleInputs *inputs, bool estimators_failed, real_t speed, int64_t now_ns);
void codes_valued(uint32_t tick, bool invalid, bool stopped, real_t *values);

/* -- rules (ecu_rules.c) */

uint32_t validity_without(uint64_t unusable);
void validity_start(void);
uint32_t validity_consistent(uint32_t valid, const Estimates *e, int64_t now_ns); /* once a tick */
void reasons_found(const Estimates *e, const CycleInputs *inputs, uint32_t known, const Alarm *alarms, bool *found);

#endif
