/// @file world_events.h
/// Contact events: where feet and plates meet the surface, and what that does to a vehicle.      [MODEL sec. 7]
#ifndef IVL_WORLD_EVENTS_H
#define IVL_WORLD_EVENTS_H

#include "world_group.h"

/// Share of a step, beyond its end.
#define WORLD_NO_EVENT 2.0

/// Height of the surface in each lane.
ivl_wide_t world_surface_m(const ivl_sim_group_t *group, ivl_wide_t t_s);

/// Distances that make an event when they pass zero: of feet that may stick, and of plates that have not touched yet.
/// @param[in] which     lanes that are looked at
/// @param[in,out] gap   of these lanes
/// @return those of them that are not far from the surface
ivl_mask_t world_gaps(const ivl_sim_group_t *group, const ivl_sim_state_t *s, ivl_wide_t t_s, ivl_mask_t which,
                      ivl_wide_t gap[IVL_SIM_GAPS]);

/// Share of the tried step after which the earliest event happens, from the gaps before and after it.
/// @param[in] which  lanes that are looked at; the others have no event
ivl_wide_t world_event_share(ivl_sim_group_t *group, ivl_mask_t which);

/// Feet and plates that have arrived at the surface, at the gaps before the step.  Feet that arrive together are stopped together.
/// @param[in] which  lanes that are looked at
void world_handle_touches(ivl_sim_group_t *group, ivl_mask_t which);

/// Held feet: a sliding one sticks after the delay or lifts off, a stuck one comes off beyond the adhesion.
/// @param[in] which  lanes that are looked at
/// @return those in which any did: the forces have jumped
ivl_mask_t world_handle_held(ivl_sim_group_t *group, ivl_mask_t which);

#endif  // IVL_WORLD_EVENTS_H
