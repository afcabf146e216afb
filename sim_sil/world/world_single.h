/// @file world_single.h
/// Single precision numbers of several vehicles side by side: what the flight core's pure stages are compiled with (ivl_num.h).
#ifndef IVL_WORLD_SINGLE_H
#define IVL_WORLD_SINGLE_H

#include "phys_wide.h"

typedef float   ivl_single_t __attribute__((vector_size(sizeof(float) * IVL_SIM_LANES)));
typedef int32_t ivl_single_mask_t __attribute__((vector_size(sizeof(int32_t) * IVL_SIM_LANES)));

/// The same number in all lanes; a wide number as it is.
#define IVL_SINGLE(x) ((x) - (ivl_single_t){0.0f})

IVL_SIM_INLINE ivl_single_t ivl_single_select(ivl_single_mask_t m, ivl_single_t yes, ivl_single_t no)
{
    return (ivl_single_t)((m & (ivl_single_mask_t)yes) | (~m & (ivl_single_mask_t)no));
}

IVL_SIM_INLINE ivl_single_t ivl_single_sqrt(ivl_single_t a)
{
    ivl_single_t r;
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        r[i] = sqrtf(a[i]);
    }
    return r;
}

IVL_SIM_INLINE ivl_single_t ivl_single_abs(ivl_single_t a)
{
    return (ivl_single_t)((ivl_single_mask_t)a & 0x7fffffff);
}

#endif  // IVL_WORLD_SINGLE_H
