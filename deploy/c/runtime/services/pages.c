#include "pages.h"

#include <string.h>

#include "calibrated.h"
#include "measured.h"

#define MOST_DECIMALS 22U /* powers of ten up to here are exact in double precision */
#define MOST_STAGED (NUMBER_BYTES - 1U)

static real_t working[CALIBRATION_NUMBERS]; /* in the units of their keys */
static uint8_t active;
static bool is_changed; /* since the last cycle: numbers, or the page that the ECU works with */
static struct {
    uint32_t offset;
    uint8_t count;
    uint8_t bytes[MOST_STAGED];
} staged; /* the first bytes of a number whose last have not come */

static void reference_copied(real_t *numbers)
{
    for (uint16_t k = 0U; k < CALIBRATION_NUMBERS; ++k) {
        numbers[k] = calibration_rows[k].reference;
    }
}

void pages_reset(void)
{
    reference_copied(working);
    staged.count = 0U;
    is_changed = true;
}

void pages_start(void)
{
    active = WORKING_PAGE;
    pages_reset();
    is_changed = false; /* the program is compiled with these numbers */
}

void pages_chosen(uint8_t page)
{
    active = page;
    is_changed = true;
}

uint8_t pages_active(void)
{
    return active;
}

uint8_t pages_byte(uint8_t page, uint32_t offset)
{
    const uint32_t place = offset / NUMBER_BYTES;
    uint8_t bytes[NUMBER_BYTES];
    float_stored((float)((page == WORKING_PAGE) ? working[place] : calibration_rows[place].reference), bytes);
    return bytes[offset % NUMBER_BYTES];
}

/*
 * The shortest decimal of a float, 0.3 and not 0.30000001: a limit of a range is then within it. A number below 1e-13, for which
 * there are more decimals than powers that are exact, stays as it is.
 */
static real_t decimal(float number)
{
    real_t power = R(1.0);
    for (uint32_t k = 0U; k <= MOST_DECIMALS; ++k) {
        const real_t shorter = real_rint((real_t)number * power) / power;
        if ((float)shorter == number) {
            return shorter;
        }
        power *= R(10.0);
    }
    return (real_t)number;
}

static PagesResult number_written(uint32_t place, const uint8_t *bytes)
{
    const CalibrationNumber *row = &calibration_rows[place];
    const real_t before = working[place];
    const real_t number = decimal(float_of(bytes));
    if (!row->is_adjustable) {
        return PAGES_FIXED;
    }
    /* written so that what is no number is refused too */
    if (!((row->low <= number) && (number <= row->high))) {
        return PAGES_REFUSED;
    }
    working[place] = number;
    if (!calibration_holds(working)) {
        working[place] = before;
        return PAGES_REFUSED;
    }
    is_changed = true;
    return PAGES_TAKEN;
}

/* Whole numbers at `offset`, then the begin of one that is kept. */
static PagesResult bytes_written(uint32_t offset, const uint8_t *bytes, uint8_t count)
{
    uint8_t done = 0U;
    if (((offset % NUMBER_BYTES) != 0U) || (offset > CALIBRATION_BYTES) || (count > (CALIBRATION_BYTES - offset))) {
        return PAGES_FIXED;
    }
    while ((uint8_t)(count - done) >= NUMBER_BYTES) {
        const PagesResult result = number_written((offset + done) / NUMBER_BYTES, &bytes[done]);
        if (result != PAGES_TAKEN) {
            return result;
        }
        done = (uint8_t)(done + NUMBER_BYTES);
    }
    staged.offset = offset + done;
    staged.count = (uint8_t)(count - done);
    if ((staged.count > 0U) && !calibration_rows[staged.offset / NUMBER_BYTES].is_adjustable) {
        staged.count = 0U;
        return PAGES_FIXED;
    }
    (void)memcpy(staged.bytes, &bytes[done], staged.count);
    return PAGES_TAKEN;
}

PagesResult pages_written(uint32_t offset, const uint8_t *bytes, uint8_t count)
{
    uint8_t joined[MOST_STAGED + 8U];
    uint8_t before = 0U;
    if ((staged.count > 0U) && ((staged.offset + staged.count) == offset)) {
        before = staged.count;
        (void)memcpy(joined, staged.bytes, before);
    }
    staged.count = 0U;
    (void)memcpy(&joined[before], bytes, count);
    return bytes_written(offset - before, joined, (uint8_t)(count + before));
}

void pages_before_cycle(void)
{
    if (!is_changed) {
        return;
    }
    is_changed = false;
    if (active == WORKING_PAGE) {
        calibration_applied(working);
    } else {
        static real_t reference[CALIBRATION_NUMBERS];
        reference_copied(reference);
        calibration_applied(reference);
    }
}
