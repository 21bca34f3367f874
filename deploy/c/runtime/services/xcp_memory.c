#include "xcp_memory.h"

#include <stddef.h>
#include <string.h>

#include "measured.h"
#include "pages.h"

#define SEGMENT 0U
#define ECU_PAGE 0x01U
#define XCP_PAGE 0x02U
#define ALL_SEGMENTS 0x80U
#define CRC_32 0x09U
#define PAGES 2U
#define IN_A_PACKET (XCP_MAX_CTO - 1U)

static struct {
    uint32_t address;
    uint8_t extension;
    const uint8_t *text; /* what UPLOAD reads instead of memory; NULL: memory */
    uint16_t text_length;
    uint8_t page; /* that the tool reads and writes */
} memory;

void memory_ended(void)
{
    pages_reset();
    pages_chosen(WORKING_PAGE);
    (void)memset(&memory, 0, sizeof memory);
    memory.page = WORKING_PAGE;
}

void memory_start(void)
{
    pages_start();
    (void)memset(&memory, 0, sizeof memory);
    memory.page = WORKING_PAGE;
}

void memory_text(const uint8_t *text, uint16_t length)
{
    memory.text = text;
    memory.text_length = length;
}

/* Whether so many bytes lie inside one area; `offset`: in it. */
static bool is_inside(uint32_t address, uint32_t size, uint32_t base, uint32_t length, uint32_t *offset)
{
    *offset = address - base;
    return (address >= base) && (*offset <= length) && (size <= (length - *offset));
}

static bool is_readable(uint32_t size)
{
    uint32_t offset;
    return (memory.extension == 0U) && (is_inside(memory.address, size, MEASURED_BASE, MEASURED_BYTES, &offset) ||
                                        is_inside(memory.address, size, CALIBRATION_BASE, CALIBRATION_BYTES, &offset) ||
                                        is_inside(memory.address, size, EPK_ADDRESS, EPK_BYTES, &offset));
}

static uint8_t byte_at(uint32_t address)
{
    uint32_t offset;
    if (is_inside(address, 1U, MEASURED_BASE, MEASURED_BYTES, &offset)) {
        return measured_image()[offset];
    }
    if (is_inside(address, 1U, CALIBRATION_BASE, CALIBRATION_BYTES, &offset)) {
        return pages_byte(memory.page, offset);
    }
    return is_inside(address, 1U, EPK_ADDRESS, EPK_BYTES, &offset) ? epk_text[offset] : (uint8_t)0U;
}

XcpResult memory_measured(uint32_t address, uint8_t extension, uint8_t size, uint16_t *offset)
{
    uint32_t found;
    if ((extension != 0U) || !is_inside(address, size, MEASURED_BASE, MEASURED_BYTES, &found)) {
        return XCP_ACCESS_DENIED;
    }
    *offset = (uint16_t)found;
    return XCP_DONE;
}

XcpResult memory_set_mta(const XcpPacket *command, XcpPacket *answer)
{
    (void)answer;
    memory.extension = command->bytes[3];
    memory.address = packet_read(command, 4U, 4U);
    memory.text = NULL;
    return XCP_DONE;
}

/* The next byte of a text or of memory; the place moves on. */
static uint8_t next_byte(void)
{
    uint8_t byte;
    if (memory.text != NULL) {
        byte = *memory.text;
        memory.text = &memory.text[1];
        memory.text_length = (uint16_t)(memory.text_length - 1U);
    } else {
        byte = byte_at(memory.address);
        memory.address += 1U;
    }
    return byte;
}

static XcpResult readable(uint8_t count)
{
    if (count == 0U) {
        return XCP_OUT_OF_RANGE;
    }
    if (memory.text != NULL) {
        if (memory.text_length < count) {
            memory.text_length = 0U; /* what is left of a text is not read in part */
            return XCP_ACCESS_DENIED;
        }
        return XCP_DONE;
    }
    return is_readable(count) ? XCP_DONE : XCP_ACCESS_DENIED;
}

XcpResult memory_upload(const XcpPacket *command, XcpPacket *answer)
{
    uint8_t left = command->bytes[1];
    const XcpResult result = readable(left);
    if (result != XCP_DONE) {
        return result;
    }
    while (left > 0U) { /* more than one packet holds: slave block mode */
        packet_byte(answer, next_byte());
        left = (uint8_t)(left - 1U);
        if ((answer->length == XCP_MAX_CTO) && (left > 0U)) {
            packet_sent(answer);
            answer->length = 1U;
        }
    }
    return XCP_DONE;
}

XcpResult memory_short_upload(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t count = command->bytes[1];
    const uint32_t address_before = memory.address;
    const uint8_t extension_before = memory.extension;
    if ((count == 0U) || (count > IN_A_PACKET)) {
        return XCP_OUT_OF_RANGE;
    }
    memory.extension = command->bytes[3];
    memory.address = packet_read(command, 4U, 4U);
    if (!is_readable(count)) {
        memory.address = address_before;
        memory.extension = extension_before;
        return XCP_ACCESS_DENIED;
    }
    memory.text = NULL;
    for (uint8_t k = 0U; k < count; ++k) {
        packet_byte(answer, next_byte());
    }
    return XCP_DONE;
}

