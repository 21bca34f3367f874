#include "xcp.h"

#include <stddef.h>
#include <string.h>

#include "access.h"
#include "pages.h"
#include "services.h"
#include "xcp_daq.h"
#include "xcp_memory.h"

#define SILENCE_NS 60000000000LL /* a tool with write access that is silent for so long has lost it */
#define CALIBRATION 0x01U
#define DAQ 0x04U
#define SLAVE_BLOCK_MODE 0x40U
#define OPTIONAL_INFO 0x80U
#define DRIVER_VERSION 0x10U
#define MICROSECOND (3U << 4)
#define FOUR_BYTES 4U
#define MILLISECOND 6U
#define CYCLE_MS 10U
#define DAQ_OF_EVENT 0x04U
#define ALL_OF_ONE_EVENT 0x80U
#define ANY_NUMBER 0xFFU
#define SESSION_TERMINATED 0x07U
#define IS_RUNNING 0x40U
#define IN_A_PACKET (XCP_MAX_CTO - 2U) /* bytes of a seed or a key */

typedef struct {
    uint8_t code;
    uint8_t least; /* bytes; longer commands are padded, which CAN permits */
    XcpHandler *handler;
} Command;

static struct {
    uint32_t send;
    bool is_connected;
    bool is_terminated; /* an event says so after the cycle */
    int64_t heard_ns;
    Lock lock;
    uint8_t seed_left; /* bytes of the seed that are still to be sent */
    uint8_t key[KEY_BYTES]; /* what has come of a key, as far as one can be right */
    uint8_t key_bytes;
    uint8_t key_length; /* announced; 0: none is under way */
} xcp;

bool xcp_is_unlocked(void)
{
    return xcp.lock.is_open;
}

void packet_sent(const XcpPacket *packet)
{
    EcuFrame frame;
    (void)memset(&frame, 0, sizeof frame);
    frame.id = xcp.send;
    frame.length = packet->length;
    (void)memcpy(frame.data, packet->bytes, packet->length);
    service_answered(&frame);
}

static void key_forgotten(void)
{
    xcp.key_bytes = 0U;
    xcp.key_length = 0U;
}

/* End the session: nothing is sent, calibration is locked, and the ECU works with its file's values again. */
static void session_ended(void)
{
    xcp.is_connected = false;
    lock_closed(&xcp.lock);
    xcp.seed_left = 0U;
    key_forgotten();
    daq_reset();
    memory_ended();
}

/* -- session */

static XcpResult connect(const XcpPacket *command, XcpPacket *answer)
{
    if (command->bytes[1] != 0U) {
        return XCP_OUT_OF_RANGE; /* the mode in which some ECUs are flashed */
    }
    if (!xcp.is_connected) {
        session_ended();
        xcp.is_connected = true;
    }
    packet_byte(answer, CALIBRATION | DAQ);
    packet_byte(answer, SLAVE_BLOCK_MODE | OPTIONAL_INFO);
    packet_byte(answer, XCP_MAX_CTO);
    packet_number(answer, XCP_MAX_DTO, 2U);
    packet_byte(answer, 1U);
    packet_byte(answer, 1U);
    return XCP_DONE;
}

static XcpResult disconnect(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    (void)answer;
    session_ended();
    return XCP_DONE;
}

static uint8_t protected_now(void)
{
    return xcp.lock.is_open ? (uint8_t)0U : (uint8_t)CALIBRATION;
}

static XcpResult get_status(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_byte(answer, daq_is_running() ? IS_RUNNING : 0U);
    packet_byte(answer, protected_now());
    packet_number(answer, 0U, 3U);
    return XCP_DONE;
}

static XcpResult synch(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    (void)answer;
    return XCP_CMD_SYNCH; /* this answer is what the standard asks for */
}

static XcpResult get_comm_mode_info(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_number(answer, 0U, 4U);
    packet_number(answer, 0U, 2U);
    packet_byte(answer, DRIVER_VERSION);
    return XCP_DONE;
}

