/* Inputs: frames checked one by one, gathered once per cycle. After ecu/inputs.py and ecu/coherence.py. */
#include <string.h>

#include "ecu_internal.h"

#define INPUT_BIT(input) ((uint64_t)1U << (input))
#define FAULTY 2 /* sensor states from here on make a signal unusable */
#define MOST_SAME 60000U

typedef struct {
    Checker checker;
    bool heard;
    int64_t heard_ns;
    uint64_t unusable;
    uint64_t stepped; /* of these, those whose value came and was too far away */
    bool came; /* since the last cycle */
    bool has_previous;
} ListenerState;

/* Whether left and right of one axle are exchanged. */
typedef struct {
    bool exchanged;
    uint32_t against;
} AxleSides;

static ListenerState heard_of[LISTENERS];
static real_t previous[INPUTS];
static uint16_t same[INPUTS]; /* frames in a row with the value of the one before */
static AxleSides axles[2];
static CycleInputs gathered;

const CycleInputs *inputs_start(void)
{
    (void)memset(heard_of, 0, sizeof heard_of);
    (void)memset(axles, 0, sizeof axles);
    for (uint8_t k = 0U; k < INPUTS; ++k) {
        previous[k] = R(0.0);
        same[k] = 0U;
        gathered.values[k] = R(0.0);
    }
    gathered.values[INPUT_SPECIFIC_FORCE_Z] = R(9.81);
    return &gathered;
}

static bool is_fresh(uint8_t listener, int64_t now_ns)
{
    return heard_of[listener].heard && ((now_ns - heard_of[listener].heard_ns) <= listeners[listener].fresh_ns);
}

/* Whether a signal that was the same in so many frames is frozen: true while most others have moved lately. */
static bool is_frozen(uint16_t frames)
{
    if ((RULE_FROZEN_FRAMES == 0U) || (frames < RULE_FROZEN_FRAMES)) {
        return false;
    }
    uint16_t still = 0U;
    uint16_t sensed = 0U;
    for (uint8_t k = 0U; k < INPUTS; ++k) {
        if (input_fields[k].sensed) {
            sensed += 1U;
            still = (uint16_t)(still + ((same[k] >= RULE_STANDING_FRAMES) ? 1U : 0U));
        }
    }
    return (2U * still) < sensed;
}

static bool axle_exchanged(AxleSides *axle, real_t lever, real_t left, real_t right, real_t yaw_rate)
{
    if ((RULE_EXCHANGED_FRAMES == 0U) || (real_abs(yaw_rate) < RULE_TURNING)) {
        return axle->exchanged;
    }
    const real_t shown = (right - left) * lever;
    const real_t expected = axle->exchanged ? -yaw_rate : yaw_rate;
    const bool contradicts = real_abs(shown + expected) < (R(0.5) * real_abs(yaw_rate));
    axle->against = contradicts ? (axle->against + 1U) : 0U;
    if (axle->against >= RULE_EXCHANGED_FRAMES) {
        axle->exchanged = !axle->exchanged;
        axle->against = 0U;
    }
    return axle->exchanged;
}

/* Whether a message is one of wheel speeds and has left and right exchanged. */
static bool is_exchanged(uint8_t listener, const real_t *now, int64_t now_ns)
{
    static const uint8_t needed[3] = {HEARS_BODY_RATES, HEARS_ARTICULATION, HEARS_BODY_ACCELERATION};
    if ((listener != HEARS_WHEEL_SPEEDS_FRONT) && (listener != HEARS_WHEEL_SPEEDS_REAR)) {
        return false;
    }
    const bool front = (listener == HEARS_WHEEL_SPEEDS_FRONT);
    AxleSides *axle = &axles[front ? 0 : 1];
    for (uint8_t k = 0U; k < 3U; ++k) {
        if ((heard_of[needed[k]].unusable != 0U) || !is_fresh(needed[k], now_ns)) {
            return axle->exchanged;
        }
    }
    if ((real_abs(gathered.values[INPUT_SPECIFIC_FORCE_Y]) > RULE_CARRIED) ||
        (gathered.values[INPUT_SPECIFIC_FORCE_Z] < RULE_LIGHT)) {
        axle->against = 0U;
        return axle->exchanged;
    }
    const real_t turning =
        gathered.values[INPUT_YAW_RATE] + (front ? gathered.values[INPUT_ARTICULATION_RATE] : R(0.0));
    return axle_exchanged(axle, front ? RULE_FRONT_LEVER : RULE_REAR_LEVER, now[0], now[1], turning);
}

/* Failure mode of all inputs of a message that cannot be right together; 0 if they can. */
static uint8_t contradiction(uint8_t listener, const real_t *now, int64_t now_ns)
{
    if ((listener == HEARS_BODY_ACCELERATION) &&
        (real_sqrt((now[0] * now[0]) + (now[1] * now[1]) + (now[2] * now[2])) < RULE_LEAST_SPECIFIC_FORCE)) {
        return MODE_BAD_DEVICE;
    }
    return is_exchanged(listener, now, now_ns) ? MODE_EXCHANGED : 0U;
}

