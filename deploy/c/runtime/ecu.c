/* The ECU's cycle: states, estimators, limits, warnings, frames. After ecu/cycle.py. */
#include "ecu.h"

#include <string.h>

#include "ecu_internal.h"

#define MOST_OVERRUNS 1023U
#define ROLL_OVER_NOT_AVAILABLE 7U

/* records of reals only: a row of numbers can become one */
typedef char inputs_are_reals[(sizeof(Inputs) == (ESTIMATOR_INPUTS * sizeof(real_t))) ? 1 : -1];
typedef char estimates_are_reals[(sizeof(Estimates) == (ESTIMATES * sizeof(real_t))) ? 1 : -1];
typedef char frames_suffice[(MOST_FRAMES <= ECU_MOST_FRAMES) ? 1 : -1];

typedef struct {
    bool limits_enabled;
#ifndef ECU_WITHOUT_DETECTION
    bool detects_faults;
#endif
    uint8_t state;
    uint32_t ticks;
    bool started; /* whether a frame has been received */
    int64_t started_ns;
    int64_t bad_ns; /* when an input was last bad */
    int64_t fault_ns; /* when an estimator last failed */
    bool has_previous;
    int64_t previous_ns; /* time of the previous cycle */
    int64_t execution_ns;
    uint32_t overruns;
    bool overran; /* since the last tick, as is the next */
    bool protection_failed;
    State estimator;
    Limits limits;
    Alarm alarms[ALARMS];
    uint8_t counters[OUTPUT_FRAMES];
#ifdef ECU_FINDINGS
    uint16_t stale; /* groups that were stale in the last cycle */
#endif
} Ecu;

static Ecu ecu;
static real_t last_values[VALUES]; /* of the last tick */
static const CycleInputs *last_inputs; /* those that the last tick relied on: of the bus, or as the detection left them */

/* The machine's own limits only. */
static Limits limits_none(void)
{
    return limits_unlimited(&calibration_limits, &calibration_parameters.prediction);
}

static Times times_of(int64_t on_delay_ns)
{
    const Times times = {.on_delay_ns = on_delay_ns, .least_on_ns = RULE_LEAST_ON_NS, .off_delay_ns = RULE_OFF_DELAY_NS};
    return times;
}

/* Time since the previous cycle, in whole periods, MOST_TICKS at most: the sensors sample by the same clock. */
static real_t period(int64_t now_ns)
{
    if (!ecu.has_previous) {
        return (real_t)TICK_NS * R(1e-9);
    }
    int64_t counted = ratio_rounded(now_ns - ecu.previous_ns, TICK_NS);
    if (counted < 1) {
        counted = 1;
    } else if (counted > MOST_TICKS) {
        counted = MOST_TICKS;
    } else {
        /* as many as there were */
    }
    const int64_t period_ns = counted * TICK_NS;
    return (real_t)period_ns * R(1e-9);
}

/* -- what is compiled of the detection of faulty sensors */

#ifdef ECU_WITHOUT_DETECTION
static void detection_restart(void)
{
}

static const CycleInputs *tested(const CycleInputs *received, int64_t now_ns)
{
    (void)now_ns;
    return received;
}
#else
static void detection_restart(void)
{
    detection_start();
}

/* The inputs that may be relied on. */
static const CycleInputs *tested(const CycleInputs *received, int64_t now_ns)
{
    const bool runs = (ecu.state == STATE_RUNNING) || (ecu.state == STATE_DEGRADED);
    return (ecu.detects_faults && runs) ? detection_looked(received, period(now_ns)) : received;
}

void ecu_detect_faults(bool on)
{
    ecu.detects_faults = on;
}
#endif

void ecu_restart(void)
{
    ecu.state = STATE_INIT;
    ecu.started = false;
    ecu.bad_ns = -1;
    ecu.fault_ns = -1;
    ecu.has_previous = false;
    ecu.overran = false;
    ecu.protection_failed = false;
    ecu.limits = limits_safe(&calibration_limits);
    (void)memset(&ecu.estimator, 0, sizeof ecu.estimator);
    (void)memset(ecu.alarms, 0, sizeof ecu.alarms);
    for (uint8_t k = 0U; k < ALARMS; ++k) {
        ecu.alarms[k].against_ns = NEVER_NS;
    }
#ifdef ECU_FINDINGS
    ecu.stale = 0U;
#endif
    last_inputs = inputs_start();
    validity_start();
    detection_restart();
    codes_dropped();
}

