/// @file phys_energy.h
/// Energy and momentum of one vehicle, from its state alone.
#ifndef IVL_PHYS_ENERGY_H
#define IVL_PHYS_ENERGY_H

#include "phys_state.h"

/// Kinetic, gravitational and elastic energy, J; the surface is where it is at present.                                                 [MODEL eq. 4.15]
double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double surface_height_m);

/// Linear momentum, and angular momentum about the world's origin, SI.
void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double linear[3], double angular[3]);

#endif  // IVL_PHYS_ENERGY_H
