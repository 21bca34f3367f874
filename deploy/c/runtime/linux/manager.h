/* The link to systemd: ready, alive, stopping, sd_notify(3). Without systemd nothing is sent. */
#ifndef MANAGER_H
#define MANAGER_H

#include <stdint.h>

void manager_found(void); /* reads the environment */
void manager_ready(const char *interface);
void manager_alive(int64_t now_ns); /* after each tick */
void manager_stopping(void);

#endif
