/// @file ivl_surface.c
#include "ivl_surface.h"

#include "ivl_controller.h"

ivl_surface_t ivl_surface_of(const ivl_cfg_t *cfg)
{
    const ivl_sincos_t tilt = ivl_sincos(cfg->surface_tilt_rad);
    const float        s = tilt.sin, c = tilt.cos;
    // below a ceiling gravity brakes a vehicle that keeps its least lift; along x, and above a floor, the thrust does
    const float fall_mps2 = cfg->gravity_mps2 - IVL_LIFT_NORM_MIN * cfg->gravity_mps2;
    const float turn_s = (cfg->kp_att_xy_Nmprad > 0.0f) ? cfg->kd_rate_xy_Nmsprad / cfg->kp_att_xy_Nmprad : 0.0f;
    return (ivl_surface_t){
        .sin = s,
        .cos = c,
        .up_z_cut = sqrtf(0.5f * (1.0f - c)),
        .late_s = s * turn_s + ((c < 0.0f) ? -c * cfg->motor_lag_s : 0.0f),
        .brake_mps2 = s * s * cfg->approach_accel_mps2 + c * c * ((c < 0.0f) ? cfg->approach_accel_mps2 : fall_mps2),
    };
}

ivl_relative_t ivl_surface_see(const ivl_cfg_t *cfg, const ivl_surface_t *surface, const ivl_sample_t *sample)
{
    const float      s = surface->sin, c = surface->cos;
    const ivl_quat_t q = sample->q_WB;
    const ivl_vec3_t v = sample->v_WB_mps, f = sample->f_B_mps2;
    // rows x and z of the attitude's matrix
    const ivl_vec3_t x = {1.0f - 2.0f * (q.y * q.y + q.z * q.z), 2.0f * (q.x * q.y - q.w * q.z), 2.0f * (q.x * q.z + q.w * q.y)};
    const ivl_vec3_t z = {q.x * q.z - q.w * q.y, q.y * q.z + q.w * q.x, 1.0f - 2.0f * (q.x * q.x + q.y * q.y)};
    const float      up_mps2 = 2.0f * (z.x * f.x + z.y * f.y) + z.z * f.z;
    return (ivl_relative_t){
        .height_m = ivl_surface_height(surface, sample->p_WB_m),
        .close_mps = s * v.x + c * v.z,
        .along_mps = c * v.x - s * v.z,
        .facing = s * x.z + c * z.z,
        .accel_mps2 = s * ivl_dot(x, f) + c * (up_mps2 - cfg->gravity_mps2),
        // nose-up by the surface's angle, b_x points along (sin) and b_z against (cos) what holds the vehicle up
        .hung_mps2 = s * f.x - c * f.z,
    };
}
