#include "xcp_daq.h"

#include <stddef.h>
#include <string.h>

#include "measured.h"
#include "xcp_memory.h"

#define MOST_LISTS 64U
#define MOST_ENTRIES 1024U /* of all lists together: more than there are measurements several times over */
#define EVENT_CYCLE 0U     /* the only event channel: the end of a cycle */
#define STIM 0x02U
#define TIMESTAMP 0x10U
#define PID_OFF 0x20U
#define ALTERNATING 0x01U
#define SELECTED 0x01U
#define RUNNING 0x40U
#define TIMESTAMP_BYTES 4U
#define DYNAMIC_LISTS 0x01U
#define PRESCALER 0x02U
#define WHOLE_BYTES 0xFFU /* bit offset of an entry: single bits are not offered */
#define IN_A_PACKET (XCP_MAX_DTO - 1U)

typedef struct {
    uint16_t offset; /* in the image */
    uint8_t size;    /* 0: not written yet */
} Entry;

typedef struct {
    uint16_t first; /* of its entries */
    uint8_t count;
} Odt;

typedef struct {
    uint16_t first; /* of its ODTs, each a packet */
    uint8_t count;
    bool has_timestamp;
    bool is_selected;
    bool is_running;
    uint8_t prescaler;
    uint8_t cycles; /* until the next one that is sent */
} List;

static Entry entries[MOST_ENTRIES];
static Odt odts[XCP_MOST_ODTS];
static List lists[MOST_LISTS];
static uint16_t entry_count;
static uint16_t odt_count;
static uint16_t list_count;
static bool is_freed;
static struct {
    bool is_set;
    uint16_t list;
    Odt *odt;
    uint8_t entry;
} pointer;

static void freed(void)
{
    (void)memset(entries, 0, sizeof entries);
    (void)memset(odts, 0, sizeof odts);
    (void)memset(lists, 0, sizeof lists);
    entry_count = 0U;
    odt_count = 0U;
    list_count = 0U;
    pointer.is_set = false;
    is_freed = true;
}

void daq_reset(void)
{
    freed();
    is_freed = false;
}

bool daq_is_running(void)
{
    bool running = false;
    for (uint16_t k = 0U; k < list_count; ++k) {
        running = running || lists[k].is_running;
    }
    return running;
}

static uint8_t size_of(const Odt *odt)
{
    uint8_t size = 0U;
    for (uint8_t k = 0U; k < odt->count; ++k) {
        size = (uint8_t)(size + entries[odt->first + k].size);
    }
    return size;
}

static bool is_complete(const Odt *odt)
{
    bool complete = true;
    for (uint8_t k = 0U; k < odt->count; ++k) {
        complete = complete && (entries[odt->first + k].size > 0U);
    }
    return complete;
}

/* A list that is there and is not being sent; NULL after an error. */
static List *stopped(uint32_t number, XcpResult *result)
{
    *result = (number >= list_count) ? XCP_OUT_OF_RANGE : XCP_DONE;
    if ((*result == XCP_DONE) && lists[number].is_running) {
        *result = XCP_DAQ_ACTIVE;
    }
    return (*result == XCP_DONE) ? &lists[number] : NULL;
}

/* -- making lists */

XcpResult daq_free(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    (void)answer;
    freed();
    return XCP_DONE;
}

XcpResult daq_alloc(const XcpPacket *command, XcpPacket *answer)
{
    const uint32_t count = packet_read(command, 2U, 2U);
    (void)answer;
    if (daq_is_running()) {
        return XCP_DAQ_ACTIVE;
    }
    if (!is_freed || (list_count > 0U)) {
        return XCP_SEQUENCE;
    }
    if (count > MOST_LISTS) {
        return XCP_MEMORY_OVERFLOW;
    }
    list_count = (uint16_t)count;
    for (uint16_t k = 0U; k < list_count; ++k) {
        lists[k].prescaler = 1U;
    }
    return XCP_DONE;
}

XcpResult daq_alloc_odt(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t count = command->bytes[4];
    XcpResult result;
    (void)answer;
    if (daq_is_running()) {
        return XCP_DAQ_ACTIVE;
    }
    List *list = stopped(packet_read(command, 2U, 2U), &result);
    if (list == NULL) {
        return result;
    }
    if ((list->count > 0U) || (entry_count > 0U)) { /* all lists before the first entry of any */
        return XCP_SEQUENCE;
    }
    if ((odt_count + (uint16_t)count) > XCP_MOST_ODTS) {
        return XCP_MEMORY_OVERFLOW;
    }
    list->first = odt_count;
    list->count = count;
    odt_count = (uint16_t)(odt_count + count);
    return XCP_DONE;
}