static XcpResult get_id(const XcpPacket *command, XcpPacket *answer)
{
    static const uint8_t nothing[1] = {0U};
    const Identity *found = NULL;
    for (uint8_t k = 0U; k < XCP_TEXTS; ++k) {
        found = (xcp_texts[k].identifier == command->bytes[1]) ? &xcp_texts[k] : found;
    }
    const uint16_t length = (found == NULL) ? (uint16_t)0U : found->length;
    memory_text((found == NULL) ? nothing : found->bytes, length);
    packet_number(answer, 0U, 3U);
    packet_number(answer, length, 4U);
    return XCP_DONE;
}

/* -- access */

static XcpResult get_seed(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    const uint8_t resource = command->bytes[2];
    if (mode == 0U) {
        if ((resource != CALIBRATION) && (resource != DAQ)) {
            return XCP_OUT_OF_RANGE;
        }
        xcp.seed_left = 0U;
        if ((resource == CALIBRATION) && !xcp.lock.is_open) {
            lock_seed(&xcp.lock);
            xcp.seed_left = SEED_BYTES;
        }
        key_forgotten();
    } else if ((mode != 1U) || (xcp.seed_left == 0U)) {
        return (mode == 1U) ? XCP_SEQUENCE : XCP_OUT_OF_RANGE;
    } else {
        /* the next part */
    }
    packet_byte(answer, xcp.seed_left);
    for (uint8_t k = 0U; (k < IN_A_PACKET) && (xcp.seed_left > 0U); ++k) {
        packet_byte(answer, xcp.lock.seed[SEED_BYTES - xcp.seed_left]);
        xcp.seed_left = (uint8_t)(xcp.seed_left - 1U);
    }
    return XCP_DONE;
}

static XcpResult unlock(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t left = command->bytes[1];
    if (xcp.key_length == 0U) {
        xcp.key_length = left;
    }
    if ((left == 0U) || (left != (uint8_t)(xcp.key_length - xcp.key_bytes))) {
        key_forgotten();
        return XCP_SEQUENCE;
    }
    for (uint8_t k = 2U; (k < command->length) && (xcp.key_bytes < xcp.key_length); ++k) {
        if (xcp.key_bytes < KEY_BYTES) {
            xcp.key[xcp.key_bytes] = command->bytes[k];
        }
        xcp.key_bytes += 1U;
    }
    if (xcp.key_bytes == xcp.key_length) {
        const uint8_t length = xcp.key_length;
        key_forgotten();
        if (!lock_unlocked(&xcp.lock, xcp.key, length)) {
            session_ended(); /* as the standard asks for after a wrong key */
            return XCP_ACCESS_LOCKED;
        }
    }
    packet_byte(answer, protected_now());
    return XCP_DONE;
}

/* -- lists */

/* The lowest 32 bits of a time. */
static uint32_t microseconds(int64_t at_ns)
{
    const int64_t at_us = at_ns / 1000;
    return (uint32_t)at_us;
}

static XcpResult get_daq_resolution_info(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_byte(answer, 1U);
    packet_byte(answer, XCP_MAX_DTO - 1U);
    packet_byte(answer, 1U);
    packet_byte(answer, 0U);
    packet_byte(answer, MICROSECOND | FOUR_BYTES);
    packet_number(answer, 1U, 2U);
    return XCP_DONE;
}

static XcpResult get_daq_event_info(const XcpPacket *command, XcpPacket *answer)
{
    static const uint8_t name[5] = {(uint8_t)'c', (uint8_t)'y', (uint8_t)'c', (uint8_t)'l', (uint8_t)'e'};
    if (packet_read(command, 2U, 2U) != 0U) {
        return XCP_OUT_OF_RANGE;
    }
    memory_text(name, (uint16_t)sizeof name);
    packet_byte(answer, DAQ_OF_EVENT | ALL_OF_ONE_EVENT);
    packet_byte(answer, ANY_NUMBER);
    packet_byte(answer, (uint8_t)sizeof name);
    packet_byte(answer, CYCLE_MS);
    packet_byte(answer, MILLISECOND);
    packet_byte(answer, 0U);
    return XCP_DONE;
}

static XcpResult get_daq_clock(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_number(answer, 0U, 3U);
    packet_number(answer, microseconds(xcp.heard_ns), 4U);
    return XCP_DONE;
}

