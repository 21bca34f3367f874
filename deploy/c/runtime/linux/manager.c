/* A datagram to the socket that systemd names is the whole protocol, so no library is needed for it. */
#define _GNU_SOURCE /* for SOCK_NONBLOCK beside C99 */
#include "manager.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define PINGS_PER_TIMEOUT 4 /* sd_watchdog_enabled(3) asks for two; four leave room for one lost to a busy host */

static int channel = -1;
static struct sockaddr_un address;
static socklen_t address_length;
static int64_t interval_ns; /* 0: no watchdog */
static int64_t next_ns;

static void said(const char *message)
{
    if (channel >= 0) {
        /* a full or missing socket is systemd's trouble: the bus goes on, and the watchdog does the rest */
        (void)sendto(channel, message, strlen(message), MSG_NOSIGNAL, (const struct sockaddr *)&address, address_length);
    }
}

static void watchdog_found(void)
{
    const char *timeout_us = getenv("WATCHDOG_USEC");
    const char *pid = getenv("WATCHDOG_PID");
    if ((timeout_us != NULL) && ((pid == NULL) || (strtol(pid, NULL, 10) == (long)getpid()))) {
        const long long timeout = strtoll(timeout_us, NULL, 10);
        interval_ns = (timeout > 0) ? ((int64_t)timeout * 1000 / PINGS_PER_TIMEOUT) : 0;
    }
}

void manager_found(void)
{
    const char *path = getenv("NOTIFY_SOCKET");
    if ((path == NULL) || (path[0] == '\0') || (strlen(path) >= sizeof address.sun_path)) {
        return;
    }
    address.sun_family = AF_UNIX;
    (void)strcpy(address.sun_path, path);
    address_length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
    if (path[0] == '@') {
        address.sun_path[0] = '\0'; /* the abstract name space */
    }
    /* non-blocking: a tick must not wait for systemd */
    channel = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    watchdog_found();
}

void manager_ready(const char *interface)
{
    char message[96];
    (void)snprintf(message, sizeof message, "READY=1\nSTATUS=estimating on socketcan:%s, in C", interface);
    said(message);
}

void manager_alive(int64_t now_ns)
{
    if ((interval_ns > 0) && (now_ns >= next_ns)) {
        next_ns = now_ns + interval_ns;
        said("WATCHDOG=1");
    }
}

void manager_stopping(void)
{
    said("STOPPING=1");
}
