#include "phys_step.h"

#include "world_clock.h"
#include "world_events.h"
#include "world_pace.h"
#include "world_step_size.h"

/// Sets up all lanes for a step of progress.dt_s.
static void propose(ivl_sim_group_t *group)
{
    ivl_sim_progress_t     *progress = &group->progress;
    ivl_sim_load_t         *load = &group->load;
    const ivl_sim_state_t  *s = &group->state;
    const ivl_wide_t        height = ivl_sim_surface_heights_of(&group->model->surface, s->p_WB_m);
    const ivl_sim_airflow_t flow = {world_surface_m(group, progress->t_s) - height, &s->v_WB_mps, s->q_WB};
    const ivl_wide_t        none = ivl_wide(0.0);
    const ivl_mask_t        powered = ivl_sim_rotor_turn(&group->rotor);
    progress->powered = powered;
    load->surface_height_m = world_surface_m(group, progress->t_s + 0.5 * progress->dt_s);
    if (ivl_mask_any(powered))
    {
        ivl_sim_rotor_step(group->model, &group->rotor, &flow, &progress->dt_s, &progress->rotor, load);
    }
    load->thrust_N = ivl_wide_select(powered, load->thrust_N, none);
    load->torque_B_Nm.x = ivl_wide_select(powered, load->torque_B_Nm.x, none);
    load->torque_B_Nm.y = ivl_wide_select(powered, load->torque_B_Nm.y, none);
    load->torque_B_Nm.z = ivl_wide_select(powered, load->torque_B_Nm.z, none);
}

/// @param[in] which  lanes in which a step begins
static void begin_step(ivl_sim_group_t *group, ivl_mask_t which)
{
    ivl_sim_progress_t *progress = &group->progress;
    const ivl_mask_t    anew = which & progress->restart;
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        progress->gap_m[i] = ivl_wide_select(which, progress->gap_after_m[i], progress->gap_m[i]);
    }
    if (ivl_mask_any(anew))
    {
        (void)world_gaps(group, &group->state, progress->t_s, anew, progress->gap_m);
    }
    world_handle_touches(group, which);
    progress->starting = (which & progress->restart) | (~which & progress->starting);
    progress->restart &= ~which;
    const ivl_wide_t dt = ivl_wide_select(progress->starting, ivl_wide(0.0), world_next_step(group));
    progress->dt_s = ivl_wide_select(which, dt, progress->dt_s);
}

/// Looks at the steps that were tried.
/// @param[in] moving    lanes in which one was
/// @param[in] diverged  those in which it led to what is no motion any more
/// @return those in which it stands; in the others another has been proposed
static ivl_mask_t judge(ivl_sim_group_t *group, ivl_mask_t moving, ivl_mask_t diverged)
{
    ivl_sim_progress_t *progress = &group->progress;
    // where the forces have jumped it begins again from here
    const ivl_mask_t jumped = world_handle_held(group, moving);
    const ivl_mask_t tested = moving & ~jumped & ~progress->starting & (progress->n_try < IVL_SIM_RETRIES_MAX);
    // where a motion that is none meets the surface says nothing, and to step there would take for ever
    const ivl_mask_t locates = tested & (progress->n_try < IVL_SIM_LOCATE_MAX) & ~diverged;
    const ivl_mask_t looks = locates | (moving & ~jumped & progress->starting);
    const ivl_mask_t near = world_gaps(group, &group->next, progress->t_s + progress->dt_s, looks, progress->gap_after_m);
    const ivl_wide_t tried = progress->dt_s, share = world_event_share(group, near & locates);
    const ivl_wide_t dt = ivl_wide_select(share < 1.0, share * tried, tried), most = world_longest_retry(group);
    const ivl_mask_t again = tested & ((dt < tried) | (most < tried - IVL_SIM_TIME_SLACK_S));
    progress->dt_s = ivl_wide_select(again, ivl_wide_smaller(dt, most), tried);
    progress->n_try = (progress->n_try - again) & again;
    return moving & ~jumped & ~again;
}

// A body that turns faster than this, or is farther away, moves no more as anything does.
static const double RATE_MOST_RADPS = 1.0e6, FAR_MOST_M = 1.0e6;

