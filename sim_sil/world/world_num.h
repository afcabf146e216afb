/// @file world_num.h
/// The flight core's numbers as those of several vehicles: see ivl_num.h.  For world_drive.c alone.
#ifndef IVL_WORLD_NUM_H
#define IVL_WORLD_NUM_H

#include "world_single.h"

typedef ivl_single_t ivl_num_t;

#define ivl_num(x)                   IVL_SINGLE(x)
#define ivl_pick(condition, yes, no) ivl_single_select((condition), (yes), (no))
#define ivl_root(x)                  ivl_single_sqrt(x)
#define ivl_magnitude(x)             ivl_single_abs(x)

// beside the functions of one vehicle
#define ivl_controller_compute ivl_controller_compute_lanes
#define ivl_mixer_thrusts      ivl_mixer_thrusts_lanes
#define ivl_mixer_wrench       ivl_mixer_wrench_lanes

#endif  // IVL_WORLD_NUM_H
