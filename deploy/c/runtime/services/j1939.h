/*
 * Network management of J1939: the claim of the ECU's address, and answers to requests. After ecu/j1939/.
 *
 * The DBC fixes the ECU's identifiers, and with them its address. Without that address the ECU sends nothing: the machine is then
 * on its safe limits, as whenever the ECU is silent.
 */
#ifndef J1939_H
#define J1939_H

#include <stdbool.h>
#include <stdint.h>

void j1939_start(uint64_t name);
bool j1939_may_send(void); /* whether the ECU has its address */
void j1939_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns);
void j1939_after_cycle(int64_t now_ns);

#endif
