/// @file ivl_math.c
/// The polynomials are minimax fits of this project on [0, (pi/4)^2] in z = x^2, rounded to single precision.
#include "ivl_math.h"

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
