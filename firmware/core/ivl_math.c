/// @file ivl_math.c
/// The polynomials are minimax fits of this project, rounded to single precision; those of sine, cosine and tangent on [0, (pi/4)^2] in z = x^2.
#include "ivl_math.h"

#include <string.h>

// pi/2 in three parts; the first two have so few bits that small integer multiples of them are exact
static const float HALF_PI_1 = 1.5703125f;
static const float HALF_PI_2 = 4.837512969970703e-4f;
static const float HALF_PI_3 = 7.549789949e-8f;
static const float TWO_OVER_PI = 0.636619772f;
static const float QUARTER_PI = 0.785398163f;
static const float SINCOS_RAD_MAX = 100.0f;
static const float TAN_RAD_MAX = 1.5f;

// sin x on [-pi/4, pi/4]
static float sin_poly(float x, float z)
{
    return x + x * z * (-1.666665494e-1f + z * (8.332178146e-3f + z * -1.951729898e-4f));
}

// cos x on [-pi/4, pi/4], z = x^2
static float cos_poly(float z)
{
    return 1.0f - 0.5f * z + z * z * (4.166664687e-2f + z * (-1.388736752e-3f + z * 2.443845160e-5f));
}

bool ivl_vec3_within(ivl_vec3_t a, float limit)
{
    return ivl_within(a.x, limit) && ivl_within(a.y, limit) && ivl_within(a.z, limit);
}

ivl_sincos_t ivl_sincos(float x_rad)
{
    if (!ivl_within(x_rad, SINCOS_RAD_MAX))
    {
        return (ivl_sincos_t){0.0f, 1.0f};
    }
    // subtract the nearest multiple of pi/2
    const int   quadrant = (int)(x_rad * TWO_OVER_PI + ((x_rad < 0.0f) ? -0.5f : 0.5f));
    const float k = (float)quadrant;
    const float r = ((x_rad - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3;
    const float z = r * r;
    const float s = sin_poly(r, z);
    const float c = cos_poly(z);

    // turn back by the quadrant
    const unsigned turn = (unsigned)quadrant & 3u;
    const bool     swap = (turn & 1u) != 0u;
    const float    sin_abs = swap ? c : s;
    const float    cos_abs = swap ? s : c;
    return (ivl_sincos_t){
        .sin = (turn >= 2u) ? -sin_abs : sin_abs,
        .cos = ((turn == 1u) || (turn == 2u)) ? -cos_abs : cos_abs,
    };
}

// tan x on [-pi/4, pi/4]
static float tan_poly(float x)
{
    const float z = x * x;
    const float high = 5.338125183e-2f + z * (2.452826796e-2f + z * (2.974438399e-3f + z * 9.465599571e-3f));
    return x + x * z * (3.333313951e-1f + z * (1.333920010e-1f + z * high));
}

float ivl_tan(float x_rad)
{
    const float x = ivl_clamp(x_rad, -TAN_RAD_MAX, TAN_RAD_MAX);
    const float x_abs = fabsf(x);
    if (x_abs <= QUARTER_PI)
    {
        return tan_poly(x);
    }
    // tan x = 1 / tan(pi/2 - x); the first difference is exact
    const float t = 1.0f / tan_poly((HALF_PI_1 - x_abs) + (HALF_PI_2 + HALF_PI_3));
    return (x < 0.0f) ? -t : t;
}

static const float LOGISTIC_MAX = 30.0f;
static const float LOG2_E = 1.44269504f;
// ln 2 in two parts; the first has so few bits that small integer multiples of it are exact
static const float LN_2_1 = 0.693359375f;
static const float LN_2_2 = -2.12194440e-4f;

// exp x on [-ln(2) / 2, ln(2) / 2]
static float exp_poly(float x)
{
    return 1.0f + x + x * x * (0.49999148f + x * (0.16666457f + x * (4.1898277e-2f + x * 8.37464e-3f)));
}

// 2^n for n in -60..0: the exponent of a single-precision number, 127 for 1
static float power_of_two(int n)
{
    const uint32_t bits = (uint32_t)(127 + n) << 23;
    float          power;
    memcpy(&power, &bits, sizeof power);
    return power;
}

float ivl_logistic(float x)
{
    // exp of a number that is not positive, so that nothing overflows
    const float x_abs = fabsf(x), a = (x_abs < LOGISTIC_MAX) ? -x_abs : -LOGISTIC_MAX;
    const int   n = (int)(a * LOG2_E - 0.5f);
    const float k = (float)n;
    const float e = exp_poly((a - k * LN_2_1) - k * LN_2_2) * power_of_two(n);
    const float low = e / (1.0f + e);
    // NaN is no reason to go
    return (x > 0.0f) ? 1.0f - low : low;
}
