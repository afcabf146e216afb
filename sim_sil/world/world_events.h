/// @file world_events.h
/// Contact events: where feet and plates meet the surface, and what that does to a vehicle.      [MODEL sec. 7]
#ifndef IVL_WORLD_EVENTS_H
#define IVL_WORLD_EVENTS_H

#include "world_group.h"

/// Share of a step, beyond its end.
#define WORLD_NO_EVENT 2.0

/// Distances that make an event when they pass zero: of feet that may stick, and of plates that have not touched yet.
/// @return false if the surface is far from all of them
bool world_gaps(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane, double t_s, double gap[IVL_SIM_GAPS]);

/// Share of the tried step after which the earliest event happens.
double world_event_share(ivl_sim_group_t *group, int lane);

/// Feet and plates that have arrived at the surface.  Feet that arrive together are stopped together.
void world_handle_touches(ivl_sim_group_t *group, int lane, const double gap[IVL_SIM_GAPS]);

/// Held feet: a sliding one sticks after the delay or lifts off, a stuck one comes off beyond the adhesion.
/// @return true if any did: the forces have jumped
bool world_handle_held(ivl_sim_group_t *group, int lane);

#endif  // IVL_WORLD_EVENTS_H
