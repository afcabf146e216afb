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

ivl_wide_t world_surface_m(const ivl_sim_group_t *group, ivl_wide_t t_s)
{
    return group->progress.surface_m + t_s * ivl_sim_surface_speed(&group->model->surface);
}

/// Height of a plate's highest point above the body origin depends on the surface's normal in body axes alone.
IVL_SIM_INLINE ivl_w3_t normal_of(const ivl_sim_surface_t *surface, const ivl_sim_state_t *s)
{
    const ivl_wide_t x = s->q_WB[0], y = s->q_WB[1], z = s->q_WB[2], w = s->q_WB[3];
    const ivl_w3_t   row_z = {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)};
    if (ivl_d3_is_z(surface->normal_W))
    {
        return row_z;
    }
    const ivl_wrot_t R = {.row = {{1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
                                  {2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)},
                                  row_z}};
    return ivl_wrot_apply_inverse_d3(&R, surface->normal_W);
}

IVL_SIM_INLINE ivl_wide_t foot_gap(const ivl_sim_model_t *model, const ivl_sim_state_t *s, ivl_wide_t surface_m, int i)
{
    return surface_m - ivl_sim_surface_heights_of(&model->surface, s->p_foot_W_m[i]) - model->raw.leg_foot_radius_m;
}

ivl_mask_t world_gaps(const ivl_sim_group_t *group, const ivl_sim_state_t *s, ivl_wide_t t_s, ivl_mask_t which,
                      ivl_wide_t gap[IVL_SIM_GAPS])
{
    const ivl_sim_model_t   *model = group->model;
    const ivl_sim_surface_t *surface = &model->surface;
    const ivl_mask_t        *may_touch = group->touch.may_touch;
    const ivl_wide_t         surface_m = world_surface_m(group, t_s), far = ivl_wide(FAR_M);
    const ivl_wide_t         room = surface_m - ivl_sim_surface_heights_of(surface, s->p_WB_m);
    const ivl_mask_t         near = which & (room < model->reach_m + NEAR_MARGIN_M);
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        gap[i] = ivl_wide_select(which, far, gap[i]);
    }
    if (ivl_mask_any(near))
    {
        const ivl_w3_t normal = normal_of(surface, s);
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            gap[i] = ivl_wide_select(near & may_touch[i], foot_gap(model, s, surface_m, i), gap[i]);
        }
        for (int i = 0; i < IVL_SIM_PLATES; i++)
        {
            ivl_wide_t *plate = &gap[IVL_SIM_LEGS + i];
            *plate = ivl_wide_select(near & may_touch[IVL_SIM_LEGS + i], room - phys_plate_top(&model->plate[i], normal), *plate);
        }
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

/// Share of the tried step at which a foot touches first, in the lanes in which it may.  A foot rings: the cubic through height and speed finds
/// a touch within the step.
static ivl_wide_t foot_share(const ivl_sim_group_t *group, int leg, ivl_mask_t which)
{
    const ivl_sim_progress_t *progress = &group->progress;
    const ivl_sim_surface_t  *surface = &group->model->surface;
    const double              flees_mps = ivl_sim_surface_speed(surface);
    const ivl_wide_t          g0 = progress->gap_m[leg], g1 = progress->gap_after_m[leg], dt = progress->dt_s;
    const ivl_wide_t          d0 = -dt * (ivl_sim_surface_heights_of(surface, group->state.v_foot_W_mps[leg]) - flees_mps);
    const ivl_wide_t          d1 = -dt * (ivl_sim_surface_heights_of(surface, group->next.v_foot_W_mps[leg]) - flees_mps);
    const ivl_mask_t          may = which & (g1 < FAR_M) & (~(g1 >= -FOOT_TOLERANCE_M) | ((d0 < 0.0) & (d1 > 0.0)));
    ivl_wide_t                share = ivl_wide(WORLD_NO_EVENT);
    for (int lane = 0; lane < IVL_SIM_LANES && ivl_mask_any(may); lane++)
    {
        if (may[lane])
        {
            share[lane] = first_zero(g0[lane], d0[lane], g1[lane], d1[lane], FOOT_TOLERANCE_M);
        }
    }
    return share;
}

