/* What a program supplies to the services, for tests: frames are kept, and seeds can be foreseen. */
#include "services/services.h"

#include <string.h>

#define MOST_SENT 4096U

EcuFrame tested_sent[MOST_SENT];
uint32_t tested_count;
static uint32_t seeds;

void service_sent(const EcuFrame *frame)
{
    if (tested_count < MOST_SENT) {
        tested_sent[tested_count] = *frame;
        tested_count += 1U;
    }
}

/* 1, 2, 3 ...: big-endian, as the tests of the Python ECU have them. */
bool service_random(uint8_t *bytes, uint8_t count)
{
    if (count == 1U) {
        bytes[0] = 10U; /* a delay of J1939 */
        return true;
    }
    seeds += 1U;
    (void)memset(bytes, 0, count);
    bytes[count - 1U] = (uint8_t)(seeds & 0xFFU);
    bytes[count - 2U] = (uint8_t)(seeds >> 8);
    return true;
}

uint64_t tested_lost_to;
uint32_t tested_losses;

void service_address_lost(uint64_t name)
{
    tested_lost_to = name;
    tested_losses += 1U;
}

void tested_start(uint32_t xcp_receive, uint32_t xcp_send, uint32_t uds_receive, uint32_t uds_send, const uint8_t *secret, uint16_t secret_length,
                  bool detect_faults, bool claims_address, uint64_t name)
{
    const Services services = {
        .xcp = {xcp_receive != 0U, xcp_receive, xcp_send},
        .uds = {uds_receive != 0U, uds_receive, uds_send},
        .claims_address = claims_address,
        .name = name,
        .secret = secret,
        .secret_length = secret_length,
    };
    ecu_init(true);
    ecu_detect_faults(detect_faults);
    services_start(&services);
}
