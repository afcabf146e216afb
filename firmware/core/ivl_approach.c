/// @file ivl_approach.c
#include "ivl_approach.h"

#include "ivl_math.h"

// shape REGION: from the present velocity straight to the aim
static void aim_anew(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room)
{
    approach->aim = ivl_region_aim(cfg, room, approach->p_W_m, approach->from_W_mps, approach->asked);
    const float dx = approach->aim.vx_mps - approach->from_W_mps.x, dz = approach->aim.vz_mps - approach->from_W_mps.z;
    const float dv_mps = sqrtf(dx * dx + dz * dz);
    approach->dir_x = (dv_mps > 0.0f) ? dx / dv_mps : 0.0f;
    approach->dir_z = (dv_mps > 0.0f) ? dz / dv_mps : 1.0f;
    approach->speed_mps = 0.0f;
    approach->target_mps = dv_mps;
    approach->open = !ivl_region_knows(cfg, room);
}

void ivl_approach_begin(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room, ivl_vec3_t p_WB_m, ivl_vec3_t v_WB_mps,
                        float speed_mps, float angle_rad)
{
    const ivl_sincos_t dir = ivl_sincos(angle_rad);
    const float        target_mps = (cfg->shape == (uint8_t)IVL_SHAPE_ACCELERATE) ? cfg->speed_mps_max : speed_mps;
    *approach = (ivl_approach_t){
        .p_W_m = p_WB_m,
        .dir_x = dir.cos,
        .dir_z = dir.sin,
        .speed_mps = v_WB_mps.x * dir.cos + v_WB_mps.z * dir.sin,
        .target_mps = target_mps,
        .aim = {.vx_mps = target_mps * dir.cos, .vz_mps = target_mps * dir.sin, .accel_mps2 = cfg->approach_accel_mps2},
        .last_mps = cfg->shape_speed_norm * speed_mps,
    };
    if (cfg->shape == (uint8_t)IVL_SHAPE_REGION)
    {
        // the cosine of a right angle is not exactly 0
        approach->asked.vx_mps = ivl_clamp(approach->aim.vx_mps, 0.0f, speed_mps);
        approach->asked.vz_mps = ivl_clamp(approach->aim.vz_mps, 0.0f, speed_mps);
        approach->from_W_mps = ivl_vec3(v_WB_mps.x, 0.0f, v_WB_mps.z);
        aim_anew(cfg, approach, room);
    }
}

void ivl_approach_look(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room)
{
    if (approach->open && ivl_region_knows(cfg, room))
    {
        approach->from_W_mps.x += approach->dir_x * approach->speed_mps;
        approach->from_W_mps.z += approach->dir_z * approach->speed_mps;
        aim_anew(cfg, approach, room);
    }
}

// RREV stays as it is while the speed falls with the distance: v' = -RREV v                                     [MODEL eq. 13.16]
static float braking_mps(const ivl_cfg_t *cfg, ivl_approach_t *approach, float rrev_per_s, float dt_s)
{
    approach->closing = approach->closing || (rrev_per_s >= cfg->shape_rrev_per_s);
    if (!approach->closing || !(approach->speed_mps > approach->last_mps))
    {
        return 0.0f;
    }
    approach->target_mps = approach->last_mps;
    const float left_mps = approach->speed_mps - approach->last_mps;
    // braking by less than the present RREV would let it run away
    const float held_per_s = (rrev_per_s > cfg->shape_rrev_per_s) ? rrev_per_s : cfg->shape_rrev_per_s;
    const float asked_mps = held_per_s * approach->speed_mps * dt_s;
    return (asked_mps < left_mps) ? asked_mps : left_mps;
}

ivl_reference_t ivl_approach_next(const ivl_cfg_t *cfg, ivl_approach_t *approach, float rrev_per_s, float dt_s)
{
    const ivl_vec3_t dir = {approach->dir_x, 0.0f, approach->dir_z};

    // speed change of the coming tick, limited by the acceleration; zero once the target is reached
    const float dv_mps_max = approach->aim.accel_mps2 * dt_s;
    float       dv_mps = ivl_clamp(approach->target_mps - approach->speed_mps, -dv_mps_max, dv_mps_max);
    if (cfg->shape == (uint8_t)IVL_SHAPE_RREV)
    {
        const float brake_mps = braking_mps(cfg, approach, rrev_per_s, dt_s);
        dv_mps = (brake_mps > 0.0f) ? -brake_mps : dv_mps;
    }

    approach->accel_mps2 = dv_mps * cfg->tick_hz;
    ivl_reference_t ref = {
        .p_W_m = approach->p_W_m,
        .v_W_mps = ivl_scale(dir, approach->speed_mps),
        .a_W_mps2 = ivl_scale(dir, approach->accel_mps2),
    };

    // constant acceleration over the tick
    const float ds_m = (approach->speed_mps + 0.5f * dv_mps) * dt_s;
    approach->p_W_m = ivl_add(approach->p_W_m, ivl_scale(dir, ds_m));
    approach->speed_mps += dv_mps;
    if (cfg->shape == (uint8_t)IVL_SHAPE_REGION)
    {
        ref.v_W_mps = ivl_add(ref.v_W_mps, approach->from_W_mps);
        approach->p_W_m = ivl_add(approach->p_W_m, ivl_scale(approach->from_W_mps, dt_s));
    }
    return ref;
}
