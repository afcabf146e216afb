#include "cf_planner.h"

#include <string.h>

#include "ivl_math.h"

static const float FULL_TURN = 2.0f * 3.14159265f;
static const float METRES_MAX = 1000.0f;  // a goal beyond is none
static const float TURN_RAD_MAX = 1.0e6f;

static float seconds(uint32_t from_ms, uint32_t to_ms)
{
    return (float)(to_ms - from_ms) * 1.0e-3f;
}

void ivl_cf_planner_init(ivl_cf_planner_t *planner)
{
    memset(planner, 0, sizeof *planner);
}

void ivl_cf_planner_tell(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, float yaw_rad)
{
    planner->last = (ivl_cf_goal_t){.p_W_m = p_W_m, .v_W_mps = v_W_mps, .yaw_rad = yaw_rad};
}

bool ivl_cf_planner_rests(const ivl_cf_planner_t *planner)
{
    return planner->plan == IVL_CF_PLAN_STOPPED || planner->plan == IVL_CF_PLAN_DISABLED;
}

void ivl_cf_planner_stop(ivl_cf_planner_t *planner)
{
    planner->plan = IVL_CF_PLAN_STOPPED;
}

bool ivl_cf_planner_finished(const ivl_cf_planner_t *planner, uint32_t now_ms)
{
    return planner->way == IVL_CF_WAY_NONE || seconds(planner->t_ms, now_ms) >= planner->duration_s;
}

// ---- planned ways

static void begin(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, ivl_cf_way_t way, float duration_s, uint32_t now_ms)
{
    planner->plan = plan;
    planner->way = way;
    planner->t_ms = now_ms;
    planner->duration_s = duration_s;
}

static void follow(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, const ivl_cf_goal_t *from, const ivl_cf_goal_t *to, float duration_s,
                   uint32_t now_ms)
{
    planner->piece = ivl_cf_piece_between(from, to, duration_s);
    begin(planner, plan, IVL_CF_WAY_PLANNED, planner->piece.duration_s, now_ms);
}

void ivl_cf_planner_hover(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, uint32_t now_ms)
{
    planner->last = (ivl_cf_goal_t){.p_W_m = p_W_m, .yaw_rad = yaw_rad};
    follow(planner, IVL_CF_PLAN_FLYING, &planner->last, &planner->last, 0.0f, now_ms);
}

/// The short way round.
static float turned_to(float from_rad, float to_rad)
{
    return from_rad + ivl_cf_wrapped(to_rad - from_rad);
}

void ivl_cf_planner_lift(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, float z_m, float yaw_rad, float duration_s, uint32_t now_ms)
{
    const ivl_cf_goal_t from = {.p_W_m = planner->last.p_W_m, .yaw_rad = ivl_cf_wrapped(planner->last.yaw_rad)};
    ivl_cf_goal_t       to = from;
    to.p_W_m.z = z_m;
    to.yaw_rad = turned_to(from.yaw_rad, yaw_rad);
    follow(planner, plan, &from, &to, duration_s, now_ms);
}

void ivl_cf_planner_go(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, bool linear, float duration_s, uint32_t now_ms)
{
    ivl_cf_goal_t from = planner->last;
    from.yaw_rad = ivl_cf_wrapped(from.yaw_rad);
    ivl_cf_goal_t to = {.p_W_m = p_W_m, .yaw_rad = turned_to(from.yaw_rad, yaw_rad)};
    if (linear && duration_s > 0.0f)
    {
        to.v_W_mps = from.v_W_mps = ivl_scale(ivl_sub(to.p_W_m, from.p_W_m), 1.0f / duration_s);
        to.yawrate_radps = from.yawrate_radps = (to.yaw_rad - from.yaw_rad) / duration_s;
        from.a_W_mps2 = ivl_vec3(0.0f, 0.0f, 0.0f);
    }
    follow(planner, IVL_CF_PLAN_FLYING, &from, &to, duration_s, now_ms);
}

// ---- spiral

/// A point that circles at an angle and a radius that both change steadily: where, how fast, and what bends it.
static ivl_cf_goal_t on_spiral(float angle_rad, float rate_radps, float r_m, float dr_mps)
{
    const ivl_sincos_t t = ivl_sincos(ivl_cf_wrapped(angle_rad));
    const ivl_vec3_t   out = {t.cos, t.sin, 0.0f}, along = {-t.sin, t.cos, 0.0f};
    return (ivl_cf_goal_t){
        .p_W_m = ivl_scale(out, r_m),
        .v_W_mps = ivl_add(ivl_scale(out, dr_mps), ivl_scale(along, r_m * rate_radps)),
        .a_W_mps2 = ivl_add(ivl_scale(out, -r_m * rate_radps * rate_radps), ivl_scale(along, 2.0f * dr_mps * rate_radps)),
    };
}

