#include "world_events.h"

#include "phys_impulse.h"
#include "phys_plates.h"
#include "world_clock.h"
#include "world_pace.h"

// A contact event is located to within these distances; at 1 m/s that is 0.1 us for a foot.
static const double FOOT_TOLERANCE_M = 1.0e-7;
static const double PLATE_TOLERANCE_M = 1.0e-6;
// A foot that came off must move this far away before it can stick again.
static const double REARM_GAP_M = 1.0e-3;
static const double NEAR_MARGIN_M = 0.05;  // more than a vehicle moves in one step
static const double FAR_M = 1.0;           // stands for the gap of what cannot make an event

/// Height of a plate's highest point above the body origin depends on the surface's normal in body axes alone.
static ivl_d3_t normal_of(const ivl_sim_surface_t *surface, const ivl_sim_state_t *s, int lane)
{
    const double   x = s->q_WB[0][lane], y = s->q_WB[1][lane], z = s->q_WB[2][lane], w = s->q_WB[3][lane];
    const ivl_d3_t row_z = ivl_d3(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y));
    if (ivl_d3_is_z(surface->normal_W))
    {
        return row_z;
    }
    const ivl_rot_t R = {.row = {{1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
                                 {2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)},
                                 row_z}};
    return ivl_rot_apply_inverse(&R, surface->normal_W);
}

static double foot_gap(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane, double surface_m, int i)
{
    return surface_m - ivl_sim_surface_height_of(&w->model->surface, ivl_w3_lane(&s->p_foot_W_m[i], lane)) -
           w->model->raw.leg_foot_radius_m;
}

bool world_gaps(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane, double t_s, double gap[IVL_SIM_GAPS])
{
    const ivl_sim_surface_t *surface = &w->model->surface;
    const double             surface_m = ivl_sim_world_surface_m(w, t_s);
    const double             room = surface_m - ivl_sim_surface_height_of(surface, ivl_w3_lane(&s->p_WB_m, lane));
    const bool               near = room < w->model->reach_m + NEAR_MARGIN_M;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const bool may_touch = near && (w->foot[i] == IVL_SIM_FOOT_FREE) && !w->detached[i];
        gap[i] = may_touch ? foot_gap(w, s, lane, surface_m, i) : FAR_M;
    }
    const ivl_d3_t normal = near ? normal_of(surface, s, lane) : ivl_d3(0.0, 0.0, 1.0);
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        const bool may_touch = near && !w->plate_touched[i];
        gap[IVL_SIM_LEGS + i] = may_touch ? room - ivl_sim_plate_top(&w->model->plate[i], normal) : FAR_M;
    }
    return near;
}

static double hermite(double g0, double d0, double g1, double d1, double x)
{
    const double a = 2.0 * (g0 - g1) + d0 + d1, b = 3.0 * (g1 - g0) - 2.0 * d0 - d1;
    return ((a * x + b) * x + d0) * x + g0;
}

/// Share of a step at which a cubic, given by values and slopes at both ends, first falls to zero; WORLD_NO_EVENT if it does not.
static double first_zero(double g0, double d0, double g1, double d1, double tolerance)
{
    double lo = 0.0, hi = 1.0;
    if (g1 >= -tolerance)
    {
        // the only way in and out again is a minimum in between
        if (!(d0 < 0.0 && d1 > 0.0))
        {
            return WORLD_NO_EVENT;
        }
        const double a = 3.0 * (2.0 * (g0 - g1) + d0 + d1), b = 2.0 * (3.0 * (g1 - g0) - 2.0 * d0 - d1);
        const double root = b * b - 4.0 * a * d0;
        hi = (root > 0.0) ? 2.0 * d0 / (-b - sqrt(root)) : 1.0;
        if (!(hi > 0.0 && hi < 1.0) || hermite(g0, d0, g1, d1, hi) >= -tolerance)
        {
            return WORLD_NO_EVENT;
        }
    }
    for (int i = 0; i < 40; i++)
    {
        const double mid = 0.5 * (lo + hi);
        const bool   outside = hermite(g0, d0, g1, d1, mid) > 0.0;
        lo = outside ? mid : lo;
        hi = outside ? hi : mid;
    }
    return hi;
}