void ecu_init(bool limits_enabled)
{
    (void)memset(&ecu, 0, sizeof ecu);
    (void)memset(last_values, 0, sizeof last_values);
    ecu.limits_enabled = limits_enabled;
    codes_start();
    ecu_restart();
}

const real_t *ecu_values(void)
{
    return last_values;
}

const CycleInputs *ecu_inputs(void)
{
    return last_inputs;
}

uint8_t ecu_state(void)
{
    return ecu.state;
}

void ecu_executed(int64_t execution_ns)
{
    ecu.execution_ns = execution_ns;
}

void ecu_overran(uint32_t skipped)
{
    const uint32_t room = MOST_OVERRUNS - ecu.overruns;
    ecu.overruns += (skipped < room) ? skipped : room;
    ecu.overran = true;
}

void ecu_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    if (!ecu.started) {
        ecu.started = true;
        ecu.started_ns = now_ns;
    }
    if (inputs_receive(id, data, length, now_ns)) {
        ecu.protection_failed = true;
    }
}

static uint8_t input_event(const CycleInputs *inputs, int64_t now_ns)
{
    if (((inputs->stale | inputs->implausible) & RULE_COUNTED_GROUPS) == 0U) {
        const int64_t since_ns = (ecu.bad_ns > ecu.fault_ns) ? ecu.bad_ns : ecu.fault_ns;
        const bool recovered = (now_ns - since_ns) >= RULE_RECOVERY_NS;
        return ((ecu.state == STATE_FAULT) && recovered) ? EVENT_RECOVERED : EVENT_INPUTS_GOOD;
    }
    ecu.bad_ns = now_ns;
    const int64_t waiting_ns = ecu.started ? (now_ns - ecu.started_ns) : 0;
    return ((ecu.state == STATE_INIT) && (waiting_ns >= RULE_START_UP_NS)) ? EVENT_START_UP_OVER : EVENT_INPUTS_BAD;
}

#ifdef ECU_FINDINGS
/* Announces the groups that have become stale since the last cycle. */
static void stale_found(const CycleInputs *inputs)
{
    for (uint8_t group = 0U; group < 16U; ++group) {
        if ((((inputs->stale & (uint16_t)~ecu.stale) >> group) & 1U) != 0U) {
            announced(ECU_STALE, group, 0U, 0U);
        }
    }
    ecu.stale = inputs->stale;
}
#endif

static void moved(uint8_t event)
{
    const uint8_t before = ecu.state;
    ecu.state = state_after[before][event];
    if (ecu.state != before) {
        announced(ECU_STATE_CHANGED, before, event, ecu.state);
        if (before == STATE_FAULT) {
            detection_restart(); /* what it held against signals was of the time before: good inputs have lasted for the time to recover */
        }
    }
    if ((before == STATE_INIT) && (ecu.state == STATE_RUNNING) && (ecu.fault_ns < 0)) {
        ecu.limits = limits_none(); /* at the start there is nothing to rise slowly from */
    }
}

static void estimator_inputs(const CycleInputs *received, real_t dt, Inputs *inputs)
{
    real_t row[ESTIMATOR_INPUTS];
    uint8_t at = 0U;
    row[at] = dt;
    at += 1U;
    for (uint8_t k = 0U; k < ESTIMATOR_SIGNALS; ++k) {
        row[at] = received->values[estimator_signals[k]];
        at += 1U;
    }
    for (uint8_t k = 0U; k < FLAGS; ++k) {
        row[at] = ((received->unusable & flag_inputs[k]) == 0U) ? R(1.0) : R(0.0);
        at += 1U;
    }
    row[at] = ecu.limits.rate;
    at += 1U;
    (void)memcpy(&row[at], &ecu.limits.levers, sizeof ecu.limits.levers);
    (void)memcpy(inputs, row, sizeof *inputs);
}

