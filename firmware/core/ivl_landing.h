/// @file ivl_landing.h
/// Stage 5d: after an abort, end a level-out, hover level, then descend straight down, or along a steep slope below, at land_speed to land_height.
/// A vehicle that is aborted on its way to the ceiling is not steered before it has turned: a tilt could bring a rotor to the ceiling.
#ifndef IVL_LANDING_H
#define IVL_LANDING_H
#include "ivl_state.h"

/// Reference of this tick of ABORTED; then advance p_hold_W_m, and landed_s once the reference has arrived.
ivl_reference_t ivl_landing_next(const ivl_cfg_t *cfg, ivl_state_t *state);
#endif  // IVL_LANDING_H
