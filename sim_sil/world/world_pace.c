#include "world_pace.h"

#include "world_clock.h"
#include "world_step_size.h"

static const double STILL_RADPS = 20.0;  // a body that turns slower than this is not looked at closely

static bool all_stuck(const ivl_sim_world_t *w)
{
    bool all = true;
    for (int i = 0; i < IVL_SIM_LEGS && all; i++)
    {
        all = w->foot[i] == IVL_SIM_FOOT_STUCK;
    }
    return all;
}

/// Four stuck feet hold the body redundantly, and near the posture in which the lines of the legs meet in one point it can
/// turn a little all the same: there a step must not turn it far, or the truss pumps energy.
static double longest_step(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    const double            most = ivl_sim_smaller(w->impact.happened ? raw->step_swing_s : raw->step_flight_s, w->model->step.longest_s);
    if (!all_stuck(w))
    {
        return most;
    }
    const ivl_d3_t turn = ivl_d3_scale(most, ivl_w3_lane(&s->w_B_radps, lane));
    const double   square = ivl_d3_dot(turn, turn);
    if (!(square > raw->step_turn_rad * raw->step_turn_rad))
    {
        return most;
    }
    const double turns = sqrt(square) / raw->step_turn_rad;
    return most / ((turns < IVL_SIM_TURNS_MAX) ? turns : IVL_SIM_TURNS_MAX);
}

void world_restart_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane)
{
    const double scale = w->model->raw.step_scale_norm;
    w->graded_s = ivl_sim_smaller(w->model->raw.step_touch_s * scale, longest_step(w, s, lane) * scale);
    w->step_s = w->graded_s;
}

static ivl_sim_pace_t pace_of(const ivl_sim_rate_t *rate, int lane)
{
    return (ivl_sim_pace_t){rate->swing_norm[lane], rate->turn2_per_s2[lane], rate->stretch_norm[lane]};
}

void world_grow_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, const ivl_sim_rate_t *rate, int lane)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    w->graded_s = ivl_sim_smaller(w->graded_s * raw->step_growth_norm, longest_step(w, s, lane) * raw->step_scale_norm);
    const ivl_sim_pace_t pace = pace_of(rate, lane);
    w->step_s = ivl_sim_step_longest(&w->model->step, &pace, w->graded_s);
}

static bool plates_press(const ivl_sim_rate_t *rate, int lane)
{
    return rate->overlap_m[IVL_SIM_PROP_PLATE][lane] > 0.0 || rate->overlap_m[IVL_SIM_BASE_PLATE][lane] > 0.0;
}

/// Graded after events, short while a plate presses, a whole share of what is left, and not beyond the instant at which a
/// sliding foot may stick.
static double choose_step(const ivl_sim_world_t *w, bool plates, bool any_sliding)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    const double            plate = raw->step_plate_s * raw->step_scale_norm;
    double                  step = (plates && w->step_s > plate) ? plate : w->step_s;
    for (int i = 0; i < IVL_SIM_LEGS && any_sliding; i++)
    {
        const double wait = w->t_touch_s[i] + raw->leg_stick_delay_s - w->t_s;
        if (w->foot[i] == IVL_SIM_FOOT_SLIDING && wait > IVL_SIM_TIME_SLACK_S && wait < step)
        {
            step = wait;
        }
    }
    // an excess of rounding size is no reason for two steps
    return (step < w->left_s * (1.0 - 1.0e-6)) ? w->left_s / ceil(w->left_s / step - 1.0e-6) : w->left_s;
}

double world_next_step(const ivl_sim_group_t *group, int lane)
{
    return choose_step(&group->world[lane], plates_press(&group->last, lane), group->contact.any_sliding);
}

/// Four stuck feet hold the body redundantly.  Where two of these constraints nearly coincide the forces change with the rates
/// faster than any step that is accurate elsewhere follows: a prediction of the body's rate that is off by more than half
/// of it is one to try again from.
static bool mispredicted(const ivl_sim_group_t *group, int lane)
{
    if (!all_stuck(&group->world[lane]))
    {
        return false;
    }
    const ivl_d3_t met = ivl_w3_lane(&group->rate.alpha_B_radps2, lane), last = ivl_w3_lane(&group->last.alpha_B_radps2, lane);
    const ivl_d3_t change = ivl_d3_sub(met, last), rate = ivl_w3_lane(&group->state.w_B_radps, lane);
    const double   dt = group->world[lane].trial.dt_s;
    return dt * dt * ivl_d3_dot(change, change) > ivl_d3_dot(rate, rate) + STILL_RADPS * STILL_RADPS;
}

double world_longest_retry(const ivl_sim_group_t *group, int lane)
{
    const ivl_sim_world_t *w = &group->world[lane];
    const ivl_sim_pace_t   pace = pace_of(&group->rate, lane);
    const double           tried = w->trial.dt_s;
    double                 most = plates_press(&group->rate, lane) ? choose_step(w, true, group->contact.any_sliding) : tried;
    if (!ivl_sim_step_allowed(&w->model->step, &pace, IVL_SIM_TRIED_MORE, tried))
    {
        most = ivl_sim_smaller(most, ivl_sim_step_longest(&w->model->step, &pace, tried));
    }
    return mispredicted(group, lane) ? ivl_sim_smaller(most, 0.5 * tried) : most;
}
