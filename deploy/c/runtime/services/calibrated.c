#include "calibrated.h"

#include <stddef.h>

#include "calibration.h"
#include "service_tables.h"

#ifndef ECU_SETTABLE
#error "services change numbers while the ECU runs: compile every file with -DECU_SETTABLE"
#endif

#define PI R(3.141592653589793)

static real_t si(const real_t *numbers, uint16_t place)
{
    return numbers[place] * calibration_rows[place].factor;
}

bool calibration_holds(const real_t *numbers)
{
    bool holds = (si(numbers, NUMBER_REAR_X) < R(0.0)) && (si(numbers, NUMBER_FRONT_X) > R(0.0));
    for (uint8_t k = 0U; k < ORDERED_NUMBERS; ++k) {
        holds = holds && (si(numbers, ordered_numbers[k].low) < si(numbers, ordered_numbers[k].high));
    }
    return holds;
}

/* Areas of `count` cylinders: their numbers are one after the other. */
static void areas(const real_t *numbers, uint16_t bore, uint16_t rod, uint16_t count, real_t *head_area, real_t *rod_area)
{
    const real_t outer = si(numbers, bore) * si(numbers, bore);
    const real_t inner = si(numbers, rod) * si(numbers, rod);
    const real_t area = (si(numbers, count) * PI) / R(4.0);
    *head_area = area * outer;
    *rod_area = area * (outer - inner);
}

static int64_t nanoseconds(real_t seconds)
{
    return (int64_t)real_rint(seconds * R(1e9));
}

static void alarms_set(const real_t *numbers)
{
    const int64_t delays[3] = {0, nanoseconds(si(numbers, NUMBER_ALARMS_SHORT_DELAY)),
                               nanoseconds(si(numbers, NUMBER_ALARMS_USUAL_DELAY))};
    for (uint8_t k = 0U; k < ALARMS; ++k) {
        alarm_times[k].on_delay_ns = delays[alarm_delays[k]];
    }
    RULE_LEAST_ON_NS = nanoseconds(si(numbers, NUMBER_ALARMS_LEAST_ON));
    RULE_OFF_DELAY_NS = nanoseconds(si(numbers, NUMBER_ALARMS_OFF_DELAY));
}

void calibration_applied(const real_t *numbers)
{
    for (uint16_t k = 0U; k < CALIBRATION_NUMBERS; ++k) {
        if (calibration_rows[k].target != NULL) {
            *calibration_rows[k].target = si(numbers, k);
        }
    }
    areas(numbers, NUMBER_CYLINDERS_BORE, NUMBER_CYLINDERS_ROD, NUMBER_CYLINDERS_COUNT,
          &calibration_parameters.cylinders.head_area, &calibration_parameters.cylinders.rod_area);
    areas(numbers, NUMBER_TILT_LINKAGE_BORE, NUMBER_TILT_LINKAGE_ROD, NUMBER_TILT_LINKAGE_COUNT,
          &calibration_parameters.tilt_linkage.head_area, &calibration_parameters.tilt_linkage.rod_area);
    alarms_set(numbers);
    RULE_PULL = PULL_SHARE * calibration_parameters.wheel.nominal_load;
    RULE_FRICTION = FRICTION_SHARE * real_max(calibration_parameters.wheel.friction, calibration_parameters.wheel.lateral_peak);
    noise_of_residuals(&detection_rules, &detection_makes, &detection_tolerances, &calibration_parameters);
}
