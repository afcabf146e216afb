#include "sim_rng.h"

#include "phys_math.h"

static void philox_round(uint32_t c[4], const uint32_t k[2])
{
    const uint64_t p0 = (uint64_t)0xD2511F53u * c[0];
    const uint64_t p1 = (uint64_t)0xCD9E8D57u * c[2];
    const uint32_t next[4] = {(uint32_t)(p1 >> 32) ^ c[1] ^ k[0], (uint32_t)p1, (uint32_t)(p0 >> 32) ^ c[3] ^ k[1], (uint32_t)p0};
    memcpy(c, next, sizeof next);
}

void ivl_sim_philox(const uint32_t counter[4], const uint32_t key[2], uint32_t out[4])
{
    uint32_t c[4] = {counter[0], counter[1], counter[2], counter[3]};
    uint32_t k[2] = {key[0], key[1]};
    for (int i = 0; i < 10; i++)
    {
        philox_round(c, k);
        k[0] += 0x9E3779B9u;
        k[1] += 0xBB67AE85u;
    }
    memcpy(out, c, sizeof c);
}

static void block(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index, uint32_t out[4])
{
    const uint32_t counter[4] = {index, (uint32_t)purpose, (uint32_t)rng->stream, (uint32_t)(rng->stream >> 32)};
    const uint32_t key[2] = {(uint32_t)rng->seed, (uint32_t)(rng->seed >> 32)};
    ivl_sim_philox(counter, key, out);
}

/// 32 random bits to the middle of one of 2^32 equal cells of (0, 1): never 0, never 1.
static double to_uniform(uint32_t bits)
{
    return ((double)bits + 0.5) * (1.0 / 4294967296.0);
}

double ivl_sim_uniform(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index)
{
    uint32_t bits[4];
    block(rng, purpose, index, bits);
    return to_uniform(bits[0]);
}

void ivl_sim_normal4(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index, double out[4])
{
    uint32_t bits[4];
    block(rng, purpose, index, bits);
    for (int pair = 0; pair < 2; pair++)
    {
        const double radius = sqrt(-2.0 * ivl_sim_log(to_uniform(bits[2 * pair])));
        double       s, c;
        ivl_sim_sincos(2.0 * IVL_SIM_PI * to_uniform(bits[2 * pair + 1]), &s, &c);
        out[2 * pair] = radius * c;
        out[2 * pair + 1] = radius * s;
    }
}
