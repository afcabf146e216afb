/// @file planar.h
/// A vehicle to fly in the examples: a rigid body in the x-z plane under a ceiling, with ideal motors.  It is no simulator of landings
/// (that is sim_sil): it has no legs, and what it does ends where legs would touch the ceiling.
#ifndef EXAMPLES_PLANAR_H
#define EXAMPLES_PLANAR_H

#include <math.h>

#include "ivl.h"

#define PLANAR_REACH_M 0.1f  ///< of legs, from the body's origin

typedef struct
{
    float x_m, z_m, vx_mps, vz_mps;
    float pitch_rad, rate_radps;  ///< about b_y: positive is nose down
    float fx_B_mps2, fz_B_mps2;   ///< what an accelerometer feels
} planar_t;

/// One tick of the motion.
static inline void planar_step(const ivl_cfg_t *cfg, planar_t *body, float thrust_N, float moment_Nm)
{
    const float dt_s = 1.0f / cfg->tick_hz;
    const float along = thrust_N / cfg->mass_kg;
    body->fx_B_mps2 = 0.0f;
    body->fz_B_mps2 = along;
    body->rate_radps += dt_s * moment_Nm / cfg->jyy_kgm2;
    body->pitch_rad += dt_s * body->rate_radps;
    body->vx_mps += dt_s * along * sinf(body->pitch_rad);
    body->vz_mps += dt_s * (along * cosf(body->pitch_rad) - cfg->gravity_mps2);
    body->x_m += dt_s * body->vx_mps;
    body->z_m += dt_s * body->vz_mps;
}

/// What a port has to fill in each tick: time, pose, velocity, rate, specific force.  The command and the vitals are the caller's.
static inline void planar_sense(const planar_t *body, uint64_t t_us, ivl_in_t *in)
{
    in->t_us = t_us;
    in->t_pose_us = t_us;
    in->p_WB_m.x = body->x_m;
    in->p_WB_m.z = body->z_m;
    in->v_WB_mps.x = body->vx_mps;
    in->v_WB_mps.z = body->vz_mps;
    in->q_WB.y = sinf(0.5f * body->pitch_rad);
    in->q_WB.w = cosf(0.5f * body->pitch_rad);
    in->w_B_radps.y = body->rate_radps;
    in->f_B_mps2.x = body->fx_B_mps2;
    in->f_B_mps2.z = body->fz_B_mps2;
}
#endif  // EXAMPLES_PLANAR_H