XcpResult daq_alloc_odt_entry(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t place = command->bytes[4];
    const uint8_t count = command->bytes[5];
    XcpResult result;
    (void)answer;
    if (daq_is_running()) {
        return XCP_DAQ_ACTIVE;
    }
    const List *list = stopped(packet_read(command, 2U, 2U), &result);
    if (list == NULL) {
        return result;
    }
    if (place >= list->count) {
        return XCP_OUT_OF_RANGE;
    }
    Odt *odt = &odts[list->first + place];
    if (odt->count > 0U) {
        return XCP_SEQUENCE;
    }
    if (((entry_count + (uint16_t)count) > MOST_ENTRIES) || (count > IN_A_PACKET)) {
        return XCP_MEMORY_OVERFLOW;
    }
    odt->first = entry_count;
    odt->count = count;
    entry_count = (uint16_t)(entry_count + count);
    return XCP_DONE;
}

XcpResult daq_set_pointer(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t place = command->bytes[4];
    const uint8_t entry = command->bytes[5];
    XcpResult result;
    (void)answer;
    const List *list = stopped(packet_read(command, 2U, 2U), &result);
    if (list == NULL) {
        return result;
    }
    if ((place >= list->count) || (entry >= odts[list->first + place].count)) {
        return XCP_OUT_OF_RANGE;
    }
    pointer.is_set = true;
    pointer.list = (uint16_t)packet_read(command, 2U, 2U);
    pointer.odt = &odts[list->first + place];
    pointer.entry = entry;
    return XCP_DONE;
}

XcpResult daq_write(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t size = command->bytes[2];
    uint16_t offset = 0U;
    XcpResult result;
    (void)answer;
    if (!pointer.is_set) {
        return XCP_SEQUENCE;
    }
    if (stopped(pointer.list, &result) == NULL) {
        return result;
    }
    if (command->bytes[1] != WHOLE_BYTES) {
        return XCP_OUT_OF_RANGE;
    }
    Entry *entry = &entries[pointer.odt->first + pointer.entry];
    const uint8_t others = (uint8_t)(size_of(pointer.odt) - entry->size);
    if ((size == 0U) || ((uint16_t)others + (uint16_t)size > IN_A_PACKET)) {
        return XCP_DAQ_CONFIG;
    }
    result = memory_measured(packet_read(command, 4U, 4U), command->bytes[3], size, &offset);
    if (result == XCP_DONE) {
        entry->offset = offset;
        entry->size = size;
        pointer.entry += 1U;
        pointer.is_set = pointer.entry < pointer.odt->count;
    }
    return result;
}

XcpResult daq_clear(const XcpPacket *command, XcpPacket *answer)
{
    const uint32_t number = packet_read(command, 2U, 2U);
    (void)answer;
    if (number >= list_count) {
        return XCP_OUT_OF_RANGE;
    }
    List *list = &lists[number];
    list->is_running = false;
    list->is_selected = false;
    for (uint8_t k = 0U; k < list->count; ++k) {
        const Odt *odt = &odts[list->first + k];
        for (uint8_t place = 0U; place < odt->count; ++place) {
            entries[odt->first + place].size = 0U;
        }
    }
    return XCP_DONE;
}

XcpResult daq_set_mode(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    const uint8_t prescaler = command->bytes[6];
    XcpResult result;
    (void)answer;
    List *list = stopped(packet_read(command, 2U, 2U), &result);
    if (list == NULL) {
        return result;
    }
    if ((mode & (STIM | PID_OFF | ALTERNATING)) != 0U) {
        return XCP_MODE_NOT_VALID;
    }
    /* priorities are not offered, which the standard has answered this way */
    if ((packet_read(command, 4U, 2U) != EVENT_CYCLE) || (prescaler == 0U) || (command->bytes[7] != 0U)) {
        return XCP_OUT_OF_RANGE;
    }
    list->has_timestamp = (mode & TIMESTAMP) != 0U;
    list->prescaler = prescaler;
    return XCP_DONE;
}

XcpResult daq_get_mode(const XcpPacket *command, XcpPacket *answer)
{
    const uint32_t number = packet_read(command, 2U, 2U);
    uint8_t mode = 0U;
    if (number >= list_count) {
        return XCP_OUT_OF_RANGE;
    }
    mode |= lists[number].is_selected ? SELECTED : 0U;
    mode |= lists[number].has_timestamp ? TIMESTAMP : 0U;
    mode |= lists[number].is_running ? RUNNING : 0U;
    packet_byte(answer, mode);
    packet_number(answer, 0U, 4U);
    packet_byte(answer, lists[number].prescaler);
    packet_byte(answer, 0U);
    return XCP_DONE;
}

