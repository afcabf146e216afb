#include "cf_power.h"

// A small single-cell battery: 250 mAh, and a current of hover that empties it in seven minutes.
static const float    CHARGE_As = 900.0f;
static const float    HOVER_A = 2.1f;
static const float    FULL_V = 4.15f;
static const float    EMPTY_V = 3.3f;
static const float    RESISTANCE_OHM = 0.08f;
static const uint32_t LOW_MS = 5000;

static float left(const ivl_cf_power_t *power)
{
    const float share = 1.0f - power->drawn_As / CHARGE_As;
    return (share > 0.0f) ? share : 0.0f;
}

void ivl_cf_power_full(ivl_cf_power_t *power)
{
    *power = (ivl_cf_power_t){.vbat_V = FULL_V};
}

void ivl_cf_power_step(ivl_cf_power_t *power, float thrust_norm, float fixed_V, float low_V, uint32_t dt_ms)
{
    const float current_A = HOVER_A * thrust_norm;
    power->drawn_As += current_A * (float)dt_ms * 1.0e-3f;
    const float modelled_V = EMPTY_V + (FULL_V - EMPTY_V) * left(power) - RESISTANCE_OHM * current_A;
    power->vbat_V = (fixed_V > 0.0f) ? fixed_V : modelled_V;
    power->low_ms = !(power->vbat_V > low_V) ? power->low_ms + dt_ms : 0;
}

/// In tens, from a discharge curve, as the stock firmware tells it; a full battery says 90.
uint8_t ivl_cf_power_level(const ivl_cf_power_t *power)
{
    static const float CURVE_V[] = {3.00f, 3.78f, 3.83f, 3.87f, 3.89f, 3.92f, 3.96f, 4.00f, 4.04f, 4.10f};
    const unsigned     last = sizeof CURVE_V / sizeof CURVE_V[0] - 1u;
    unsigned           tens = 0;
    while (tens < last && power->vbat_V > CURVE_V[tens])
    {
        tens++;
    }
    return (uint8_t)(10u * tens);
}

int8_t ivl_cf_power_state(const ivl_cf_power_t *power)
{
    return (power->low_ms >= LOW_MS) ? 3 : 0;
}
