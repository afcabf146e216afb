/// @file ivl_pwm.h
/// Stage 7: PWM of the thrust curve, PWM = a tan((f - b) / c) + d with f in gram-force [S].  The only place where gram-force appears.
#ifndef IVL_PWM_H
#define IVL_PWM_H
#include "ivl_cfg.h"

/// True if the argument of the tangent stays within +-1.4 rad from thrust 0 to motor_thrust_N_max, well away from the pole.
bool ivl_pwm_curve_good(const ivl_cfg_t *cfg);

/// PWM values of M1..M4 in [0, pwm_max], rounded down; thrust 0 (or NaN) gives exactly 0.
void ivl_pwm_of_thrust(const ivl_cfg_t *cfg, const float thrust_N[4], uint16_t pwm[4]);
#endif  // IVL_PWM_H
