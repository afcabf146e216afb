/// @file world_pace.h
/// The step of a world: graded after events, short while a plate presses, no longer than the motion of the legs allows.
/// [MODEL sec. 7]
#ifndef IVL_WORLD_PACE_H
#define IVL_WORLD_PACE_H

#include "world_group.h"

/// After an event the motion begins anew, with a short step; from there it grows.
void world_restart_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane);

/// Grows, up to what is accurate; and no longer than the legs allow at present.
void world_grow_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, const ivl_sim_rate_t *rate, int lane);

/// The next step of a lane.
double world_next_step(const ivl_sim_group_t *group, int lane);

/// Longest step that the forces which the tried one has met allow.
double world_longest_retry(const ivl_sim_group_t *group, int lane);

#endif  // IVL_WORLD_PACE_H
