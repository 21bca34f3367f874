/*
 * A CAN interface of Linux that may go down, away or bus off, and come back.
 *
 * Each is a line of the log and not an end: meanwhile nothing is received and nothing is sent.
 */
#ifndef CAN_BUS_H
#define CAN_BUS_H

#include <stdbool.h>
#include <stdint.h>

#include "ecu.h"

typedef void Received(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns);

int64_t now_of(void); /* CLOCK_MONOTONIC [ns] */
bool bus_opened(const char *interface); /* false after a line that says why not */
int bus_descriptor(void);
void bus_drained(Received *received);                       /* every waiting frame goes to `received` */
void bus_sent(const EcuFrame *frames, uint8_t count);       /* a frame that the kernel does not take is lost */
void bus_looked_after(void);                                /* once a tick: whether the interface is back */
uint32_t bus_errors(void);                                  /* error frames so far */

#endif
