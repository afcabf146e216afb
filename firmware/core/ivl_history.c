/// @file ivl_history.c
#include "ivl_history.h"

void ivl_history_start(ivl_history_t *history)
{
    history->n = 0;
    history->a_mps2 = 0.0f;
    history->at[0] = (ivl_motion_t){0.0f, 0.0f};
}

static ivl_motion_t moved(ivl_motion_t from, float a_mps2, float t_s)
{
    const float dv_mps = a_mps2 * t_s;
    return (ivl_motion_t){from.v_mps + dv_mps, from.p_m + (from.v_mps + 0.5f * dv_mps) * t_s};
}

void ivl_history_push(ivl_history_t *history, float a_mps2, float dt_s)
{
    history->a_mps2 = a_mps2;
    const ivl_motion_t now = ivl_history_after(history, dt_s);
    history->n++;
    history->at[history->n % IVL_HISTORY_TICKS] = now;
}

ivl_motion_t ivl_history_after(const ivl_history_t *history, float t_s)
{
    return moved(history->at[history->n % IVL_HISTORY_TICKS], history->a_mps2, t_s);
}

bool ivl_history_at(const ivl_history_t *history, float ago_s, float ago_ticks, ivl_motion_t *motion)
{
    if (ago_ticks <= 0.0f)
    {
        *motion = ivl_history_after(history, -ago_s);
        return true;
    }
    // in positive form: what is no number was never
    if (!(ago_ticks < (float)(IVL_HISTORY_TICKS - 1u)))
    {
        return false;
    }
    const uint32_t whole = (uint32_t)ago_ticks;
    if (whole >= history->n)
    {
        return false;
    }
    const float         back = ago_ticks - (float)whole;
    const ivl_motion_t *after = &history->at[(history->n - whole) % IVL_HISTORY_TICKS];
    const ivl_motion_t *before = &history->at[(history->n - whole - 1u) % IVL_HISTORY_TICKS];
    *motion = (ivl_motion_t){after->v_mps + back * (before->v_mps - after->v_mps), after->p_m + back * (before->p_m - after->p_m)};
    return true;
}
