/* ReadDTCInformation: trouble codes with status, freeze frames and counts. After ecu/uds/trouble.py. */
#ifndef UDS_TROUBLE_H
#define UDS_TROUBLE_H

#include "uds_answer.h"

#define UDS_ALL_CODES 0xFFFFFFU

/* `request`: from the sub-function on, at least that. */
UdsResult trouble_reported(const uint8_t *request, uint16_t length, UdsAnswer *answer);

#endif
