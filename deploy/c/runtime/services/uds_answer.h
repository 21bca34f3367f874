/* The answer to one UDS request, written byte by byte; numbers are big-endian. After ecu/uds/codes.py. */
#ifndef UDS_ANSWER_H
#define UDS_ANSWER_H

#include <stdbool.h>
#include <stdint.h>

#include "isotp.h"

/* Why a request is refused: codes of ISO 14229-1. */
typedef enum {
    UDS_DONE = 0x00,
    UDS_SERVICE_NOT_SUPPORTED = 0x11,
    UDS_SUBFUNCTION_NOT_SUPPORTED = 0x12,
    UDS_WRONG_LENGTH = 0x13,
    UDS_RESPONSE_TOO_LONG = 0x14,
    UDS_CONDITIONS_NOT_CORRECT = 0x22,
    UDS_SEQUENCE_ERROR = 0x24,
    UDS_OUT_OF_RANGE = 0x31,
    UDS_SECURITY_ACCESS_DENIED = 0x33,
    UDS_INVALID_KEY = 0x35,
    UDS_TOO_MANY_ATTEMPTS = 0x36,
    UDS_DELAY_NOT_EXPIRED = 0x37,
    UDS_SERVICE_NOT_IN_SESSION = 0x7F
} UdsResult;

typedef struct {
    uint8_t bytes[ISOTP_LONGEST_ANSWER];
    uint16_t length;
    bool is_too_long; /* something did not fit */
} UdsAnswer;

void answer_start(UdsAnswer *answer);
void answer_byte(UdsAnswer *answer, uint8_t byte);
void answer_bytes(UdsAnswer *answer, const uint8_t *bytes, uint16_t count);
void answer_number(UdsAnswer *answer, uint32_t number, uint8_t count); /* its lowest `count` bytes */
void answer_float(UdsAnswer *answer, float number);

#endif
