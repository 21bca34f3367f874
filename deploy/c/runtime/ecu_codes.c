/* Trouble codes in the manner of J1939-73: what failed and how, and how the machine stood. After ecu/codes.py. */
#include <string.h>

#include "ecu_internal.h"

#define MOST_CODES ((INPUTS * 6U) + (WATCHED * DETECTED_MODES) + (LISTENERS * 2U) + 1U) /* suspect parameters times the modes that each can have */
#define MOST_OCCURRENCES 126U
#define MANUFACTURERS 7U /* top three bits of an SPN of the manufacturer's range */
#define EVERY_TICKS 10U  /* each message shows the next code */

typedef struct {
    uint16_t suspect;
    uint8_t mode;
} Noted;

static Code codes[MOST_CODES]; /* in the order in which they first came */
static uint16_t code_count;
static Noted noted[MOST_CODES];
static uint16_t noted_count;
static bool started;
static int64_t started_ns;

void codes_start(void)
{
    code_count = 0U;
    noted_count = 0U;
    started = false;
}

void codes_noted(uint16_t suspect, uint8_t mode)
{
    for (uint16_t k = 0U; k < noted_count; ++k) {
        if ((noted[k].suspect == suspect) && (noted[k].mode == mode)) {
            return;
        }
    }
    if (noted_count < MOST_CODES) {
        noted[noted_count].suspect = suspect;
        noted[noted_count].mode = mode;
        noted_count += 1U;
    }
}

static Code *code_of(uint16_t suspect, uint8_t mode)
{
    for (uint16_t k = 0U; k < code_count; ++k) {
        if ((codes[k].suspect == suspect) && (codes[k].mode == mode)) {
            return &codes[k];
        }
    }
    if (code_count >= MOST_CODES) {
        return NULL;
    }
    Code *made = &codes[code_count];
    code_count += 1U;
    (void)memset(made, 0, sizeof *made);
    made->suspect = suspect;
    made->mode = mode;
    return made;
}

static void occurred(uint16_t suspect, uint8_t mode, const CycleInputs *inputs, real_t speed, int64_t now_ns)
{
    Code *code = code_of(suspect, mode);
    if (code == NULL) {
        return;
    }
    code->last_ns = now_ns;
    if (code->active) {
        return;
    }
    code->active = true;
    code->occurrences = (code->occurrences < MOST_OCCURRENCES) ? (uint8_t)(code->occurrences + 1U) : MOST_OCCURRENCES;
    code->frozen[0] = (suspect < INPUTS) ? (inputs->values[suspect] / suspects[suspect].full) : R(0.0);
    code->frozen[1] = speed;
    code->frozen[2] = inputs->values[INPUT_ARTICULATION_ANGLE];
    code->frozen[3] = inputs->values[INPUT_LIFT_ARM_ANGLE];
    const int64_t since_start_ns = now_ns - started_ns;
    code->frozen[4] = (real_t)since_start_ns * R(1e-9);
}

static bool goes_on(uint16_t suspect, const CycleInputs *inputs)
{
    if (suspect < INPUTS) {
        return (((inputs->unusable | inputs->doubted) >> suspect) & 1U) != 0U;
    }
    return (suspect < (INPUTS + LISTENERS)) && (((inputs->silent >> (suspect - INPUTS)) & 1U) != 0U);
}

void codes_stepped(const CycleInputs *inputs, bool estimators_failed, real_t speed, int64_t now_ns)
{
    if (!started) {
        started = true;
        started_ns = now_ns;
    }
    for (uint16_t k = 0U; k < code_count; ++k) {
        if (codes[k].active && goes_on(codes[k].suspect, inputs)) {
            codes[k].last_ns = now_ns;
        } else if (codes[k].active && ((now_ns - codes[k].last_ns) > RULE_CODE_HOLD_NS)) {
            codes[k].active = false;
        } else {
            /* it stays what it is */
        }
    }
    for (uint8_t k = 0U; k < LISTENERS; ++k) {
        const uint8_t listener = listeners_by_name[k];
        if (((inputs->silent >> listener) & 1U) != 0U) {
            occurred((uint16_t)(INPUTS + (uint16_t)listener), MODE_UPDATE_RATE, inputs, speed, now_ns);
        }
    }
    for (uint16_t k = 0U; k < noted_count; ++k) {
        occurred(noted[k].suspect, noted[k].mode, inputs, speed, now_ns);
    }
    noted_count = 0U;
    if (estimators_failed) {
        occurred(SUSPECTS - 1U, MODE_BAD_DEVICE, inputs, speed, now_ns);
    }
}

/* The code at a place among the active or the others; NULL where there are not so many. */
static const Code *code_at(uint16_t place, bool active)
{
    uint16_t seen = 0U;
    for (uint16_t k = 0U; k < code_count; ++k) {
        if (codes[k].active == active) {
            if (seen == place) {
                return &codes[k];
            }
            seen += 1U;
        }
    }
    return NULL;
}

