/// @file ivl_controller.c
/// Law (Lee, Leok, McClamroch 2010), with e_p = p - p_ref, e_v = v - v_ref, desired body rate 0 and heading 0:
///   F   = m (g e3 + a_ref) - Kp e_p - Kd e_v                 force that the rotors should make, in W
///   R_d = [b1 b2 b3], b3 = F / |F|, b2 = b3 x e1 / |b3 x e1|, b1 = b2 x b3
///   e_R = 1/2 vee(R_d^T R - R^T R_d)
///   thrust = F . R e3,   M = -K_R e_R - K_w w + w x J w
#include "ivl_controller.h"

// The vertical force asked for never falls below this part of the weight: it keeps the thrust direction defined, the vehicle upright
// and its roll and pitch under control.
static const float LIFT_NORM_MIN = 0.2f;

static ivl_vec3_t desired_force(const ivl_cfg_t *cfg, const ivl_sample_t *sample, const ivl_reference_t *ref, float tan_tilt_max)
{
    const ivl_vec3_t e_p = ivl_sub(sample->p_WB_m, ref->p_W_m);
    const ivl_vec3_t e_v = ivl_sub(sample->v_WB_mps, ref->v_W_mps);
    const float      weight_N = cfg->mass_kg * cfg->gravity_mps2;
    const float      x_N = cfg->mass_kg * ref->a_W_mps2.x - cfg->kp_pos_xy_Npm * e_p.x - cfg->kd_vel_xy_Nspm * e_v.x;
    const float      y_N = cfg->mass_kg * ref->a_W_mps2.y - cfg->kp_pos_xy_Npm * e_p.y - cfg->kd_vel_xy_Nspm * e_v.y;
    const float      z_N = weight_N + cfg->mass_kg * ref->a_W_mps2.z - cfg->kp_pos_z_Npm * e_p.z - cfg->kd_vel_z_Nspm * e_v.z;

    // no more lift than four motors have, then no more tilt than allowed: height goes before horizontal position
    const float lift_N = ivl_clamp(z_N, LIFT_NORM_MIN * weight_N, 4.0f * cfg->motor_thrust_N_max);
    const float side_N_max = tan_tilt_max * lift_N;
    const float side_N = sqrtf(x_N * x_N + y_N * y_N);
    const float keep = (side_N > side_N_max) ? side_N_max / side_N : 1.0f;
    return ivl_vec3(x_N * keep, y_N * keep, lift_N);
}

// heading 0: b2 has no x component, because it is perpendicular to e1
static ivl_axes_t desired_axes(ivl_vec3_t force_W_N)
{
    const ivl_vec3_t b3 = ivl_scale(force_W_N, 1.0f / sqrtf(ivl_dot(force_W_N, force_W_N)));
    const float      norm = 1.0f / sqrtf(b3.z * b3.z + b3.y * b3.y);
    const ivl_vec3_t b2 = {0.0f, b3.z * norm, -b3.y * norm};
    return (ivl_axes_t){.x = ivl_cross(b2, b3), .y = b2, .z = b3};
}

// element (i, j) of R_d^T R is the product of desired axis i with actual axis j
static ivl_vec3_t attitude_error(const ivl_axes_t *d, const ivl_axes_t *r)
{
    return ivl_vec3(0.5f * (ivl_dot(d->z, r->y) - ivl_dot(d->y, r->z)), 0.5f * (ivl_dot(d->x, r->z) - ivl_dot(d->z, r->x)),
                    0.5f * (ivl_dot(d->y, r->x) - ivl_dot(d->x, r->y)));
}

ivl_wrench_t ivl_controller_compute(const ivl_cfg_t *cfg, const ivl_sample_t *sample, const ivl_reference_t *ref, float tan_tilt_max)
{
    const ivl_vec3_t force_W_N = desired_force(cfg, sample, ref, tan_tilt_max);
    const ivl_axes_t r = ivl_axes_of(sample->q_WB);
    const ivl_axes_t d = desired_axes(force_W_N);
    const ivl_vec3_t e_r = attitude_error(&d, &r);
    const ivl_vec3_t w = sample->w_B_radps;
    const ivl_vec3_t spin = {cfg->jxx_kgm2 * w.x, cfg->jyy_kgm2 * w.y, cfg->jzz_kgm2 * w.z};
    const ivl_vec3_t gyro = ivl_cross(w, spin);
    const float      along_N = ivl_dot(force_W_N, r.z);
    return (ivl_wrench_t){
        .thrust_N = (along_N > 0.0f) ? along_N : 0.0f,
        .moment_B_Nm = {gyro.x - cfg->kp_att_xy_Nmprad * e_r.x - cfg->kd_rate_xy_Nmsprad * w.x,
                        gyro.y - cfg->kp_att_xy_Nmprad * e_r.y - cfg->kd_rate_xy_Nmsprad * w.y,
                        gyro.z - cfg->kp_att_z_Nmprad * e_r.z - cfg->kd_rate_z_Nmsprad * w.z},
    };
}
