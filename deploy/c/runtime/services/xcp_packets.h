/* Packets of XCP on classic CAN: results of commands, answers, and the numbers in them. After ecu/xcp/packets.py. */
#ifndef XCP_PACKETS_H
#define XCP_PACKETS_H

#include <stdbool.h>
#include <stdint.h>

#define XCP_MAX_CTO 8U
#define XCP_MAX_DTO 8U
#define XCP_RESPONSE 0xFFU
#define XCP_ERROR 0xFEU
#define XCP_EVENT 0xFDU
#define XCP_MOST_ODTS 0xFCU /* packet identifiers below are those of measured data */

typedef enum { /* the standard's error codes, and one for none */
    XCP_CMD_SYNCH = 0x00,
    XCP_DAQ_ACTIVE = 0x11,
    XCP_CMD_UNKNOWN = 0x20,
    XCP_CMD_SYNTAX = 0x21,
    XCP_OUT_OF_RANGE = 0x22,
    XCP_WRITE_PROTECTED = 0x23,
    XCP_ACCESS_DENIED = 0x24,
    XCP_ACCESS_LOCKED = 0x25,
    XCP_PAGE_NOT_VALID = 0x26,
    XCP_MODE_NOT_VALID = 0x27,
    XCP_SEGMENT_NOT_VALID = 0x28,
    XCP_SEQUENCE = 0x29,
    XCP_DAQ_CONFIG = 0x2A,
    XCP_MEMORY_OVERFLOW = 0x30,
    XCP_DONE = 0x100
} XcpResult;

typedef struct {
    uint8_t bytes[XCP_MAX_CTO];
    uint8_t length;
} XcpPacket;

/* What a command is answered by; the answer already holds the byte that says that it is one. An empty one is not sent. */
typedef XcpResult XcpHandler(const XcpPacket *command, XcpPacket *answer);

void packet_byte(XcpPacket *packet, uint8_t byte);
void packet_number(XcpPacket *packet, uint32_t number, uint8_t count); /* its lowest `count` bytes, the lowest first */
uint32_t packet_read(const XcpPacket *packet, uint8_t at, uint8_t count);
void packet_sent(const XcpPacket *packet); /* xcp.c */
bool xcp_is_unlocked(void);                /* xcp.c */

#endif
