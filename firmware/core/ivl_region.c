/// @file ivl_region.c
#include "ivl_region.h"

#include "ivl_math.h"

// with no thrust left to accelerate with, the aim is still finite: what cannot be reached is left to the rule approach_time
static const float ACCEL_MPS2_MIN = 0.1f;

static float most(float a, float b)
{
    return (a > b) ? a : b;
}

static float least(float a, float b)
{
    return (a < b) ? a : b;
}

bool ivl_region_knows(const ivl_cfg_t *cfg, const ivl_room_t *room)
{
    return (room->d_ceil_m > 0.0f) && (room->d_ceil_m <= cfg->d_ceil_m_max);
}

// each component raised to the region, the one towards the ceiling first, within speed_max                            [MODEL eq. 15.1]
static ivl_aim_t nominal(const ivl_cfg_t *cfg, ivl_aim_t asked)
{
    // what is asked is within speed_max, so no root is of a negative number
    const float square = cfg->speed_mps_max * cfg->speed_mps_max;
    const float vz = most(asked.vz_mps, least(cfg->region_vz_mps, sqrtf(square - asked.vx_mps * asked.vx_mps)));
    const float vx = most(asked.vx_mps, least(cfg->region_vx_mps, sqrtf(square - vz * vz)));
    return (ivl_aim_t){.vx_mps = vx, .vz_mps = vz};
}

// part of the rated thrust that the battery gives; the square is a little less than what is measured
static float battery_share(const ivl_cfg_t *cfg, float vbat_V)
{
    if (!(vbat_V > 0.0f) || !(vbat_V < cfg->vbat_V_rated))
    {
        return 1.0f;
    }
    const float share = vbat_V / cfg->vbat_V_rated;
    return share * share;
}

// Acceleration a along a direction (dir_z: its part upwards) for which the rotors have to make A: |a dir + g e3| = A     [MODEL eq. 15.2]
static float accel_mps2(const ivl_cfg_t *cfg, float vbat_V, float dir_z)
{
    const float g = cfg->gravity_mps2;
    const float full_mps2 = 4.0f * cfg->motor_thrust_N_max * battery_share(cfg, vbat_V) / cfg->mass_kg;
    const float used_mps2 = g + cfg->thrust_use_norm * most(full_mps2 - g, 0.0f);
    const float up_mps2 = g * dir_z;
    const float a = sqrtf(up_mps2 * up_mps2 + used_mps2 * used_mps2 - g * g) - up_mps2;
    return ivl_clamp(a, ACCEL_MPS2_MIN, cfg->approach_accel_mps2);
}

// Largest v with v t + v^2 / 2a within the room: the way of a time t, and a ramp from rest or braking                [MODEL eq. 15.3, 15.4]
static float within(float a_mps2, float t_s, float room_m)
{
    return a_mps2 * (sqrtf(t_s * t_s + 2.0f * most(room_m, 0.0f) / a_mps2) - t_s);
}

// the clamps take the slower end for what is no number: where nothing is to be accelerated, or a measured value is bad
ivl_aim_t ivl_region_aim(const ivl_cfg_t *cfg, const ivl_room_t *room, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, ivl_aim_t asked)
{
    ivl_aim_t   aim = nominal(cfg, asked);
    const float dx = aim.vx_mps - v_W_mps.x, dz = aim.vz_mps - v_W_mps.z, dv = sqrtf(dx * dx + dz * dz);
    const float dir_z = (dv > 0.0f) ? dz / dv : 1.0f;
    aim.accel_mps2 = accel_mps2(cfg, room->vbat_V, dir_z);

    // a vehicle that is faster already is not braked: that would take room, too
    const bool  knows = ivl_region_knows(cfg, room);
    const float up_m = cfg->fence_z_m_max - p_W_m.z, d_m = room->d_ceil_m;
    const float room_z_m = (knows && !(up_m < d_m)) ? d_m : up_m;
    const float az_mps2 = aim.accel_mps2 * dir_z;
    const float vz = within(az_mps2, 1.0f / cfg->region_rrev_per_s, room_z_m + 0.5f * v_W_mps.z * v_W_mps.z / az_mps2);
    aim.vz_mps = ivl_clamp(vz, most(asked.vz_mps, least(v_W_mps.z, aim.vz_mps)), aim.vz_mps);

    if (knows && (aim.vz_mps > 0.0f))
    {
        // what the present speed carries the vehicle on while it changes
        const float on_m = 0.5f * most(v_W_mps.x, 0.0f) * dv / aim.accel_mps2;
        const float vx = within(cfg->approach_accel_mps2, d_m / aim.vz_mps, cfg->fence_x_m_max - p_W_m.x - on_m);
        aim.vx_mps = ivl_clamp(vx, asked.vx_mps, aim.vx_mps);
    }
    return aim;
}