/* Estimates, and which of them are known, a bit each. Estimators that fail start anew after a fault. */
static uint32_t estimated(const CycleInputs *received, int64_t now_ns, Estimates *estimates, bool *failed)
{
    Inputs inputs;
    *failed = false;
    if ((ecu.state != STATE_RUNNING) && (ecu.state != STATE_DEGRADED)) {
        return 0U;
    }
    estimator_inputs(received, period(now_ns), &inputs);
    bool well = estimators_cycle(&inputs, &ecu.estimator, &calibration_parameters, estimates);
    real_t found[ESTIMATES];
    (void)memcpy(found, estimates, sizeof found);
    for (uint8_t k = 0U; k < ESTIMATES; ++k) {
        well = well && real_is_finite(found[k]);
    }
    if (well) {
        return validity_without(received->unusable);
    }
    *failed = true;
    (void)memset(estimates, 0, sizeof *estimates);
    (void)memset(&ecu.estimator, 0, sizeof ecu.estimator);
    ecu.fault_ns = now_ns;
    announced(ECU_ESTIMATOR_FAILED, 0U, 0U, 0U);
    moved(EVENT_INTERNAL_ERROR);
    return 0U;
}

static void limits_stepped(const Estimates *estimates, uint32_t known, int64_t now_ns)
{
    if (!ecu.limits_enabled) {
        ecu.limits = limits_none();
    } else if (((known >> VALID_ROLL_OVER) & 1U) == 0U) {
        ecu.limits = limits_safe(&calibration_limits);
    } else {
        const Limits none = limits_none();
        const Times times = times_of(0); /* prevention acts at once */
        ecu.limits = limits_next_limits(&ecu.limits, estimates, now_ns, period(now_ns), &times, &calibration_limits,
                                        &none, &calibration_parameters.linkage_drive);
    }
}

static void alarms_stepped(const Estimates *e, const CycleInputs *inputs, uint32_t known, bool invalid, int64_t now_ns)
{
    bool found[ALARMS];
    (void)memset(found, 0, sizeof found);
    reasons_found(e, inputs, known, ecu.alarms, found);
    found[REASON_ESTIMATE_INVALID] = invalid;
    found[REASON_PROTECTION_ERROR] = ecu.protection_failed;
    found[REASON_CYCLE_OVERRUN] = ecu.overran;
    ecu.protection_failed = false;
    ecu.overran = false;
    for (uint8_t k = 0U; k < ALARMS; ++k) {
        const Times times = times_of(alarm_times[k].on_delay_ns);
        ecu.alarms[k] = alarms_after(&ecu.alarms[k], found[k], now_ns, &times);
    }
}

static real_t as_real(bool flag)
{
    return flag ? R(1.0) : R(0.0);
}

static void warnings_valued(uint32_t known, real_t *values)
{
    uint8_t level = 0U;
    for (uint8_t k = 0U; k < REASONS; ++k) {
        values[VALUE_REASON_ROLL_OVER_PREDICTED + k] = as_real(ecu.alarms[k].on);
        if (ecu.alarms[k].on && (alarm_times[k].level > level)) {
            level = alarm_times[k].level;
        }
    }
    uint8_t state = 0U;
    for (uint8_t k = REASONS; k < ALARMS; ++k) {
        if (ecu.alarms[k].on) {
            state = (uint8_t)((k - REASONS) + 1U);
        }
    }
    const bool roll_over = ((known >> VALID_ROLL_OVER) & 1U) != 0U;
    values[VALUE_WARNING_LEVEL] = (real_t)level;
    values[VALUE_ROLL_OVER_STATE] = (real_t)(roll_over ? state : (uint8_t)ROLL_OVER_NOT_AVAILABLE);
}