XcpResult memory_build_checksum(const XcpPacket *command, XcpPacket *answer)
{
    const uint32_t size = packet_read(command, 4U, 4U);
    uint32_t crc = 0xFFFFFFFFU;
    if ((size == 0U) || (memory.text != NULL)) {
        return XCP_OUT_OF_RANGE;
    }
    if (!is_readable(size)) {
        return XCP_ACCESS_DENIED;
    }
    for (uint32_t k = 0U; k < size; ++k) {
        crc ^= next_byte();
        for (uint8_t bit = 0U; bit < 8U; ++bit) {
            crc = ((crc & 1U) != 0U) ? ((crc >> 1) ^ 0xEDB88320U) : (crc >> 1);
        }
    }
    packet_byte(answer, CRC_32);
    packet_number(answer, 0U, 2U);
    packet_number(answer, ~crc, 4U);
    return XCP_DONE;
}

static XcpResult written(const uint8_t *bytes, uint8_t count)
{
    uint32_t offset;
    if ((memory.extension != 0U) ||
        !is_inside(memory.address, count, CALIBRATION_BASE, CALIBRATION_BYTES, &offset)) {
        return XCP_ACCESS_DENIED;
    }
    if (memory.page == REFERENCE_PAGE) {
        return XCP_WRITE_PROTECTED;
    }
    switch (pages_written(offset, bytes, count)) {
    case PAGES_TAKEN:
        memory.address += count;
        return XCP_DONE;
    case PAGES_FIXED:
        return XCP_WRITE_PROTECTED;
    default:
        return XCP_OUT_OF_RANGE;
    }
}

XcpResult memory_download(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t count = command->bytes[1];
    (void)answer;
    if (!xcp_is_unlocked()) {
        return XCP_ACCESS_LOCKED;
    }
    if ((count == 0U) || (count > (XCP_MAX_CTO - 2U))) {
        return XCP_OUT_OF_RANGE;
    }
    if ((command->length - 2U) < count) {
        return XCP_CMD_SYNTAX;
    }
    return (memory.text != NULL) ? XCP_ACCESS_DENIED : written(&command->bytes[2], count);
}

/* -- pages */

XcpResult memory_set_cal_page(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    const uint8_t page = command->bytes[3];
    (void)answer;
    if (page > WORKING_PAGE) {
        return XCP_PAGE_NOT_VALID;
    }
    if ((command->bytes[2] != SEGMENT) && ((mode & ALL_SEGMENTS) == 0U)) {
        return XCP_SEGMENT_NOT_VALID;
    }
    if ((mode & (ECU_PAGE | XCP_PAGE)) == 0U) {
        return XCP_MODE_NOT_VALID;
    }
    if ((mode & ECU_PAGE) != 0U) {
        if (!xcp_is_unlocked()) {
            return XCP_ACCESS_LOCKED;
        }
        pages_chosen(page);
    }
    if ((mode & XCP_PAGE) != 0U) { /* only what the tool itself reads */
        memory.page = page;
    }
    return XCP_DONE;
}

XcpResult memory_get_cal_page(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    if (command->bytes[2] != SEGMENT) {
        return XCP_SEGMENT_NOT_VALID;
    }
    if ((mode != ECU_PAGE) && (mode != XCP_PAGE)) {
        return XCP_MODE_NOT_VALID;
    }
    packet_number(answer, 0U, 2U);
    packet_byte(answer, (mode == ECU_PAGE) ? pages_active() : memory.page);
    return XCP_DONE;
}

XcpResult memory_copy_cal_page(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t source = command->bytes[2];
    const uint8_t page = command->bytes[4];
    (void)answer;
    if (!xcp_is_unlocked()) {
        return XCP_ACCESS_LOCKED;
    }
    if ((command->bytes[1] != SEGMENT) || (command->bytes[3] != SEGMENT)) {
        return XCP_SEGMENT_NOT_VALID;
    }
    if ((source > WORKING_PAGE) || (page > WORKING_PAGE)) {
        return XCP_PAGE_NOT_VALID;
    }
    if (page == REFERENCE_PAGE) {
        return XCP_WRITE_PROTECTED;
    }
    if (source == REFERENCE_PAGE) {
        pages_reset();
    }
    return XCP_DONE;
}

XcpResult memory_get_pag_processor_info(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_byte(answer, 1U);
    packet_byte(answer, 0U);
    return XCP_DONE;
}

XcpResult memory_get_segment_info(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    const uint8_t kind = command->bytes[3];
    if (command->bytes[2] != SEGMENT) {
        return XCP_SEGMENT_NOT_VALID;
    }
    if ((mode == 0U) && (kind <= 1U)) {
        packet_number(answer, 0U, 3U);
        packet_number(answer, (kind == 0U) ? CALIBRATION_BASE : CALIBRATION_BYTES, 4U);
        return XCP_DONE;
    }
    if (mode == 1U) {
        packet_byte(answer, PAGES);
        packet_number(answer, 0U, 4U);
        return XCP_DONE;
    }
    return XCP_OUT_OF_RANGE;
}

/* The ECU and the tool read both pages at any time; the tool writes the working page only. */
XcpResult memory_get_page_info(const XcpPacket *command, XcpPacket *answer)
{
    static const uint8_t rights[PAGES] = {0x0FU, 0x3FU};
    if (command->bytes[2] != SEGMENT) {
        return XCP_SEGMENT_NOT_VALID;
    }
    if (command->bytes[3] >= PAGES) {
        return XCP_PAGE_NOT_VALID;
    }
    packet_byte(answer, rights[command->bytes[3]]);
    packet_byte(answer, 0U);
    return XCP_DONE;
}
