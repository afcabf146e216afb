/// @file phys_impulse.h
/// The impulse of a foot that sticks.
#ifndef IVL_PHYS_IMPULSE_H
#define IVL_PHYS_IMPULSE_H

#include "phys_mass.h"
#include "phys_state.h"

/// Velocities after held feet that still move are brought to rest at once, without rebound: the projection of the
/// motion, in the metric of the kinetic energy, on what the constraints allow.                   [MODEL eq. 4.14]
void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_foot_t foot[IVL_SIM_LEGS], ivl_sim_kin_t *kin);

#endif  // IVL_PHYS_IMPULSE_H
