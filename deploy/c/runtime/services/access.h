/* Seed and key: who knows the secret may change the ECU's behaviour. After ecu/measure/access.py. */
#ifndef ACCESS_H
#define ACCESS_H

#include <stdbool.h>
#include <stdint.h>

#define SEED_BYTES 12U
#define KEY_BYTES 16U
#define MOST_PURPOSE 20U

typedef struct {
    const char *purpose; /* a key for one purpose does not open another; at most MOST_PURPOSE letters */
    bool is_open;
    bool has_seed;
    uint8_t seed[SEED_BYTES];
} Lock;

/* The secret behind all locks; without one (length 0) none can be opened. */
void access_start(const uint8_t *secret, uint16_t length);

void lock_start(Lock *lock, const char *purpose);
void lock_seed(Lock *lock); /* a new one in lock->seed; the one before is void */
bool lock_unlocked(Lock *lock, const uint8_t *key, uint32_t length); /* a seed serves one try */
void lock_closed(Lock *lock);

#endif
