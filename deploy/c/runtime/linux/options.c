#define _GNU_SOURCE /* for CPU_SET and SCHED_RESET_ON_FORK beside C99 */
#include "options.h"

#include <errno.h>
#include <net/if.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

static const char usage[] =
    "usage: loader-ecu [OPTIONS] INTERFACE\n"
    "\n"
    "The ECU on a CAN interface of Linux, until Ctrl-C. Findings go to standard error.\n"
    "\n"
    "  --bus socketcan:INTERFACE  the interface, as `loaderhil ecu` takes it\n"
    "  --no-limits                warn only\n"
    "  --detect-faults            test the sensors against each other, and go on without a faulty one (the default)\n"
    "  --no-detect-faults         do not\n"
    "  --listen-s SECONDS         listen before the first frame is sent; end where another node sends the ECU's messages\n"
    "  --fifo PRIORITY            real-time priority (SCHED_FIFO), 1 to 99\n"
    "  --lock-memory              lock all memory, so that no tick waits for a page fault\n"
    "  --cpu N                    run only on processor N, counted from 0\n"
    "  --xcp RECEIVE,SEND         answer XCP: CAN identifiers of the tool's and of the ECU's frames\n"
    "  --uds RECEIVE,SEND         answer UDS on ISO-TP, likewise\n"
    "  --j1939 NAME               claim the ECU's address by J1939-81 with this NAME, such as identity=1,manufacturer=0, and\n"
    "                             answer requests; without the address nothing is sent\n"
    "  --access-key FILE          the secret behind seed and key; without it nothing can be unlocked\n"
    "  -h, --help                 this text\n"
    "\n"
    "Exit code 0: ended by a signal; 1: the bus has another ECU, or errors; 2: wrong options; 4: no such interface.\n";

static int refused(const char *option, const char *value, const char *permitted)
{
    (void)fprintf(stderr, "loader-ecu: %s %s: it takes %s\n", option, value, permitted);
    return MISUSED;
}

/* A whole number within low .. high. */
static bool whole(const char *text, long low, long high, int *found)
{
    char *end = NULL;
    errno = 0;
    const long value = strtol(text, &end, 10);
    if ((end == text) || (*end != '\0') || (errno != 0) || (value < low) || (value > high)) {
        return false;
    }
    *found = (int)value;
    return true;
}

static int valued(const char *option, const char *value, Options *options)
{
    static const char scheme[] = "socketcan:";
    if (strcmp(option, "--bus") == 0) {
        if (strncmp(value, scheme, sizeof scheme - 1U) != 0) {
            return refused(option, value, "socketcan:INTERFACE");
        }
        options->interface = value + (sizeof scheme - 1U);
    } else if (strcmp(option, "--xcp") == 0) {
        options->xcp = value;
    } else if (strcmp(option, "--uds") == 0) {
        options->uds = value;
    } else if (strcmp(option, "--j1939") == 0) {
        options->j1939 = value;
    } else if (strcmp(option, "--access-key") == 0) {
        options->access_key = value;
    } else if (strcmp(option, "--fifo") == 0) {
        return whole(value, 1, 99, &options->fifo) ? -1 : refused(option, value, "a priority of 1 to 99");
    } else if (strcmp(option, "--cpu") == 0) {
        return whole(value, 0, CPU_SETSIZE - 1, &options->cpu) ? -1 : refused(option, value, "the number of a processor");
    } else if (strcmp(option, "--listen-s") == 0) {
        char *end = NULL;
        options->listen_s = strtod(value, &end);
        /* written so that a NaN is refused too */
        if ((end == value) || (*end != '\0') || !((options->listen_s >= 0.0) && (options->listen_s <= 60.0))) {
            return refused(option, value, "0 to 60 s");
        }
    } else {
        (void)fprintf(stderr, "loader-ecu: there is no option %s; loader-ecu --help lists them\n", option);
        return MISUSED;
    }
    return -1;
}

int options_read(int count, char **words, Options *options)
{
    const Options ordinary = {.interface = NULL, .limits = true, .detect_faults = true, .fifo = 0, .cpu = -1,
                              .lock_memory = false, .listen_s = 0.0, .xcp = NULL, .uds = NULL, .j1939 = NULL,
                              .access_key = NULL};
    *options = ordinary;
    for (int k = 1; k < count; ++k) {
        const char *word = words[k];
        if ((strcmp(word, "--help") == 0) || (strcmp(word, "-h") == 0)) {
            (void)fputs(usage, stdout);
            return PASSED;
        }
        if (strcmp(word, "--no-limits") == 0) {
            options->limits = false;
        } else if (strcmp(word, "--detect-faults") == 0) {
            options->detect_faults = true;
        } else if (strcmp(word, "--no-detect-faults") == 0) {
            options->detect_faults = false;
        } else if (strcmp(word, "--lock-memory") == 0) {
            options->lock_memory = true;
        } else if (word[0] != '-') {
            options->interface = word;
        } else if ((k + 1) < count) {
            k += 1;
            const int ending = valued(word, words[k], options);
            if (ending >= 0) {
                return ending;
            }
        } else {
            return valued(word, "(nothing)", options);
        }
    }
    if (options->interface == NULL) {
        (void)fputs(usage, stderr);
        return MISUSED;
    }
    if ((options->interface[0] == '\0') || (strlen(options->interface) >= IFNAMSIZ)) {
        return refused("INTERFACE", options->interface, "the name of a CAN interface, at most 15 letters");
    }
    return -1;
}

static bool granted(bool well, const char *what)
{
    if (!well) {
        (void)fprintf(stderr, "loader-ecu: %s: %s\n", what, strerror(errno));
    }
    return well;
}

bool realtime_applied(const Options *options)
{
    cpu_set_t processors;
    CPU_ZERO(&processors);
    if (options->cpu >= 0) {
        CPU_SET((size_t)options->cpu, &processors);
        if (!granted(sched_setaffinity(0, sizeof processors, &processors) == 0, "--cpu: this process may not run there")) {
            return false;
        }
    }
    if (options->lock_memory && !granted(mlockall(MCL_CURRENT | MCL_FUTURE) == 0, "--lock-memory")) {
        return false;
    }
    const struct sched_param priority = {.sched_priority = options->fifo};
    return (options->fifo == 0) ||
           granted(sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority) == 0, "--fifo");
}
