/*
 * What the ECU offers on the bus beside its cycle, where it is asked for: XCP and UDS.
 *
 * The program calls services_receive for every frame, services_before_cycle and services_after_cycle around ecu_tick, all from
 * the context of the ECU. A firmware that offers nothing leaves this folder out; one that has it is compiled with -DECU_SETTABLE.
 */
#ifndef SERVICES_H
#define SERVICES_H

#include "ecu.h"

typedef struct {
    bool offered;
    uint32_t receive; /* identifier of the tool's frames; bit 31: 29 bits */
    uint32_t send;    /* of the ECU's */
} Channel;

typedef struct {
    Channel xcp;
    Channel uds;
    const uint8_t *secret; /* behind seed and key; is not needed any more when services_start has returned */
    uint16_t secret_length; /* 0: nothing can be unlocked */
} Services;

void services_start(const Services *services);
void services_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns);
void services_before_cycle(int64_t now_ns);
void services_after_cycle(int64_t now_ns);

/* The program supplies these: one frame for the bus, and bytes that nobody can foresee; false where there are none. */
void service_sent(const EcuFrame *frame);
bool service_random(uint8_t *bytes, uint8_t count);

#endif
