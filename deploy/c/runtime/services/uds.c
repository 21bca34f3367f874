#include "uds.h"

#include <string.h>

#include "access.h"
#include "ecu_internal.h"
#include "measured.h"
#include "uds_answer.h"
#include "uds_trouble.h"

#define S3_NS 5000000000LL /* silence after which a session other than the default one ends (ISO 14229-2) */
#define P2_MS 50U
#define P2_STAR_10_MS 500U
#define MOST_ATTEMPTS 3U
#define DELAY_NS 10000000000LL /* after so many wrong keys, no seed for so long */
#define NEGATIVE 0x7FU
#define POSITIVE 0x40U /* an answer's identifier has so much more than its request's */
#define SUPPRESS 0x80U /* bit of a sub-function: no positive answer wanted */
#define STANDING R(0.5) /* largest speed at which the ECU may be restarted [m/s] */
#define SELF_TEST 0x0201U
#define SELF_TEST_BYTES 5U
#define DEFAULT_SESSION 0x01U
#define EXTENDED_SESSION 0x03U
#define HARD_RESET 0x01U
#define SOFT_RESET 0x03U

typedef UdsResult Handler(const Request *request, UdsAnswer *answer, int64_t now_ns);

typedef struct {
    uint8_t service;
    uint8_t least;         /* length of a request */
    bool has_subfunction;  /* which may suppress the positive answer */
    bool is_extended_only; /* refused in the default session */
    Handler *handler;
} Service;

static struct {
    Lock lock;
    uint8_t session;
    int64_t heard_ns;
    uint8_t attempts;
    bool is_barred; /* no seed is given */
    int64_t barred_ns;
    bool seed_given;
    bool is_tested;
    uint8_t tested[SELF_TEST_BYTES];
    bool restarts;
} uds;

static UdsAnswer answer_now; /* it is sent from here: no request is looked at meanwhile */

/* Every change of the session locks what was unlocked (ISO 14229-1). */
static void entered(uint8_t session)
{
    uds.session = session;
    lock_closed(&uds.lock);
    uds.seed_given = false;
    uds.is_tested = false;
}

static void session_expired(int64_t now_ns)
{
    if ((uds.session != DEFAULT_SESSION) && ((now_ns - uds.heard_ns) > S3_NS)) {
        entered(DEFAULT_SESSION);
    }
}

static UdsResult session_control(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    const uint8_t wanted = request->bytes[1] & 0x7FU;
    (void)now_ns;
    if (request->length != 2U) {
        return UDS_WRONG_LENGTH;
    }
    if ((wanted != DEFAULT_SESSION) && (wanted != EXTENDED_SESSION)) {
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    }
    entered(wanted);
    answer_byte(answer, wanted);
    answer_number(answer, P2_MS, 2U);
    answer_number(answer, P2_STAR_10_MS, 2U);
    return UDS_DONE;
}

static UdsResult tester_present(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    (void)now_ns;
    if (request->length != 2U) {
        return UDS_WRONG_LENGTH;
    }
    if ((request->bytes[1] & 0x7FU) != 0U) {
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    }
    answer_byte(answer, 0U);
    return UDS_DONE;
}

/* Whether a wheel turns: by the wheels and not by the estimate, which a fault sets to zero. */
static bool is_moving(void)
{
    static const uint16_t wheels[4] = {INPUT_WHEEL_SPEED_1, INPUT_WHEEL_SPEED_2, INPUT_WHEEL_SPEED_3, INPUT_WHEEL_SPEED_4};
    real_t fastest = R(0.0);
    for (uint8_t k = 0U; k < 4U; ++k) {
        fastest = real_max(fastest, real_abs(measured_input(wheels[k])));
    }
    return (fastest * calibration_parameters.wheel.unloaded_radius) > STANDING;
}

static UdsResult ecu_reset(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    const uint8_t kind = request->bytes[1] & 0x7FU;
    (void)now_ns;
    if (request->length != 2U) {
        return UDS_WRONG_LENGTH;
    }
    if ((kind != HARD_RESET) && (kind != SOFT_RESET)) {
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    }
    if (!uds.lock.is_open) {
        return UDS_SECURITY_ACCESS_DENIED;
    }
    if (is_moving()) {
        return UDS_CONDITIONS_NOT_CORRECT;
    }
    uds.restarts = true;
    entered(DEFAULT_SESSION);
    answer_byte(answer, kind);
    return UDS_DONE;
}

