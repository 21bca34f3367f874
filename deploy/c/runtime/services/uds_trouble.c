#include "uds_trouble.h"

#include <stddef.h>

#include "ecu_internal.h"
#include "service_tables.h"

#define FORMAT_J1939 0x02U /* 19 bits of SPN and 5 of FMI, as in DM1 */
#define RECORD 0x01U       /* a code has one freeze frame and one record of extended data: the count */
#define ANY_RECORD 0xFFU
#define SNAPSHOT_BASE 0x0100U
#define LARGEST R(3.4e38) /* beyond single precision there is no number to pack */
#define TEST_FAILED 0x01U
#define KEPT 0x2BU /* and: failed this cycle, confirmed, failed since the last clear; codes live from the start of the ECU on */
#define FAILED 0x2AU

static uint8_t status_of(const Code *code)
{
    return code->active ? (uint8_t)(FAILED | TEST_FAILED) : (uint8_t)FAILED;
}

static uint32_t number_of(uint32_t spn, uint8_t mode)
{
    return ((spn & 0xFFU) << 16) | (((spn >> 8) & 0xFFU) << 8) | ((((spn >> 16) << 5) | mode) & 0xFFU);
}

static uint32_t code_number(const Code *code)
{
    return number_of((uint32_t)suspects[code->suspect].spn, code->mode);
}

static void codes_counted(uint8_t mask, UdsAnswer *answer)
{
    uint16_t count;
    uint16_t matching = 0U;
    const Code *codes = codes_all(&count);
    for (uint16_t k = 0U; k < count; ++k) {
        matching = (uint16_t)(matching + (((status_of(&codes[k]) & mask) != 0U) ? 1U : 0U));
    }
    answer_byte(answer, KEPT);
    answer_byte(answer, FORMAT_J1939);
    answer_number(answer, matching, 2U);
}

/* Of the codes that are active, or of the others: number, then `record`, or the status where that is 0. */
static void listed(bool active, uint8_t mask, uint8_t record, UdsAnswer *answer)
{
    uint16_t count;
    const Code *codes = codes_all(&count);
    for (uint16_t k = 0U; k < count; ++k) {
        const Code *code = &codes[k];
        if ((code->active == active) && ((status_of(code) & mask) != 0U)) {
            answer_number(answer, code_number(code), 3U);
            answer_byte(answer, (record != 0U) ? record : status_of(code));
        }
    }
}

static void by_mask(uint8_t mask, UdsAnswer *answer)
{
    answer_byte(answer, KEPT);
    listed(true, mask, 0U, answer);
    listed(false, mask, 0U, answer);
}

static void snapshots(UdsAnswer *answer)
{
    listed(true, KEPT, RECORD, answer);
    listed(false, KEPT, RECORD, answer);
}

static void supported(UdsAnswer *answer)
{
    uint16_t count;
    const Code *codes = codes_all(&count);
    answer_byte(answer, KEPT);
    for (uint16_t k = 0U; k < POSSIBLE_CODES; ++k) {
        const uint32_t number = number_of(possible_codes[k].spn, possible_codes[k].mode);
        uint8_t status = 0U;
        for (uint16_t place = 0U; place < count; ++place) {
            status = (code_number(&codes[place]) == number) ? status_of(&codes[place]) : status;
        }
        answer_number(answer, number, 3U);
        answer_byte(answer, status);
    }
}

/* The code with this number and record; NULL where there is none. */
static const Code *named(const uint8_t *rest)
{
    const uint32_t wanted = ((uint32_t)rest[0] << 16) | ((uint32_t)rest[1] << 8) | rest[2];
    uint16_t count;
    const Code *codes = codes_all(&count);
    for (uint16_t k = 0U; k < count; ++k) {
        if ((code_number(&codes[k]) == wanted) && ((rest[3] == RECORD) || (rest[3] == ANY_RECORD))) {
            return &codes[k];
        }
    }
    return NULL;
}

/* The code that a request names, with the head of the answer; NULL if there is none. */
static const Code *answered(const uint8_t *rest, UdsAnswer *answer)
{
    const Code *code = named(rest);
    if (code != NULL) {
        answer_number(answer, code_number(code), 3U);
        answer_byte(answer, status_of(code));
        answer_byte(answer, RECORD);
    }
    return code;
}

static UdsResult snapshot(const uint8_t *rest, UdsAnswer *answer)
{
    const Code *code = answered(rest, answer);
    if (code == NULL) {
        return UDS_OUT_OF_RANGE;
    }
    answer_byte(answer, FROZEN_VALUES);
    for (uint8_t k = 0U; k < FROZEN_VALUES; ++k) {
        answer_number(answer, SNAPSHOT_BASE + (uint32_t)k, 2U);
        answer_float(answer, (float)real_min(real_max(code->frozen[k], -LARGEST), LARGEST));
    }
    return UDS_DONE;
}

static UdsResult extended(const uint8_t *rest, UdsAnswer *answer)
{
    const Code *code = answered(rest, answer);
    if (code == NULL) {
        return UDS_OUT_OF_RANGE;
    }
    answer_byte(answer, code->occurrences);
    return UDS_DONE;
}

/* How many bytes follow a sub-function; 255 for one that is not served. */
static uint8_t bytes_after(uint8_t kind)
{
    static const uint8_t served[] = {255U, 1U, 1U, 0U, 4U, 255U, 4U, 255U, 255U, 255U, 0U};
    return (kind < sizeof served) ? served[kind] : 255U;
}

UdsResult trouble_reported(const uint8_t *request, uint16_t length, UdsAnswer *answer)
{
    const uint8_t kind = request[0] & 0x7FU;
    const uint8_t *rest = &request[1];
    UdsResult result = UDS_DONE;
    if (bytes_after(kind) == 255U) {
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    }
    if (length != (1U + (uint16_t)bytes_after(kind))) {
        return UDS_WRONG_LENGTH;
    }
    answer_byte(answer, kind);
    switch (kind) {
    case 0x01U:
        codes_counted(rest[0], answer);
        break;
    case 0x02U:
        by_mask(rest[0], answer);
        break;
    case 0x03U:
        snapshots(answer);
        break;
    case 0x04U:
        result = snapshot(rest, answer);
        break;
    case 0x06U:
        result = extended(rest, answer);
        break;
    default:
        supported(answer);
        break;
    }
    return result;
}
