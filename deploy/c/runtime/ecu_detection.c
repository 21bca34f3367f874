/* Detection of faulty sensors: samples in, inputs without what is faulty out. After ecu/detection/live.py; the tests are translated (detection.c). */
#include <string.h>

#include "ecu_internal.h"

#ifndef ECU_WITHOUT_DETECTION

#define ALIKE R(0.3) /* two signals that jumped against each other, equally far to within this share, are exchanged */

static DetectionState state;
static uint32_t known; /* faulty signals of the last cycle, a bit each */
static CycleInputs relied_on;

void detection_start(void)
{
    (void)memset(&state, 0, sizeof state);
    known = 0U;
}

static uint32_t watched_bit(uint8_t k)
{
    return (uint32_t)1U << k;
}

static uint64_t input_bit(uint8_t k)
{
    return (uint64_t)1U << watched_inputs[k];
}

/* The message of an input. */
static uint8_t listener_of(uint8_t input)
{
    uint8_t found = 0U;
    while (input >= listeners[found].last) {
        found += 1U;
    }
    return found;
}

/* Runs one cycle; false where a residual cannot be computed. */
static bool tested(const CycleInputs *received, real_t dt, real_t *samples)
{
    int32_t heard[WATCHED];
    real_t usable[WATCHED];
    real_t residuals[DETECTION_RESIDUALS];
    real_t bounds[DETECTION_RESIDUALS];
    for (uint8_t k = 0U; k < WATCHED; ++k) {
        const uint64_t bit = input_bit(k);
        const bool is_usable_now = (received->unusable & bit) == 0U;
        const bool came = ((received->came >> listener_of(watched_inputs[k])) & 1U) != 0U;
        samples[k] = received->values[watched_inputs[k]];
        usable[k] = is_usable_now ? R(1.0) : R(0.0);
        heard[k] = 0;
        if (came && is_usable_now) {
            heard[k] = (int32_t)DETECTION_SAMPLE;
        } else if (came && ((received->stepped & bit) != 0U)) {
            heard[k] = (int32_t)DETECTION_REJECTED;
        } else {
            /* nothing came of it */
        }
    }
    divided_by_zero = false;
    (void)detector_step(samples, heard, usable, watched_messages, &calibration_parameters, &detection_tolerances, &detection_rules,
                        detection_height, &state, dt, residuals, bounds);
    return !divided_by_zero;
}

static uint8_t mode_of(uint8_t k)
{
    const real_t mode = state.at[DETECTION_MODE][k];
    const real_t jumped = state.at[DETECTION_JUMPED][k];
    if (mode == (real_t)DETECTION_BY_FREEZE) {
        return MODE_NOT_RESPONDING;
    }
    if (mode != (real_t)DETECTION_BY_JUMP) {
        return (state.at[DETECTION_SIZE][k] > R(0.0)) ? MODE_DRIFTED_HIGH : MODE_DRIFTED_LOW;
    }
    for (uint8_t other = 0U; other < WATCHED; ++other) {
        const real_t against = jumped + state.at[DETECTION_JUMPED][other];
        if ((other != k) && (watched_messages[other] == watched_messages[k]) && (state.at[DETECTION_FAULTY][other] != R(0.0)) &&
            (real_abs(against) < (ALIKE * real_abs(jumped)))) {
            return MODE_EXCHANGED;
        }
    }
    return MODE_RATE_OF_CHANGE;
}

static bool is_undecided(uint8_t k)
{
    return state.at[DETECTION_MODE][k] == (real_t)DETECTION_UNDECIDED;
}

/* Announces the new faults: those of which any one signal could be wrong together, then the others, in the order of names. */
static void faults_found(uint32_t fresh)
{
    uint8_t more = 0U;
    for (uint8_t k = 0U; k < WATCHED; ++k) {
        more = (uint8_t)(more + ((((fresh & watched_bit(k)) != 0U) && is_undecided(k)) ? 1U : 0U));
    }
    for (uint8_t n = 0U; n < WATCHED; ++n) {
        const uint8_t k = watched_by_name[n];
        if (((fresh & watched_bit(k)) != 0U) && is_undecided(k)) {
            more = (uint8_t)(more - 1U);
            codes_noted(watched_inputs[k], MODE_ROOT_CAUSE_NOT_KNOWN);
            announced(ECU_FAULT_FOUND, watched_inputs[k], MODE_ROOT_CAUSE_NOT_KNOWN, more);
        }
    }
    for (uint8_t n = 0U; n < WATCHED; ++n) {
        const uint8_t k = watched_by_name[n];
        if (((fresh & watched_bit(k)) != 0U) && !is_undecided(k)) {
            const uint8_t mode = mode_of(k);
            codes_noted(watched_inputs[k], mode);
            announced(ECU_FAULT_FOUND, watched_inputs[k], mode, 0U);
        }
    }
}

/* Whether another value can stand in for a faulty signal, and which. */
static bool replaced(uint8_t k, uint32_t faulty, const real_t *samples, real_t *value)
{
    const real_t jumped = state.at[DETECTION_JUMPED][k];
    if ((state.at[DETECTION_MODE][k] == (real_t)DETECTION_BY_JUMP) && (state.at[DETECTION_SINCE][k] < DETECTION_REPLACED)) {
        const bool away = real_abs(jumped) > (detection_rules.at[DETECTION_JUMP][k] / R(2.0));
        *value = samples[k] - (away ? jumped : R(0.0));
        return true;
    }
    const uint32_t pressures = watched_bit(WATCHED_LIFT) | watched_bit(WATCHED_TILT);
    const uint32_t needed = (pressures & ~watched_bit(k)) | WATCHED_POSE;
    if (((pressures & watched_bit(k)) != 0U) && ((faulty & needed) == 0U)) {
        const real_t couple = state.at[DETECTION_FILTERS][DETECTION_F_COUPLE];
        *value = bucket_pressure_from_other(samples, (int32_t)k, couple, &calibration_parameters);
        return true;
    }
    return false;
}

const CycleInputs *detection_looked(const CycleInputs *received, real_t dt)
{
    real_t samples[WATCHED];
    if (!tested(received, dt, samples)) {
        const uint32_t estimators = SUSPECTS - 1U;
        detection_start();
        codes_noted((uint16_t)estimators, MODE_BAD_DEVICE);
        announced(ECU_ESTIMATOR_FAILED, 1U, 0U, 0U);
        return received;
    }
    uint32_t faulty = 0U;
    for (uint8_t k = 0U; k < WATCHED; ++k) {
        faulty |= (state.at[DETECTION_FAULTY][k] != R(0.0)) ? watched_bit(k) : 0U;
    }
    faults_found(faulty & ~known);
    known = faulty;
    relied_on = *received;
    for (uint8_t k = 0U; k < WATCHED; ++k) {
        const uint8_t input = watched_inputs[k];
        real_t value = samples[k];
        if ((faulty & watched_bit(k)) == 0U) {
            /* a jump that others may still explain is left out meanwhile */
            const bool waits = state.at[DETECTION_SUSPECTED][k] > R(0.0);
            relied_on.values[input] = waits ? (value - state.at[DETECTION_JUMPED][k]) : value;
        } else {
            relied_on.doubted |= input_bit(k);
            if (replaced(k, faulty, samples, &value)) {
                relied_on.values[input] = value;
            } else {
                relied_on.unusable |= input_bit(k);
                relied_on.implausible |= (uint16_t)((1U << listeners[listener_of(input)].group) & RULE_COUNTED_GROUPS);
            }
        }
    }
    return &relied_on;
}

#endif
