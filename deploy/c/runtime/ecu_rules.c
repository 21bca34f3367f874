/* Alarms, limits, validity, warnings. After ecu/alarms.py, ecu/limits.py, ecu/validity.py, ecu/consistency.py, ecu/reasons.py. */
#include <string.h>

#include "ecu_internal.h"

/* -- alarms: conditions that must last to be raised, and must stay away to be dropped */

AlarmState alarm_after(AlarmState alarm, bool condition, int64_t now_ns, int64_t on_delay_ns)
{
    AlarmState next = alarm;
    if (condition == alarm.on) {
        next.against_ns = NEVER_NS;
        return next;
    }
    const int64_t since_ns = (alarm.against_ns == NEVER_NS) ? now_ns : alarm.against_ns;
    next.against_ns = since_ns;
    if (!alarm.on) {
        if ((now_ns - since_ns) >= on_delay_ns) {
            next.on = true;
            next.raised_ns = now_ns;
            next.against_ns = NEVER_NS;
        }
        return next;
    }
    if (((now_ns - alarm.raised_ns) >= RULE_LEAST_ON_NS) && ((now_ns - since_ns) >= RULE_OFF_DELAY_NS)) {
        next.on = false;
        next.against_ns = NEVER_NS;
    }
    return next;
}

static bool is_below(real_t value, real_t threshold, real_t hysteresis, bool on)
{
    return value < (on ? (threshold + hysteresis) : threshold);
}

/* -- limits */

static const AlarmState silent_alarm = {false, 0, NEVER_NS};

LimitState limits_none(void)
{
    const LimitState none = {
        .front_torque = LIMIT_FRONT_TORQUE,
        .rear_torque = LIMIT_REAR_TORQUE,
        .speed = calibration_parameters.prediction.largest_speed,
        .rate = calibration_parameters.prediction.largest_rate,
        .direction = R(0.0),
        .levers = {REAL_INFINITY, REAL_INFINITY, REAL_INFINITY, REAL_INFINITY},
        .cause = NO_LIMIT,
        .lever_cause = NO_LIMIT,
        .prevention = silent_alarm,
    };
    return none;
}

LimitState limits_safe(void)
{
    const LimitState safe = {
        .front_torque = real_min(LIMIT_SAFE_TORQUE, LIMIT_FRONT_TORQUE),
        .rear_torque = real_min(LIMIT_SAFE_TORQUE, LIMIT_REAR_TORQUE),
        .speed = LIMIT_SAFE_SPEED,
        .rate = LIMIT_SAFE_RATE,
        .direction = R(0.0),
        .levers = {LIMIT_SAFE_LIFT_RATE, LIMIT_SAFE_LIFT_RATE, LIMIT_SAFE_TILT_RATE, LIMIT_SAFE_TILT_RATE},
        .cause = SAFE_VALUES,
        .lever_cause = SAFE_VALUES,
        .prevention = silent_alarm,
    };
    return safe;
}

/* Share of the full torque at a predicted margin: linear between the two thresholds. */
static real_t torque_share(real_t margin)
{
    const real_t span = LIMIT_TORQUE_FULL_MARGIN - LIMIT_TORQUE_LEAST_MARGIN;
    const real_t place = real_min(real_max((margin - LIMIT_TORQUE_LEAST_MARGIN) / span, R(0.0)), R(1.0));
    return LIMIT_TORQUE_LEAST_SHARE + ((R(1.0) - LIMIT_TORQUE_LEAST_SHARE) * place);
}

/* The estimates bring the limit of one of the levers' motions, the others stay as they are. */
static void levers_next(LimitState *next, const LimitState *before, const Estimates *e, real_t dt)
{
    const LinkageDrive *drive = &calibration_parameters.linkage_drive;
    const real_t full[LEVERS] = {drive->lift_up, drive->lift_down, drive->tilt_back, drive->tilt_forward};
    const uint8_t motion = (uint8_t)e->permitted_motion;
    const real_t rise = LIMIT_LINKAGE_RISE * dt * (real_t)LEVERS; /* once in so many cycles */
    for (uint8_t k = 0U; k < LEVERS; ++k) {
        next->levers[k] = before->levers[k];
    }
    if (motion < LEVERS) {
        const real_t reached = real_min(e->permitted_lever, before->levers[motion] + rise);
        next->levers[motion] = (reached >= full[motion]) ? REAL_INFINITY : reached;
    }
    next->lever_cause = NO_LIMIT;
    for (uint8_t k = 0U; k < LEVERS; ++k) {
        if (next->levers[k] < REAL_INFINITY) {
            next->lever_cause = next->prevention.on ? ROLL_OVER_PREVENTION : PRECAUTION;
        }
    }
}

