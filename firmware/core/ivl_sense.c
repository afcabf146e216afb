/// @file ivl_sense.c
#include "ivl_sense.h"

#include <string.h>

#include "ivl_math.h"

// age before the first good sample, s: larger than any stale_s_max, and absorbs a tick's growth
static const float AGE_S_NEVER = 1.0e9f;

void ivl_sense_reset(ivl_sense_t *sense)
{
    memset(sense, 0, sizeof *sense);
    sense->sample.q_WB.w = 1.0f;
    sense->age_s = AGE_S_NEVER;
    sense->cmd_age_s = AGE_S_NEVER;
    // one before zero, so that a clock may start at zero
    sense->t_last_us = UINT64_MAX;
}

bool ivl_sense_command_good(const ivl_cfg_t *cfg, const ivl_command_t *cmd)
{
    switch (cmd->request)
    {
    case IVL_REQUEST_IDLE:
    case IVL_REQUEST_ABORT:
        return true;
    case IVL_REQUEST_HOVER:
        return ivl_vec3_within(cmd->p_hover_W_m, IVL_SENSE_P_M_MAX);
    case IVL_REQUEST_APPROACH:
        return (cmd->speed_mps >= cfg->speed_mps_min) && (cmd->speed_mps <= cfg->speed_mps_max) && (cmd->angle_rad >= 0.0f) &&
               (cmd->angle_rad <= IVL_PI);
    case IVL_REQUEST_COUNT:
    default:
        return false;
    }
}

// age of the pose in seconds; negative if the clock stands still, or the pose is from the future or too old
static float pose_age_s(const ivl_cfg_t *cfg, const ivl_sense_t *sense, const ivl_in_t *in)
{
    // differences of unsigned clocks: an instant before the other one shows up as a huge number
    const uint64_t advance_us = in->t_us - sense->t_last_us - 1u;
    const uint64_t age_us = in->t_us - in->t_pose_us;
    if ((advance_us < UINT64_MAX / 2u) && (age_us <= 10000000u))
    {
        const float age_s = (float)(uint32_t)age_us * 1.0e-6f;
        return (age_s <= cfg->stale_s_max) ? age_s : -1.0f;
    }
    return -1.0f;
}

static bool pose_good(const ivl_in_t *in, float q_norm2)
{
    return ivl_within(q_norm2 - 1.0f, IVL_SENSE_Q_NORM2_TOL) && ivl_vec3_within(in->p_WB_m, IVL_SENSE_P_M_MAX) &&
           ivl_vec3_within(in->v_WB_mps, IVL_SENSE_V_MPS_MAX) && ivl_vec3_within(in->w_B_radps, IVL_SENSE_W_RADPS_MAX) &&
           ivl_vec3_within(in->f_B_mps2, IVL_SENSE_F_MPS2_MAX);
}

static void accept(ivl_sense_t *sense, const ivl_in_t *in, float q_norm2, float age_s)
{
    const float   scale = 1.0f / sqrtf(q_norm2);
    ivl_sample_t *s = &sense->sample;
    s->t_us = in->t_us;
    s->t_pose_us = in->t_pose_us;
    s->p_WB_m = in->p_WB_m;
    s->v_WB_mps = in->v_WB_mps;
    s->q_WB = (ivl_quat_t){in->q_WB.x * scale, in->q_WB.y * scale, in->q_WB.z * scale, in->q_WB.w * scale};
    s->w_B_radps = in->w_B_radps;
    s->f_B_mps2 = in->f_B_mps2;
    sense->up_z = 1.0f - 2.0f * (s->q_WB.x * s->q_WB.x + s->q_WB.y * s->q_WB.y);
    sense->age_s = age_s;
}

void ivl_sense_update(const ivl_cfg_t *cfg, ivl_sense_t *sense, const ivl_in_t *in, float dt_s)
{
    const ivl_quat_t q = in->q_WB;
    const float      q_norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
    const float      age_s = pose_age_s(cfg, sense, in);
    sense->pose_fresh = (age_s >= 0.0f) && pose_good(in, q_norm2);
    sense->cmd_fresh = ivl_sense_command_good(cfg, &in->cmd);

    // what is good is taken, what is not lets its predecessor age
    if (sense->pose_fresh)
    {
        accept(sense, in, q_norm2, age_s);
    }
    else
    {
        sense->age_s += dt_s;
    }
    if (sense->cmd_fresh)
    {
        sense->cmd = in->cmd;
    }
    sense->cmd_age_s = sense->cmd_fresh ? 0.0f : sense->cmd_age_s + dt_s;
    sense->pose_usable = sense->age_s <= cfg->stale_s_max;
    sense->cmd_usable = sense->cmd_age_s <= cfg->stale_s_max;
    sense->t_last_us = in->t_us;
}
