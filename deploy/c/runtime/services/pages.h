/*
 * The calibration as two pages: the reference page is the file, the working page can be written while the ECU runs.
 *
 * A write is checked as the whole file would be, and changes nothing where the checks refuse it. What has been written acts from
 * the next cycle on, all of it at once. After ecu/measure/pages.py.
 */
#ifndef PAGES_H
#define PAGES_H

#include "service_tables.h"

#define REFERENCE_PAGE 0U
#define WORKING_PAGE 1U
#define NUMBER_BYTES 4U /* a float, in the unit of its key */
#define CALIBRATION_BYTES (CALIBRATION_NUMBERS * NUMBER_BYTES)

typedef enum {
    PAGES_TAKEN,
    PAGES_FIXED, /* the number is fixed while the ECU runs, or there is none */
    PAGES_REFUSED /* by the checks of a calibration file */
} PagesResult;

void pages_start(void);
void pages_reset(void);           /* the working page becomes a copy of the reference page */
void pages_chosen(uint8_t page);  /* the page that the ECU works with from the next cycle on */
uint8_t pages_active(void);
uint8_t pages_byte(uint8_t page, uint32_t offset);

/* Write into the working page. A number that comes in several pieces is taken when it is complete. At most 8 bytes. */
PagesResult pages_written(uint32_t offset, const uint8_t *bytes, uint8_t count);
void pages_before_cycle(void);

#endif
