/*
 * The ECU on a Linux CAN interface, in the place of `loaderhil ecu`: `loader-ecu can0`. 100 Hz by an absolute timer; missed ticks
 * are skipped and reported.
 *
 * An interface that goes down, away or bus off is waited for. systemd hears when the ECU is ready and that it ticks.
 */
#define _GNU_SOURCE /* for sigaction and timerfd beside C99 */
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "can_bus.h"
#include "ecu.h"
#include "ecu_names.h"
#include "ecu_tables.h"
#include "log.h"
#include "manager.h"
#include "offered.h"
#include "options.h"
#include "services/services.h"

#define MS_NS 1000000LL

static volatile sig_atomic_t ended;
static const char *other_sender; /* message of ours that another node sends */

static void on_signal(int number)
{
    (void)number;
    ended = 1;
}

/* The name of a message that this ECU sends; NULL for any other identifier. No socket returns its own frames. */
static const char *own_message(uint32_t id)
{
    for (uint8_t k = 0U; k < OUTPUT_FRAMES; ++k) {
        if (output_frames[k].id == id) {
            return names_of_sent[k];
        }
    }
    return NULL;
}

static void listened(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    (void)data;
    (void)length;
    (void)now_ns;
    other_sender = (other_sender == NULL) ? own_message(id) : other_sender;
}

static void received(uint32_t id, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    const char *ours = own_message(id);
    if ((ours != NULL) && (other_sender == NULL)) {
        other_sender = ours;
        log_note("two senders: we and another node send ", ours);
    }
    ecu_receive(id, data, length, now_ns);
    services_receive(id, data, length, now_ns);
}

/* Listens before anything is sent. False after a line that says why the ECU must not start. */
static bool bus_is_free(double listen_s)
{
    const int64_t until_ns = now_of() + (int64_t)(listen_s * 1e9);
    struct pollfd watched = {bus_descriptor(), POLLIN, 0};
    while ((ended == 0) && (other_sender == NULL) && (now_of() < until_ns)) {
        (void)poll(&watched, 1, (int)((until_ns - now_of()) / MS_NS) + 1);
        bus_drained(listened);
    }
    if (other_sender != NULL) {
        /* two ECUs on one bus would each see the other's limits obeyed */
        (void)fprintf(stderr, "loader-ecu: another node sends %s\n", other_sender);
        return false;
    }
    if ((listen_s > 0.0) && (bus_errors() > 0U)) {
        (void)fprintf(stderr, "loader-ecu: the bus has errors: bit rate, termination, or a broken node?\n");
        return false;
    }
    return true;
}

static void ticked(int64_t due_ns)
{
    EcuFrame frames[ECU_MOST_FRAMES];
    const int64_t started_ns = now_of();
    services_before_cycle(due_ns);
    const uint8_t count = ecu_tick(due_ns, frames);
    if (services_may_send()) {
        bus_sent(frames, count);
    }
    services_after_cycle(due_ns);
    const int64_t ended_ns = now_of();
    ecu_executed(ended_ns - started_ns);
    bus_looked_after();
    manager_alive(ended_ns);
}

static void run(int timer)
{
    struct pollfd watched[2] = {{bus_descriptor(), POLLIN, 0}, {timer, POLLIN, 0}};
    int64_t due_ns = now_of();
    while (ended == 0) {
        if (poll(watched, 2, -1) < 0) {
            continue;
        }
        bus_drained(received);
        uint64_t expired = 0U;
        if (read(timer, &expired, sizeof expired) == (ssize_t)sizeof expired) {
            if (expired > 1U) {
                ecu_overran((uint32_t)(expired - 1U));
            }
            due_ns += (int64_t)expired * TICK_NS;
            ticked(due_ns);
        }
    }
}

int main(int count, char **words)
{
    Options options;
    const int ending = options_read(count, words, &options);
    if (ending >= 0) {
        return ending;
    }
    struct sigaction action;
    (void)memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    manager_found();
    if (!offered_started(&options)) {
        return MISUSED;
    }
    if (!bus_opened(options.interface)) {
        return BUS_LOST;
    }
    if (!realtime_applied(&options)) {
        return MISUSED;
    }
    if (!bus_is_free(options.listen_s)) {
        return FAILED;
    }
    const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    const struct itimerspec period = {{0, TICK_NS}, {0, TICK_NS}};
    ecu_init(options.limits);
    ecu_detect_faults(options.detect_faults);
    if ((timer < 0) || (timerfd_settime(timer, 0, &period, NULL) != 0)) {
        (void)fprintf(stderr, "loader-ecu: no timer: %s\n", strerror(errno));
        return FAILED;
    }
    manager_ready(options.interface);
    run(timer);
    manager_stopping();
    return PASSED;
}
