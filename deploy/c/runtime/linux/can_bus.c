#define _GNU_SOURCE /* for SOCK_NONBLOCK beside C99 */
#include "can_bus.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "log.h"

#define SECOND_NS 1000000000LL
#define LOOK_NS 50000000LL /* between two looks at an interface that is not usable */

typedef enum { USABLE, DOWN, GONE, BUS_OFF } Trouble;

static int can = -1;
static const char *name = "";
static Trouble trouble = USABLE;
static int64_t looked_ns;
static uint32_t errors;

int64_t now_of(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * SECOND_NS) + now.tv_nsec;
}

static struct ifreq request_of(void)
{
    struct ifreq request;
    (void)memset(&request, 0, sizeof request);
    (void)strncpy(request.ifr_name, name, IFNAMSIZ - 1);
    return request;
}

/* Attaches the socket to the interface of that name, which may have been removed and made anew. */
static bool bound(void)
{
    static const struct can_filter everything = {0U, 0U};
    struct ifreq request = request_of();
    struct sockaddr_can address;
    /* the kernel forgets a socket's filters with the interface, and would then pass nothing on */
    (void)setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, &everything, sizeof everything);
    (void)memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    if (ioctl(can, SIOCGIFINDEX, &request) < 0) {
        return false;
    }
    address.can_ifindex = request.ifr_ifindex;
    return bind(can, (const struct sockaddr *)&address, sizeof address) == 0;
}

/* IFF_UP: set up by root; IFF_RUNNING: able to send, too, which a controller that is bus off is not. */
static bool has_flags(short flags)
{
    struct ifreq request = request_of();
    return (ioctl(can, SIOCGIFFLAGS, &request) >= 0) && ((request.ifr_flags & flags) == flags);
}

static void lost(Trouble found)
{
    static const char *const words[] = {
        [USABLE] = "", [DOWN] = "interface went down", [GONE] = "interface was removed", [BUS_OFF] = "bus off"};
    if (trouble != found) {
        trouble = found;
        log_bus(words[found], name);
    }
}

bool bus_opened(const char *interface)
{
    const can_err_mask_t reported = CAN_ERR_BUSOFF | CAN_ERR_CRTL | CAN_ERR_RESTARTED | CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR;
    name = interface;
    can = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (can < 0) {
        (void)fprintf(stderr, "loader-ecu: this kernel has no CAN: %s\n", strerror(errno));
        return false;
    }
    (void)setsockopt(can, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &reported, sizeof reported);
    if (!bound()) {
        (void)fprintf(stderr, "loader-ecu: %s: no such CAN interface: is the adapter plugged in?\n", name);
        return false;
    }
    if (!has_flags(IFF_UP)) {
        (void)fprintf(stderr, "loader-ecu: %s: it is down; bring it up: ip link set %s up\n", name, name);
        return false;
    }
    if (!has_flags(IFF_RUNNING)) {
        lost(BUS_OFF);
    }
    return true;
}

int bus_descriptor(void)
{
    return can;
}

/* Whether the error says that the interface cannot be used for now. */
static bool is_of_link(int error)
{
    if (error == ENETDOWN) {
        lost(DOWN);
    } else if ((error == ENODEV) || (error == ENXIO)) {
        lost(GONE);
    } else {
        return false;
    }
    return true;
}

static void controller_reported(uint8_t state)
{
    static const struct {
        uint8_t bit;
        const char *words;
        const char *detail;
    } states[] = {
        {CAN_ERR_CRTL_RX_OVERFLOW, "controller's receive buffer overflowed", ""},
        {CAN_ERR_CRTL_TX_OVERFLOW, "controller's transmit buffer overflowed", ""},
        {CAN_ERR_CRTL_RX_WARNING, "error warning level reached", "receive errors"},
        {CAN_ERR_CRTL_TX_WARNING, "error warning level reached", "transmit errors"},
        {CAN_ERR_CRTL_RX_PASSIVE, "controller is error passive", "receive errors"},
        {CAN_ERR_CRTL_TX_PASSIVE, "controller is error passive", "transmit errors"},
        {CAN_ERR_CRTL_ACTIVE, "controller is error active again", ""},
    };
    for (size_t k = 0U; k < (sizeof states / sizeof states[0]); ++k) {
        if ((state & states[k].bit) != 0U) {
            log_bus(states[k].words, states[k].detail);
        }
    }
}

static void error_reported(const struct can_frame *frame)
{
    errors += 1U;
    if ((frame->can_id & CAN_ERR_CRTL) != 0U) {
        controller_reported(frame->data[1]);
    }
    if ((frame->can_id & CAN_ERR_PROT) != 0U) {
        log_bus("protocol violation", "");
    }
    if ((frame->can_id & CAN_ERR_ACK) != 0U) {
        log_bus("no acknowledgement", "");
    }
    /* a report that the interface does not confirm is an old one */
    if (((frame->can_id & CAN_ERR_BUSOFF) != 0U) && !has_flags(IFF_RUNNING)) {
        lost(BUS_OFF);
    }
    if ((frame->can_id & CAN_ERR_RESTARTED) != 0U) {
        log_bus("controller restarted", "");
        looked_ns = 0;
    }
}

void bus_drained(Received *received)
{
    struct can_frame frame;
    for (;;) {
        const ssize_t got = read(can, &frame, sizeof frame);
        if (got == (ssize_t)sizeof frame) {
            if ((frame.can_id & CAN_ERR_FLAG) != 0U) {
                error_reported(&frame);
            } else {
                received(frame.can_id, frame.data, frame.can_dlc, now_of());
            }
        } else if ((got >= 0) || !is_of_link(errno)) {
            return; /* nothing is waiting */
        } else {
            /* the error is taken off the socket, and frames from before it may wait behind it */
        }
    }
}

void bus_sent(const EcuFrame *frames, uint8_t count)
{
    /* in a bus-off the kernel would take the frames, throw them away, and show them to other programs as sent */
    for (uint8_t k = 0U; (k < count) && (trouble == USABLE); ++k) {
        struct can_frame frame;
        (void)memset(&frame, 0, sizeof frame);
        frame.can_id = frames[k].id;
        frame.can_dlc = frames[k].length;
        (void)memcpy(frame.data, frames[k].data, sizeof frame.data);
        /* a full queue loses the frame, and its receivers see that by the counter; the cycle must not wait */
        if ((write(can, &frame, sizeof frame) < 0) && !is_of_link(errno) && (errno == ENOBUFS)) {
            log_bus("transmit queue is full", "");
        }
    }
}

void bus_looked_after(void)
{
    const int64_t now_ns = now_of();
    if ((trouble == USABLE) || ((now_ns - looked_ns) < LOOK_NS)) {
        return;
    }
    looked_ns = now_ns;
    if (has_flags(IFF_UP | IFF_RUNNING) && bound()) {
        trouble = USABLE;
        log_bus("interface is up again", name);
    }
}

uint32_t bus_errors(void)
{
    return errors;
}
