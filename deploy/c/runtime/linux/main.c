/*
 * The ECU on a Linux CAN interface: `loader-ecu can0`. 100 Hz by an absolute timer; missed ticks are skipped and reported.
 *
 * Ends with 0 on SIGINT and SIGTERM, 2 for wrong arguments, 4 where the interface does not exist or goes away.
 */
#define _GNU_SOURCE /* for SOCK_NONBLOCK beside C99 */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include "ecu.h"

enum { MISUSED = 2, BUS_LOST = 4 };
#define TICK_NS 10000000LL
#define SECOND_NS 1000000000LL

static volatile sig_atomic_t ended;

static void on_signal(int number)
{
    (void)number;
    ended = 1;
}

static int64_t now_of(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * SECOND_NS) + now.tv_nsec;
}

/* A raw CAN socket on the interface; -1 with errno where there is none. */
static int opened(const char *name)
{
    struct ifreq interface;
    struct sockaddr_can address;
    const int can = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (can < 0) {
        return -1;
    }
    (void)memset(&interface, 0, sizeof interface);
    (void)strncpy(interface.ifr_name, name, IFNAMSIZ - 1);
    (void)memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    if (ioctl(can, SIOCGIFINDEX, &interface) >= 0) {
        address.can_ifindex = interface.ifr_ifindex;
        if (bind(can, (const struct sockaddr *)&address, sizeof address) == 0) {
            return can;
        }
    }
    (void)close(can);
    return -1;
}

/* Every waiting frame goes to the ECU; false where the bus is gone. */
static bool drained(int can)
{
    struct can_frame frame;
    for (;;) {
        const ssize_t got = read(can, &frame, sizeof frame);
        if (got == (ssize_t)sizeof frame) {
            ecu_receive(frame.can_id, frame.data, frame.can_dlc, now_of());
        } else {
            return (got < 0) && ((errno == EAGAIN) || (errno == EINTR));
        }
    }
}

static bool sent(int can, const EcuFrame *frames, uint8_t count)
{
    for (uint8_t k = 0U; k < count; ++k) {
        struct can_frame frame;
        (void)memset(&frame, 0, sizeof frame);
        frame.can_id = frames[k].id;
        frame.can_dlc = frames[k].length;
        (void)memcpy(frame.data, frames[k].data, sizeof frame.data);
        /* a full queue loses the frame, and its receivers see that by the counter; the cycle must not wait */
        if ((write(can, &frame, sizeof frame) < 0) && (errno != ENOBUFS) && (errno != EAGAIN) && (errno != EINTR)) {
            return false;
        }
    }
    return true;
}

static bool ran(int can, int timer)
{
    EcuFrame frames[ECU_MOST_FRAMES];
    struct pollfd watched[2] = {{can, POLLIN, 0}, {timer, POLLIN, 0}};
    int64_t due_ns = now_of();
    while (ended == 0) {
        if (poll(watched, 2, -1) < 0) {
            continue;
        }
        if (!drained(can)) {
            return false;
        }
        uint64_t expired = 0U;
        if (read(timer, &expired, sizeof expired) == (ssize_t)sizeof expired) {
            const int64_t started_ns = now_of();
            if (expired > 1U) {
                ecu_overran((uint32_t)(expired - 1U));
            }
            due_ns += (int64_t)expired * TICK_NS;
            const uint8_t count = ecu_tick(due_ns, frames);
            if (!sent(can, frames, count)) {
                return false;
            }
            ecu_executed(now_of() - started_ns);
        }
    }
    return true;
}

int main(int count, char **words)
{
    if (count != 2) {
        (void)fprintf(stderr, "usage: loader-ecu INTERFACE\n");
        return MISUSED;
    }
    const int can = opened(words[1]);
    const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    const struct itimerspec period = {{0, TICK_NS}, {0, TICK_NS}};
    if ((can < 0) || (timer < 0) || (timerfd_settime(timer, 0, &period, NULL) != 0)) {
        (void)fprintf(stderr, "%s: %s\n", words[1], strerror(errno));
        return BUS_LOST;
    }
    struct sigaction action;
    (void)memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    ecu_init(true);
    if (!ran(can, timer)) {
        (void)fprintf(stderr, "%s: %s\n", words[1], strerror(errno));
        return BUS_LOST;
    }
    return 0;
}
