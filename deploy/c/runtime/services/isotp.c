#include "isotp.h"

#include <stddef.h>
#include <string.h>

#include "services.h"

#define TIMEOUT_NS 1000000000LL /* of the tool's next frame: N_Bs and N_Cr of ISO 15765-2 */
#define MS_NS 1000000LL
#define LONGEST_PAUSE_MS 0x7FU
#define PADDING 0xCCU
#define NIBBLE 0x0FU
#define SHORTEST_LONG 8U /* bytes of the shortest message that does not fit into one frame */
#define SINGLE 0U
#define FIRST 1U
#define CONSECUTIVE 2U
#define FLOW_CONTROL 3U
#define CONTINUE 0U
#define OVERFLOW 2U

typedef enum { IDLE, WAITING, SENDING } Sending; /* WAITING: for the tool's flow control */

static struct {
    bool is_going_on;
    Request request; /* as far as it has come */
    uint16_t announced;
    uint8_t sequence; /* of the frame that came last */
    int64_t heard_ns;
} receiving;

static struct {
    uint32_t id;
    Sending state;
    const uint8_t *bytes;
    uint16_t length;
    uint16_t sent;
    uint8_t sequence;
    uint8_t block;    /* frames that the tool wants at once; 0: all */
    uint8_t in_block; /* sent of them */
    int64_t pause_ns;
    int64_t since_ns; /* WAITING: when the wait began; SENDING: when the last frame went */
} sending;

void isotp_start(uint32_t send)
{
    (void)memset(&receiving, 0, sizeof receiving);
    (void)memset(&sending, 0, sizeof sending);
    sending.id = send;
}

bool isotp_is_sending(void)
{
    return sending.state != IDLE;
}

/* One frame of eight bytes: `head` of them, then as many of `bytes` as there are and fit, then padding. */
static void framed(const uint8_t *head, uint8_t heads, const uint8_t *bytes, uint16_t count)
{
    EcuFrame frame;
    frame.id = sending.id;
    frame.length = 8U;
    for (uint8_t k = 0U; k < 8U; ++k) {
        if (k < heads) {
            frame.data[k] = head[k];
        } else {
            const uint16_t place = (uint16_t)((uint16_t)k - (uint16_t)heads);
            frame.data[k] = (place < count) ? bytes[place] : PADDING;
        }
    }
    service_answered(&frame);
}

static void flow_controlled(uint8_t status)
{
    const uint8_t head[3] = {(uint8_t)((FLOW_CONTROL << 4) | status), 0U, 0U}; /* all frames at once, without a pause */
    framed(head, 3U, NULL, 0U);
}

/* -- frames out */

static void consecutive_sent(int64_t now_ns)
{
    const uint16_t left = (uint16_t)(sending.length - sending.sent);
    const uint16_t count = (left < 7U) ? left : 7U;
    const uint8_t head = (uint8_t)((CONSECUTIVE << 4) | sending.sequence);
    framed(&head, 1U, &sending.bytes[sending.sent], count);
    sending.sequence = (uint8_t)((sending.sequence + 1U) & NIBBLE);
    sending.sent = (uint16_t)(sending.sent + count);
    sending.in_block += 1U;
    sending.since_ns = now_ns;
    if (sending.sent == sending.length) {
        sending.state = IDLE;
    } else if ((sending.block != 0U) && (sending.in_block >= sending.block)) {
        sending.state = WAITING;
    } else {
        /* the next frame follows after the pause */
    }
}

static void sent_on(int64_t now_ns)
{
    while ((sending.state == SENDING) && ((sending.pause_ns == 0) || ((now_ns - sending.since_ns) > sending.pause_ns))) {
        consecutive_sent(now_ns);
    }
}

void isotp_answered(const uint8_t *bytes, uint16_t length, int64_t now_ns)
{
    if (length < SHORTEST_LONG) {
        const uint8_t head = (uint8_t)length;
        framed(&head, 1U, bytes, length);
    } else {
        const uint8_t head[2] = {(uint8_t)((FIRST << 4) | (uint8_t)(length >> 8)), (uint8_t)(length & 0xFFU)};
        framed(head, 2U, bytes, length);
        sending.bytes = bytes;
        sending.length = length;
        sending.sent = 6U;
        sending.sequence = 1U;
        sending.state = WAITING;
        sending.since_ns = now_ns;
    }
}

static int64_t pause_of(uint8_t code)
{
    if ((code >= 0xF1U) && (code <= 0xF9U)) {
        return ((int64_t)code - 0xF0) * (MS_NS / 10);
    }
    /* a reserved code is the longest pause */
    return (int64_t)((code <= LONGEST_PAUSE_MS) ? code : LONGEST_PAUSE_MS) * MS_NS;
}

