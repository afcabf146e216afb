/// @file ivl_region.h
/// Shape REGION of the approach: the velocity at which the vehicle is to meet the ceiling.  Pure.                    [MODEL section 15]
///
/// A policy lands well in a region of velocities only, at least region_vx along the ceiling and region_vz towards it.  The aim is the commanded
/// velocity, each component raised to that; then
///   1. not faster than speed_max,
///   2. towards the ceiling not faster than can be reached, with the acceleration that the thrust left allows, before RREV is region_rrev,
///   3. along the ceiling not faster than can be braked inside the fence, from where the ceiling would be met.
/// No limit makes a component slower than commanded: the operator's command stands, and the rules (fence, go / no-go) watch over it.
/// The limits are exact for a vehicle that hovers at the start.
#ifndef IVL_REGION_H
#define IVL_REGION_H
#include "ivl_cfg.h"

/// What is known of what is left.
typedef struct
{
    float d_ceil_m;  ///< distance to the plane of the cues; 0 or NaN: not known
    float vbat_V;    ///< battery, as measured in flight; 0 or NaN: not known
} ivl_room_t;

/// A velocity in the x-z plane of W, and how to get there.
typedef struct
{
    float vx_mps;      ///< >= 0
    float vz_mps;      ///< >= 0
    float accel_mps2;  ///< of the straight change of velocity, > 0
} ivl_aim_t;

/// True if the distance is known: limits 2 (but for the fence above) and 3 need it.
bool ivl_region_knows(const ivl_cfg_t *cfg, const ivl_room_t *room);

/// @param[in] p_W_m    where the change of velocity begins
/// @param[in] v_W_mps  from which velocity; finite, as the core has checked
/// @param[in] asked    the commanded velocity, both components >= 0; its acceleration is not used
ivl_aim_t ivl_region_aim(const ivl_cfg_t *cfg, const ivl_room_t *room, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, ivl_aim_t asked);
#endif  // IVL_REGION_H
