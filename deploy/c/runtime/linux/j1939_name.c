#include "j1939_name.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FIELDS (sizeof(fields) / sizeof(fields[0]))
#define EXAMPLE "identity=1,manufacturer=0"

typedef struct {
    const char *key;
    uint8_t bits;
    uint8_t at; /* its lowest bit */
    bool is_needed;
    uint8_t ordinary; /* what it is where it is not given: not available, in construction equipment */
} NameField;

static const NameField fields[] = {
    {"identity", 21U, 0U, true, 0U},         {"manufacturer", 11U, 21U, true, 0U},
    {"ecu_instance", 3U, 32U, false, 0U},    {"function_instance", 5U, 35U, false, 0U},
    {"function", 8U, 40U, false, 255U},      {"vehicle_system", 7U, 49U, false, 127U},
    {"vehicle_system_instance", 4U, 56U, false, 0U}, {"industry", 3U, 60U, false, 3U},
};

static bool name_refused(const char *text, const char *words, const char *key)
{
    (void)fprintf(stderr, "loader-ecu: --j1939 %s: %s%s, as in " EXAMPLE "\n", text, words, key);
    return false;
}

/* The place of the field that a word begins with; FIELDS for an unknown one. */
static size_t field_of(const char *word)
{
    const size_t length = strcspn(word, "=,");
    size_t k = 0U;
    while ((k < FIELDS) && ((strlen(fields[k].key) != length) || (strncmp(word, fields[k].key, length) != 0))) {
        k += 1U;
    }
    return k;
}

/* The whole number at `digits` up to the next comma; false for what is none. */
static bool number_read(const char *digits, uint64_t *number, const char **after)
{
    char *end = NULL;
    errno = 0;
    /* a digit first: no sign and no blanks; a zero before another one would be read as octal */
    if ((isdigit((unsigned char)digits[0]) == 0) || ((digits[0] == '0') && (isdigit((unsigned char)digits[1]) != 0))) {
        return false;
    }
    *number = strtoull(digits, &end, 0);
    *after = end;
    return ((*end == ',') || (*end == '\0')) && (errno == 0);
}

static bool field_read(const char *text, const char **place, uint64_t values[], bool given[])
{
    const size_t k = field_of(*place);
    const char *digits = &(*place)[strcspn(*place, "=,")];
    if ((k == FIELDS) || (*digits != '=')) {
        return name_refused(text, "a NAME has the fields identity, manufacturer, ecu_instance, function_instance, function, "
                                  "vehicle_system, vehicle_system_instance and industry, each with a number", "");
    }
    if (!number_read(&digits[1], &values[k], place)) {
        return name_refused(text, "there is no whole number for ", fields[k].key);
    }
    if ((values[k] >> fields[k].bits) != 0U) {
        return name_refused(text, "the number is too large for ", fields[k].key);
    }
    given[k] = true;
    return true;
}

bool name_read(const char *text, uint64_t *name)
{
    uint64_t values[FIELDS];
    bool given[FIELDS];
    const char *place = text;
    for (size_t k = 0U; k < FIELDS; ++k) {
        values[k] = fields[k].ordinary;
        given[k] = false;
    }
    for (;;) {
        if (!field_read(text, &place, values, given)) {
            return false;
        }
        if (*place == '\0') {
            break;
        }
        place = &place[1];
    }
    *name = 0U;
    for (size_t k = 0U; k < FIELDS; ++k) {
        if (fields[k].is_needed && !given[k]) {
            return name_refused(text, "a NAME needs ", fields[k].key);
        }
        *name |= values[k] << fields[k].at;
    }
    return true;
}