static void limits_valued(real_t *values)
{
    const Limits *acting = &ecu.limits;
    const Limits none = limits_none();
    const bool prevents = (acting->cause == (int32_t)CAUSE_ROLL_OVER_PREVENTION) || (acting->cause == (int32_t)CAUSE_SAFE_VALUES);
    values[VALUE_LIMIT_FRONT_TORQUE] = acting->front_torque;
    values[VALUE_LIMIT_REAR_TORQUE] = acting->rear_torque;
    values[VALUE_LIMIT_SPEED] = acting->speed;
    values[VALUE_LIMIT_RATE] = acting->rate;
    values[VALUE_LIMIT_CAUSE] = (real_t)acting->cause;
    values[VALUE_LIMIT_LIFT_UP_RATE] = acting->levers.item0;
    values[VALUE_LIMIT_LIFT_DOWN_RATE] = acting->levers.item1;
    values[VALUE_LIMIT_TILT_BACK_RATE] = acting->levers.item2;
    values[VALUE_LIMIT_TILT_FORWARD_RATE] = acting->levers.item3;
    values[VALUE_LINKAGE_LIMIT_CAUSE] = (real_t)acting->lever_cause;
    values[VALUE_PREVENTION_LIMITS_TORQUE] = as_real(prevents && (acting->front_torque < none.front_torque));
    values[VALUE_PREVENTION_LIMITS_SPEED] = as_real(prevents && (acting->speed < none.speed));
}

/* A standard deviation means nothing where its estimate is not valid, or where it is 0: not known. */
static void deviations_valued(uint32_t valid, real_t *values)
{
    for (uint8_t k = 0U; k < DEVIATIONS; ++k) {
        const Deviation *each = &deviations[k];
        if ((((valid >> each->validity) & 1U) == 0U) || (values[each->estimate] <= R(0.0))) {
            values[each->estimate] = REAL_NAN;
        }
    }
}

static uint8_t frames_made(const real_t *values, EcuFrame *frames)
{
    uint8_t made = 0U;
    for (uint8_t k = 0U; k < OUTPUT_FRAMES; ++k) {
        const OutputFrame *frame = &output_frames[k];
        if ((ecu.ticks % frame->every) == frame->phase) {
            frame_packed(frame, values, &ecu.counters[k], &frames[made]);
            made += 1U;
        }
    }
    return made;
}

uint8_t ecu_tick(int64_t now_ns, EcuFrame frames[ECU_MOST_FRAMES])
{
    real_t *const values = last_values;
    Estimates estimates;
    bool failed;
    (void)memset(&estimates, 0, sizeof estimates);
    (void)memset(last_values, 0, sizeof last_values);
    const CycleInputs *received = inputs_gathered(now_ns);
#ifdef ECU_FINDINGS
    stale_found(received);
#endif
    received = tested(received, now_ns);
    last_inputs = received;
    moved(input_event(received, now_ns));
    const uint32_t known = estimated(received, now_ns, &estimates, &failed);
    codes_stepped(received, failed, estimates.speed, now_ns);
    limits_stepped(&estimates, known, now_ns);
    const uint32_t valid = validity_consistent(known, &estimates, now_ns);
    const bool invalid = valid != (((uint32_t)1U << VALIDITIES) - 1U);
    alarms_stepped(&estimates, received, known, invalid, now_ns);

    (void)memcpy(values, &estimates, sizeof estimates);
    for (uint8_t k = 0U; k < VALIDITIES; ++k) {
        values[VALUE_NORMAL_VALID + k] = as_real(((valid >> k) & 1U) != 0U);
    }
    deviations_valued(valid, values);
    warnings_valued(known, values);
    limits_valued(values);
    codes_valued(ecu.ticks, invalid, ecu.state == STATE_FAULT, values);
    values[VALUE_ECHO] = received->values[INPUT_SEQUENCE];
    values[VALUE_EXECUTION_TIME] = (real_t)ecu.execution_ns * R(1e-9);
    values[VALUE_OVERRUNS] = (real_t)ecu.overruns;
    values[VALUE_STATE] = (real_t)ecu.state;
    const uint16_t counted_groups = received->stale & RULE_COUNTED_GROUPS;
    values[VALUE_STALE_INPUTS] = (real_t)counted_groups;
    const uint8_t made = frames_made(values, frames);
    ecu.has_previous = true;
    ecu.previous_ns = now_ns;
    ecu.ticks += 1U;
    return made;
}