/// Forward, the centre is at the left of the heading, or, clockwise, at the right; sideways it is behind, or, clockwise, ahead.
void ivl_cf_planner_spiral(ivl_cf_planner_t *planner, const ivl_cf_spiral_t *s, uint32_t now_ms)
{
    const float      T = s->duration_s, quarter = 0.25f * FULL_TURN, half = 0.5f * FULL_TURN;
    const float      phi_rad = ivl_clamp(s->phi_rad, -FULL_TURN, FULL_TURN);
    const float      sense = s->clockwise ? -1.0f : 1.0f;
    const float      yaw_rad = ivl_cf_wrapped(planner->last.yaw_rad);
    const float      side = s->sideways ? (s->clockwise ? half : 0.0f) : -sense * quarter;
    const float      rate_radps = sense * phi_rad / T, dr_mps = (s->r1_m - s->r0_m) / T;
    ivl_cf_goal_t    from = on_spiral(yaw_rad + side, rate_radps, s->r0_m, dr_mps);
    ivl_cf_goal_t    to = on_spiral(yaw_rad + side + sense * phi_rad, rate_radps, s->r1_m, dr_mps);
    const ivl_vec3_t centre = ivl_sub(planner->last.p_W_m, from.p_W_m);
    from.p_W_m = planner->last.p_W_m;
    to.p_W_m = ivl_add(centre, to.p_W_m);
    to.p_W_m.z += s->climb_m;
    from.v_W_mps.z = to.v_W_mps.z = s->climb_m / T;
    from.yaw_rad = yaw_rad;
    to.yaw_rad = yaw_rad + sense * phi_rad;
    from.yawrate_radps = to.yawrate_radps = rate_radps;
    follow(planner, IVL_CF_PLAN_FLYING, &from, &to, T, now_ms);
}

// ---- uploaded trajectories

static ivl_cf_goal_t at_rest(ivl_cf_goal_t goal)
{
    return (ivl_cf_goal_t){.p_W_m = goal.p_W_m, .yaw_rad = goal.yaw_rad};
}

static ivl_vec3_t turned(ivl_vec3_t a, ivl_sincos_t by)
{
    return ivl_vec3(by.cos * a.x - by.sin * a.y, by.sin * a.x + by.cos * a.y, a.z);
}

/// As it was uploaded, then turned about the origin and moved; the way back is moved only.
static ivl_cf_goal_t placed(const ivl_cf_planner_t *planner, ivl_cf_goal_t goal)
{
    if (!planner->reversed && planner->way == IVL_CF_WAY_PLAIN)
    {
        const ivl_sincos_t by = ivl_sincos(planner->shift_yaw_rad);
        goal.p_W_m = turned(goal.p_W_m, by);
        goal.v_W_mps = turned(goal.v_W_mps, by);
        goal.a_W_mps2 = turned(goal.a_W_mps2, by);
        goal.yaw_rad += planner->shift_yaw_rad;
    }
    goal.p_W_m = ivl_add(goal.p_W_m, planner->shift_m);
    return goal;
}

/// A piece at a time of its own, stretched and perhaps backwards.
static ivl_cf_goal_t in_piece(const ivl_cf_planner_t *planner, const ivl_cf_piece_t *piece, float t_s)
{
    const float   speed = (planner->reversed ? -1.0f : 1.0f) / planner->timescale;
    ivl_cf_goal_t goal = ivl_cf_piece_at(piece, planner->reversed ? piece->duration_s + t_s * speed : t_s * speed);
    goal.v_W_mps = ivl_scale(goal.v_W_mps, speed);
    goal.a_W_mps2 = ivl_scale(goal.a_W_mps2, speed * speed);
    goal.yawrate_radps *= speed;
    return goal;
}

/// @return false if a piece cannot be read
static bool along_plain(const ivl_cf_planner_t *planner, float t_s, ivl_cf_goal_t *goal)
{
    ivl_cf_piece_t piece = {.duration_s = 0.0f};
    for (uint32_t i = 0; i < planner->n_pieces; i++)
    {
        const uint32_t number = planner->reversed ? planner->n_pieces - 1u - i : i;
        if (!ivl_cf_trajectory_piece(&planner->uploaded, planner->offset, number, &piece))
        {
            return false;
        }
        const float duration_s = piece.duration_s * planner->timescale;
        if (t_s <= duration_s)
        {
            *goal = placed(planner, in_piece(planner, &piece, t_s));
            return true;
        }
        t_s -= duration_s;
    }
    *goal = placed(planner, at_rest(ivl_cf_piece_at(&piece, planner->reversed ? 0.0f : piece.duration_s)));
    return true;
}

static ivl_cf_goal_t along_compressed(ivl_cf_planner_t *planner, float t_s)
{
    ivl_cf_compressed_seek(&planner->uploaded, &planner->head, t_s);
    return placed(planner, ivl_cf_piece_at(&planner->head.piece, t_s - planner->head.begin_s));
}

