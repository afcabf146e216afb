/// @file ivl_approach.c
#include "ivl_approach.h"

#include "ivl_math.h"

void ivl_approach_begin(ivl_approach_t *approach, ivl_vec3_t p_WB_m, ivl_vec3_t v_WB_mps, float speed_mps, float angle_rad)
{
    const ivl_sincos_t dir = ivl_sincos(angle_rad);
    *approach = (ivl_approach_t){
        .p_W_m = p_WB_m,
        .dir_x = dir.cos,
        .dir_z = dir.sin,
        .speed_mps = v_WB_mps.x * dir.cos + v_WB_mps.z * dir.sin,
        .target_mps = speed_mps,
    };
}

ivl_reference_t ivl_approach_next(const ivl_cfg_t *cfg, ivl_approach_t *approach, float dt_s)
{
    const ivl_vec3_t dir = {approach->dir_x, 0.0f, approach->dir_z};

    // speed change of the coming tick, limited by the acceleration; zero once the target is reached
    const float dv_mps_max = cfg->approach_accel_mps2 * dt_s;
    const float dv_mps = ivl_clamp(approach->target_mps - approach->speed_mps, -dv_mps_max, dv_mps_max);

    const ivl_reference_t ref = {
        .p_W_m = approach->p_W_m,
        .v_W_mps = ivl_scale(dir, approach->speed_mps),
        .a_W_mps2 = ivl_scale(dir, dv_mps * cfg->tick_hz),
    };

    // constant acceleration over the tick
    const float ds_m = (approach->speed_mps + 0.5f * dv_mps) * dt_s;
    approach->p_W_m = ivl_add(approach->p_W_m, ivl_scale(dir, ds_m));
    approach->speed_mps += dv_mps;
    return ref;
}