uint16_t codes_count(bool active)
{
    uint16_t found = 0U;
    for (uint16_t k = 0U; k < code_count; ++k) {
        found = (uint16_t)(found + ((codes[k].active == active) ? 1U : 0U));
    }
    return found;
}

const Code *codes_all(uint16_t *count)
{
    *count = code_count;
    return codes;
}

void codes_cleared(void)
{
    uint16_t kept = 0U;
    for (uint16_t k = 0U; k < code_count; ++k) {
        if (codes[k].active) {
            /* a fault is found when it begins: a code that is forgotten would not come back while its fault goes on */
            codes[kept] = codes[k];
            codes[kept].occurrences = 1U;
            kept += 1U;
        }
    }
    code_count = kept;
}

void codes_dropped(void)
{
    noted_count = 0U;
}

/* Where the values of one of the two messages with codes stand. */
typedef struct {
    uint16_t spn;
    uint16_t fmi;
    uint16_t top;
    uint16_t occurrences;
    uint16_t place;
    uint16_t total;
} MessagePlaces;

static void shown(const MessagePlaces *places, bool active, uint32_t turn, real_t *values)
{
    const uint16_t total = codes_count(active);
    if (total == 0U) {
        return;
    }
    const uint16_t place = (uint16_t)(turn % total);
    const Code *code = code_at(place, active);
    if (code != NULL) {
        values[places->spn] = (real_t)suspects[code->suspect].spn;
        values[places->fmi] = (real_t)code->mode;
        values[places->top] = (real_t)MANUFACTURERS;
        values[places->occurrences] = (real_t)code->occurrences;
        const uint16_t counted_from_one = (uint16_t)(place + 1U);
        values[places->place] = (real_t)counted_from_one;
        values[places->total] = (real_t)total;
    }
}

static void shown_frozen(uint32_t turn, real_t *values)
{
    const uint16_t active = codes_count(true);
    const uint16_t place = (uint16_t)(turn % code_count);
    const Code *code = (place < active) ? code_at(place, true) : code_at((uint16_t)(place - active), false);
    if (code != NULL) {
        values[VALUE_FAULT_FREEZE_FRAME_SPN] = (real_t)suspects[code->suspect].spn;
        values[VALUE_FAULT_FREEZE_FRAME_VALUE] = code->frozen[0];
        values[VALUE_FAULT_FREEZE_FRAME_SPEED] = code->frozen[1];
        values[VALUE_FAULT_FREEZE_FRAME_ARTICULATION_ANGLE] = code->frozen[2];
        values[VALUE_FAULT_FREEZE_FRAME_LIFT_ARM_ANGLE] = code->frozen[3];
        values[VALUE_FAULT_FREEZE_FRAME_AT] = code->frozen[4];
    }
}

void codes_valued(uint32_t tick, bool invalid, bool stopped, real_t *values)
{
    static const MessagePlaces of_active = {
        VALUE_ACTIVE_FAULTS_SPN, VALUE_ACTIVE_FAULTS_FMI, VALUE_ACTIVE_FAULTS_SPN_TOP,
        VALUE_ACTIVE_FAULTS_OCCURRENCE_COUNT, VALUE_ACTIVE_FAULTS_PLACE, VALUE_ACTIVE_FAULTS_CODES};
    static const MessagePlaces of_previous = {
        VALUE_PREVIOUS_FAULTS_SPN, VALUE_PREVIOUS_FAULTS_FMI, VALUE_PREVIOUS_FAULTS_SPN_TOP,
        VALUE_PREVIOUS_FAULTS_OCCURRENCE_COUNT, VALUE_PREVIOUS_FAULTS_PLACE, VALUE_PREVIOUS_FAULTS_CODES};
    values[VALUE_ACTIVE_FAULTS_SPN] = RULE_NO_CODE;
    values[VALUE_PREVIOUS_FAULTS_SPN] = RULE_NO_CODE;
    values[VALUE_FAULT_FREEZE_FRAME_SPN] = RULE_NO_FROZEN;
    if (code_count == 0U) {
        return;
    }
    const uint32_t turn = tick / EVERY_TICKS;
    const bool any = codes_count(true) != 0U;
    values[VALUE_ACTIVE_FAULTS_PROTECT_LAMP] = any ? R(1.0) : R(0.0);
    values[VALUE_ACTIVE_FAULTS_AMBER_WARNING_LAMP] = (invalid && any) ? R(1.0) : R(0.0);
    values[VALUE_ACTIVE_FAULTS_RED_STOP_LAMP] = stopped ? R(1.0) : R(0.0);
    shown(&of_active, true, turn, values);
    shown(&of_previous, false, turn, values);
    shown_frozen(turn, values);
}
