/// @file ivl_vision_fixed.h
/// Whole numbers as fractions: Q30 means that 2^30 stands for 1.  Every function gives the same bits on every processor.
///
/// A shift of a negative number to the right rounds down, which every compiler of this project does; the tests ask it.
#ifndef IVL_VISION_FIXED_H
#define IVL_VISION_FIXED_H

#include <stdint.h>

static const int32_t IVL_VISION_ONE_Q30 = 1 << 30;

/// a / 2^bits, rounded to the nearest.
static inline int64_t ivl_vision_shift(int64_t a, int bits)
{
    return (a + ((int64_t)1 << (bits - 1))) >> bits;
}

/// a * 2^bits; for negative bits rounded down.  The result must fit, and |a| * 2^bits with it.
static inline int64_t ivl_vision_scale(int64_t a, int bits)
{
    return (bits >= 0) ? a * ((int64_t)1 << bits) : ((bits > -63) ? a >> -bits : 0);
}

/// Product of two numbers, one of them in Q30.
static inline int32_t ivl_vision_mul_q30(int32_t a, int32_t b)
{
    return (int32_t)ivl_vision_shift((int64_t)a * b, 30);
}

/// `a` held within +-limit.
static inline int64_t ivl_vision_clamp(int64_t a, int64_t limit)
{
    return (a > limit) ? limit : ((a < -limit) ? -limit : a);
}

/// Number of binary digits: 0 for 0.
static inline int ivl_vision_bits(uint64_t a)
{
    int n = 0;
    for (int step = 32; step > 0; step /= 2)
    {
        if ((a >> step) != 0)
        {
            a >>= step;
            n += step;
        }
    }
    return n + (int)a;
}

/// Square root, rounded down.
static inline uint32_t ivl_vision_sqrt(uint64_t a)
{
    uint64_t root = 0;
    for (uint64_t bit = (uint64_t)1 << 62; bit != 0; bit >>= 2)
    {
        const uint64_t trial = root + bit;
        root >>= 1;
        if (a >= trial)
        {
            a -= trial;
            root += bit;
        }
    }
    return (uint32_t)root;
}

#endif  // IVL_VISION_FIXED_H
