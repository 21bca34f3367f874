/*
 * The ECU of an articulated wheel loader: frames and times in, frames out. No clock, no bus, no heap.
 *
 * Call ecu_receive for every frame and ecu_tick every 10 ms, from one context. Times are of one monotonic clock, in
 * nanoseconds. There is one ECU per program; ecu_init starts it anew.
 */
#ifndef ECU_H
#define ECU_H

#include <stdbool.h>
#include <stdint.h>

#define ECU_MOST_FRAMES 32U /* of one tick */

typedef struct {
    uint32_t id; /* bit 31: a 29-bit identifier */
    uint8_t length;
    uint8_t data[8];
} EcuFrame;

/* Start anew. limits_enabled: false only warns. */
void ecu_init(bool limits_enabled);

/*
 * Whether sensors are tested against each other: a faulty one is then no longer relied on. Off after ecu_init; call it before frames.
 * A firmware that is compiled with -DECU_WITHOUT_DETECTION has neither the tests nor this function.
 */
#ifndef ECU_WITHOUT_DETECTION
void ecu_detect_faults(bool on);
#endif

/* Take one frame from the bus; frames of other identifiers are ignored. */
void ecu_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns);

/* One cycle; returns how many frames of `frames` are to be sent. */
uint8_t ecu_tick(int64_t now_ns, EcuFrame frames[ECU_MOST_FRAMES]);

/* The last tick took so long; it is reported in the next status. */
void ecu_executed(int64_t execution_ns);

/* So many ticks had to be left out. */
void ecu_overran(uint32_t skipped);

/* 0 init, 1 running, 2 degraded, 3 fault. */
uint8_t ecu_state(void);

/*
 * What the ECU found, for a log or a test bench. A build with -DECU_FINDINGS calls ecu_found, which the program supplies, for
 * every finding, inside ecu_receive and ecu_tick. Without it no finding is made.
 */
typedef enum {
    ECU_PROTECTION_FAILED, /* subject: message; detail: check */
    ECU_IMPLAUSIBLE,       /* subject: input; detail: failure mode; other: 1 its sensor reports it, 2 the message contradicts itself */
    ECU_STALE,             /* subject: input group */
    ECU_STATE_CHANGED,     /* subject: state before; detail: event; other: state after */
    ECU_ESTIMATOR_FAILED,  /* subject: 1 the detection of faults, which begins anew */
    ECU_FAULT_FOUND        /* subject: input; detail: failure mode; other: how many more findings follow, of which one signal is faulty */
} EcuFindingKind;

typedef struct {
    uint8_t kind;
    uint8_t subject;
    uint8_t detail;
    uint8_t other;
    double value;  /* of an implausible input, SI */
    double before; /* its value in the frame before */
} EcuFinding;

#ifdef ECU_FINDINGS
void ecu_found(const EcuFinding *finding);
#endif

#endif
