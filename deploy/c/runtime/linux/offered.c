#define _GNU_SOURCE /* for getrandom beside C99 */
#include "offered.h"

#include <errno.h>
#include <inttypes.h>
#include <linux/can.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "can_bus.h"
#include "ecu_names.h"
#include "j1939_name.h"
#include "log.h"
#include "services/services.h"

#define LEAST_SECRET 16U /* bytes: shorter ones can be found by trying */
#define MOST_SECRET 4096U

void service_sent(const EcuFrame *frame)
{
    bus_sent(frame, 1U);
}

bool service_random(uint8_t *bytes, uint8_t count)
{
    /* the cycle must not wait for a kernel that has gathered no randomness yet */
    return getrandom(bytes, count, GRND_NONBLOCK) == (ssize_t)count;
}

void service_address_lost(uint64_t name)
{
    char detail[20];
    (void)snprintf(detail, sizeof detail, "%016" PRIX64, name);
    log_note("another controller has the ECU's address, which sends nothing until it is restarted: NAME ", detail);
}

/* One identifier of "RECEIVE,SEND", with bit 31 where it has 29 bits. False where there is none before `stop`. */
static bool identifier(const char *text, char stop, uint32_t *id, const char **after)
{
    char *end = NULL;
    errno = 0;
    const unsigned long number = strtoul(text, &end, 0);
    if ((end == text) || (*end != stop) || (errno != 0) || (*text == '-') || (number > CAN_EFF_MASK)) {
        return false;
    }
    *id = (uint32_t)number | ((number > CAN_SFF_MASK) ? CAN_EFF_FLAG : 0U);
    *after = &end[1];
    return true;
}

/* The message of the DBC with this identifier; NULL where there is none. */
static const char *known_message(uint32_t id)
{
    for (size_t k = 0U; k < KNOWN_IDENTIFIERS; ++k) {
        if (known_identifiers[k].id == id) {
            return known_identifiers[k].name;
        }
    }
    return NULL;
}

static bool channel_read(const char *option, const char *text, Channel *channel)
{
    const char *rest = text;
    if (text == NULL) {
        return true;
    }
    if (!identifier(text, ',', &channel->receive, &rest) || !identifier(rest, '\0', &channel->send, &rest)) {
        (void)fprintf(stderr, "loader-ecu: %s %s: give two CAN identifiers, that of the tool and that of the ECU, such as "
                              "0x18EF80F9,0x18EFF980\n", option, text);
        return false;
    }
    if (channel->receive == channel->send) {
        (void)fprintf(stderr, "loader-ecu: %s %s: tool and ECU need different identifiers: their frames would collide\n",
                      option, text);
        return false;
    }
    const char *taken = known_message(channel->receive);
    taken = (taken == NULL) ? known_message(channel->send) : taken;
    if (taken != NULL) {
        (void)fprintf(stderr, "loader-ecu: %s %s: one is the identifier of %s; take a free one\n", option, text, taken);
        return false;
    }
    channel->offered = true;
    return true;
}

static bool shares(const Channel *one, const Channel *other)
{
    return (one->receive == other->receive) || (one->receive == other->send) || (one->send == other->receive) ||
           (one->send == other->send);
}

/* The secret in a file, without the line end behind it; its length, 0 after a line that says what is wrong. */
static size_t secret_read(const char *file, uint8_t *secret)
{
    FILE *opened = fopen(file, "rb");
    if (opened == NULL) {
        (void)fprintf(stderr, "loader-ecu: %s: cannot be read: %s\n", file, strerror(errno));
        return 0U;
    }
    size_t length = fread(secret, 1U, MOST_SECRET + 1U, opened);
    (void)fclose(opened);
    while ((length > 0U) && ((secret[length - 1U] == (uint8_t)'\n') || (secret[length - 1U] == (uint8_t)'\r'))) {
        length -= 1U;
    }
    if ((length < LEAST_SECRET) || (length > MOST_SECRET)) {
        (void)fprintf(stderr, "loader-ecu: %s: a secret has %u to %u bytes, this file %u; head -c 32 /dev/urandom | base64 makes one\n",
                      file, LEAST_SECRET, MOST_SECRET, (unsigned)length);
        return 0U;
    }
    return length;
}

bool offered_started(const Options *options)
{
    static uint8_t secret[MOST_SECRET + 1U];
    Services services;
    (void)memset(&services, 0, sizeof services);
    if (!channel_read("--xcp", options->xcp, &services.xcp) || !channel_read("--uds", options->uds, &services.uds)) {
        return false;
    }
    if (services.xcp.offered && services.uds.offered && shares(&services.xcp, &services.uds)) {
        (void)fprintf(stderr, "loader-ecu: --xcp %s and --uds %s share an identifier\n", options->xcp, options->uds);
        return false;
    }
    if (options->j1939 != NULL) {
        services.claims_address = true;
        if (!name_read(options->j1939, &services.name)) {
            return false;
        }
    }
    if (options->access_key != NULL) {
        services.secret_length = (uint16_t)secret_read(options->access_key, secret);
        services.secret = secret;
        if (services.secret_length == 0U) {
            return false;
        }
    }
    services_start(&services);
    (void)memset(secret, 0, sizeof secret);
    return true;
}
