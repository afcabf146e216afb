/// @file ivl_approach.c
#include "ivl_approach.h"

#include <string.h>

#include "ivl_math.h"

// a sensor with a measurement in every tick must not put the aim off for ever
static const uint8_t PUT_OFF_MAX = 8u;

void ivl_approach_begin(const ivl_cfg_t *cfg, ivl_approach_t *approach, ivl_vec3_t p_WB_m, ivl_vec3_t v_WB_mps, float speed_mps,
                        float angle_rad)
{
    const ivl_sincos_t dir = ivl_sincos(angle_rad);
    memset(approach, 0, sizeof *approach);
    approach->p_W_m = p_WB_m;
    approach->dir_x = dir.cos;
    approach->dir_z = dir.sin;
    approach->last_mps = cfg->shape_speed_norm * speed_mps;
    approach->target_mps = (cfg->shape == (uint8_t)IVL_SHAPE_ACCELERATE) ? cfg->speed_mps_max : speed_mps;
    approach->aim.vx_mps = approach->target_mps * dir.cos;
    approach->aim.vz_mps = approach->target_mps * dir.sin;
    approach->aim.accel_mps2 = cfg->approach_accel_mps2;
    approach->speed_mps = v_WB_mps.x * dir.cos + v_WB_mps.z * dir.sin;
    if (cfg->shape == (uint8_t)IVL_SHAPE_REGION)
    {
        // the present velocity, until there is an aim; the cosine of a right angle is not exactly 0
        approach->asked.vx_mps = ivl_clamp(approach->aim.vx_mps, 0.0f, speed_mps);
        approach->asked.vz_mps = ivl_clamp(approach->aim.vz_mps, 0.0f, speed_mps);
        approach->from_x_mps = v_WB_mps.x;
        approach->from_z_mps = v_WB_mps.z;
        approach->speed_mps = 0.0f;
        approach->target_mps = 0.0f;
        approach->wants = IVL_APPROACH_AIM;
    }
}

void ivl_approach_aim(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room, bool busy)
{
    const bool knows = ivl_region_knows(cfg, room);
    if ((approach->wants == (uint8_t)IVL_APPROACH_NOTHING) || ((approach->wants == (uint8_t)IVL_APPROACH_DISTANCE) && !knows))
    {
        return;
    }
    if (busy && (approach->n_put_off < PUT_OFF_MAX))
    {
        approach->n_put_off++;
        return;
    }
    // from the present velocity straight to the aim
    approach->from_x_mps += approach->dir_x * approach->speed_mps;
    approach->from_z_mps += approach->dir_z * approach->speed_mps;
    const ivl_vec3_t from = {approach->from_x_mps, 0.0f, approach->from_z_mps};
    approach->aim = ivl_region_aim(cfg, room, approach->p_W_m, from, approach->asked);
    const float dx = approach->aim.vx_mps - from.x, dz = approach->aim.vz_mps - from.z;
    const float dv_mps = sqrtf(dx * dx + dz * dz);
    approach->dir_x = (dv_mps > 0.0f) ? dx / dv_mps : 0.0f;
    approach->dir_z = (dv_mps > 0.0f) ? dz / dv_mps : 1.0f;
    approach->speed_mps = 0.0f;
    approach->target_mps = dv_mps;
    approach->wants = (uint8_t)(knows ? IVL_APPROACH_NOTHING : IVL_APPROACH_DISTANCE);
    approach->n_put_off = 0;
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
        ref.v_W_mps.x += approach->from_x_mps;
        ref.v_W_mps.z += approach->from_z_mps;
        approach->p_W_m.x += approach->from_x_mps * dt_s;
        approach->p_W_m.z += approach->from_z_mps * dt_s;
    }
    return ref;
}
