#define _GNU_SOURCE /* for localtime_r beside C99 */
#include "log.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "can_bus.h"
#include "ecu_names.h"

#define MOST_KINDS 24U /* of bus trouble; more would be logged each time */
#define AGAIN_NS 1000000000LL

typedef struct {
    const char *words; /* constant texts, so that their address is their identity */
    const char *detail;
    int64_t logged_ns;
    uint32_t since;
} Logged;

static void line(const char *source, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void line(const char *source, const char *format, ...)
{
    char stamp[24];
    char text[256];
    struct timespec now;
    struct tm parts;
    va_list arguments;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    (void)localtime_r(&now.tv_sec, &parts);
    (void)strftime(stamp, sizeof stamp, "%Y-%m-%d %H:%M:%S", &parts);
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    (void)fprintf(stderr, "%s,%03ld %s WARNING %s\n", stamp, now.tv_nsec / 1000000L, source, text);
}

static Logged *logged_of(const char *words, const char *detail, int64_t now_ns)
{
    static Logged all[MOST_KINDS];
    static uint8_t count;
    for (uint8_t k = 0U; k < count; ++k) {
        if ((all[k].words == words) && (all[k].detail == detail)) {
            return &all[k];
        }
    }
    if (count == MOST_KINDS) {
        count = 0U;
    }
    Logged *made = &all[count];
    count += 1U;
    made->words = words;
    made->detail = detail;
    made->logged_ns = now_ns - AGAIN_NS; /* as if logged one interval ago, so that the first is logged at once */
    made->since = 0U;
    return made;
}

void log_bus(const char *words, const char *detail)
{
    const int64_t now_ns = now_of();
    Logged *logged = logged_of(words, detail, now_ns);
    if ((now_ns - logged->logged_ns) < AGAIN_NS) {
        logged->since += 1U;
        return;
    }
    char more[48] = "";
    if (logged->since > 0U) {
        (void)snprintf(more, sizeof more, ", %" PRIu32 " more since the last line", logged->since);
    }
    if (detail[0] == '\0') {
        line("bus.trouble_log", "bus: %s%s", words, more);
    } else {
        line("bus.trouble_log", "bus: %s (%s)%s", words, detail, more);
    }
    logged->logged_ns = now_ns;
    logged->since = 0U;
}

void log_note(const char *words, const char *detail)
{
    line("ecu.node", "%s%s", words, detail);
}

void ecu_found(const EcuFinding *finding)
{
    const int64_t now_ns = now_of();
    switch (finding->kind) {
    case ECU_PROTECTION_FAILED:
        line("ecu.node", "ProtectionFailed(message='%s', what=%s, at_ns=%" PRId64 ")", names_of_messages[finding->subject],
             names_of_checks[finding->detail], now_ns);
        break;
    case ECU_IMPLAUSIBLE:
        line("ecu.node", "Implausible(%s, value=%.17g, reason=%s, at_ns=%" PRId64 ")", names_of_inputs[finding->subject],
             finding->value, names_of_modes[finding->detail], now_ns);
        break;
    case ECU_STALE:
        line("ecu.node", "Stale(group='%s', at_ns=%" PRId64 ")", names_of_groups[finding->subject], now_ns);
        break;
    case ECU_STATE_CHANGED:
        line("ecu.node", "StateChanged(before=%s, after=%s, event=%s, at_ns=%" PRId64 ")", names_of_states[finding->subject],
             names_of_states[finding->other], names_of_events[finding->detail], now_ns);
        break;
    case ECU_FAULT_FOUND: /* of several with the mode ROOT_CAUSE_NOT_KNOWN one is faulty */
        line("ecu.node", "FaultFound(%s, mode=%s, at_ns=%" PRId64 ")", names_of_inputs[finding->subject],
             names_of_modes[finding->detail], now_ns);
        break;
    default:
        line("ecu.node", "EstimatorFailed(error='%s', at_ns=%" PRId64 ")",
             (finding->subject == 1U) ? "fault detection: division by zero" : "the estimators have no finite result", now_ns);
        break;
    }
}