double world_event_share(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t         *w = &group->world[lane];
    const double            *g0 = w->trial.gap_m, dt = w->trial.dt_s;
    double                   share = WORLD_NO_EVENT;
    double                  *g1 = w->trial.gap_after_m;
    const ivl_sim_surface_t *surface = &w->model->surface;
    if (!world_gaps(w, &group->next, lane, w->t_s + dt, g1))
    {
        return WORLD_NO_EVENT;
    }
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        double s = WORLD_NO_EVENT;
        if (i >= IVL_SIM_LEGS)
        {
            s = (g1[i] < -PLATE_TOLERANCE_M) ? g0[i] / (g0[i] - g1[i]) : WORLD_NO_EVENT;
        }
        else if (g1[i] < FAR_M)
        {
            // a foot rings: cubic through height and speed, so that a touch within the step is not missed
            const double d0 = -dt * ivl_sim_surface_closing(surface, ivl_w3_lane(&group->state.v_foot_W_mps[i], lane));
            const double d1 = -dt * ivl_sim_surface_closing(surface, ivl_w3_lane(&group->next.v_foot_W_mps[i], lane));
            s = first_zero(g0[i], d0, g1[i], d1, FOOT_TOLERANCE_M);
        }
        share = (s < share) ? s : share;
    }
    return share;
}

static void hold(ivl_sim_group_t *group, int lane, int leg, ivl_sim_foot_t foot)
{
    ivl_sim_world_t *w = &group->world[lane];
    w->foot[leg] = foot;
    w->restart = true;
    ivl_sim_contact_set(w->model, &group->contact, lane, w->foot);
    bool listed = foot != IVL_SIM_FOOT_STUCK;
    for (int i = 0; i < w->n_order; i++)
    {
        listed = listed || (w->stuck_order[i] == leg + 1);
    }
    if (!listed)
    {
        w->stuck_order[w->n_order++] = (int8_t)(leg + 1);
    }
}

static void stop_held_feet(ivl_sim_group_t *group, int lane)
{
    ivl_sim_kin_t kin = ivl_sim_world_kin(group, lane);
    ivl_sim_impulse(group->model, group->world[lane].foot, &kin);
    ivl_sim_lane_set(&group->state, lane, &kin);
}

/// Positive form: a gap that is no number has been passed.
static bool all_open(const double gap[IVL_SIM_GAPS])
{
    bool open = true;
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        open = open & (gap[i] > ((i < IVL_SIM_LEGS) ? FOOT_TOLERANCE_M : PLATE_TOLERANCE_M));
    }
    return open;
}

void world_handle_touches(ivl_sim_group_t *group, int lane, const double gap[IVL_SIM_GAPS])
{
    ivl_sim_world_t *w = &group->world[lane];
    if (all_open(gap))
    {
        return;
    }
    bool event = false, foot_event = false;
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        const bool is_foot = i < IVL_SIM_LEGS;
        if (gap[i] > (is_foot ? FOOT_TOLERANCE_M : PLATE_TOLERANCE_M))
        {
            continue;
        }
        if (!w->impact.happened)
        {
            w->impact = (ivl_sim_impact_t){true, w->t_s, ivl_sim_world_kin(group, lane)};
        }
        event = true;
        if (is_foot)
        {
            foot_event = true;
            w->t_touch_s[i] = w->t_s;
            hold(group, lane, i, (w->model->raw.leg_stick_delay_s > 0.0) ? IVL_SIM_FOOT_SLIDING : IVL_SIM_FOOT_STUCK);
        }
        else
        {
            w->plate_touched[i - IVL_SIM_LEGS] = true;
        }
    }
    if (foot_event)
    {
        stop_held_feet(group, lane);
    }
    if (event)
    {
        world_restart_step(w, &group->state, lane);
    }
}

/// Feet of which none is held, or has just come off.
static bool all_loose(const ivl_sim_world_t *w)
{
    bool loose = true;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        loose = loose & (w->foot[i] == IVL_SIM_FOOT_FREE) & !w->detached[i];
    }
    return loose;
}

bool world_handle_held(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t        *w = &group->world[lane];
    const ivl_sim_params_t *raw = &w->model->raw;
    bool                    event = false;
    if (all_loose(w))
    {
        return false;
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const double pull = group->rate.pull_N[i][lane];
        if ((w->foot[i] == IVL_SIM_FOOT_SLIDING && pull > 0.0) || (w->foot[i] == IVL_SIM_FOOT_STUCK && pull > raw->leg_adhesion_N))
        {
            hold(group, lane, i, IVL_SIM_FOOT_FREE);
            w->detached[i] = true;
            event = true;
        }
        else if (w->foot[i] == IVL_SIM_FOOT_SLIDING && w->t_s >= w->t_touch_s[i] + raw->leg_stick_delay_s - IVL_SIM_TIME_SLACK_S)
        {
            hold(group, lane, i, IVL_SIM_FOOT_STUCK);
            stop_held_feet(group, lane);
            event = true;
        }
        else if (w->detached[i])
        {
            const double gap = foot_gap(w, &group->state, lane, ivl_sim_world_surface_m(w, w->t_s), i);
            w->detached[i] = !(gap > REARM_GAP_M);
        }
    }
    if (event)
    {
        world_restart_step(w, &group->state, lane);
    }
    return event;
}