/* -- commands */

static const Command *command_of(uint8_t code)
{
    static const Command commands[] = {
        {0xFFU, 2U, connect},
        {0xFEU, 1U, disconnect},
        {0xFDU, 1U, get_status},
        {0xFCU, 1U, synch},
        {0xFBU, 1U, get_comm_mode_info},
        {0xFAU, 2U, get_id},
        {0xF8U, 3U, get_seed},
        {0xF7U, 2U, unlock},
        {0xF6U, 8U, memory_set_mta},
        {0xF5U, 2U, memory_upload},
        {0xF4U, 8U, memory_short_upload},
        {0xF3U, 8U, memory_build_checksum},
        {0xF0U, 3U, memory_download},
        {0xEBU, 4U, memory_set_cal_page},
        {0xEAU, 3U, memory_get_cal_page},
        {0xE9U, 1U, memory_get_pag_processor_info},
        {0xE8U, 5U, memory_get_segment_info},
        {0xE7U, 4U, memory_get_page_info},
        {0xE4U, 5U, memory_copy_cal_page},
        {0xE3U, 4U, daq_clear},
        {0xE2U, 6U, daq_set_pointer},
        {0xE1U, 8U, daq_write},
        {0xE0U, 8U, daq_set_mode},
        {0xDFU, 4U, daq_get_mode},
        {0xDEU, 4U, daq_start_stop},
        {0xDDU, 2U, daq_start_stop_synch},
        {0xDCU, 1U, get_daq_clock},
        {0xDAU, 1U, daq_get_processor_info},
        {0xD9U, 1U, get_daq_resolution_info},
        {0xD7U, 4U, get_daq_event_info},
        {0xD6U, 1U, daq_free},
        {0xD5U, 4U, daq_alloc},
        {0xD4U, 5U, daq_alloc_odt},
        {0xD3U, 6U, daq_alloc_odt_entry},
    };
    for (uint8_t k = 0U; k < (sizeof(commands) / sizeof(Command)); ++k) {
        if (commands[k].code == code) {
            return &commands[k];
        }
    }
    return NULL;
}

static XcpResult carried_out(const XcpPacket *packet, XcpPacket *answer)
{
    const Command *command = command_of(packet->bytes[0]);
    if (command == NULL) {
        return XCP_CMD_UNKNOWN;
    }
    return (packet->length < command->least) ? XCP_CMD_SYNTAX : command->handler(packet, answer);
}

void xcp_start(uint32_t send)
{
    (void)memset(&xcp, 0, sizeof xcp);
    xcp.send = send;
    lock_start(&xcp.lock, "xcp calibration");
    daq_reset();
    memory_start();
}

void xcp_receive(const uint8_t *data, uint8_t length, int64_t now_ns)
{
    XcpPacket command;
    XcpPacket answer;
    command.length = 0U;
    answer.length = 0U;
    packet_byte(&answer, XCP_RESPONSE);
    for (uint8_t k = 0U; k < length; ++k) {
        packet_byte(&command, data[k]);
    }
    if (!xcp.is_connected && (command.bytes[0] != 0xFFU)) {
        return;
    }
    xcp.heard_ns = now_ns;
    const XcpResult result = carried_out(&command, &answer);
    if (result != XCP_DONE) {
        answer.length = 0U;
        packet_byte(&answer, XCP_ERROR);
        packet_byte(&answer, (uint8_t)result);
    }
    packet_sent(&answer);
}

void xcp_before_cycle(int64_t now_ns)
{
    if (xcp.lock.is_open && ((now_ns - xcp.heard_ns) > SILENCE_NS)) {
        session_ended();
        xcp.is_terminated = true;
    }
    pages_before_cycle();
}

void xcp_after_cycle(int64_t now_ns)
{
    if (xcp.is_terminated) {
        XcpPacket event;
        event.length = 0U;
        packet_byte(&event, XCP_EVENT);
        packet_byte(&event, SESSION_TERMINATED);
        packet_sent(&event);
        xcp.is_terminated = false;
    }
    if (xcp.is_connected) {
        daq_sampled(microseconds(now_ns));
    }
}
