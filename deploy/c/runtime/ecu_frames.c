/* Frames: bits, checksum and counter of E2E profile 1 (AUTOSAR PRS_E2EProtocol), packing. After dbc/packing.py and dbc/protection.py. */
#include "ecu_internal.h"

uint64_t frame_bits(const uint8_t *data, uint8_t length)
{
    uint64_t bits = 0U;
    for (uint8_t k = 0U; (k < length) && (k < 8U); ++k) {
        const uint32_t place = 8U * (uint32_t)k;
        bits |= (uint64_t)data[k] << place;
    }
    return bits;
}

int32_t raw_value(uint64_t bits, uint8_t first_bit, uint8_t count, bool is_signed)
{
    const uint32_t mask = ((uint32_t)1U << count) - 1U;
    const uint32_t raw = (uint32_t)(bits >> first_bit) & mask;
    if (is_signed) {
        const uint32_t place = (uint32_t)count - 1U;
        const uint32_t top = (uint32_t)1U << place;
        const int32_t sign = (int32_t)top;
        return ((int32_t)raw ^ sign) - sign; /* sign extension of two's complement */
    }
    return (int32_t)raw;
}

static uint8_t crc_step(uint8_t crc, uint8_t byte)
{
    uint8_t rest = crc ^ byte;
    for (uint8_t bit = 0U; bit < 8U; ++bit) {
        rest = ((rest & 0x80U) != 0U) ? (uint8_t)((uint8_t)(rest << 1) ^ 0x1DU) : (uint8_t)(rest << 1);
    }
    return rest;
}

static uint8_t checksum(const uint8_t *data, uint8_t length, int32_t data_id)
{
    /* low byte of the data id first, then the high one, then the bytes after the checksum */
    uint8_t crc = crc_step(crc_step(0U, (uint8_t)((uint32_t)data_id & 0xFFU)), (uint8_t)((uint32_t)data_id >> 8));
    for (uint8_t k = 1U; k < length; ++k) {
        crc = crc_step(crc, data[k]);
    }
    return crc;
}

int64_t ratio_rounded(int64_t numerator, int64_t denominator)
{
    int64_t whole = numerator / denominator;
    int64_t rest = numerator % denominator;
    if (rest < 0) {
        rest += denominator;
        whole -= 1;
    }
    /* halves go to the even neighbour, as Python's round() has it */
    if (((2 * rest) > denominator) || (((2 * rest) == denominator) && ((whole % 2) != 0))) {
        whole += 1;
    }
    return whole;
}

/* Place the counter on its circle, with the time passed to say how often it went round. Whole numbers: steps and times in ns. */
static Check counted(Checker *checker, const Listener *listener, uint8_t counter, int64_t now_ns)
{
    const int64_t cycle = listener->cycle_ns;
    const int64_t passed = now_ns - checker->heard_ns;
    const int64_t circle = (int64_t)COUNTERS;
    const int64_t step = ((int64_t)counter + circle - (int64_t)checker->counter) % circle;
    const int64_t turns = ratio_rounded(passed - (step * cycle), circle * cycle);
    const int64_t missed = (turns * circle) + step - 1;
    int64_t off = passed - ((1 + missed) * cycle);
    off = (off < 0) ? -off : off;
    if ((step == 1) && ((missed <= 0) || (off > cycle))) {
        return CHECK_OK;
    }
    const int64_t most_lost = (circle - 1) / 2; /* a jump of more than half the circle is a step back */
    if ((missed > most_lost) || ((step > 1) && (step <= (most_lost + 1)))) {
        return CHECK_LOST;
    }
    const bool follows =
        checker->has_stale && ((((int64_t)counter + circle - (int64_t)checker->stale_counter) % circle) == 1);
    if (follows && ((2 * passed) > cycle)) {
        return CHECK_RESTARTED;
    }
    return (step == 0) ? CHECK_REPEATED : CHECK_REORDERED;
}

bool is_usable(Check check)
{
    return check <= CHECK_RESTARTED;
}

Check frame_checked(Checker *checker, const Listener *listener, const uint8_t *data, uint8_t length, int64_t now_ns)
{
    if (listener->data_id < 0) {
        return (length < listener->length) ? CHECK_WRONG_LENGTH : CHECK_OK;
    }
    if (length != listener->length) {
        return CHECK_WRONG_LENGTH;
    }
    if (checksum(data, length, listener->data_id) != data[0]) {
        return CHECK_WRONG_CRC;
    }
    const uint8_t counter = data[1] & 0x0FU;
    if (counter >= COUNTERS) {
        return CHECK_WRONG_COUNTER;
    }
    const Check check = checker->heard ? counted(checker, listener, counter, now_ns) : CHECK_OK;
    checker->heard_ns = now_ns;
    checker->has_stale = (check == CHECK_REORDERED);
    checker->stale_counter = counter;
    if (is_usable(check)) {
        checker->heard = true;
        checker->counter = counter;
    }
    return check;
}

static int32_t raw_of(real_t value, const OutputSignal *signal)
{
    const real_t x = ((value / signal->factor) - signal->offset) / signal->scale;
    if (x <= (real_t)signal->lowest) {
        return signal->lowest;
    }
    if (x >= (real_t)signal->highest) {
        return signal->highest;
    }
    /* only a number equals itself */
    return (x == x) ? (int32_t)real_rint(x) : signal->absent; /* cppcheck-suppress duplicateExpression */
}

void frame_packed(const OutputFrame *frame, const real_t *values, uint8_t *counter, EcuFrame *out)
{
    uint64_t bits = frame->resting;
    for (uint16_t k = frame->first; k < frame->last; ++k) {
        const OutputSignal *signal = &output_signals[k];
        const uint64_t mask = ((uint64_t)1U << signal->bits) - 1U;
        bits |= ((uint64_t)(uint32_t)raw_of(values[signal->value], signal) & mask) << signal->first_bit;
    }
    out->id = frame->id;
    out->length = frame->length;
    for (uint8_t k = 0U; k < 8U; ++k) {
        const uint32_t place = 8U * (uint32_t)k;
        out->data[k] = (uint8_t)(bits >> place);
    }
    if (frame->data_id >= 0) {
        out->data[1] = (uint8_t)((out->data[1] & 0xF0U) | *counter);
        *counter = (uint8_t)((*counter + 1U) % COUNTERS);
        out->data[0] = checksum(out->data, frame->length, frame->data_id);
    }
}
