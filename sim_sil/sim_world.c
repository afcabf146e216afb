#include "sim_world.h"

// A contact event is located to within these distances; at 1 m/s that is 0.1 us for a foot.
static const double FOOT_TOLERANCE_M = 1.0e-7;
static const double PLATE_TOLERANCE_M = 1.0e-6;
// A foot that came off must move this far away before it can stick again.
static const double REARM_GAP_M = 1.0e-3;
static const int LOCATE_MAX = 12;

enum
{
    GAPS = IVL_SIM_LEGS + IVL_SIM_PLATES ///< feet, then plates
};

static double foot_gap(const ivl_sim_model_t *model, const ivl_sim_kin_t *s, int leg)
{
    return model->raw.world_ceiling_height_m - s->p_foot_W_m[2][leg] - model->raw.leg_foot_radius_m;
}

/// Legs at rest on a level or tilted body that moves without turning.
static void place_feet(const ivl_sim_model_t *model, ivl_sim_kin_t *s)
{
    const ivl_rot_t R = ivl_rot_from_quat(s->q_WB);
    const ivl_l3_t foot_B = ivl_l3_add(model->leg.hip_B_m,
                                       ivl_l3_scale(ivl_v4_set(model->raw.leg_length_m), model->leg.rest_B));
    ivl_l3_store(s->p_foot_W_m, ivl_l3_add(ivl_rot_apply_l3(&R, foot_B), ivl_l3_set(ivl_d3_load(s->p_WB_m))));
    ivl_l3_store(s->v_foot_W_mps, ivl_l3_set(ivl_d3_load(s->v_WB_mps)));
}

static void draw_scatter(ivl_sim_world_t *w)
{
    const double sigma = w->model->raw.rotor_thrust_scatter_norm;
    if (sigma > 0.0)
    {
        double n[4];
        ivl_sim_normal4(&w->rng, IVL_SIM_DRAW_THRUST, 0, n);
        for (int i = 0; i < IVL_SIM_MOTORS; i++)
        {
            const double factor = 1.0 + sigma * n[i];
            w->rotor.scatter[i] = (factor > 0.0) ? factor : 0.0;
        }
    }
}

void ivl_sim_world_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const double p_W_m[3],
                        const double v_W_mps[3], ivl_sim_world_t *w)
{
    // field by field: the sensors' queue is large and needs no clearing
    w->model = model;
    w->rng = *rng;
    w->t_s = 0.0;
    w->n_tick = 0;
    w->n_step = 0;
    w->step_s = model->raw.step_flight_s * model->raw.step_scale_norm;
    memset(&w->kin, 0, sizeof w->kin);
    memcpy(w->kin.p_WB_m, p_W_m, sizeof w->kin.p_WB_m);
    memcpy(w->kin.v_WB_mps, v_W_mps, sizeof w->kin.v_WB_mps);
    w->kin.q_WB[3] = 1.0;
    place_feet(model, &w->kin);
    ivl_sim_contact_init(model, &w->contact);
    ivl_sim_rotor_init(model, &w->rotor);
    draw_scatter(w);
    ivl_sim_sensors_init(model, rng, &w->kin, &w->sensors);
    memset(w->a_W_mps2, 0, sizeof w->a_W_mps2);
    ivl_init(&model->firmware, &w->firmware);
    memset(&w->in, 0, sizeof w->in);
    memset(&w->out, 0, sizeof w->out);
    w->impact.happened = false;
    memset(w->t_touch_s, 0, sizeof w->t_touch_s);
    memset(w->detached, 0, sizeof w->detached);
    memset(w->stuck_order, 0, sizeof w->stuck_order);
    w->n_order = 0;
    memset(w->plate_touched, 0, sizeof w->plate_touched);
    w->d_min_m = model->raw.world_ceiling_height_m - p_W_m[2];
}

/// Distances that make an event when they pass zero: of feet that may stick, and of plates that have not touched yet.
/// Others are reported as far away.
static void gaps(const ivl_sim_world_t *w, const ivl_sim_kin_t *s, double gap[GAPS])
{
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const bool may_touch = (w->contact.foot[i] == IVL_SIM_FOOT_FREE) && !w->detached[i];
        gap[i] = may_touch ? foot_gap(w->model, s, i) : 1.0;
    }
    const double highest = s->p_WB_m[2] + w->model->reach_m;
    const bool near = highest > w->model->raw.world_ceiling_height_m;
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        gap[IVL_SIM_LEGS + i] = (near && !w->plate_touched[i]) ? -ivl_sim_plate_overlap(w->model, s, i) : 1.0;
    }
}

static double tolerance(int index)
{
    return (index < IVL_SIM_LEGS) ? FOOT_TOLERANCE_M : PLATE_TOLERANCE_M;
}

static double hermite(double g0, double d0, double g1, double d1, double x)
{
    const double a = 2.0 * (g0 - g1) + d0 + d1, b = 3.0 * (g1 - g0) - 2.0 * d0 - d1;
    return ((a * x + b) * x + d0) * x + g0;
}

