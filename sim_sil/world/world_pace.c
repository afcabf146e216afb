#include "world_pace.h"

#include "world_clock.h"
#include "world_step_size.h"

static const double STILL_RADPS = 20.0;  // a body that turns slower than this is not looked at closely

/// Four stuck feet hold the body redundantly, and near the posture in which the lines of the legs meet in one point it can
/// turn a little all the same: there a step must not turn it far, or the truss pumps energy.
IVL_SIM_INLINE ivl_wide_t longest_step(const ivl_sim_group_t *group, const ivl_sim_state_t *s)
{
    const ivl_sim_params_t *raw = &group->model->raw;
    const ivl_sim_touch_t  *touch = &group->touch;
    const double            flight_s = ivl_sim_smaller(raw->step_flight_s, group->model->step.longest_s);
    const double            swing_s = ivl_sim_smaller(raw->step_swing_s, group->model->step.longest_s);
    const ivl_wide_t        most = ivl_wide_select(touch->impacted, ivl_wide(swing_s), ivl_wide(flight_s));
    if (!ivl_mask_any(touch->all_stuck))
    {
        return most;
    }
    const ivl_w3_t   turn = ivl_w3_scale(most, s->w_B_radps);
    const ivl_wide_t square = ivl_w3_dot(turn, turn);
    const ivl_mask_t far = touch->all_stuck & (square > raw->step_turn_rad * raw->step_turn_rad);
    const ivl_wide_t turns = ivl_wide_smaller(ivl_wide_sqrt(square) / raw->step_turn_rad, ivl_wide(IVL_SIM_TURNS_MAX));
    return ivl_wide_select(far, most / turns, most);
}

void world_restart_step(ivl_sim_group_t *group, int lane)
{
    const double     scale = group->model->raw.step_scale_norm;
    const ivl_wide_t longest = longest_step(group, &group->state);
    const double     step_s = ivl_sim_smaller(group->model->raw.step_touch_s * scale, longest[lane] * scale);
    group->progress.graded_s[lane] = step_s;
    group->progress.step_s[lane] = step_s;
}

static ivl_sim_pace_t pace_of(const ivl_sim_rate_t *rate)
{
    return (ivl_sim_pace_t){rate->swing_norm, rate->turn2_per_s2, rate->stretch_norm};
}

void world_grow_step(ivl_sim_group_t *group, ivl_mask_t which)
{
    const ivl_sim_params_t *raw = &group->model->raw;
    ivl_sim_progress_t     *progress = &group->progress;
    const ivl_sim_pace_t    pace = pace_of(&group->rate);
    const ivl_wide_t        longest = longest_step(group, &group->next) * raw->step_scale_norm;
    const ivl_wide_t        graded = ivl_wide_smaller(progress->graded_s * raw->step_growth_norm, longest);
    const ivl_wide_t        step = ivl_sim_step_longest(&group->model->step, &pace, graded);
    progress->graded_s = ivl_wide_select(which, graded, progress->graded_s);
    progress->step_s = ivl_wide_select(which, step, progress->step_s);
}

IVL_SIM_INLINE ivl_mask_t plates_press(const ivl_sim_rate_t *rate)
{
    return (rate->overlap_m[IVL_SIM_PROP_PLATE] > 0.0) | (rate->overlap_m[IVL_SIM_BASE_PLATE] > 0.0);
}

/// Graded after events, short while a plate presses, a whole share of what is left, and not beyond the instant at which a
/// sliding foot may stick.
IVL_SIM_INLINE ivl_wide_t choose_step(const ivl_sim_group_t *group, ivl_mask_t plates)
{
    const ivl_sim_params_t   *raw = &group->model->raw;
    const ivl_sim_progress_t *progress = &group->progress;
    const double              plate = raw->step_plate_s * raw->step_scale_norm;
    ivl_wide_t                step = ivl_wide_select(plates & (progress->step_s > plate), ivl_wide(plate), progress->step_s);
    for (int i = 0; i < IVL_SIM_LEGS && group->contact.any_sliding; i++)
    {
        const ivl_wide_t wait = group->touch.t_touch_s[i] + raw->leg_stick_delay_s - progress->t_s;
        const ivl_mask_t waits = (group->contact.sliding[i] > 0.0) & (wait > IVL_SIM_TIME_SLACK_S) & (wait < step);
        step = ivl_wide_select(waits, wait, step);
    }
    // an excess of rounding size is no reason for two steps
    const ivl_wide_t left = progress->left_s;
    return ivl_wide_select(step < left * (1.0 - 1.0e-6), left / ivl_wide_ceil(left / step - 1.0e-6), left);
}

ivl_wide_t world_next_step(const ivl_sim_group_t *group)
{
    return choose_step(group, plates_press(&group->last));
}

/// Four stuck feet hold the body redundantly.  Where two of these constraints nearly coincide the forces change with the rates
/// faster than any step that is accurate elsewhere follows: a prediction of the body's rate that is off by more than half
/// of it is one to try again from.
IVL_SIM_INLINE ivl_mask_t mispredicted(const ivl_sim_group_t *group)
{
    const ivl_w3_t   change = ivl_w3_sub(group->rate.alpha_B_radps2, group->last.alpha_B_radps2), rate = group->state.w_B_radps;
    const ivl_wide_t dt = group->progress.dt_s;
    return group->touch.all_stuck & (dt * dt * ivl_w3_dot(change, change) > ivl_w3_dot(rate, rate) + STILL_RADPS * STILL_RADPS);
}

ivl_wide_t world_longest_retry(const ivl_sim_group_t *group)
{
    const ivl_sim_step_limits_t *step = &group->model->step;
    const ivl_sim_pace_t         pace = pace_of(&group->rate);
    const ivl_wide_t             tried = group->progress.dt_s;
    const ivl_mask_t             plates = plates_press(&group->rate);
    ivl_wide_t                   most = tried;
    if (ivl_mask_any(plates))
    {
        most = ivl_wide_select(plates, choose_step(group, plates), tried);
    }
    const ivl_mask_t too_long = ~ivl_sim_step_allowed(step, &pace, IVL_SIM_TRIED_MORE, tried);
    if (ivl_mask_any(too_long))
    {
        most = ivl_wide_select(too_long, ivl_wide_smaller(most, ivl_sim_step_longest(step, &pace, tried)), most);
    }
    return ivl_wide_select(mispredicted(group), ivl_wide_smaller(most, 0.5 * tried), most);
}
