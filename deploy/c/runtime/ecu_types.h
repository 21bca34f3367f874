/* Rows of the ECU's tables. */
#ifndef ECU_TYPES_H
#define ECU_TYPES_H

#include "real.h"

typedef struct {
    uint8_t first_bit; /* of a little-endian signal */
    uint8_t bits;
    bool is_signed;
    real_t scale; /* value in the DBC's unit = raw * scale + offset */
    real_t offset;
    real_t factor; /* SI value per value in the DBC's unit */
    int32_t lowest; /* raw range of a value; outside of it lie "error" and "not available" */
    int32_t highest;
    real_t limit; /* largest plausible magnitude, SI */
    real_t step; /* largest plausible change between two frames */
    bool sensed; /* by a sensor with noise, so that it never stands still for long */
} InputField;

typedef struct {
    uint8_t first_bit;
    uint8_t bits;
    bool is_signed;
    uint64_t inputs; /* that the sensor vouches for, a bit each */
} SensorState;

typedef struct {
    uint32_t id; /* with bit 31 for 29-bit identifiers, as Linux has it */
    uint8_t length;
    int32_t data_id; /* of E2E profile 1; -1: not protected */
    int64_t cycle_ns;
    int64_t fresh_ns; /* a frame counts so long */
    uint8_t group;
    uint8_t first; /* its inputs: first .. last - 1 */
    uint8_t last;
    uint8_t first_state;
    uint8_t last_state;
} Listener;

typedef struct {
    uint8_t first_bit;
    uint8_t bits;
    bool is_signed;
    real_t scale;
    real_t offset;
    real_t factor;
    int32_t lowest; /* values are saturated to this raw range */
    int32_t highest;
    int32_t absent; /* raw code of "not available" */
    uint16_t value; /* that goes into it */
} OutputSignal;

typedef struct {
    uint32_t id;
    uint8_t length;
    int32_t data_id;
    uint64_t resting; /* bits of the signals that are not sent */
    uint16_t first; /* its signals: first .. last - 1 */
    uint16_t last;
    uint16_t every; /* cycle time and phase in ticks */
    uint16_t phase;
} OutputFrame;

typedef struct {
    uint8_t validity; /* entry of the validity table */
    uint8_t estimate;
    real_t least;
    real_t most;
} ValueRange;

typedef struct {
    uint8_t validity; /* of the estimate whose standard deviation this is */
    uint8_t estimate;
} Deviation;

typedef struct {
    int64_t on_delay_ns;
    uint8_t level; /* of the warning that the reason raises */
} AlarmTimes;

typedef struct {
    int32_t spn;
    real_t full; /* largest plausible magnitude: freeze frames carry shares of it */
} Suspect;

#endif
