/* XCP on CAN: measuring and calibrating the ECU while it runs (ASAM MCD-1 XCP 1.1, classic CAN). After ecu/xcp/slave.py. */
#ifndef XCP_H
#define XCP_H

#include <stdint.h>

void xcp_start(uint32_t send);
void xcp_receive(const uint8_t *data, uint8_t length, int64_t now_ns);
void xcp_before_cycle(int64_t now_ns); /* takes over what was written since the last cycle */
void xcp_after_cycle(int64_t now_ns);  /* sends events, and what was measured in the cycle */

#endif
