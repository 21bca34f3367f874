/* What loader-ecu offers on the bus beside its cycle: its options, and what the services need of Linux. */
#ifndef OFFERED_H
#define OFFERED_H

#include "options.h"

/* Starts what is asked for. False after a line that says why it cannot be offered. */
bool offered_started(const Options *options);

#endif
