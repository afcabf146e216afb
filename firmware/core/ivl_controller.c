/// @file ivl_controller.c
/// Law (Lee, Leok, McClamroch 2010), with e_p = p - p_ref, e_v = v - v_ref, e_a = v' - a_ref and heading 0:
///   F   = m (g e3 + a_ref) - Kp e_p - Kd e_v                 force that the rotors should make, in W
///   R_d = [b1 b2 b3], b3 = F / |F|, b2 = b3 x e1 / |b3 x e1|, b1 = b2 x b3
///   w_d = rate of R_d while F changes as F' = -Kp e_v - Kd e_a, with v' = (F . R e3) R e3 / m - g e3
///   e_R = 1/2 vee(R_d^T R - R^T R_d),   e_w = w - R^T w_d
///   thrust = F . R e3,   M = -K_R e_R - K_w e_w + w x J w
/// v' is what the thrust of this very law makes, so w_d needs neither a sensor nor a difference in time.  It matters: with K_R / K_w = 2.4 1/s
/// attitude alone follows slower than the horizontal loop (3.7 rad/s) asks, and an oblique approach swings; with w_d it settles in a second.
#include "ivl_controller.h"

// Far from the reference, where F is limited, F' means little: then this bounds w_d.
static const float RATE_RADPS_MAX = 10.0f;

// -Kp e - Kd e': the force of the errors, and, given e' and e'', its rate
static ivl_vec3_t feedback(const ivl_cfg_t *cfg, ivl_vec3_t e, ivl_vec3_t e_rate)
{
    return ivl_vec3(-cfg->kp_pos_xy_Npm * e.x - cfg->kd_vel_xy_Nspm * e_rate.x, -cfg->kp_pos_xy_Npm * e.y - cfg->kd_vel_xy_Nspm * e_rate.y,
                    -cfg->kp_pos_z_Npm * e.z - cfg->kd_vel_z_Nspm * e_rate.z);
}

// no more lift than four motors have, then no more tilt than allowed: height goes before horizontal position
static ivl_vec3_t limited(const ivl_cfg_t *cfg, ivl_vec3_t force_W_N, float tan_tilt_max)
{
    const float     weight_N = cfg->mass_kg * cfg->gravity_mps2;
    const ivl_num_t lift_N = ivl_clamp(force_W_N.z, ivl_num(IVL_LIFT_NORM_MIN * weight_N), ivl_num(4.0f * cfg->motor_thrust_N_max));
    const ivl_num_t side_N_max = tan_tilt_max * lift_N;
    const ivl_num_t side_N = ivl_root(force_W_N.x * force_W_N.x + force_W_N.y * force_W_N.y);
    const ivl_num_t keep = ivl_pick(side_N > side_N_max, side_N_max / side_N, ivl_num(1.0f));
    return ivl_vec3(force_W_N.x * keep, force_W_N.y * keep, lift_N);
}

// heading 0: b2 has no x component, because it is perpendicular to e1
static ivl_axes_t desired_axes(ivl_vec3_t force_W_N)
{
    const ivl_vec3_t b3 = ivl_scale(force_W_N, 1.0f / ivl_root(ivl_dot(force_W_N, force_W_N)));
    const ivl_num_t  norm = 1.0f / ivl_root(b3.z * b3.z + b3.y * b3.y);
    const ivl_vec3_t b2 = {ivl_num(0.0f), b3.z * norm, -b3.y * norm};
    return (ivl_axes_t){.x = ivl_cross(b2, b3), .y = b2, .z = b3};
}

