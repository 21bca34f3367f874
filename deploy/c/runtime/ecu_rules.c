/* Validity, warnings. After ecu/validity.py, ecu/consistency.py, ecu/reasons.py; limits and alarms are translated (estimators.c). */
#include <string.h>

#include "ecu_internal.h"

/* -- validity */

static bool usable(uint64_t unusable, uint64_t inputs)
{
    return (unusable & inputs) == 0U;
}

uint32_t validity_without(uint64_t unusable)
{
    static const uint64_t wheels[4] = {USABLE_WHEEL_1, USABLE_WHEEL_2, USABLE_WHEEL_3, USABLE_WHEEL_4};
    uint32_t known = 0U;
    for (uint8_t k = 0U; k < 4U; ++k) {
        if (usable(unusable, wheels[k])) {
            known |= ((uint32_t)1U << (CONDITION_WHEEL_1 + (uint32_t)k)) | ((uint32_t)1U << CONDITION_SPEED);
        }
    }
    const bool from_wheels = usable(unusable, USABLE_WHEEL_3 | USABLE_WHEEL_4 | USABLE_SLOPE);
    known |= usable(unusable, USABLE_ARTICULATION) ? ((uint32_t)1U << CONDITION_ARTICULATION) : 0U;
    known |= usable(unusable, USABLE_MASS) ? ((uint32_t)1U << CONDITION_MASS) : 0U;
    known |= (usable(unusable, USABLE_INERTIAL) || from_wheels) ? ((uint32_t)1U << CONDITION_MOTION) : 0U;
    known |= usable(unusable, USABLE_TORQUE) ? ((uint32_t)1U << CONDITION_TORQUE) : 0U;
    uint32_t valid = 0U;
    for (uint8_t k = 0U; k < VALIDITIES; ++k) {
        if ((known & validity_needs[k]) == validity_needs[k]) {
            valid |= (uint32_t)1U << k;
        }
    }
    return valid;
}

static uint32_t beyond_friction(const Estimates *e)
{
    const real_t load[4] = {e->normal_1, e->normal_2, e->normal_3, e->normal_4};
    const real_t along[4] = {e->longitudinal_1, e->longitudinal_2, e->longitudinal_3, e->longitudinal_4};
    const real_t across[4] = {e->lateral_1, e->lateral_2, e->lateral_3, e->lateral_4};
    uint32_t broken = 0U;
    for (uint8_t k = 0U; k < 4U; ++k) {
        const real_t most = (RULE_FRICTION * real_max(load[k], R(0.0))) + RULE_PULL;
        if (real_hypot(along[k], across[k]) > most) {
            broken |= (uint32_t)1U << (VALID_FORCE_1 + (uint32_t)k);
        }
    }
    return broken;
}

static real_t least_load(const Estimates *e)
{
    return real_min(real_min(e->normal_1, e->normal_2), real_min(e->normal_3, e->normal_4));
}

/* The validities whose estimates break a rule. */
static uint32_t contradicted(const Estimates *e)
{
    real_t values[ESTIMATES];
    (void)memcpy(values, e, sizeof values);
    uint32_t broken = beyond_friction(e);
    for (uint8_t k = 0U; k < RANGES; ++k) {
        const ValueRange *range = &value_ranges[k];
        const real_t value = values[range->estimate];
        if (!((range->least <= value) && (value <= range->most))) {
            broken |= (uint32_t)1U << range->validity;
        }
    }
    if ((least_load(e) < -RULE_PULL) || (real_abs(e->load_gap) > RULE_PULL) || (e->load_contradiction > RULE_CONTRADICTION)) {
        broken |= (uint32_t)1U << VALID_NORMAL;
    }
    if (real_max(real_abs(e->load_transfer_ratio), real_abs(e->predicted_load_transfer_ratio)) > R(1.0)) {
        broken |= (uint32_t)1U << VALID_ROLL_OVER;
    }
    if (e->speed_doubt > RULE_DOUBTFUL) {
        broken |= RULE_FROM_SPEED;
    }
    if (((broken >> VALID_NORMAL) & 1U) != 0U) {
        broken |= RULE_FROM_LOADS;
    }
    return broken;
}

static int64_t settled_ns[VALIDITIES]; /* from when on each is valid again */

void validity_start(void)
{
    (void)memset(settled_ns, 0, sizeof settled_ns);
}

uint32_t validity_consistent(uint32_t valid, const Estimates *e, int64_t now_ns)
{
    uint32_t broken = contradicted(e);
    if ((now_ns < settled_ns[VALID_NORMAL]) && (least_load(e) < RULE_PULL)) {
        broken |= RULE_FROM_LOADS; /* a lifted wheel has landed only when it bears load again */
    }
    uint32_t settling = 0U;
    for (uint8_t k = 0U; k < VALIDITIES; ++k) {
        if (((broken >> k) & 1U) != 0U) {
            settled_ns[k] = now_ns + RULE_SETTLING_NS;
        }
        if (now_ns < settled_ns[k]) {
            settling |= (uint32_t)1U << k;
        }
    }
    return valid & ~settling;
}

