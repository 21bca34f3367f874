#include "uds_answer.h"

#include "measured.h"

void answer_start(UdsAnswer *answer)
{
    answer->length = 0U;
    answer->is_too_long = false;
}

void answer_byte(UdsAnswer *answer, uint8_t byte)
{
    if (answer->length < ISOTP_LONGEST_ANSWER) {
        answer->bytes[answer->length] = byte;
        answer->length += 1U;
    } else {
        answer->is_too_long = true;
    }
}

void answer_bytes(UdsAnswer *answer, const uint8_t *bytes, uint16_t count)
{
    for (uint16_t k = 0U; k < count; ++k) {
        answer_byte(answer, bytes[k]);
    }
}

void answer_number(UdsAnswer *answer, uint32_t number, uint8_t count)
{
    for (uint8_t k = count; k > 0U; --k) {
        answer_byte(answer, (uint8_t)(number >> (8U * ((uint32_t)k - 1U))));
    }
}

void answer_float(UdsAnswer *answer, float number)
{
    uint8_t bytes[4];
    float_stored(number, bytes);
    for (uint8_t k = 4U; k > 0U; --k) {
        answer_byte(answer, bytes[k - 1U]);
    }
}
