/* The numbers of one machine in a shared library that a bench loads: the bench sets them before ecu_init. */
#include "library.h"

/* the bench compares it with what it has to set */
const uint32_t library_parameter_count = (uint32_t)(sizeof calibration_parameters / sizeof(real_t));
