/* The services of a shared library that a bench loads: what they send is kept until the bench has read it after each call. */
#include "library.h"

#include <stddef.h>

#include "services/services.h"

#define MOST_SENT 1024U /* of one call: a long answer of ISO-TP has 585 frames, lists of measurements 255 */

EcuFrame library_sent[MOST_SENT];
uint32_t library_sent_count; /* the bench sets it back */
const uint32_t library_most_sent = MOST_SENT;
bool (*library_random)(uint8_t *bytes, uint8_t count); /* of the bench */

void service_sent(const EcuFrame *frame)
{
    if (library_sent_count < MOST_SENT) {
        library_sent[library_sent_count] = *frame;
        library_sent_count += 1U;
    }
}

bool service_random(uint8_t *bytes, uint8_t count)
{
    return (library_random != NULL) && library_random(bytes, count);
}

void service_address_lost(uint64_t name)
{
    (void)name; /* a bench claims the address by itself */
}

void library_services_start(bool xcp, uint32_t xcp_receive, uint32_t xcp_send, bool uds, uint32_t uds_receive, uint32_t uds_send,
                            const uint8_t *secret, uint16_t secret_length)
{
    const Services services = {
        .xcp = {xcp, xcp_receive, xcp_send},
        .uds = {uds, uds_receive, uds_send},
        .claims_address = false,
        .name = 0U,
        .secret = secret,
        .secret_length = secret_length,
    };
    services_start(&services);
}