/// @return false if the way leads nowhere
static bool goal_at(ivl_cf_planner_t *planner, uint32_t now_ms, ivl_cf_goal_t *goal)
{
    const float t_s = seconds(planner->t_ms, now_ms);
    switch (planner->way)
    {
    case IVL_CF_WAY_PLANNED:
        *goal = (t_s <= planner->duration_s) ? ivl_cf_piece_at(&planner->piece, t_s)
                                             : at_rest(ivl_cf_piece_at(&planner->piece, planner->duration_s));
        break;
    case IVL_CF_WAY_PLAIN:
        if (!along_plain(planner, t_s, goal))
        {
            return false;
        }
        break;
    case IVL_CF_WAY_COMPRESSED:
        *goal = along_compressed(planner, t_s);
        break;
    case IVL_CF_WAY_NONE:
    default:
        return false;
    }
    return ivl_vec3_within(goal->p_W_m, METRES_MAX) && ivl_vec3_within(goal->v_W_mps, METRES_MAX) &&
           ivl_vec3_within(goal->a_W_mps2, METRES_MAX) && ivl_within(goal->yaw_rad, TURN_RAD_MAX);
}

/// @return false if a piece is missing
static bool measure(ivl_cf_planner_t *planner)
{
    ivl_cf_piece_t piece;
    planner->duration_s = 0.0f;
    for (uint32_t i = 0; i < planner->n_pieces; i++)
    {
        if (!ivl_cf_trajectory_piece(&planner->uploaded, planner->offset, i, &piece))
        {
            return false;
        }
        planner->duration_s += piece.duration_s * planner->timescale;
    }
    return planner->n_pieces > 0u;
}

static bool load(ivl_cf_planner_t *planner, const ivl_cf_definition_t *d, const ivl_cf_start_t *how)
{
    planner->offset = d->offset;
    planner->n_pieces = d->n_pieces;
    planner->timescale = how->timescale;
    planner->reversed = how->reversed;
    planner->shift_m = ivl_vec3(0.0f, 0.0f, 0.0f);
    planner->shift_yaw_rad = 0.0f;
    if (d->type == IVL_CF_TRAJECTORY_PLAIN)
    {
        planner->way = IVL_CF_WAY_PLAIN;
        return measure(planner);
    }
    const bool as_it_is = how->timescale >= 1.0f && how->timescale <= 1.0f && !how->reversed;
    planner->way = IVL_CF_WAY_COMPRESSED;
    planner->duration_s = ivl_cf_compressed_duration_s(&planner->uploaded, d->offset);
    return as_it_is && d->type == IVL_CF_TRAJECTORY_COMPRESSED && ivl_cf_compressed_begin(&planner->uploaded, d->offset, &planner->head);
}

bool ivl_cf_planner_start(ivl_cf_planner_t *planner, uint8_t id, const ivl_cf_start_t *how, uint32_t now_ms)
{
    if (id >= IVL_CF_TRAJECTORIES || planner->uploaded.defined[id].location != IVL_CF_TRAJECTORY_IN_MEMORY)
    {
        return false;
    }
    // a copy flies it, so that a trajectory that cannot be flown changes nothing
    ivl_cf_planner_t next = *planner;
    ivl_cf_goal_t    first;
    next.t_ms = now_ms;
    if (!load(&next, &planner->uploaded.defined[id], how) || !goal_at(&next, now_ms, &first))
    {
        return false;
    }
    if (how->relative_position)
    {
        next.shift_m = ivl_sub(planner->last.p_W_m, first.p_W_m);
        const bool turns = how->relative_yaw && next.way == IVL_CF_WAY_PLAIN;
        next.shift_yaw_rad = turns ? ivl_cf_wrapped(planner->last.yaw_rad - first.yaw_rad) : 0.0f;
    }
    next.plan = IVL_CF_PLAN_FLYING;
    *planner = next;
    return true;
}

void ivl_cf_planner_catch_up(ivl_cf_planner_t *planner, uint32_t now_ms)
{
    ivl_cf_goal_t goal;
    if (!ivl_cf_planner_rests(planner) && goal_at(planner, now_ms, &goal))
    {
        planner->last = goal;
    }
}

// ---- set-points

bool ivl_cf_planner_next(ivl_cf_planner_t *planner, uint32_t now_ms, ivl_cf_setpoint_t *setpoint)
{
    *setpoint = (ivl_cf_setpoint_t){.z = IVL_CF_MODE_OFF};
    if (ivl_cf_planner_rests(planner))
    {
        return planner->plan == IVL_CF_PLAN_STOPPED;
    }
    ivl_cf_goal_t goal;
    if (!goal_at(planner, now_ms, &goal))
    {
        planner->plan = IVL_CF_PLAN_DISABLED;
        return false;
    }
    if (planner->plan == IVL_CF_PLAN_LANDING && ivl_cf_planner_finished(planner, now_ms))
    {
        planner->plan = IVL_CF_PLAN_STOPPED;
    }
    planner->last = goal;
    *setpoint = (ivl_cf_setpoint_t){
        .xy = IVL_CF_MODE_ABS,
        .z = IVL_CF_MODE_ABS,
        .yaw = IVL_CF_MODE_ABS,
        .p_W_m = goal.p_W_m,
        .v_mps = goal.v_W_mps,
        .a_W_mps2 = goal.a_W_mps2,
        .yaw_rad = ivl_cf_wrapped(goal.yaw_rad),
    };
    return true;
}
