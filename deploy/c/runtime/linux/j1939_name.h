/* The NAME of a controller on the command line. After ecu/j1939/name.py. */
#ifndef J1939_NAME_H
#define J1939_NAME_H

#include <stdbool.h>
#include <stdint.h>

/* From "identity=1,manufacturer=0,..."; numbers may be hexadecimal. False after a line that says what is wrong. */
bool name_read(const char *text, uint64_t *name);

#endif