LimitState limits_next(const LimitState *before, const Estimates *e, int64_t now_ns, real_t dt)
{
    const LimitState none = limits_none();
    LimitState next = none;
    const real_t margin = real_min(e->predicted_margin, e->lift_off_margin);
    const real_t hysteresis = LIMIT_RELEASE_MARGIN - LIMIT_ENGAGE_MARGIN;
    const bool close = is_below(margin, LIMIT_ENGAGE_MARGIN, hysteresis, before->prevention.on);
    next.prevention = alarm_after(before->prevention, close, now_ns, 0);
    next.rate = real_min(e->permitted_rate, none.rate);
    const real_t side = e->permitted_direction;
    if ((side * before->direction) >= R(0.0)) { /* a driver who turns back is not held by the limit of the other side */
        next.rate = real_min(next.rate, before->rate + (LIMIT_RATE_RISE * dt));
    }
    const real_t permitted = real_max(e->permitted_speed, LIMIT_CREEP_SPEED);
    const real_t start = real_min(before->speed, real_max(real_abs(e->speed) + RULE_SPEED_HEADROOM, permitted));
    next.speed = real_max(permitted, start - (LIMIT_SPEED_FALL * dt));
    next.speed = real_min(real_min(next.speed, before->speed + (LIMIT_SPEED_RISE * dt)), none.speed);
    const real_t share = torque_share(margin);
    next.front_torque = real_min(share * none.front_torque, before->front_torque + (LIMIT_TORQUE_RISE * dt));
    next.rear_torque = real_min(share * none.rear_torque, before->rear_torque + (LIMIT_TORQUE_RISE * dt));
    next.direction = (side != R(0.0)) ? side : before->direction;
    levers_next(&next, before, e, dt);
    const bool limited = (next.rate < none.rate) || (next.speed < none.speed) ||
                         (next.front_torque < none.front_torque) || (next.rear_torque < none.rear_torque);
    if (next.prevention.on) {
        next.cause = ROLL_OVER_PREVENTION;
    } else {
        next.cause = limited ? PRECAUTION : NO_LIMIT;
    }
    return next;
}

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
            known |= ((uint32_t)1U << (CONDITION_WHEEL_1 + k)) | ((uint32_t)1U << CONDITION_SPEED);
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
            broken |= (uint32_t)1U << (VALID_FORCE_1 + k);
        }
    }
    return broken;
}

uint32_t validity_consistent(uint32_t valid, const Estimates *e)
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
    const real_t least = real_min(real_min(e->normal_1, e->normal_2), real_min(e->normal_3, e->normal_4));
    if (least < -RULE_PULL) {
        broken |= ((uint32_t)1U << VALID_NORMAL) | ((uint32_t)1U << VALID_ROLL_OVER);
    }
    if (real_max(real_abs(e->load_transfer_ratio), real_abs(e->predicted_load_transfer_ratio)) > R(1.0)) {
        broken |= (uint32_t)1U << VALID_ROLL_OVER;
    }
    return valid & ~broken;
}

/* -- conditions of the warnings */

static bool is_known(uint32_t known, uint8_t entry)
{
    return ((known >> entry) & 1U) != 0U;
}

static void roll_over_found(const Estimates *e, bool valid, const AlarmState *alarms, bool *found)
{
    const real_t margin = real_min(e->lift_off_margin, e->predicted_margin);
    const real_t hold = WARNING_MARGIN_HYSTERESIS;
    const bool lifted = (e->lift_off_margin <= R(0.0)) ||
                        is_below(e->lift_off_margin, R(0.0), hold, alarms[ROLL_OVER_LIFTED].on);
    const bool soon = e->time_to_lift_off <= WARNING_IMMINENT_TIME;
    const bool imminent =
        lifted || soon || is_below(margin, WARNING_IMMINENT_MARGIN, hold, alarms[ROLL_OVER_IMMINENT].on);
    const bool warning = imminent || (e->time_to_lift_off < RULE_NEVER) ||
                         is_below(margin, WARNING_WARNING_MARGIN, hold, alarms[ROLL_OVER_WARNING].on);
    const bool attention =
        warning || is_below(margin, WARNING_ATTENTION_MARGIN, hold, alarms[ROLL_OVER_ATTENTION].on);
    found[ROLL_OVER_ATTENTION] = valid && attention;
    found[ROLL_OVER_WARNING] = valid && warning;
    found[ROLL_OVER_IMMINENT] = valid && imminent;
    found[ROLL_OVER_LIFTED] = valid && lifted;
}

void reasons_found(const Estimates *e, const CycleInputs *inputs, uint32_t known, const AlarmState *alarms, bool *found)
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
                                (real_max(real_abs(v[INPUT_PITCH]), real_abs(v[INPUT_ROLL])) > WARNING_SLOPE);
    found[REASON_PAYLOAD_HIGH] = is_known(known, VALID_PAYLOAD) && speed && (e->payload > WARNING_PAYLOAD) &&
                                 (v[INPUT_LIFT_ARM_ANGLE] > WARNING_PAYLOAD_ARM) &&
                                 (real_abs(e->speed) > WARNING_PAYLOAD_SPEED);
    found[REASON_INPUT_STALE] = inputs->stale != 0U;
    found[REASON_INPUT_IMPLAUSIBLE] = inputs->implausible != 0U;
    roll_over_found(e, roll_over, alarms, found);
}