/// Of each lane.
static ivl_mask_t all_diverged(const ivl_sim_state_t *s)
{
    const ivl_w3_t   w = s->w_B_radps, p = s->p_WB_m;
    const ivl_wide_t rate_radps = ivl_wide_abs(w.x) + ivl_wide_abs(w.y) + ivl_wide_abs(w.z);
    const ivl_wide_t far_m = ivl_wide_abs(p.x) + ivl_wide_abs(p.y) + ivl_wide_abs(p.z);
    return ~((rate_radps < RATE_MOST_RADPS) & (far_m < FAR_MOST_M));
}

bool ivl_sim_world_diverged(const ivl_sim_state_t *s, int lane)
{
    const ivl_d3_t w = ivl_w3_lane(&s->w_B_radps, lane), p = ivl_w3_lane(&s->p_WB_m, lane);
    return !(fabs(w.x) + fabs(w.y) + fabs(w.z) < RATE_MOST_RADPS && fabs(p.x) + fabs(p.y) + fabs(p.z) < FAR_MOST_M);
}

/// @param[in] moved  lanes whose step stands, and took time
static void accept(ivl_sim_group_t *group, ivl_mask_t moved, ivl_mask_t diverged)
{
    ivl_sim_progress_t *progress = &group->progress;
    const ivl_mask_t    turned = moved & progress->powered;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        group->rotor.speed_radps[i] = ivl_wide_select(turned, progress->rotor.speed_radps[i], group->rotor.speed_radps[i]);
    }
    const ivl_wide_t left =
        ivl_wide_select(diverged, ivl_wide(0.0), progress->left_s - progress->dt_s);  // the tick ends, and with it the landing
    progress->t_s = ivl_wide_select(moved, progress->t_s + progress->dt_s, progress->t_s);
    progress->left_s = ivl_wide_select(moved, left, progress->left_s);
    progress->n_step -= moved;
    const ivl_wide_t d = world_surface_m(group, progress->t_s) - ivl_sim_surface_heights_of(&group->model->surface, group->next.p_WB_m);
    progress->d_min_m = ivl_wide_select(moved & (d < progress->d_min_m), d, progress->d_min_m);
    world_grow_step(group, moved);
}

/// to = from in the lanes that `which` names, for structs that are made of wide numbers only.
IVL_SIM_INLINE void take(void *to, const void *from, size_t size, ivl_mask_t which)
{
    ivl_wide_t       *t = to;
    const ivl_wide_t *f = from;
    for (size_t i = 0; i < size / sizeof *t; i++)
    {
        t[i] = ivl_wide_select(which, f[i], t[i]);
    }
}

bool ivl_sim_world_ready(const ivl_sim_group_t *group, int lane)
{
    return !(group->progress.left_s[lane] > IVL_SIM_TIME_SLACK_S);
}

static void give_up(ivl_sim_group_t *group, ivl_mask_t which)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (which[lane])
        {
            group->world[lane].gave_up = true;
            group->progress.left_s[lane] = 0.0;
            group->progress.restart[lane] = -1;
            group->progress.n_try[lane] = 0;
        }
    }
}

/// Worlds that have motion to do and may take one more evaluation for it.  This bounds every loop of steps: no tick takes
/// more evaluations than it was given, whatever the vehicle and its state.
static ivl_mask_t may_move(ivl_sim_group_t *group)
{
    ivl_sim_progress_t *progress = &group->progress;
    const ivl_mask_t    due = progress->left_s > IVL_SIM_TIME_SLACK_S, spent = due & (progress->evaluations_left == 0);
    if (ivl_mask_any(spent))
    {
        give_up(group, spent);
    }
    const ivl_mask_t moving = due & ~spent;
    progress->evaluations_left += moving;
    progress->n_evaluation -= moving;
    return moving;
}

void ivl_sim_group_step(ivl_sim_group_t *group)
{
    ivl_sim_progress_t *progress = &group->progress;
    const ivl_mask_t    moving = may_move(group);
    begin_step(group, moving & (progress->n_try == 0));
    progress->dt_s = ivl_wide_select(moving, progress->dt_s, ivl_wide(0.0));
    propose(group);
    ivl_sim_leapfrog(group->model, &group->contact, &group->load, &progress->dt_s, &group->state, &group->last, &group->next, &group->rate);
    const ivl_mask_t diverged = all_diverged(&group->next);
    const ivl_mask_t stands = judge(group, moving, diverged);
    accept(group, stands & ~progress->starting, diverged);
    take(&group->state, &group->next, sizeof group->state, stands);
    take(&group->last, &group->rate, sizeof group->last, stands);
}
