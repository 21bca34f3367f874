/* UDS (ISO 14229-1) on ISO-TP: identification, measurements, trouble codes, self test, restart. After ecu/uds/server.py. */
#ifndef UDS_H
#define UDS_H

#include <stdint.h>

void uds_start(uint32_t send);
void uds_receive(const uint8_t *data, uint8_t length, int64_t now_ns);
void uds_before_cycle(int64_t now_ns); /* a restart that was asked for takes place, and a silent tool loses its session */
void uds_after_cycle(int64_t now_ns);

#endif
