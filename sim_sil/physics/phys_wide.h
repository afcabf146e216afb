/// @file phys_wide.h
/// Numbers, vectors and rotations of several rollouts side by side, one in each lane.  Pure, no state.
#ifndef IVL_PHYS_WIDE_H
#define IVL_PHYS_WIDE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "phys_vector.h"

// Vectors are passed by value only between inlined functions, so how the ABI would pass them does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"

// Short loops over matrix elements are written out, so that their indices cost nothing.
#if defined(__clang__)
#define IVL_SIM_UNROLL _Pragma("unroll")
#else
#define IVL_SIM_UNROLL _Pragma("GCC unroll 16")
#endif

/// Rollouts that are stepped together, one in each double of a register; a power of two.  Physics and world are compiled once for each width
/// of registers that a machine may have (tools/native.mk); everything else sees the narrowest, which every machine has.
#if !defined(IVL_SIM_LANES)
#define IVL_SIM_LANES 2
#endif

/// A function of which there is one for each width: sim_width.h chooses among them.
#define IVL_SIM_OF_WIDTH(name)       IVL_SIM_WITH_LANES(name, IVL_SIM_LANES)
#define IVL_SIM_WITH_LANES(name, n)  IVL_SIM_WITH_LANES_(name, n)
#define IVL_SIM_WITH_LANES_(name, n) name##_lanes##n

/// One number of each of several rollouts, in one register.  Every operation acts on each lane alone, and rounds alike in registers of any
/// width (there is no fused multiply-add), so a lane's bits depend neither on its neighbours nor on the width.
typedef double     ivl_wide_t __attribute__((vector_size(sizeof(double) * IVL_SIM_LANES)));
typedef int64_t    ivl_mask_t __attribute__((vector_size(sizeof(int64_t) * IVL_SIM_LANES)));  ///< comparison: all bits set, or none
typedef ivl_mask_t ivl_whole_t;  ///< whole numbers: a mask is 0 or -1 in each lane

/// The same number in all lanes.
IVL_SIM_INLINE ivl_wide_t ivl_wide(double a)
{
    return a - (ivl_wide_t){0.0};  // exact for any a, -0 and NaN included
}

IVL_SIM_INLINE ivl_wide_t ivl_wide_sqrt(ivl_wide_t a)
{
    ivl_wide_t r;
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        r[i] = sqrt(a[i]);
    }
    return r;
}

IVL_SIM_INLINE ivl_wide_t ivl_wide_select(ivl_mask_t m, ivl_wide_t yes, ivl_wide_t no)
{
    return (ivl_wide_t)((m & (ivl_mask_t)yes) | (~m & (ivl_mask_t)no));
}

IVL_SIM_INLINE ivl_wide_t ivl_wide_abs(ivl_wide_t a)
{
    return (ivl_wide_t)((ivl_mask_t)a & 0x7fffffffffffffffLL);
}

/// The smaller of two numbers; b unless a < b.
IVL_SIM_INLINE ivl_wide_t ivl_wide_smaller(ivl_wide_t a, ivl_wide_t b)
{
    return ivl_wide_select(a < b, a, b);
}

/// The larger of two numbers; b unless a > b.
IVL_SIM_INLINE ivl_wide_t ivl_wide_larger(ivl_wide_t a, ivl_wide_t b)
{
    return ivl_wide_select(a > b, a, b);
}

/// Nearest whole number of |a| < 2^51: so large a number is added that no digits are left for the rest.
IVL_SIM_INLINE ivl_wide_t ivl_wide_nearest(ivl_wide_t a)
{
    return (a + 6755399441055744.0) - 6755399441055744.0;
}

/// Largest whole number that is not above a, |a| < 2^51.
IVL_SIM_INLINE ivl_wide_t ivl_wide_floor(ivl_wide_t a)
{
    const ivl_wide_t near = ivl_wide_nearest(a);
    return near - ivl_wide_select(near > a, ivl_wide(1.0), ivl_wide(0.0));
}

/// Smallest whole number that is not below a, |a| < 2^51.
IVL_SIM_INLINE ivl_wide_t ivl_wide_ceil(ivl_wide_t a)
{
    const ivl_wide_t near = ivl_wide_nearest(a);
    return near + ivl_wide_select(near < a, ivl_wide(1.0), ivl_wide(0.0));
}

/// The same answer in all lanes.
IVL_SIM_INLINE ivl_mask_t ivl_mask(bool yes)
{
    return (ivl_mask_t){0} - (yes ? 1 : 0);
}

