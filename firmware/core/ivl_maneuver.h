/// @file ivl_maneuver.h
/// Stage 5a: the flip.  Collective 0, the front pair alone makes the nose-up moment [S].
#ifndef IVL_MANEUVER_H
#define IVL_MANEUVER_H
#include "ivl_cfg.h"

/// Thrusts of the flip: M1 and M4 get M / (2 arm_x) each, limited to [0, motor_thrust_N_max]; M2 and M3 get 0.
/// @param[in]  moment_Nm  magnitude of the nose-up (negative b_y) moment, >= 0
/// @param[out] thrust_N   M1..M4
void ivl_maneuver_thrusts(const ivl_cfg_t *cfg, float moment_Nm, float thrust_N[4]);
#endif  // IVL_MANEUVER_H
