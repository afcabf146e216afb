/// @file ivl_vision_warp.h
/// The earlier picture as the present camera would see it, row by row.
#ifndef IVL_VISION_WARP_H
#define IVL_VISION_WARP_H

#include "ivl_vision_fit.h"

/// Map from pixels of the present picture to pixels of the earlier one: (a x, b x) / c x with x = (column, row, 1), Q23.
typedef struct
{
    int64_t row_q23[3][3];
} ivl_vision_map_t;

/// @return false if the window is seen from a place that the fit does not reach
bool ivl_vision_map(const ivl_vision_pair_t *pair, const ivl_vision_belief_t *belief, int x0, int y0, ivl_vision_map_t *map);

/// Row y of the present picture from column x0 on, drawn from the earlier one; pixels outside of it are holes.
void ivl_vision_warp_row(const ivl_vision_pair_t *pair, const ivl_vision_map_t *map, int x0, int y, int n, int32_t gain_q12, int32_t offset,
                         int16_t *out);

#endif  // IVL_VISION_WARP_H
