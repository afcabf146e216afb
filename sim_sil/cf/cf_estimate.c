#include "cf_estimate.h"

#include "ivl_math.h"

// Time constant of the velocity: at 100 Hz it follows a change within two samples or so.
static const float VELOCITY_TAU_S = 0.015f;
// After a gap this long a difference of positions says nothing about the velocity.
static const uint64_t GAP_US = 200000;

void ivl_cf_estimate_reset(ivl_cf_estimate_t *e)
{
    *e = (ivl_cf_estimate_t){.attitude = {.q_WB = {0.0f, 0.0f, 0.0f, 1.0f}}};
}

void ivl_cf_estimate_packet(ivl_cf_estimate_t *e, uint64_t now_us, ivl_vec3_t p_W_m, const ivl_quat_t *q_WB)
{
    const uint64_t gap_us = now_us - e->t_us;
    if (!e->has_position || gap_us > GAP_US)
    {
        e->v_W_mps = ivl_vec3(0.0f, 0.0f, 0.0f);
    }
    else if (gap_us > 0)
    {
        const float      dt_s = (float)gap_us * 1.0e-6f, gain = dt_s / (dt_s + VELOCITY_TAU_S);
        const ivl_vec3_t v = ivl_scale(ivl_sub(p_W_m, e->p_W_m), 1.0f / dt_s);
        e->v_W_mps = ivl_add(e->v_W_mps, ivl_scale(ivl_sub(v, e->v_W_mps), gain));
    }
    e->has_position = true;
    e->t_us = now_us;
    e->n++;
    e->p_W_m = p_W_m;
    if (q_WB != NULL)
    {
        const ivl_quat_t q = *q_WB;
        const float      scale = 1.0f / sqrtf(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
        e->has_attitude = true;
        e->q_WB = (ivl_quat_t){q.x * scale, q.y * scale, q.z * scale, q.w * scale};
    }
}

void ivl_cf_estimate_fill(ivl_cf_estimate_t *e, float dt_s, ivl_in_t *in)
{
    if (!e->has_position)
    {
        in->t_pose_us = 0;
        return;
    }
    in->t_pose_us = e->t_us;
    in->p_WB_m = e->p_W_m;
    in->v_WB_mps = (in->t_us - e->t_us > GAP_US) ? ivl_vec3(0.0f, 0.0f, 0.0f) : e->v_W_mps;
    if (e->has_attitude)
    {
        ivl_attitude_update(&e->attitude, e->q_WB, true, in->w_B_radps, dt_s);
        in->q_WB = e->attitude.q_WB;
    }
}

static ivl_vec3_t turned(ivl_vec3_t a, ivl_sincos_t by)
{
    return ivl_vec3(by.cos * a.x - by.sin * a.y, by.sin * a.x + by.cos * a.y, a.z);
}

void ivl_cf_frame_apply(const ivl_cf_frame_t *frame, ivl_in_t *in)
{
    if (!frame->is_other)
    {
        return;
    }
    const ivl_sincos_t full = ivl_sincos(frame->turn_rad), half = ivl_sincos(0.5f * frame->turn_rad);
    const ivl_quat_t   q = in->q_WB;
    in->p_WB_m = ivl_add(turned(ivl_sub(in->p_WB_m, frame->from_W_m), full), frame->to_m);
    in->v_WB_mps = turned(in->v_WB_mps, full);
    in->q_WB = (ivl_quat_t){
        half.cos * q.x - half.sin * q.y,
        half.cos * q.y + half.sin * q.x,
        half.cos * q.z + half.sin * q.w,
        half.cos * q.w - half.sin * q.z,
    };
}
