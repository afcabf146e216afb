#include "phys_step.h"

#include "world_clock.h"
#include "world_events.h"
#include "world_pace.h"
#include "world_step_size.h"

/// Sets up lane `lane` for a step of length dt.
static void propose(ivl_sim_group_t *group, int lane, double dt)
{
    ivl_sim_world_t *w = &group->world[lane];
    ivl_sim_thrust_t thrust = {0.0, {0.0, 0.0, 0.0}};
    w->trial.dt_s = dt;
    w->trial.powered = !ivl_sim_rotor_still(&w->rotor);
    if (w->trial.powered)
    {
        const ivl_sim_state_t  *s = &group->state;
        const ivl_sim_airflow_t body = {.gap_m = ivl_sim_world_gap_m(group, lane),
                                        .v_W_mps = {s->v_WB_mps.x[lane], s->v_WB_mps.y[lane], s->v_WB_mps.z[lane]},
                                        .q_WB = {s->q_WB[0][lane], s->q_WB[1][lane], s->q_WB[2][lane], s->q_WB[3][lane]}};
        w->trial.rotor = w->rotor;
        thrust = ivl_sim_rotor_step(w->model, &w->trial.rotor, &body, dt);
    }
    group->dt_s[lane] = dt;
    group->load.surface_height_m[lane] = ivl_sim_world_surface_m(w, w->t_s + 0.5 * dt);
    group->load.thrust_N[lane] = thrust.thrust_N;
    group->load.torque_B_Nm.x[lane] = thrust.torque_B_Nm[0];
    group->load.torque_B_Nm.y[lane] = thrust.torque_B_Nm[1];
    group->load.torque_B_Nm.z[lane] = thrust.torque_B_Nm[2];
}

static void begin_step(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (w->restart)
    {
        world_gaps(w, &group->state, lane, w->t_s, w->trial.gap_m);
    }
    else
    {
        memcpy(w->trial.gap_m, w->trial.gap_after_m, sizeof w->trial.gap_m);
    }
    world_handle_touches(group, lane, w->trial.gap_m);
    w->trial.starting = w->restart;
    w->restart = false;
    w->trial.n_try = 0;
    propose(group, lane, w->trial.starting ? 0.0 : world_next_step(group, lane));
}

/// Looks at the step that was tried.
/// @param[in] diverged  where it led to is no motion any more
/// @return true if it stands; if not, another has been proposed
static bool judge(ivl_sim_group_t *group, int lane, bool diverged)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (world_handle_held(group, lane))
    {
        w->trial.n_try = 0;  // the forces have jumped: begin again from here
        return false;
    }
    if (w->trial.starting || w->trial.n_try >= IVL_SIM_RETRIES_MAX)
    {
        return true;
    }
    const double most = world_longest_retry(group, lane);
    // where a motion that is none meets the surface says nothing, and to step there would take for ever
    const bool   locate = w->trial.n_try < IVL_SIM_LOCATE_MAX && !diverged;
    const double share = locate ? world_event_share(group, lane) : WORLD_NO_EVENT;
    const double dt = (share < 1.0) ? share * w->trial.dt_s : w->trial.dt_s;
    if (dt < w->trial.dt_s || most < w->trial.dt_s - IVL_SIM_TIME_SLACK_S)
    {
        w->trial.n_try++;
        propose(group, lane, (dt < most) ? dt : most);
        return false;
    }
    return true;
}

bool ivl_sim_world_diverged(const ivl_sim_state_t *s, int lane)
{
    const double rate_radps = fabs(s->w_B_radps.x[lane]) + fabs(s->w_B_radps.y[lane]) + fabs(s->w_B_radps.z[lane]);
    const double far_m = fabs(s->p_WB_m.x[lane]) + fabs(s->p_WB_m.y[lane]) + fabs(s->p_WB_m.z[lane]);
    return !(rate_radps < 1.0e6 && far_m < 1.0e6);
}

static void accept(ivl_sim_group_t *group, int lane, bool diverged)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (w->trial.starting)
    {
        world_gaps(w, &group->next, lane, w->t_s, w->trial.gap_after_m);
        return;
    }
    if (w->trial.powered)
    {
        w->rotor = w->trial.rotor;
    }
    w->t_s += w->trial.dt_s;
    w->left_s -= w->trial.dt_s;
    w->n_step++;
    if (diverged)
    {
        w->left_s = 0.0;  // the tick ends here, and with it the landing
    }
    const double height = ivl_sim_surface_height_of(&w->model->surface, ivl_w3_lane(&group->next.p_WB_m, lane));
    const double d = ivl_sim_world_surface_m(w, w->t_s) - height;
    w->d_min_m = (d < w->d_min_m) ? d : w->d_min_m;
    world_grow_step(w, &group->next, &group->rate, lane);
}

/// state = next and last = rate, in the lanes where the step stands.  Most stand, so the few others are put back, and then all are copied.
static void commit(ivl_sim_group_t *group, const bool stands[IVL_SIM_LANES])
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (!stands[lane])
        {
            ivl_sim_state_lane_copy(&group->next, &group->state, lane);
            ivl_sim_rate_lane_copy(&group->rate, &group->last, lane);
        }
    }
    group->state = group->next;
    group->last = group->rate;
}

bool ivl_sim_world_ready(const ivl_sim_group_t *group, int lane)
{
    return !(group->world[lane].left_s > IVL_SIM_TIME_SLACK_S);
}

/// True if a world has motion to do and may take one more evaluation for it.  This bounds every loop of steps: no tick takes
/// more evaluations than it was given, whatever the vehicle and its state.
static bool may_move(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (!group->active[lane] || ivl_sim_world_ready(group, lane))
    {
        return false;
    }
    if (w->evaluations_left == 0)
    {
        w->gave_up = true;
        w->left_s = 0.0;
        w->restart = true;
        w->trial.n_try = 0;
        return false;
    }
    w->evaluations_left--;
    w->n_evaluation++;
    return true;
}

void ivl_sim_group_step(ivl_sim_group_t *group)
{
    bool stands[IVL_SIM_LANES], moving[IVL_SIM_LANES];
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        moving[lane] = may_move(group, lane);
        if (!moving[lane])
        {
            group->dt_s[lane] = 0.0;
        }
        else if (group->world[lane].trial.n_try == 0)
        {
            begin_step(group, lane);
        }
    }
    ivl_sim_leapfrog(group->model, &group->contact, &group->load, &group->dt_s, &group->state, &group->last, &group->next, &group->rate);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        const bool diverged = moving[lane] && ivl_sim_world_diverged(&group->next, lane);
        stands[lane] = moving[lane] && judge(group, lane, diverged);
        if (stands[lane])
        {
            accept(group, lane, diverged);
            group->world[lane].trial.n_try = 0;
        }
    }
    commit(group, stands);
}