ivl_wide_t world_event_share(ivl_sim_group_t *group, ivl_mask_t which)
{
    const ivl_sim_progress_t *progress = &group->progress;
    ivl_wide_t                share = ivl_wide(WORLD_NO_EVENT);
    for (int i = 0; i < IVL_SIM_LEGS && ivl_mask_any(which); i++)
    {
        share = ivl_wide_smaller(foot_share(group, i, which), share);
    }
    for (int i = IVL_SIM_LEGS; i < IVL_SIM_GAPS; i++)
    {
        const ivl_wide_t g0 = progress->gap_m[i], g1 = progress->gap_after_m[i];
        const ivl_mask_t touches = which & (g1 < -PLATE_TOLERANCE_M);
        share = ivl_wide_smaller(ivl_wide_select(touches, g0 / (g0 - g1), ivl_wide(WORLD_NO_EVENT)), share);
    }
    return share;
}

static void hold(ivl_sim_group_t *group, int lane, int leg, ivl_sim_foot_t foot)
{
    ivl_sim_world_t *w = &group->world[lane];
    w->foot[leg] = foot;
    group->progress.restart[lane] = -1;
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

static double tolerance_m(int gap)
{
    return (gap < IVL_SIM_LEGS) ? FOOT_TOLERANCE_M : PLATE_TOLERANCE_M;
}

static void touch(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    const double     t_s = ivl_sim_world_time_s(group, lane);
    bool             foot_event = false;
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        if (group->progress.gap_m[i][lane] > tolerance_m(i))
        {
            continue;
        }
        if (!w->impact.happened)
        {
            w->impact = (ivl_sim_impact_t){true, t_s, ivl_sim_world_kin(group, lane)};
        }
        if (i < IVL_SIM_LEGS)
        {
            foot_event = true;
            group->touch.t_touch_s[i][lane] = t_s;
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
    ivl_sim_world_note_contact(group, lane);
    world_restart_step(group, lane);
}

void world_handle_touches(ivl_sim_group_t *group, ivl_mask_t which)
{
    ivl_mask_t open = ~(ivl_mask_t){0};
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        open &= group->progress.gap_m[i] > tolerance_m(i);  // positive form: a gap that is no number has been passed
    }
    const ivl_mask_t touches = which & ~open;
    for (int lane = 0; lane < IVL_SIM_LANES && ivl_mask_any(touches); lane++)
    {
        if (touches[lane])
        {
            touch(group, lane);
        }
    }
}

/// The held and the detached feet of a world.
static bool look_at_feet(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t        *w = &group->world[lane];
    const ivl_sim_params_t *raw = &w->model->raw;
    const double            t_s = ivl_sim_world_time_s(group, lane);
    bool                    event = false;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const double pull = group->rate.pull_N[i][lane];
        if ((w->foot[i] == IVL_SIM_FOOT_SLIDING && pull > 0.0) || (w->foot[i] == IVL_SIM_FOOT_STUCK && pull > raw->leg_adhesion_N))
        {
            hold(group, lane, i, IVL_SIM_FOOT_FREE);
            w->detached[i] = true;
            event = true;
        }
        else if (w->foot[i] == IVL_SIM_FOOT_SLIDING &&
                 t_s >= group->touch.t_touch_s[i][lane] + raw->leg_stick_delay_s - IVL_SIM_TIME_SLACK_S)
        {
            hold(group, lane, i, IVL_SIM_FOOT_STUCK);
            stop_held_feet(group, lane);
            event = true;
        }
        else if (w->detached[i])
        {
            const double gap = foot_gap(w->model, &group->state, world_surface_m(group, group->progress.t_s), i)[lane];
            w->detached[i] = !(gap > REARM_GAP_M);
        }
    }
    ivl_sim_world_note_contact(group, lane);
    if (event)
    {
        world_restart_step(group, lane);
    }
    return event;
}

ivl_mask_t world_handle_held(ivl_sim_group_t *group, ivl_mask_t which)
{
    ivl_mask_t changes = group->touch.sliding | group->touch.detached, event = {0};
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        changes |= group->rate.pull_N[i] > group->touch.hold_N[i];
    }
    changes &= which;
    for (int lane = 0; lane < IVL_SIM_LANES && ivl_mask_any(changes); lane++)
    {
        if (changes[lane] && look_at_feet(group, lane))
        {
            event[lane] = -1;
        }
    }
    return event;
}
