/// @file phys_step.h
/// One step of the motion of rigid bodies with four articulated legs, several vehicles side by side.
#ifndef IVL_PHYS_STEP_H
#define IVL_PHYS_STEP_H

#include "phys_mass.h"
#include "phys_state.h"

/// One step of every lane, each of its own length: leapfrog with one evaluation, at the middle of the step, with the
/// velocities there predicted from the last one.  dt = 0 evaluates without moving, to begin.     [MODEL eq. 7.1 - 7.5]
/// @param[in] last   of the lane's previous step, or of a step of length 0 after a discontinuity
/// @param[out] next, rate
void ivl_sim_leapfrog(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load, const ivl_wide_t *dt_s,
                      const ivl_sim_state_t *state, const ivl_sim_rate_t *last, ivl_sim_state_t *next, ivl_sim_rate_t *rate);

#endif  // IVL_PHYS_STEP_H
