/// @file world_pace.h
/// The step of a world: graded after events, short while a plate presses, no longer than the motion of the legs allows.
/// [MODEL sec. 7]
#ifndef IVL_WORLD_PACE_H
#define IVL_WORLD_PACE_H

#include "world_group.h"

/// After an event the motion of a world begins anew, with a short step; from there it grows.
void world_restart_step(ivl_sim_group_t *group, int lane);

/// Grows the steps of these lanes, up to what is accurate; and no longer than the legs allow at present.
void world_grow_step(ivl_sim_group_t *group, ivl_mask_t which);

/// The next step of each lane.
ivl_wide_t world_next_step(const ivl_sim_group_t *group);

/// Longest step of each lane that the forces which the tried one has met allow.
ivl_wide_t world_longest_retry(const ivl_sim_group_t *group);

#endif  // IVL_WORLD_PACE_H