XcpResult daq_get_processor_info(const XcpPacket *command, XcpPacket *answer)
{
    (void)command;
    packet_byte(answer, DYNAMIC_LISTS | PRESCALER | TIMESTAMP);
    packet_number(answer, list_count, 2U);
    packet_number(answer, 1U, 2U); /* event channels */
    packet_number(answer, 0U, 2U);
    return XCP_DONE;
}

/* -- sending */

/* Whether every packet has what it is to carry. The first may hold the timestamp alone: a float has no room beside it. */
static bool is_sendable(const List *list)
{
    bool sendable = list->count > 0U;
    for (uint8_t k = 0U; k < list->count; ++k) {
        const Odt *odt = &odts[list->first + k];
        const bool may_be_empty = list->has_timestamp && (k == 0U);
        sendable = sendable && is_complete(odt) && ((odt->count > 0U) || may_be_empty);
    }
    if (sendable && list->has_timestamp) {
        sendable = (size_of(&odts[list->first]) + TIMESTAMP_BYTES) <= IN_A_PACKET;
    }
    return sendable;
}

static void list_started(List *list)
{
    list->is_running = true;
    list->cycles = 0U;
}

XcpResult daq_start_stop(const XcpPacket *command, XcpPacket *answer)
{
    const uint32_t number = packet_read(command, 2U, 2U);
    const uint8_t mode = command->bytes[1];
    uint8_t first = 0U;
    if (number >= list_count) {
        return XCP_OUT_OF_RANGE;
    }
    List *list = &lists[number];
    if (mode == 0U) {
        list->is_running = false;
        list->is_selected = false;
    } else if (mode == 1U) {
        if (!is_sendable(list)) {
            return XCP_DAQ_CONFIG;
        }
        list_started(list);
    } else if (mode == 2U) {
        list->is_selected = true;
    } else {
        return XCP_MODE_NOT_VALID;
    }
    for (uint32_t k = 0U; k < number; ++k) { /* packets are numbered through all lists */
        first = (uint8_t)(first + lists[k].count);
    }
    packet_byte(answer, first);
    return XCP_DONE;
}

/* Start the selected lists together; none if one of them cannot be sent. */
static XcpResult selected_started(void)
{
    for (uint16_t k = 0U; k < list_count; ++k) {
        if (lists[k].is_selected && !is_sendable(&lists[k])) {
            return XCP_DAQ_CONFIG;
        }
    }
    for (uint16_t k = 0U; k < list_count; ++k) {
        if (lists[k].is_selected) {
            list_started(&lists[k]);
            lists[k].is_selected = false;
        }
    }
    return XCP_DONE;
}

XcpResult daq_start_stop_synch(const XcpPacket *command, XcpPacket *answer)
{
    const uint8_t mode = command->bytes[1];
    (void)answer;
    if (mode > 2U) {
        return XCP_MODE_NOT_VALID;
    }
    if (mode == 1U) {
        return selected_started();
    }
    for (uint16_t k = 0U; k < list_count; ++k) { /* all, or the selected ones */
        if ((mode == 0U) || lists[k].is_selected) {
            lists[k].is_running = false;
            lists[k].is_selected = false;
        }
    }
    return XCP_DONE;
}

static void list_sent(const List *list, uint8_t identifier, uint32_t microseconds)
{
    const uint8_t *image = measured_image();
    for (uint8_t k = 0U; k < list->count; ++k) {
        const Odt *odt = &odts[list->first + k];
        XcpPacket packet;
        packet.length = 0U;
        packet_byte(&packet, (uint8_t)(identifier + k));
        if (list->has_timestamp && (k == 0U)) {
            packet_number(&packet, microseconds, TIMESTAMP_BYTES);
        }
        for (uint8_t place = 0U; place < odt->count; ++place) {
            const Entry *entry = &entries[odt->first + place];
            for (uint8_t byte = 0U; byte < entry->size; ++byte) {
                packet_byte(&packet, image[entry->offset + byte]);
            }
        }
        packet_sent(&packet);
    }
}

void daq_sampled(uint32_t microseconds)
{
    uint8_t identifier = 0U;
    for (uint16_t k = 0U; k < list_count; ++k) {
        List *list = &lists[k];
        if (list->is_running) {
            if (list->cycles == 0U) {
                list_sent(list, identifier, microseconds);
            }
            list->cycles = (uint8_t)((list->cycles + 1U) % list->prescaler);
        }
        identifier = (uint8_t)(identifier + list->count);
    }
}
