/// @file ivl_maneuver.c
#include "ivl_maneuver.h"

#include "ivl_math.h"

void ivl_maneuver_thrusts(const ivl_cfg_t *cfg, float moment_Nm, float thrust_N[4])
{
    // two motors, each at arm_x ahead of the b_y axis: M = 2 f arm_x
    const float front_N = ivl_clamp(moment_Nm / (2.0f * cfg->arm_x_m), 0.0f, cfg->motor_thrust_N_max);
    thrust_N[0] = front_N;
    thrust_N[1] = 0.0f;
    thrust_N[2] = 0.0f;
    thrust_N[3] = front_N;
}