static UdsResult clear_codes(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    const uint8_t *group = &request->bytes[1];
    (void)answer;
    (void)now_ns;
    if (request->length != 4U) {
        return UDS_WRONG_LENGTH;
    }
    if ((((uint32_t)group[0] << 16) | ((uint32_t)group[1] << 8) | group[2]) != UDS_ALL_CODES) {
        return UDS_OUT_OF_RANGE;
    }
    codes_cleared();
    return UDS_DONE;
}

static UdsResult read_codes(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    (void)now_ns;
    return trouble_reported(&request->bytes[1], (uint16_t)(request->length - 1U), answer);
}

/* -- data by identifier */

static void identity_read(uint16_t identifier, const Identity *identity, UdsAnswer *answer)
{
    answer_number(answer, identifier, 2U);
    answer_bytes(answer, identity->bytes, identity->length);
}

static void measurement_read(uint16_t identifier, UdsAnswer *answer)
{
    const uint16_t place = (uint16_t)(identifier - MEASURED_IDENTIFIER);
    const uint8_t *image = measured_image();
    answer_number(answer, identifier, 2U);
    if (measured_rows[place].is_float) {
        const uint8_t *at = &image[4U * (uint32_t)place]; /* the floats come first */
        for (uint8_t k = 4U; k > 0U; --k) { /* UDS is big-endian, the image of the tools is not */
            answer_byte(answer, at[k - 1U]);
        }
    } else {
        answer_byte(answer, image[(4U * MEASURED_FLOATS) + ((uint32_t)place - MEASURED_FLOATS)]);
    }
}

/* Whether the identifier is known; its bytes are then in the answer. */
static bool identifier_read(uint16_t identifier, UdsAnswer *answer)
{
    for (uint8_t k = 0U; k < IDENTITIES; ++k) {
        if (identities[k].identifier == identifier) {
            identity_read(identifier, &identities[k], answer);
            return true;
        }
    }
    if ((identifier >= MEASURED_IDENTIFIER) && (identifier < (MEASURED_IDENTIFIER + MEASUREMENTS))) {
        measurement_read(identifier, answer);
        return true;
    }
    return false;
}

static UdsResult read_data(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    bool is_any_known = false;
    (void)now_ns;
    if ((request->length % 2U) == 0U) {
        return UDS_WRONG_LENGTH;
    }
    for (uint16_t k = 1U; k < request->length; k = (uint16_t)(k + 2U)) {
        const uint16_t identifier = (uint16_t)(((uint16_t)request->bytes[k] << 8) | request->bytes[k + 1U]);
        is_any_known = identifier_read(identifier, answer) || is_any_known;
    }
    return is_any_known ? UDS_DONE : UDS_OUT_OF_RANGE;
}

/* -- what needs the key */

static UdsResult seed_given(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    if (request->length != 2U) {
        return UDS_WRONG_LENGTH;
    }
    if (uds.is_barred && ((now_ns - uds.barred_ns) < DELAY_NS)) {
        return UDS_DELAY_NOT_EXPIRED;
    }
    uds.is_barred = false;
    uds.seed_given = !uds.lock.is_open;
    lock_seed(&uds.lock);
    answer_byte(answer, 1U);
    for (uint8_t k = 0U; k < SEED_BYTES; ++k) {
        answer_byte(answer, uds.seed_given ? uds.lock.seed[k] : 0U); /* zeros: unlocked already */
    }
    return UDS_DONE;
}

static UdsResult key_taken(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    if (!uds.seed_given) {
        return UDS_SEQUENCE_ERROR;
    }
    uds.seed_given = false;
    if (lock_unlocked(&uds.lock, &request->bytes[2], (uint32_t)request->length - 2U)) {
        uds.attempts = 0U;
        answer_byte(answer, 2U);
        return UDS_DONE;
    }
    uds.attempts += 1U;
    if (uds.attempts < MOST_ATTEMPTS) {
        return UDS_INVALID_KEY;
    }
    uds.attempts = 0U;
    uds.is_barred = true;
    uds.barred_ns = now_ns;
    return UDS_TOO_MANY_ATTEMPTS;
}

static UdsResult security_access(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    const uint8_t kind = request->bytes[1] & 0x7FU;
    if (kind == 1U) {
        return seed_given(request, answer, now_ns);
    }
    return (kind == 2U) ? key_taken(request, answer, now_ns) : UDS_SUBFUNCTION_NOT_SUPPORTED;
}

