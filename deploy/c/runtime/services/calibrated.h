/* Lets the ECU work with other numbers, as a calibration file with them would. After ecu/calibration.py. */
#ifndef CALIBRATED_H
#define CALIBRATED_H

#include "real.h"

/* Both take all numbers in the order of their addresses, each in the unit of its key. */
bool calibration_holds(const real_t *numbers); /* the rules between numbers; their ranges are checked one by one */
void calibration_applied(const real_t *numbers);

#endif