/// Share of the step after which a foot first reaches the ceiling, 2 if it does not: from the cubic through height and
/// speed at both ends, so that a foot which rings into the ceiling and back within one step is not missed.
static double foot_share(const ivl_sim_world_t *w, const ivl_sim_kin_t *next, double dt, double g0, double g1, int leg)
{
    const double d0 = -w->kin.v_foot_W_mps[2][leg] * dt, d1 = -next->v_foot_W_mps[2][leg] * dt;
    double lo = 0.0, hi = 1.0;
    if (g1 >= -FOOT_TOLERANCE_M)
    {
        // the only way in and out again is a minimum in between
        if (!(d0 < 0.0 && d1 > 0.0))
        {
            return 2.0;
        }
        const double a = 3.0 * (2.0 * (g0 - g1) + d0 + d1), b = 2.0 * (3.0 * (g1 - g0) - 2.0 * d0 - d1);
        const double root = b * b - 4.0 * a * d0;
        hi = (root > 0.0) ? 2.0 * d0 / (-b - sqrt(root)) : 1.0;
        if (!(hi > 0.0 && hi < 1.0) || hermite(g0, d0, g1, d1, hi) >= -FOOT_TOLERANCE_M)
        {
            return 2.0;
        }
    }
    for (int i = 0; i < 50; i++)
    {
        const double mid = 0.5 * (lo + hi);
        if (hermite(g0, d0, g1, d1, mid) > 0.0)
        {
            lo = mid;
        }
        else
        {
            hi = mid;
        }
    }
    return hi;
}

/// Share of the step after which the earliest event happens, 2 if there is none.
static double event_share(const ivl_sim_world_t *w, const ivl_sim_kin_t *next, double dt, const double g0[GAPS])
{
    double g1[GAPS], share = 2.0;
    gaps(w, next, g1);
    for (int i = 0; i < GAPS; i++)
    {
        double s = 2.0;
        if (i < IVL_SIM_LEGS)
        {
            s = (g0[i] < 1.0) ? foot_share(w, next, dt, g0[i], g1[i], i) : 2.0;
        }
        else if (g1[i] < -PLATE_TOLERANCE_M)
        {
            s = (g0[i] > 0.0) ? g0[i] / (g0[i] - g1[i]) : 0.0;
        }
        share = (s < share) ? s : share;
    }
    return share;
}

static void remember_impact(ivl_sim_world_t *w)
{
    if (!w->impact.happened)
    {
        w->impact.happened = true;
        w->impact.t_s = w->t_s;
        w->impact.kin = w->kin;
    }
}

static void stick(ivl_sim_world_t *w, int leg)
{
    ivl_sim_contact_set(w->model, &w->contact, leg, IVL_SIM_FOOT_STUCK);
    bool listed = false;
    for (int i = 0; i < w->n_order; i++)
    {
        listed = listed || (w->stuck_order[i] == leg + 1);
    }
    if (!listed)
    {
        w->stuck_order[w->n_order++] = (int8_t)(leg + 1);
    }
}

/// Feet and plates that have arrived at the ceiling.  Feet that arrive together are stopped together.
static bool handle_touches(ivl_sim_world_t *w)
{
    double gap[GAPS];
    bool event = false, foot_event = false;
    gaps(w, &w->kin, gap);
    for (int i = 0; i < GAPS; i++)
    {
        const bool closing = (i >= IVL_SIM_LEGS) || (w->kin.v_foot_W_mps[2][i] > 0.0);
        if (gap[i] > tolerance(i) || !closing)
        {
            continue;
        }
        event = true;
        remember_impact(w);
        if (i >= IVL_SIM_LEGS)
        {
            w->plate_touched[i - IVL_SIM_LEGS] = true;
        }
        else
        {
            foot_event = true;
            w->t_touch_s[i] = w->t_s;
            if (w->model->raw.leg_stick_delay_s > 0.0)
            {
                ivl_sim_contact_set(w->model, &w->contact, i, IVL_SIM_FOOT_SLIDING);
            }
            else
            {
                stick(w, i);
            }
        }
    }
    if (foot_event)
    {
        ivl_sim_impulse(w->model, &w->contact, &w->kin);
    }
    return event;
}

/// Held feet: a sliding one sticks after the delay or lifts off, a stuck one comes off beyond the adhesion.
static bool handle_held(ivl_sim_world_t *w, const ivl_sim_forces_t *forces)
{
    bool event = false;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        if (w->contact.foot[i] == IVL_SIM_FOOT_SLIDING && forces->pull_N[i] > 0.0)
        {
            ivl_sim_contact_set(w->model, &w->contact, i, IVL_SIM_FOOT_FREE);
            w->detached[i] = true;
            event = true;
        }
        else if (w->contact.foot[i] == IVL_SIM_FOOT_SLIDING &&
                 w->t_s >= w->t_touch_s[i] + w->model->raw.leg_stick_delay_s)
        {
            stick(w, i);
            ivl_sim_impulse(w->model, &w->contact, &w->kin);
            event = true;
        }
        else if (w->contact.foot[i] == IVL_SIM_FOOT_STUCK && forces->pull_N[i] > w->model->raw.leg_adhesion_N)
        {
            ivl_sim_contact_set(w->model, &w->contact, i, IVL_SIM_FOOT_FREE);
            w->detached[i] = true;
            event = true;
        }
        else if (w->detached[i] && foot_gap(w->model, &w->kin, i) > REARM_GAP_M)
        {
            w->detached[i] = false;
        }
    }
    return event;
}