/* The tool says how to go on. A wish to wait longer than the timeout is not granted. */
static void flow_control_heard(const uint8_t *data, int64_t now_ns)
{
    const uint8_t status = data[0] & NIBBLE;
    if (status == OVERFLOW) {
        sending.state = IDLE;
    } else if ((status == CONTINUE) && (sending.state != IDLE)) {
        if (sending.state == WAITING) {
            sending.in_block = 0U;
            sending.since_ns = now_ns;
            sending.state = SENDING;
        }
        sending.pause_ns = pause_of(data[2]);
        sending.block = data[1];
    } else {
        /* nothing is under way, or the tool wants to wait */
    }
}

/* -- frames in */

/* Whether the standard wants the frame to be looked at. */
static bool is_sound(const uint8_t *data, uint8_t length)
{
    const uint8_t low = data[0] & NIBBLE;
    bool sound = false;
    switch (data[0] >> 4) {
    case SINGLE:
        sound = (low > 0U) && (low < length);
        break;
    case FIRST:
        sound = length == 8U;
        if (sound && (low == 0U) && (data[1] == 0U)) { /* 32 bits of length, for what 12 cannot say */
            sound = (data[2] != 0U) || (data[3] != 0U) || (data[4] > 0x0FU);
        } else {
            sound = sound && ((low > 0U) || (data[1] >= SHORTEST_LONG));
        }
        break;
    case CONSECUTIVE:
        sound = true;
        break;
    case FLOW_CONTROL:
        sound = (length >= 3U) && (low <= OVERFLOW);
        break;
    default:
        break;
    }
    return sound;
}

static void taken(const uint8_t *data, uint16_t count)
{
    for (uint16_t k = 0U; (k < count) && (receiving.request.length < receiving.announced); ++k) {
        receiving.request.bytes[receiving.request.length] = data[k];
        receiving.request.length += 1U;
    }
}

static void first_heard(const uint8_t *data, int64_t now_ns)
{
    const uint16_t announced = (uint16_t)(((uint16_t)(data[0] & NIBBLE) << 8) | data[1]);
    receiving.request.length = 0U;
    receiving.is_going_on = (announced > 0U) && (announced <= ISOTP_LONGEST_REQUEST);
    if (receiving.is_going_on) {
        receiving.announced = announced;
        receiving.sequence = 0U;
        receiving.heard_ns = now_ns;
        taken(&data[2], 6U);
        flow_controlled(CONTINUE);
    } else {
        flow_controlled(OVERFLOW);
    }
}

/* Whether the request is complete. */
static bool consecutive_heard(const uint8_t *data, uint8_t length, int64_t now_ns)
{
    if (!receiving.is_going_on) {
        return false;
    }
    if ((data[0] & NIBBLE) != ((receiving.sequence + 1U) & NIBBLE)) {
        receiving.is_going_on = false;
        return false;
    }
    receiving.sequence = data[0] & NIBBLE;
    receiving.heard_ns = now_ns;
    taken(&data[1], (uint16_t)((uint16_t)length - 1U));
    receiving.is_going_on = receiving.request.length < receiving.announced;
    return !receiving.is_going_on;
}

static void single_heard(const uint8_t *data)
{
    receiving.is_going_on = false; /* a new message ends one that was under way */
    receiving.request.length = 0U;
    receiving.announced = data[0];
    taken(&data[1], data[0]);
}

/* Transfers end in which the tool has fallen silent. */
static void expired(int64_t now_ns)
{
    if (receiving.is_going_on && ((now_ns - receiving.heard_ns) > TIMEOUT_NS)) {
        receiving.is_going_on = false;
    }
    if ((sending.state == WAITING) && ((now_ns - sending.since_ns) > TIMEOUT_NS)) {
        sending.state = IDLE;
    }
}

bool isotp_receive(const uint8_t *data, uint8_t length, int64_t now_ns, Request *request)
{
    bool complete = false;
    if (!is_sound(data, length)) {
        return false;
    }
    expired(now_ns);
    switch (data[0] >> 4) {
    case SINGLE:
        single_heard(data);
        complete = true;
        break;
    case FIRST:
        first_heard(data, now_ns);
        break;
    case CONSECUTIVE:
        complete = consecutive_heard(data, length, now_ns);
        break;
    default:
        flow_control_heard(data, now_ns);
        break;
    }
    sent_on(now_ns);
    if (complete) {
        *request = receiving.request;
    }
    return complete;
}

void isotp_cycle(int64_t now_ns)
{
    expired(now_ns);
    sent_on(now_ns);
}
