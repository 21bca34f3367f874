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
    uint32_t came; /* messages with a good frame since the cycle before */
    uint64_t stepped; /* unusable inputs whose value came and was too far from the last */
    uint64_t doubted; /* inputs that the detection holds for faulty, replaced ones too */
} CycleInputs;

const CycleInputs *inputs_start(void); /* forgets what has come; the inputs that a tick gathers */
bool inputs_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns); /* whether a protection failed */
const CycleInputs *inputs_gathered(int64_t now_ns);

/* -- detection of faulty sensors (ecu_detection.c) */

#ifdef ECU_WITHOUT_DETECTION
#define DETECTED_MODES 0U
#else
#define DETECTED_MODES 3U /* failure modes that no check of a single signal has */
void detection_start(void); /* forgets all cycles */
const CycleInputs *detection_looked(const CycleInputs *received, real_t dt); /* the inputs that may be relied on */
#endif

/* -- trouble codes (ecu_codes.c) */

#define FROZEN_VALUES 5U

typedef struct {
    uint16_t suspect;
    uint8_t mode;
    uint8_t occurrences;
    bool active;
    int64_t last_ns;
    real_t frozen[FROZEN_VALUES]; /* value as a share, speed, articulation, lift arm, time since start */
} Code;

void codes_start(void);
void codes_noted(uint16_t suspect, uint8_t mode); /* a fault that the next tick turns into a code */
void codes_stepped(const CycleInputs *inputs, bool estimators_failed, real_t speed, int64_t now_ns);
void codes_valued(uint32_t tick, bool invalid, bool stopped, real_t *values);
uint16_t codes_count(bool active);
const Code *codes_all(uint16_t *count); /* the oldest first */
void codes_cleared(void); /* forgets the previous ones; of those that are active, that they came before */
void codes_dropped(void); /* what was noted since the last tick becomes no code */

/* -- what the cycle shows to services beside it (ecu.c) */

const real_t *ecu_values(void); /* VALUES of the last tick; zeros before the first */
const CycleInputs *ecu_inputs(void); /* that the last tick relied on, until a frame is received */
void ecu_restart(void); /* as after power-on; trouble codes, counters of frames and of ticks go on */

/* -- rules (ecu_rules.c) */

uint32_t validity_without(uint64_t unusable);
void validity_start(void);
uint32_t validity_consistent(uint32_t valid, const Estimates *e, int64_t now_ns); /* once a tick */
void reasons_found(const Estimates *e, const CycleInputs *inputs, uint32_t known, const Alarm *alarms, bool *found);

#endif