/// The step to try: graded after events, short while a plate presses, a whole share of what is left, and not beyond the
/// instant at which a sliding foot may stick.
static double choose_step(const ivl_sim_world_t *w, const ivl_sim_forces_t *forces, double left_s)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    double step = w->step_s;
    const double plate = raw->step_plate_s * raw->step_scale_norm;
    if ((forces->plate_touches[0] || forces->plate_touches[1]) && step > plate)
    {
        step = plate;
    }
    for (int i = 0; i < IVL_SIM_LEGS && w->contact.any_sliding; i++)
    {
        const double wait = w->t_touch_s[i] + raw->leg_stick_delay_s - w->t_s;
        if (w->contact.foot[i] == IVL_SIM_FOOT_SLIDING && wait > 1.0e-9 && wait < step)
        {
            step = wait;
        }
    }
    return (step < left_s) ? left_s / ceil(left_s / step - 1.0e-6) : left_s;
}

static void grade_step(ivl_sim_world_t *w, bool event)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    const double most = (w->impact.happened ? raw->step_swing_s : raw->step_flight_s) * raw->step_scale_norm;
    const double next = event ? raw->step_touch_s * raw->step_scale_norm : w->step_s * raw->step_growth_norm;
    w->step_s = (next < most) ? next : most;
}

static void watch(ivl_sim_world_t *w)
{
    const double d = w->model->raw.world_ceiling_height_m - w->kin.p_WB_m[2];
    w->d_min_m = (d < w->d_min_m) ? d : w->d_min_m;
    w->n_step++;
}

/// One integration step, cut at the first contact event; returns its length.
static double step(ivl_sim_world_t *w, double left_s)
{
    const ivl_sim_model_t *model = w->model;
    ivl_sim_kin_t rate, next;
    ivl_sim_forces_t forces = {{0.0}, {0.0}, {false, false}};
    double g0[GAPS];
    if (handle_touches(w))
    {
        grade_step(w, true);
    }
    gaps(w, &w->kin, g0);
    ivl_sim_rotor_t rotor = w->rotor;
    double dt = (w->step_s < left_s) ? left_s / ceil(left_s / w->step_s - 1.0e-6) : left_s;
    ivl_sim_load_t load = ivl_sim_rotor_step(model, &rotor, &w->kin, dt);
    ivl_sim_rate(model, &w->contact, &load, &w->kin, &rate, &forces);
    if (handle_held(w, &forces))
    {
        grade_step(w, true);
        gaps(w, &w->kin, g0);
        ivl_sim_rate(model, &w->contact, &load, &w->kin, &rate, &forces);
    }
    double chosen = choose_step(w, &forces, left_s);
    double share = 1.0;
    for (int i = 0; i < LOCATE_MAX && share < 2.0; i++)
    {
        if (chosen < dt)
        {
            // a shorter step has other mean rotor forces
            dt = chosen;
            rotor = w->rotor;
            load = ivl_sim_rotor_step(model, &rotor, &w->kin, dt);
            ivl_sim_rate(model, &w->contact, &load, &w->kin, &rate, &forces);
        }
        ivl_sim_rk4(model, &w->contact, &load, &rate, dt, &w->kin, &next);
        share = event_share(w, &next, dt, g0);
        chosen = dt * share;
    }
    memcpy(w->a_W_mps2, forces.a_WB_mps2, sizeof w->a_W_mps2);
    w->rotor = rotor;
    w->kin = next;
    w->t_s += dt;
    watch(w);
    grade_step(w, false);
    return dt;
}

void ivl_sim_world_advance(ivl_sim_world_t *w, double dt_s)
{
    double left = dt_s;
    while (left > 1.0e-9)
    {
        left -= step(w, left);
    }
    if (handle_touches(w))
    {
        grade_step(w, true);
    }
}

void ivl_sim_world_tick(ivl_sim_world_t *w)
{
    const ivl_sim_model_t *model = w->model;
    // time is a count of ticks, so that it does not drift
    const double start = w->t_s, end = (double)(w->n_tick + 1) * model->tick_s;
    if (!ivl_motors_latched_off(&w->firmware))
    {
        ivl_sim_sensors_read(model, &w->rng, &w->kin, w->a_W_mps2, w->t_s, &w->sensors, &w->in);
        ivl_step(&model->firmware, &w->firmware, &w->in, &w->out);
        ivl_sim_rotor_command(model, &w->rotor, w->out.thrust_N);
    }
    ivl_sim_world_advance(w, end - start);
    w->t_s = end;
    w->n_tick++;
}

int ivl_sim_world_count_stuck(const ivl_sim_world_t *w)
{
    int n = 0;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        n += (w->contact.foot[i] == IVL_SIM_FOOT_STUCK) ? 1 : 0;
    }
    return n;
}
