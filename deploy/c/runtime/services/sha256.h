/* SHA-256 (FIPS 180-4) and HMAC-SHA256 (RFC 2104). */
#ifndef SHA256_H
#define SHA256_H

#include <stdint.h>

#define SHA256_BYTES 32U
#define SHA256_BLOCK 64U

typedef struct {
    uint32_t state[8];
    uint64_t total; /* bytes so far */
    uint8_t block[SHA256_BLOCK];
} Sha256;

void sha256_start(Sha256 *hash);
void sha256_add(Sha256 *hash, const uint8_t *bytes, uint32_t length);
void sha256_end(Sha256 *hash, uint8_t digest[SHA256_BYTES]);

/* A key as HMAC works with it: as it is, filled up with zeros; a longer one by its digest. */
void hmac_key(const uint8_t *key, uint32_t length, uint8_t block[SHA256_BLOCK]);

void hmac_sha256(const uint8_t key[SHA256_BLOCK], const uint8_t *bytes, uint32_t length, uint8_t digest[SHA256_BYTES]);

#endif
