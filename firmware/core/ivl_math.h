/// @file ivl_math.h
/// Vectors, rotations and the few functions that the core needs instead of libm.
/// Only + - * /, sqrtf, fabsf and comparisons: the bits are the same on every IEEE-754 machine when contraction is off.  Pure, O(1).
#ifndef IVL_MATH_H
#define IVL_MATH_H
#include <math.h>

#include "ivl_types.h"

/// Rotation matrix by columns: the axes of B expressed in W.
typedef struct
{
    ivl_vec3_t x, y, z;
} ivl_axes_t;

typedef struct
{
    float sin, cos;
} ivl_sincos_t;

static const float IVL_PI = 3.14159265f;
static const float IVL_HALF_PI = 1.57079633f;

/// True if |x| <= limit; false for NaN and infinity (limit finite).
static inline bool ivl_within(float x, float limit)
{
    return fabsf(x) <= limit;
}

/// x limited to [lo, hi]; NaN gives lo, so that a bad value becomes the safe end.
static inline ivl_num_t ivl_clamp(ivl_num_t x, ivl_num_t lo, ivl_num_t hi)
{
    return ivl_pick(x > lo, ivl_pick(x < hi, x, hi), lo);
}

static inline ivl_vec3_t ivl_vec3(ivl_num_t x, ivl_num_t y, ivl_num_t z)
{
    return (ivl_vec3_t){x, y, z};
}

static inline ivl_vec3_t ivl_add(ivl_vec3_t a, ivl_vec3_t b)
{
    return ivl_vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline ivl_vec3_t ivl_sub(ivl_vec3_t a, ivl_vec3_t b)
{
    return ivl_vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline ivl_vec3_t ivl_scale(ivl_vec3_t a, ivl_num_t s)
{
    return ivl_vec3(a.x * s, a.y * s, a.z * s);
}

static inline ivl_num_t ivl_dot(ivl_vec3_t a, ivl_vec3_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline ivl_vec3_t ivl_cross(ivl_vec3_t a, ivl_vec3_t b)
{
    return ivl_vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/// Body axes in W of a unit quaternion q_WB.
static inline ivl_axes_t ivl_axes_of(ivl_quat_t q_WB)
{
    // doubled products: each appears in several elements
    const ivl_num_t xx = 2.0f * q_WB.x * q_WB.x, yy = 2.0f * q_WB.y * q_WB.y, zz = 2.0f * q_WB.z * q_WB.z;
    const ivl_num_t xy = 2.0f * q_WB.x * q_WB.y, xz = 2.0f * q_WB.x * q_WB.z, yz = 2.0f * q_WB.y * q_WB.z;
    const ivl_num_t wx = 2.0f * q_WB.w * q_WB.x, wy = 2.0f * q_WB.w * q_WB.y, wz = 2.0f * q_WB.w * q_WB.z;
    return (ivl_axes_t){
        .x = {1.0f - (yy + zz), xy + wz, xz - wy},
        .y = {xy - wz, 1.0f - (xx + zz), yz + wx},
        .z = {xz + wy, yz - wx, 1.0f - (xx + yy)},
    };
}

/// True if every component lies in [-limit, limit]; false for NaN.
bool ivl_vec3_within(ivl_vec3_t a, float limit);

/// Sine and cosine, absolute error below 1.5e-7 for |x| <= 100 rad; {0, 1} for anything else, NaN included.
ivl_sincos_t ivl_sincos(float x_rad);

/// Tangent, relative error below 4e-7 for |x| <= 1.5 rad; the argument is limited to that range (NaN: the lower end).
float ivl_tan(float x_rad);

/// Logistic function 1 / (1 + exp(-x)), absolute error below 2e-7; NaN gives 0.
float ivl_logistic(float x);
#endif  // IVL_MATH_H