/// True if the mask is set in any lane.  Compilers make of the loop a long chain, so where there is an instruction for it, it is named.
IVL_SIM_INLINE bool ivl_mask_any(ivl_mask_t m)
{
#if defined(__AVX512DQ__) && IVL_SIM_LANES == 8
    return _mm512_movepi64_mask((__m512i)m) != 0;
#elif defined(__AVX__) && IVL_SIM_LANES == 4
    return _mm256_movemask_pd((__m256d)m) != 0;
#elif defined(__SSE2__) && IVL_SIM_LANES == 2
    return _mm_movemask_pd((__m128d)m) != 0;
#else
    int64_t any = 0;
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        any |= m[i];
    }
    return any != 0;
#endif
}

/// A vector of each of several rollouts.
typedef struct
{
    ivl_wide_t x, y, z;
} ivl_w3_t;

/// The vector of one rollout.
IVL_SIM_INLINE ivl_d3_t ivl_w3_lane(const ivl_w3_t *a, int lane)
{
    return (ivl_d3_t){a->x[lane], a->y[lane], a->z[lane]};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_of(ivl_d3_t a)
{
    return (ivl_w3_t){ivl_wide(a.x), ivl_wide(a.y), ivl_wide(a.z)};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_add(ivl_w3_t a, ivl_w3_t b)
{
    return (ivl_w3_t){a.x + b.x, a.y + b.y, a.z + b.z};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_sub(ivl_w3_t a, ivl_w3_t b)
{
    return (ivl_w3_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_scale(ivl_wide_t s, ivl_w3_t a)
{
    return (ivl_w3_t){s * a.x, s * a.y, s * a.z};
}

/// a + s b
IVL_SIM_INLINE ivl_w3_t ivl_w3_plus(ivl_w3_t a, ivl_wide_t s, ivl_w3_t b)
{
    return (ivl_w3_t){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

IVL_SIM_INLINE ivl_wide_t ivl_w3_dot(ivl_w3_t a, ivl_w3_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// dot and cross product with a vector that is the same in all lanes
IVL_SIM_INLINE ivl_wide_t ivl_w3_dot_d3(ivl_w3_t a, ivl_d3_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_cross(ivl_w3_t a, ivl_w3_t b)
{
    return (ivl_w3_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_cross_d3(ivl_w3_t a, ivl_d3_t b)
{
    return (ivl_w3_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

IVL_SIM_INLINE ivl_w3_t ivl_w3_cross_from_d3(ivl_d3_t a, ivl_w3_t b)
{
    return (ivl_w3_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Rotation matrices body to world, by rows.
typedef struct
{
    ivl_w3_t row[3];
} ivl_wrot_t;

IVL_SIM_INLINE ivl_wrot_t ivl_wrot_from_quat(const ivl_wide_t q[4])
{
    const ivl_wide_t x = q[0], y = q[1], z = q[2], w = q[3];
    const ivl_wide_t s = 2.0 / (x * x + y * y + z * z + w * w);
    const ivl_wide_t xs = x * s, ys = y * s, zs = z * s;
    ivl_wrot_t       R;
    R.row[0] = (ivl_w3_t){1.0 - (y * ys + z * zs), x * ys - w * zs, x * zs + w * ys};
    R.row[1] = (ivl_w3_t){x * ys + w * zs, 1.0 - (x * xs + z * zs), y * zs - w * xs};
    R.row[2] = (ivl_w3_t){x * zs - w * ys, y * zs + w * xs, 1.0 - (x * xs + y * ys)};
    return R;
}

IVL_SIM_INLINE ivl_w3_t ivl_wrot_apply(const ivl_wrot_t *R, ivl_w3_t a)
{
    return (ivl_w3_t){ivl_w3_dot(R->row[0], a), ivl_w3_dot(R->row[1], a), ivl_w3_dot(R->row[2], a)};
}

/// A vector that is the same in all lanes, in the axes that each lane's rotation is of.
IVL_SIM_INLINE ivl_w3_t ivl_wrot_apply_inverse_d3(const ivl_wrot_t *R, ivl_d3_t a)
{
    return ivl_w3_plus(ivl_w3_plus(ivl_w3_scale(ivl_wide(a.x), R->row[0]), ivl_wide(a.y), R->row[1]), ivl_wide(a.z), R->row[2]);
}

/// The same for a unit vector.  For z the products with 0 and 1 are left out: they would change no number.
IVL_SIM_INLINE ivl_w3_t ivl_wrot_direction(const ivl_wrot_t *R, ivl_d3_t a)
{
    return ivl_d3_is_z(a) ? R->row[2] : ivl_wrot_apply_inverse_d3(R, a);
}

IVL_SIM_INLINE ivl_w3_t ivl_wrot_apply_inverse(const ivl_wrot_t *R, ivl_w3_t a)
{
    return ivl_w3_plus(ivl_w3_plus(ivl_w3_scale(a.x, R->row[0]), a.y, R->row[1]), a.z, R->row[2]);
}

#endif  // IVL_PHYS_WIDE_H
