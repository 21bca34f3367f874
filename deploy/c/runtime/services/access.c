#include "access.h"

#include <string.h>

#include "services.h"
#include "sha256.h"

static bool has_secret;
static uint8_t secret_key[SHA256_BLOCK]; /* of the HMAC */

void access_start(const uint8_t *secret, uint16_t length)
{
    has_secret = length > 0U;
    hmac_key(secret, length, secret_key);
}

void lock_start(Lock *lock, const char *purpose)
{
    (void)memset(lock, 0, sizeof *lock);
    lock->purpose = purpose;
}

void lock_seed(Lock *lock)
{
    /* a seed that can be foreseen would let an overheard key serve again */
    lock->has_seed = service_random(lock->seed, SEED_BYTES);
}

bool lock_unlocked(Lock *lock, const uint8_t *key, uint32_t length)
{
    uint8_t message[MOST_PURPOSE + 1U + SEED_BYTES];
    uint8_t digest[SHA256_BYTES];
    uint32_t used = 0U;
    uint8_t differing = 0U;
    const bool has_seed = lock->has_seed;
    lock->has_seed = false;
    if (!has_seed || !has_secret) {
        return false;
    }
    while ((used < MOST_PURPOSE) && ((uint8_t)lock->purpose[used] != 0U)) {
        message[used] = (uint8_t)lock->purpose[used];
        used += 1U;
    }
    message[used] = 0U;
    (void)memcpy(&message[used + 1U], lock->seed, SEED_BYTES);
    hmac_sha256(secret_key, message, used + 1U + SEED_BYTES, digest);
    /* all bytes are compared whatever the first ones are: the time says nothing about the key */
    for (uint32_t k = 0U; k < KEY_BYTES; ++k) {
        const uint8_t given = (k < length) ? key[k] : (uint8_t)0U;
        differing |= digest[k] ^ given;
    }
    lock->is_open = (differing == 0U) && (length == KEY_BYTES);
    return lock->is_open;
}

void lock_closed(Lock *lock)
{
    lock->is_open = false;
    lock->has_seed = false;
}
