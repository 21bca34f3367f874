#include "sha256.h"

#include <string.h>

#define INNER 0x36U
#define OUTER 0x5CU

static uint32_t turned(uint32_t word, uint32_t bits)
{
    return (word >> bits) | (word << (32U - bits));
}

static void scheduled(const uint8_t *block, uint32_t *w)
{
    for (uint32_t k = 0U; k < 16U; ++k) {
        const uint8_t *at = &block[4U * k];
        w[k] = ((uint32_t)at[0] << 24) | ((uint32_t)at[1] << 16) | ((uint32_t)at[2] << 8) | (uint32_t)at[3];
    }
    for (uint32_t k = 16U; k < 64U; ++k) {
        const uint32_t early = turned(w[k - 15U], 7U) ^ turned(w[k - 15U], 18U) ^ (w[k - 15U] >> 3);
        const uint32_t late = turned(w[k - 2U], 17U) ^ turned(w[k - 2U], 19U) ^ (w[k - 2U] >> 10);
        w[k] = w[k - 16U] + early + w[k - 7U] + late;
    }
}

/* One block into the state: FIPS 180-4, 6.2.2. s[0] .. s[7] are its a .. h. */
static void compressed(Sha256 *hash)
{
    static const uint32_t constants[64] = {
        0x428a2f98U, 0x71374491U, 0xb5c0fbcfU, 0xe9b5dba5U, 0x3956c25bU, 0x59f111f1U, 0x923f82a4U, 0xab1c5ed5U,
        0xd807aa98U, 0x12835b01U, 0x243185beU, 0x550c7dc3U, 0x72be5d74U, 0x80deb1feU, 0x9bdc06a7U, 0xc19bf174U,
        0xe49b69c1U, 0xefbe4786U, 0x0fc19dc6U, 0x240ca1ccU, 0x2de92c6fU, 0x4a7484aaU, 0x5cb0a9dcU, 0x76f988daU,
        0x983e5152U, 0xa831c66dU, 0xb00327c8U, 0xbf597fc7U, 0xc6e00bf3U, 0xd5a79147U, 0x06ca6351U, 0x14292967U,
        0x27b70a85U, 0x2e1b2138U, 0x4d2c6dfcU, 0x53380d13U, 0x650a7354U, 0x766a0abbU, 0x81c2c92eU, 0x92722c85U,
        0xa2bfe8a1U, 0xa81a664bU, 0xc24b8b70U, 0xc76c51a3U, 0xd192e819U, 0xd6990624U, 0xf40e3585U, 0x106aa070U,
        0x19a4c116U, 0x1e376c08U, 0x2748774cU, 0x34b0bcb5U, 0x391c0cb3U, 0x4ed8aa4aU, 0x5b9cca4fU, 0x682e6ff3U,
        0x748f82eeU, 0x78a5636fU, 0x84c87814U, 0x8cc70208U, 0x90befffaU, 0xa4506cebU, 0xbef9a3f7U, 0xc67178f2U};
    uint32_t w[64];
    uint32_t s[8];
    scheduled(hash->block, w);
    (void)memcpy(s, hash->state, sizeof s);
    for (uint32_t k = 0U; k < 64U; ++k) {
        const uint32_t sum1 = turned(s[4], 6U) ^ turned(s[4], 11U) ^ turned(s[4], 25U);
        const uint32_t choice = (s[4] & s[5]) ^ (~s[4] & s[6]);
        const uint32_t sum0 = turned(s[0], 2U) ^ turned(s[0], 13U) ^ turned(s[0], 22U);
        const uint32_t majority = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
        const uint32_t first = s[7] + sum1 + choice + constants[k] + w[k];
        for (uint32_t place = 7U; place > 0U; --place) {
            s[place] = s[place - 1U];
        }
        s[4] += first;
        s[0] = first + sum0 + majority;
    }
    for (uint32_t k = 0U; k < 8U; ++k) {
        hash->state[k] += s[k];
    }
}

void sha256_start(Sha256 *hash)
{
    static const uint32_t initial[8] = {0x6a09e667U, 0xbb67ae85U, 0x3c6ef372U, 0xa54ff53aU,
                                        0x510e527fU, 0x9b05688cU, 0x1f83d9abU, 0x5be0cd19U};
    (void)memset(hash, 0, sizeof *hash);
    (void)memcpy(hash->state, initial, sizeof hash->state);
}

void sha256_add(Sha256 *hash, const uint8_t *bytes, uint32_t length)
{
    for (uint32_t k = 0U; k < length; ++k) {
        hash->block[hash->total % SHA256_BLOCK] = bytes[k];
        hash->total += 1U;
        if ((hash->total % SHA256_BLOCK) == 0U) {
            compressed(hash);
        }
    }
}

void sha256_end(Sha256 *hash, uint8_t digest[SHA256_BYTES])
{
    const uint64_t bits = hash->total * 8U;
    uint8_t byte = 0x80U;
    sha256_add(hash, &byte, 1U);
    byte = 0U;
    while ((hash->total % SHA256_BLOCK) != (SHA256_BLOCK - 8U)) {
        sha256_add(hash, &byte, 1U);
    }
    for (uint32_t k = 0U; k < 8U; ++k) {
        const uint32_t place = 56U - (8U * k);
        byte = (uint8_t)(bits >> place);
        sha256_add(hash, &byte, 1U);
    }
    for (uint32_t k = 0U; k < SHA256_BYTES; ++k) {
        digest[k] = (uint8_t)(hash->state[k / 4U] >> (24U - (8U * (k % 4U))));
    }
}

void hmac_key(const uint8_t *key, uint32_t length, uint8_t block[SHA256_BLOCK])
{
    (void)memset(block, 0, SHA256_BLOCK);
    if (length > SHA256_BLOCK) {
        Sha256 hash;
        sha256_start(&hash);
        sha256_add(&hash, key, length);
        sha256_end(&hash, block);
    } else {
        for (uint32_t k = 0U; k < length; ++k) {
            block[k] = key[k];
        }
    }
}

static void padded(Sha256 *hash, const uint8_t *key, uint8_t pad)
{
    sha256_start(hash);
    for (uint32_t k = 0U; k < SHA256_BLOCK; ++k) {
        const uint8_t byte = key[k] ^ pad;
        sha256_add(hash, &byte, 1U);
    }
}

void hmac_sha256(const uint8_t key[SHA256_BLOCK], const uint8_t *bytes, uint32_t length, uint8_t digest[SHA256_BYTES])
{
    Sha256 hash;
    padded(&hash, key, INNER);
    sha256_add(&hash, bytes, length);
    sha256_end(&hash, digest);
    padded(&hash, key, OUTER);
    sha256_add(&hash, digest, SHA256_BYTES);
    sha256_end(&hash, digest);
}