/* 0 or 1 (failed), state, active trouble codes, skipped cycles since the start. */
static void self_tested(void)
{
    const uint16_t active = codes_count(true);
    const uint16_t overruns = (uint16_t)ecu_values()[VALUE_OVERRUNS];
    uds.tested[0] = ((active > 0U) || (ecu_state() != STATE_RUNNING)) ? 1U : 0U;
    uds.tested[1] = ecu_state();
    uds.tested[2] = (uint8_t)((active < 255U) ? active : 255U);
    uds.tested[3] = (uint8_t)(overruns >> 8);
    uds.tested[4] = (uint8_t)(overruns & 0xFFU);
    uds.is_tested = true;
}

static UdsResult routine_control(const Request *request, UdsAnswer *answer, int64_t now_ns)
{
    const uint8_t kind = request->bytes[1] & 0x7FU;
    (void)now_ns;
    if (request->length != 4U) {
        return UDS_WRONG_LENGTH;
    }
    if ((kind != 1U) && (kind != 3U)) {
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    }
    if ((((uint32_t)request->bytes[2] << 8) | request->bytes[3]) != SELF_TEST) {
        return UDS_OUT_OF_RANGE;
    }
    if (kind == 1U) {
        self_tested();
    }
    if (!uds.is_tested) {
        return UDS_SEQUENCE_ERROR; /* no results before a start */
    }
    answer_byte(answer, kind);
    answer_number(answer, SELF_TEST, 2U);
    answer_bytes(answer, uds.tested, SELF_TEST_BYTES);
    return UDS_DONE;
}

/* -- requests */

static const Service *service_of(uint8_t identifier)
{
    static const Service services[] = {
        {0x10U, 2U, true, false, session_control}, {0x11U, 2U, true, true, ecu_reset},
        {0x14U, 4U, false, true, clear_codes},     {0x19U, 2U, true, false, read_codes},
        {0x22U, 3U, false, false, read_data},      {0x27U, 2U, true, true, security_access},
        {0x31U, 4U, true, true, routine_control},  {0x3EU, 2U, true, false, tester_present},
    };
    for (uint8_t k = 0U; k < (sizeof(services) / sizeof(Service)); ++k) {
        if (services[k].service == identifier) {
            return &services[k];
        }
    }
    return NULL;
}

static UdsResult served(const Service *service, const Request *request, int64_t now_ns)
{
    if (service == NULL) {
        return UDS_SERVICE_NOT_SUPPORTED;
    }
    if (service->is_extended_only && (uds.session == DEFAULT_SESSION)) {
        return UDS_SERVICE_NOT_IN_SESSION;
    }
    if (request->length < service->least) {
        return UDS_WRONG_LENGTH;
    }
    answer_start(&answer_now);
    answer_byte(&answer_now, (uint8_t)(service->service + POSITIVE));
    const UdsResult result = service->handler(request, &answer_now, now_ns);
    return ((result == UDS_DONE) && answer_now.is_too_long) ? UDS_RESPONSE_TOO_LONG : result;
}

static void requested(const Request *request, int64_t now_ns)
{
    session_expired(now_ns);
    uds.heard_ns = now_ns;
    const Service *service = service_of(request->bytes[0]);
    const UdsResult result = served(service, request, now_ns);
    if (result != UDS_DONE) {
        answer_start(&answer_now);
        answer_byte(&answer_now, NEGATIVE);
        answer_byte(&answer_now, request->bytes[0]);
        answer_byte(&answer_now, (uint8_t)result);
    } else if (service->has_subfunction && ((request->bytes[1] & SUPPRESS) != 0U)) {
        return;
    } else {
        /* the answer is there */
    }
    isotp_answered(answer_now.bytes, answer_now.length, now_ns);
}

void uds_start(uint32_t send)
{
    (void)memset(&uds, 0, sizeof uds);
    uds.session = DEFAULT_SESSION;
    lock_start(&uds.lock, "uds security access");
    isotp_start(send);
}

void uds_receive(const uint8_t *data, uint8_t length, int64_t now_ns)
{
    static Request request;
    if (isotp_receive(data, length, now_ns, &request) && !isotp_is_sending()) {
        requested(&request, now_ns);
    }
}

void uds_before_cycle(int64_t now_ns)
{
    session_expired(now_ns);
    if (uds.restarts) {
        uds.restarts = false;
        ecu_restart();
    }
}

void uds_after_cycle(int64_t now_ns)
{
    isotp_cycle(now_ns);
}