/* -- conditions of the warnings */

static bool is_known(uint32_t known, uint8_t entry)
{
    return ((known >> entry) & 1U) != 0U;
}

static void roll_over_found(const Estimates *e, bool valid, const Alarm *alarms, bool *found)
{
    const real_t margin = real_min(e->lift_off_margin, e->predicted_margin);
    const real_t hold = WARNING_MARGIN_HYSTERESIS;
    const bool lifted = (e->lift_off_margin <= R(0.0)) ||
                        alarms_below(e->lift_off_margin, R(0.0), hold, alarms[ROLL_OVER_LIFTED].on);
    const bool soon = e->time_to_lift_off <= WARNING_IMMINENT_TIME;
    const bool imminent =
        lifted || soon || alarms_below(margin, WARNING_IMMINENT_MARGIN, hold, alarms[ROLL_OVER_IMMINENT].on);
    const bool warning = imminent || (e->time_to_lift_off < RULE_NEVER) ||
                         alarms_below(margin, WARNING_WARNING_MARGIN, hold, alarms[ROLL_OVER_WARNING].on);
    const bool attention =
        warning || alarms_below(margin, WARNING_ATTENTION_MARGIN, hold, alarms[ROLL_OVER_ATTENTION].on);
    found[ROLL_OVER_ATTENTION] = valid && attention;
    found[ROLL_OVER_WARNING] = valid && warning;
    found[ROLL_OVER_IMMINENT] = valid && imminent;
    found[ROLL_OVER_LIFTED] = valid && lifted;
}

void reasons_found(const Estimates *e, const CycleInputs *inputs, uint32_t known, const Alarm *alarms, bool *found)
{
    const real_t *v = inputs->values;
    const real_t slips[4] = {e->slip_1, e->slip_2, e->slip_3, e->slip_4};
    const bool roll_over = is_known(known, VALID_ROLL_OVER);
    const bool loads = is_known(known, VALID_NORMAL);
    const bool speed = is_known(known, VALID_SPEED);
    bool spins = false;
    bool locks = false;
    for (uint8_t k = 0U; k < 4U; ++k) {
        if (is_known(known, (uint8_t)(VALID_SLIP_1 + k))) {
            spins = spins || (slips[k] > WARNING_SPIN_SLIP);
            locks = locks || (slips[k] < WARNING_LOCK_SLIP);
        }
    }
    const real_t least = real_min(real_min(e->normal_1, e->normal_2), real_min(e->normal_3, e->normal_4));
    const real_t heaviest = real_max(e->normal_1 + e->normal_2, e->normal_3 + e->normal_4);
    const real_t bent = real_abs(v[INPUT_ARTICULATION_ANGLE]);
    const uint64_t angle = (uint64_t)1U << INPUT_ARTICULATION_ANGLE;
    const uint64_t slope = ((uint64_t)1U << INPUT_PITCH) | ((uint64_t)1U << INPUT_ROLL);
    found[REASON_ROLL_OVER_PREDICTED] = roll_over && (e->time_to_lift_off < RULE_NEVER);
    found[REASON_ROLL_OVER_NOW] = roll_over && (e->lift_off_margin < WARNING_IMMINENT_MARGIN);
    found[REASON_WHEEL_LIFTED] = loads && (least <= R(0.0));
    found[REASON_WHEEL_SPIN] = spins;
    found[REASON_WHEEL_LOCK] = speed && (real_abs(e->speed) > WARNING_LOCK_SPEED) && locks;
    found[REASON_AXLE_OVERLOAD] = loads && (heaviest > WARNING_AXLE_RATING);
    found[REASON_ARTICULATION_NEAR_STOP] =
        usable(inputs->unusable, angle) &&
        (bent > (calibration_parameters.geometry.articulation_stop - WARNING_STOP_DISTANCE));
    found[REASON_STEEP_SLOPE] = usable(inputs->unusable, slope) &&
                                (real_max(real_abs(e->slope_pitch), real_abs(e->slope_roll)) > WARNING_SLOPE);
    found[REASON_PAYLOAD_HIGH] = is_known(known, VALID_PAYLOAD) && speed && (e->payload > WARNING_PAYLOAD) &&
                                 (v[INPUT_LIFT_ARM_ANGLE] > WARNING_PAYLOAD_ARM) &&
                                 (real_abs(e->speed) > WARNING_PAYLOAD_SPEED);
    found[REASON_INPUT_STALE] = inputs->stale != 0U;
    found[REASON_INPUT_IMPLAUSIBLE] = inputs->implausible != 0U;
    roll_over_found(e, roll_over, alarms, found);
}
