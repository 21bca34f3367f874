#include "j1939.h"

#include <stddef.h>
#include <string.h>

#include "j1939_tables.h"
#include "services.h"

#define EXTENDED 0x80000000U /* bit of an identifier with 29 bits; the two below it mark remote and error frames */
#define FLAGS 0xE0000000U
#define ADDRESS_CLAIMED 0xEE00U
#define REQUEST 0xEA00U
#define ACKNOWLEDGEMENT 0xE800U
#define TRANSPORT_CONTROL 0xEC00U
#define TRANSPORT_DATA 0xEB00U
#define TO_ALL 0xFFU
#define TO_ALL_PLACED 0xFF00U /* in an identifier */
#define NO_ADDRESS 0xFEU
#define IDENTITY_BITS 0x1FFFFFU /* of a NAME: the number of this one unit */
#define DELAY_NS 600000LL /* unit of the random delay before a controller says that it has no address: two would collide */
#define PIECE_NS 50000000LL /* least time between two frames of a message to all */
#define PIECE 7U /* bytes of a long message in one frame */
#define BROADCAST 0x20U
#define REFUSED 1U /* control bytes of an acknowledgement */
#define BUSY 3U
#define NOT_USED 0xFFU
#define MOST_DIGITS 7U /* of an identity */
#define LONGEST (J1939_HEAD_BYTES + MOST_DIGITS + J1939_TAIL_BYTES)
#define LONGEST_MESSAGE 1785U /* of the transport protocol: 255 pieces */

typedef char component_fits[(LONGEST <= LONGEST_MESSAGE) ? 1 : -1];
typedef char software_fits[(J1939_SOFTWARE_BYTES <= LONGEST_MESSAGE) ? 1 : -1];

typedef enum { SILENT, CLAIMING, OWNED, LOST } ClaimState;

static struct {
    ClaimState state;
    uint64_t name;
    bool is_due; /* the end of the time for objections, or the statement that there is no address */
    int64_t due_ns;
} claim;

static struct {
    const uint8_t *text;
    uint16_t length; /* 0: no long answer is under way */
    uint8_t next; /* number of the piece that comes next */
    int64_t due_ns;
} answer;

static uint8_t component[LONGEST]; /* who this unit is, with the identity of its NAME */
static uint16_t component_length;

/* -- frames */

static uint32_t group_of(uint32_t id)
{
    const uint32_t number = (id >> 8) & 0x3FFFFU;
    /* below format 240 the low byte is a destination, which is no part of the group's number */
    return (((number >> 8) & 0xFFU) >= 240U) ? number : (number & 0x3FF00U);
}

static bool is_message(uint32_t id, uint32_t group)
{
    return ((id & FLAGS) == EXTENDED) && (group_of(id) == group);
}

static void message_sent(uint32_t group, uint8_t source, uint32_t priority, const uint8_t *data)
{
    EcuFrame frame;
    frame.id = EXTENDED | (priority << 26) | (group << 8) | TO_ALL_PLACED | source;
    frame.length = 8U;
    (void)memcpy(frame.data, data, sizeof frame.data);
    service_sent(&frame);
}

/* -- the claim */

static void claimed(uint8_t address)
{
    uint8_t data[8];
    for (uint8_t k = 0U; k < 8U; ++k) {
        data[k] = (uint8_t)(claim.name >> (8U * (uint32_t)k));
    }
    message_sent(ADDRESS_CLAIMED, address, 6U, data);
}

/* That there is no address is said after a random time. */
static void said_later(int64_t now_ns)
{
    uint8_t delay = 0U;
    if (!service_random(&delay, 1U)) {
        delay = (uint8_t)(claim.name & 0xFFU); /* another one in another unit */
    }
    claim.is_due = true;
    const int64_t units = delay;
    claim.due_ns = now_ns + (DELAY_NS * units);
}

static void claim_received(const uint8_t *data, int64_t now_ns)
{
    uint64_t other = 0U;
    for (uint8_t k = 0U; k < 8U; ++k) {
        const uint8_t place = (uint8_t)(8U * (uint32_t)k);
        other |= (uint64_t)data[k] << place;
    }
    if (claim.name < other) {
        claimed(J1939_ADDRESS);
    } else { /* the same NAME twice loses too: both units silent is safe, both sending is not */
        claim.state = LOST;
        said_later(now_ns);
        service_address_lost(other);
    }
}

static bool is_on_the_bus(void)
{
    return (claim.state == CLAIMING) || (claim.state == OWNED);
}

static void claim_cycle(int64_t now_ns)
{
    if (!claim.is_due || (now_ns < claim.due_ns)) {
        return;
    }
    claim.is_due = false;
    if (claim.state == LOST) {
        claimed(NO_ADDRESS);
    } else {
        claim.state = OWNED;
    }
}

/* -- long answers: a message to all, its announcement first */

static void answer_announced(uint32_t group, const uint8_t *text, uint16_t length, int64_t now_ns)
{
    const uint32_t count = ((uint32_t)length + (PIECE - 1U)) / PIECE;
    const uint8_t data[8] = {BROADCAST, (uint8_t)(length & 0xFFU), (uint8_t)(length >> 8), (uint8_t)count, NOT_USED,
                             (uint8_t)(group & 0xFFU), (uint8_t)((group >> 8) & 0xFFU), (uint8_t)(group >> 16)};
    answer.text = text;
    answer.length = length;
    answer.next = 1U;
    answer.due_ns = now_ns + PIECE_NS;
    message_sent(TRANSPORT_CONTROL, J1939_ADDRESS, 7U, data);
}

