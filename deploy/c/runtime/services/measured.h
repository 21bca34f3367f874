/* Everything that can be measured, as bytes of memory, all of one cycle. After ecu/measure/measurements.py. */
#ifndef MEASURED_H
#define MEASURED_H

#include "service_tables.h"

void measured_start(void);
void measured_taken(void);              /* a cycle is over */
const uint8_t *measured_image(void);    /* MEASURED_BYTES of the last cycle; zeros before the first */
real_t measured_input(uint16_t input);  /* its value in the last cycle; 0 before the first */
void float_stored(float value, uint8_t *bytes); /* four bytes, the lowest first */
float float_of(const uint8_t *bytes);

#endif
