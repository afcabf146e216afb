#include "phys_step.h"

#include "phys_evaluate.h"

/// q + h/2 q (0, w): turns q by h w, to second order; the length is corrected where it matters.
IVL_SIM_INLINE void turn(const ivl_wide_t q[4], const ivl_wide_t along[4], ivl_wide_t h, ivl_w3_t w, ivl_wide_t out[4])
{
    const ivl_wide_t half = 0.5 * h;
    out[0] = q[0] + half * (along[3] * w.x + along[1] * w.z - along[2] * w.y);
    out[1] = q[1] + half * (along[3] * w.y + along[2] * w.x - along[0] * w.z);
    out[2] = q[2] + half * (along[3] * w.z + along[0] * w.y - along[1] * w.x);
    out[3] = q[3] - half * (along[0] * w.x + along[1] * w.y + along[2] * w.z);
}

IVL_SIM_INLINE void normalize(ivl_wide_t q[4])
{
    const ivl_wide_t s = 1.0 / ivl_wide_sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
    {
        q[i] *= s;
    }
}

void ivl_sim_leapfrog(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load, const ivl_wide_t *dt_s,
                      const ivl_sim_state_t *s, const ivl_sim_rate_t *last, ivl_sim_state_t *next, ivl_sim_rate_t *rate)
{
    const ivl_wide_t dt = *dt_s;
    const ivl_wide_t half = 0.5 * dt;
    ivl_sim_state_t  mid;
    mid.p_WB_m = ivl_w3_plus(s->p_WB_m, half, s->v_WB_mps);
    mid.v_WB_mps = ivl_w3_plus(s->v_WB_mps, half, last->a_WB_mps2);
    mid.w_B_radps = ivl_w3_plus(s->w_B_radps, half, last->alpha_B_radps2);
    const ivl_w3_t w_quarter = ivl_w3_plus(s->w_B_radps, 0.5 * half, last->alpha_B_radps2);
    turn(s->q_WB, s->q_WB, half, w_quarter, mid.q_WB);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        mid.p_foot_W_m[i] = ivl_w3_plus(s->p_foot_W_m[i], half, s->v_foot_W_mps[i]);
        mid.v_foot_W_mps[i] = ivl_w3_plus(s->v_foot_W_mps[i], half, last->a_foot_W_mps2[i]);
    }
    phys_accelerate(model, contact, load, &mid, rate);
    next->v_WB_mps = ivl_w3_plus(s->v_WB_mps, dt, rate->a_WB_mps2);
    next->w_B_radps = ivl_w3_plus(s->w_B_radps, dt, rate->alpha_B_radps2);
    next->p_WB_m = ivl_w3_plus(mid.p_WB_m, half, next->v_WB_mps);
    const ivl_w3_t w_mean = ivl_w3_scale(ivl_wide(0.5), ivl_w3_add(s->w_B_radps, next->w_B_radps));
    turn(s->q_WB, mid.q_WB, dt, w_mean, next->q_WB);
    normalize(next->q_WB);
    next->pitch_rad = s->pitch_rad - dt * w_mean.y;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        next->v_foot_W_mps[i] = ivl_w3_plus(s->v_foot_W_mps[i], dt, rate->a_foot_W_mps2[i]);
        next->p_foot_W_m[i] = ivl_w3_plus(mid.p_foot_W_m[i], half, next->v_foot_W_mps[i]);
    }
}