// b3' = w_y b1 - w_x b2 is the part of F' / |F| across b3; w_z keeps b2 perpendicular to e1: (w_x b3 - w_z b1) . e1 = 0
static ivl_vec3_t desired_rate(const ivl_axes_t *d, ivl_vec3_t force_W_N, ivl_vec3_t force_rate_W_Nps)
{
    const ivl_num_t per_N = 1.0f / ivl_dot(force_W_N, d->z);
    const ivl_num_t most = ivl_num(RATE_RADPS_MAX);
    const ivl_num_t w_x = ivl_clamp(-ivl_dot(d->y, force_rate_W_Nps) * per_N, -most, most);
    const ivl_num_t w_y = ivl_clamp(ivl_dot(d->x, force_rate_W_Nps) * per_N, -most, most);
    const ivl_num_t w_z = w_x * d->z.x / d->x.x;
    return ivl_add(ivl_scale(d->x, w_x), ivl_add(ivl_scale(d->y, w_y), ivl_scale(d->z, w_z)));
}

// element (i, j) of R_d^T R is the product of desired axis i with actual axis j
static ivl_vec3_t attitude_error(const ivl_axes_t *d, const ivl_axes_t *r)
{
    return ivl_vec3(0.5f * (ivl_dot(d->z, r->y) - ivl_dot(d->y, r->z)), 0.5f * (ivl_dot(d->x, r->z) - ivl_dot(d->z, r->x)),
                    0.5f * (ivl_dot(d->y, r->x) - ivl_dot(d->x, r->y)));
}

static ivl_vec3_t moment(const ivl_cfg_t *cfg, ivl_vec3_t w, ivl_vec3_t e_r, ivl_vec3_t e_w)
{
    const ivl_vec3_t spin = {cfg->jxx_kgm2 * w.x, cfg->jyy_kgm2 * w.y, cfg->jzz_kgm2 * w.z};
    const ivl_vec3_t gyro = ivl_cross(w, spin);
    return ivl_vec3(gyro.x - cfg->kp_att_xy_Nmprad * e_r.x - cfg->kd_rate_xy_Nmsprad * e_w.x,
                    gyro.y - cfg->kp_att_xy_Nmprad * e_r.y - cfg->kd_rate_xy_Nmsprad * e_w.y,
                    gyro.z - cfg->kp_att_z_Nmprad * e_r.z - cfg->kd_rate_z_Nmsprad * e_w.z);
}

ivl_wrench_t ivl_controller_compute(const ivl_cfg_t *cfg, const ivl_sample_t *sample, const ivl_reference_t *ref, float tan_tilt_max)
{
    // force
    const ivl_vec3_t e_p = ivl_sub(sample->p_WB_m, ref->p_W_m);
    const ivl_vec3_t e_v = ivl_sub(sample->v_WB_mps, ref->v_W_mps);
    const ivl_vec3_t carry = {ref->a_W_mps2.x, ref->a_W_mps2.y, ref->a_W_mps2.z + cfg->gravity_mps2};
    const ivl_vec3_t asked_N = ivl_add(ivl_scale(carry, ivl_num(cfg->mass_kg)), feedback(cfg, e_p, e_v));
    const ivl_vec3_t force_W_N = limited(cfg, asked_N, tan_tilt_max);

    // attitude; e_a + carry is what the rotors make per mass
    const ivl_axes_t r = ivl_axes_of(sample->q_WB);
    const ivl_axes_t d = desired_axes(force_W_N);
    const ivl_num_t  along_N = ivl_dot(force_W_N, r.z);
    const ivl_vec3_t e_a = ivl_sub(ivl_scale(r.z, along_N / cfg->mass_kg), carry);
    const ivl_vec3_t w_d = desired_rate(&d, force_W_N, feedback(cfg, e_v, e_a));
    const ivl_vec3_t w = sample->w_B_radps;
    const ivl_vec3_t e_w = {w.x - ivl_dot(r.x, w_d), w.y - ivl_dot(r.y, w_d), w.z - ivl_dot(r.z, w_d)};
    return (ivl_wrench_t){
        .thrust_N = ivl_pick(along_N > 0.0f, along_N, ivl_num(0.0f)),
        .moment_B_Nm = moment(cfg, w, attitude_error(&d, &r), e_w),
    };
}