/* Failure mode of a value that is not plausible, 0 if it is; `before` is that of the previous frame, good or bad. */
static uint8_t doubt(const InputField *field, real_t value, real_t before)
{
    if ((real_abs(value) <= field->limit) && !(real_abs(SAMPLED(value - before)) > field->step)) {
        return 0U;
    }
    if (value != value) { /* cppcheck-suppress duplicateExpression */
        return MODE_BAD_DEVICE;
    }
    if (real_abs(value) > field->limit) {
        return (value < R(0.0)) ? MODE_BELOW_RANGE : MODE_ABOVE_RANGE;
    }
    return MODE_RATE_OF_CHANGE;
}

static real_t si_value(const InputField *field, uint64_t bits)
{
    const int32_t raw = raw_value(bits, field->first_bit, field->bits, field->is_signed);
    if ((raw < field->lowest) || (raw > field->highest)) {
        return (real_t)NAN; /* not available */
    }
    return SAMPLED(SAMPLED(SAMPLED((real_t)raw * field->scale) + field->offset) * field->factor);
}

static void decoded(uint8_t listener, uint64_t bits, int64_t now_ns)
{
    const Listener *from = &listeners[listener];
    ListenerState *state = &heard_of[listener];
    real_t now[INPUTS];
    uint64_t reported = 0U;
    for (uint8_t k = from->first; k < from->last; ++k) {
        now[k - from->first] = si_value(&input_fields[k], bits);
    }
    for (uint8_t k = from->first_state; k < from->last_state; ++k) {
        const SensorState *sensor = &sensor_states[k];
        if (raw_value(bits, sensor->first_bit, sensor->bits, sensor->is_signed) >= FAULTY) {
            reported |= sensor->inputs;
        }
    }
    const uint8_t together = contradiction(listener, now, now_ns);
    uint64_t bad = 0U;
    uint64_t stepped = 0U;
    for (uint8_t k = from->first; k < from->last; ++k) {
        const real_t value = now[k - from->first];
        const real_t before = state->has_previous ? previous[k] : value;
        if (value == before) {
            same[k] = (same[k] < MOST_SAME) ? (uint16_t)(same[k] + 1U) : same[k];
        } else {
            same[k] = 0U;
        }
        const bool is_reported = (reported & INPUT_BIT(k)) != 0U;
        uint8_t mode = is_reported ? MODE_BAD_DEVICE : together;
        if (mode == 0U) {
            mode = doubt(&input_fields[k], value, before);
        }
        if ((mode == 0U) && input_fields[k].sensed && is_frozen(same[k])) {
            mode = MODE_NOT_RESPONDING;
        }
        if (mode == 0U) {
            gathered.values[k] = value;
        } else {
            bad |= INPUT_BIT(k);
            if ((mode == MODE_ABOVE_RANGE) || (mode == MODE_BELOW_RANGE) || (mode == MODE_RATE_OF_CHANGE)) {
                stepped |= INPUT_BIT(k);
            }
            if ((state->unusable & INPUT_BIT(k)) == 0U) {
                codes_noted(k, mode);
                announced_value(ECU_IMPLAUSIBLE, k, mode, is_reported ? 1U : ((together != 0U) ? 2U : 0U), value, before);
            }
        }
        previous[k] = value;
    }
    state->has_previous = true;
    state->unusable = bad;
    state->stepped = stepped;
    state->came = true;
}

bool inputs_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    for (uint8_t k = 0U; k < LISTENERS; ++k) {
        if (listeners[k].id == id) {
            const Check check = frame_checked(&heard_of[k].checker, &listeners[k], data, length, now_ns);
            if (check != CHECK_OK) {
                codes_noted((uint16_t)(INPUTS + (uint16_t)k), MODE_DATA_IN_ERROR);
                announced(ECU_PROTECTION_FAILED, k, (uint8_t)check, 0U);
            }
            if (is_usable(check)) {
                heard_of[k].heard = true;
                heard_of[k].heard_ns = now_ns;
                decoded(k, frame_bits(data, length), now_ns);
            }
            return check != CHECK_OK;
        }
    }
    return false;
}

const CycleInputs *inputs_gathered(int64_t now_ns)
{
    gathered.unusable = 0U;
    gathered.stale = 0U;
    gathered.implausible = 0U;
    gathered.silent = 0U;
    gathered.came = 0U;
    gathered.stepped = 0U;
    for (uint8_t k = 0U; k < LISTENERS; ++k) {
        const uint16_t group = (uint16_t)(1U << listeners[k].group);
        gathered.came |= heard_of[k].came ? ((uint32_t)1U << k) : 0U;
        heard_of[k].came = false;
        if (!is_fresh(k, now_ns)) {
            gathered.stale |= group;
            for (uint8_t input = listeners[k].first; input < listeners[k].last; ++input) {
                gathered.unusable |= INPUT_BIT(input);
            }
            gathered.silent |= heard_of[k].heard ? ((uint32_t)1U << k) : 0U;
        } else if (heard_of[k].unusable != 0U) {
            gathered.implausible |= group;
            gathered.unusable |= heard_of[k].unusable;
            gathered.stepped |= heard_of[k].stepped;
        } else {
            /* every input of the message can be relied on */
        }
    }
    return &gathered;
}
