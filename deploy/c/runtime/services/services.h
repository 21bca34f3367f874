/*
 * What the ECU offers on the bus beside its cycle, where it is asked for: XCP, UDS and the network management of J1939.
 *
 * The program calls services_receive for every frame, services_before_cycle and services_after_cycle around ecu_tick, all from
 * the context of the ECU. It sends the frames of ecu_tick only where services_may_send permits. A firmware that offers nothing leaves this folder out; one that has it is compiled with -DECU_SETTABLE.
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
    bool claims_address; /* by J1939-81: until the ECU has its address, and after it has lost it, nothing is sent */
    uint64_t name; /* of this controller, for the claim */
    const uint8_t *secret; /* behind seed and key; is not needed any more when services_start has returned */
    uint16_t secret_length; /* 0: nothing can be unlocked */
} Services;

void services_start(const Services *services);
void services_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns);
void services_before_cycle(int64_t now_ns);
void services_after_cycle(int64_t now_ns);
bool services_may_send(void);

/* For the services: an answer, which is sent where the ECU may send. */
void service_answered(const EcuFrame *frame);

/*
 * The program supplies these: one frame for the bus; bytes that nobody can foresee, false where there are none; and what is to be
 * done when the controller with this NAME has taken the address.
 */
void service_sent(const EcuFrame *frame);
bool service_random(uint8_t *bytes, uint8_t count);
void service_address_lost(uint64_t name);

#endif
