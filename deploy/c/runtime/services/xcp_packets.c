#include "xcp_packets.h"

void packet_byte(XcpPacket *packet, uint8_t byte)
{
    if (packet->length < XCP_MAX_CTO) {
        packet->bytes[packet->length] = byte;
        packet->length += 1U;
    }
}

void packet_number(XcpPacket *packet, uint32_t number, uint8_t count)
{
    for (uint8_t k = 0U; k < count; ++k) {
        packet_byte(packet, (uint8_t)(number >> (8U * (uint32_t)k)));
    }
}

uint32_t packet_read(const XcpPacket *packet, uint8_t at, uint8_t count)
{
    uint32_t number = 0U;
    for (uint8_t k = 0U; k < count; ++k) {
        number |= (uint32_t)packet->bytes[at + k] << (8U * (uint32_t)k);
    }
    return number;
}
