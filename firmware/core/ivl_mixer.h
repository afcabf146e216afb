/// @file ivl_mixer.h
/// Stage 6: wrench to four motor thrusts and back.
/// Motors in B: M1 front-right (+x, -y), M2 rear-right (-x, -y), M3 rear-left (-x, +y), M4 front-left (+x, +y); a positive moment about b_y is nose down.
#ifndef IVL_MIXER_H
#define IVL_MIXER_H
#include "ivl_controller.h"

/// Thrusts M1..M4, each in [0, motor_thrust_N_max].  When the wrench does not fit: yaw is given up first; then, if motors are at their
/// maximum, collective thrust falls (never below half of the maximum) to keep roll and pitch; then roll and pitch are scaled together.
/// The collective thrust never exceeds the one asked for.
void ivl_mixer_thrusts(const ivl_cfg_t *cfg, const ivl_wrench_t *wrench, ivl_num_t thrust_N[4]);

/// The wrench that four thrusts make.
ivl_wrench_t ivl_mixer_wrench(const ivl_cfg_t *cfg, const ivl_num_t thrust_N[4]);
#endif  // IVL_MIXER_H