static void answer_cycle(int64_t now_ns)
{
    uint8_t data[8];
    const uint32_t first = PIECE * ((uint32_t)answer.next - 1U);
    if ((answer.length == 0U) || (now_ns < answer.due_ns)) {
        return;
    }
    data[0] = answer.next;
    for (uint32_t k = 0U; k < PIECE; ++k) {
        data[k + 1U] = ((first + k) < answer.length) ? answer.text[first + k] : (uint8_t)NOT_USED;
    }
    answer.due_ns = now_ns + PIECE_NS;
    if ((first + PIECE) >= answer.length) {
        answer.length = 0U;
    } else {
        answer.next = (uint8_t)(answer.next + 1U);
    }
    message_sent(TRANSPORT_DATA, J1939_ADDRESS, 7U, data);
}

/* -- requests */

static bool is_sent_anyway(uint32_t group)
{
    bool found = false;
    for (uint16_t k = 0U; k < J1939_SENT_GROUPS; ++k) {
        found = found || (j1939_sent_groups[k] == group);
    }
    return found;
}

/* A request to all is never refused. */
static void request_refused(uint32_t group, uint8_t asking, uint8_t to, uint8_t why)
{
    const uint8_t data[8] = {why, NOT_USED, NOT_USED, NOT_USED, asking,
                             (uint8_t)(group & 0xFFU), (uint8_t)((group >> 8) & 0xFFU), (uint8_t)(group >> 16)};
    if (to != TO_ALL) {
        message_sent(ACKNOWLEDGEMENT, J1939_ADDRESS, 6U, data);
    }
}

static void address_requested(int64_t now_ns)
{
    if (is_on_the_bus()) {
        claimed(J1939_ADDRESS);
    } else if (claim.state == LOST) {
        said_later(now_ns);
    } else {
        /* not yet on the bus */
    }
}

static void request_received(uint32_t id, const uint8_t *data, int64_t now_ns)
{
    const uint8_t to = (uint8_t)((id >> 8) & 0xFFU);
    const uint8_t asking = (uint8_t)(id & 0xFFU);
    const uint32_t group = (uint32_t)data[0] | ((uint32_t)data[1] << 8) | ((uint32_t)data[2] << 16);
    const bool is_software = group == J1939_SOFTWARE;
    if ((to != TO_ALL) && (to != J1939_ADDRESS)) {
        return;
    }
    if (group == ADDRESS_CLAIMED) {
        address_requested(now_ns);
    } else if ((claim.state != OWNED) || is_sent_anyway(group)) {
        /* without an address nothing is answered; what is sent anyway comes with its next cycle */
    } else if (!is_software && (group != J1939_COMPONENT)) {
        request_refused(group, asking, to, REFUSED);
    } else if (answer.length > 0U) {
        request_refused(group, asking, to, BUSY);
    } else if (is_software) {
        answer_announced(group, j1939_software, J1939_SOFTWARE_BYTES, now_ns);
    } else {
        answer_announced(group, component, component_length, now_ns);
    }
}

/* -- the service */

static void component_written(uint32_t identity)
{
    uint8_t digits[MOST_DIGITS];
    uint8_t count = 0U;
    uint32_t left = identity;
    do {
        digits[count] = (uint8_t)((uint32_t)'0' + (left % 10U));
        count = (uint8_t)(count + 1U);
        left /= 10U;
    } while ((left > 0U) && (count < MOST_DIGITS));
    (void)memcpy(component, j1939_component_head, J1939_HEAD_BYTES);
    component_length = J1939_HEAD_BYTES;
    while (count > 0U) {
        count = (uint8_t)(count - 1U);
        component[component_length] = digits[count];
        component_length = (uint16_t)(component_length + 1U);
    }
    (void)memcpy(&component[component_length], j1939_component_tail, J1939_TAIL_BYTES);
    component_length = (uint16_t)(component_length + J1939_TAIL_BYTES);
}

void j1939_start(uint64_t name)
{
    (void)memset(&claim, 0, sizeof claim);
    (void)memset(&answer, 0, sizeof answer);
    claim.state = SILENT;
    claim.name = name;
    component_written((uint32_t)(name & IDENTITY_BITS));
}

bool j1939_may_send(void)
{
    return claim.state == OWNED;
}

void j1939_receive(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    if (is_message(id, REQUEST)) {
        if (length == 3U) {
            request_received(id, data, now_ns);
        }
    } else if (is_message(id, ADDRESS_CLAIMED) && (length == 8U) && ((id & 0xFFU) == J1939_ADDRESS) && is_on_the_bus()) {
        claim_received(data, now_ns);
    } else {
        /* nothing for the network management */
    }
}

void j1939_after_cycle(int64_t now_ns)
{
    if (claim.state == SILENT) {
        claim.state = CLAIMING;
        claim.is_due = true;
        claim.due_ns = now_ns + J1939_CONTENTION_NS; /* others may object until then */
        claimed(J1939_ADDRESS);
        return;
    }
    claim_cycle(now_ns);
    if (!j1939_may_send()) {
        answer.length = 0U;
    }
    answer_cycle(now_ns);
}
