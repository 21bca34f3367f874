#include "measured.h"

#include <string.h>

#include "ecu_internal.h"

static real_t inputs[INPUTS]; /* of the last cycle: frames that come meanwhile change those of the ECU */
static uint8_t image[MEASURED_BYTES];
static bool is_packed; /* whether the image is of the last cycle */
static bool has_cycle;

typedef char floats_have_four_bytes[(sizeof(float) == sizeof(uint32_t)) ? 1 : -1];

void measured_start(void)
{
    (void)memset(inputs, 0, sizeof inputs);
    (void)memset(image, 0, sizeof image);
    is_packed = false;
    has_cycle = false;
}

void measured_taken(void)
{
    (void)memcpy(inputs, ecu_inputs()->values, sizeof inputs);
    is_packed = false;
    has_cycle = true;
}

real_t measured_input(uint16_t input)
{
    return inputs[input];
}

void float_stored(float value, uint8_t *bytes)
{
    uint32_t bits;
    (void)memcpy(&bits, &value, sizeof bits);
    for (uint32_t k = 0U; k < 4U; ++k) {
        bytes[k] = (uint8_t)(bits >> (8U * k));
    }
}

float float_of(const uint8_t *bytes)
{
    uint32_t bits = 0U;
    float value;
    for (uint32_t k = 0U; k < 4U; ++k) {
        bits |= (uint32_t)bytes[k] << (8U * k);
    }
    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

/* The number of a value table; 255 for what is none. */
static uint8_t byte_of(real_t value)
{
    return ((value >= R(0.0)) && (value <= R(255.0))) ? (uint8_t)value : 255U;
}

const uint8_t *measured_image(void)
{
    if (has_cycle && !is_packed) {
        const real_t *values = ecu_values();
        uint16_t at = 0U;
        for (uint16_t k = 0U; k < MEASUREMENTS; ++k) {
            const Measured *row = &measured_rows[k];
            const real_t value = row->is_input ? inputs[row->place] : values[row->place];
            if (row->is_float) {
                float_stored((float)value, &image[at]);
                at = (uint16_t)(at + 4U);
            } else {
                image[at] = byte_of(value);
                at = (uint16_t)(at + 1U);
            }
        }
        is_packed = true;
    }
    return image;
}
