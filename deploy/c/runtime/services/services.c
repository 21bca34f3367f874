/* Hands frames and cycles to what is offered. After ecu/offered/services.py and ecu/measure/channel.py. */
#include "services.h"

#include <stddef.h>

#include "access.h"
#include "j1939.h"
#include "measured.h"
#include "uds.h"
#include "xcp.h"

static Services offered;

void services_start(const Services *services)
{
    offered = *services;
    offered.secret = NULL; /* what is needed of it is kept by access.c */
    access_start(services->secret, services->secret_length);
    measured_start();
    if (offered.claims_address) {
        j1939_start(offered.name);
    }
    if (offered.xcp.offered) {
        xcp_start(offered.xcp.send);
    }
    if (offered.uds.offered) {
        uds_start(offered.uds.send);
    }
}

bool services_may_send(void)
{
    return !offered.claims_address || j1939_may_send();
}

void service_answered(const EcuFrame *frame)
{
    if (services_may_send()) {
        service_sent(frame);
    }
}

void services_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    if ((length == 0U) || (length > 8U)) {
        return;
    }
    if (offered.claims_address) {
        j1939_receive(id, data, length, now_ns);
    }
    if (offered.xcp.offered && (id == offered.xcp.receive)) {
        xcp_receive(data, length, now_ns);
    }
    if (offered.uds.offered && (id == offered.uds.receive)) {
        uds_receive(data, length, now_ns);
    }
}

void services_before_cycle(int64_t now_ns)
{
    if (offered.xcp.offered) {
        xcp_before_cycle(now_ns);
    }
    if (offered.uds.offered) {
        uds_before_cycle(now_ns);
    }
}

void services_after_cycle(int64_t now_ns)
{
    measured_taken();
    if (offered.claims_address) {
        j1939_after_cycle(now_ns);
    }
    if (offered.xcp.offered) {
        xcp_after_cycle(now_ns);
    }
    if (offered.uds.offered) {
        uds_after_cycle(now_ns);
    }
}
