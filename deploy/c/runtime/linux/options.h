/* The options of loader-ecu. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <stdbool.h>

enum { PASSED = 0, FAILED = 1, MISUSED = 2, BUS_LOST = 4 }; /* exit codes, as those of `loaderhil ecu` */

typedef struct {
    const char *interface;
    bool limits; /* false: only warns */
    bool detect_faults; /* whether sensors are tested against each other */
    int fifo;         /* priority of SCHED_FIFO; 0: an ordinary process */
    int cpu;          /* the only processor; -1: any */
    bool lock_memory; /* no tick waits for a page fault */
    double listen_s;  /* before the first frame is sent [s] */
    const char *xcp;  /* identifiers of tool and ECU, for measuring and calibrating; NULL: not offered */
    const char *uds;  /* for diagnosis */
    const char *j1939; /* NAME with which the ECU claims its address; NULL: it claims none */
    const char *access_key; /* file with the secret behind seed and key; NULL: nothing can be unlocked */
} Options;

/* Reads the command line. The exit code where the program is to end at once, -1 where it is to run. */
int options_read(int count, char **words, Options *options);

/* Asks the kernel for what the options want. False after a line that says what it refused. */
bool realtime_applied(const Options *options);

#endif
