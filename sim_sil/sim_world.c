#include "sim_world.h"

#include "sim_step.h"

// A contact event is located to within these distances; at 1 m/s that is 0.1 us for a foot.
static const double FOOT_TOLERANCE_M = 1.0e-7;
static const double PLATE_TOLERANCE_M = 1.0e-6;
// A foot that came off must move this far away before it can stick again.
static const double REARM_GAP_M = 1.0e-3;
static const double NEAR_MARGIN_M = 0.05;  // more than a vehicle moves in one step
static const double FAR_M = 1.0;           // stands for the gap of what cannot make an event
static const double NO_EVENT = 2.0;        // share of a step, beyond its end
static const double TIME_SLACK_S = 1.0e-9;
static const double LEAST_V = 0.01;      // a drawn voltage stays above that of a supply that never sags
static const double STILL_RADPS = 20.0;  // a body that turns slower than this is not looked at closely

static double smaller(double a, double b)
{
    return (a < b) ? a : b;
}

// ---- starting -----------------------------------------------------------------------------------------------------------

void ivl_sim_world_rest_legs(const ivl_sim_model_t *model, ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t foot_B = ivl_d3_add(model->leg.hip_B_m[i], ivl_d3_scale(model->raw.leg_length_m, model->leg.rest_B[i]));
        ivl_d3_store(kin->p_foot_W_m[i], ivl_d3_add(ivl_d3_load(kin->p_WB_m), ivl_rot_apply(&R, foot_B)));
        memcpy(kin->v_foot_W_mps[i], kin->v_WB_mps, sizeof kin->v_WB_mps);
    }
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

/// Open-circuit voltage of this rollout: the one given, or drawn about the model's.
static void draw_battery(ivl_sim_world_t *w, double battery_V)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    if (battery_V > 0.0)
    {
        w->rotor.open_circuit_V = battery_V;
    }
    else if (raw->battery_voltage_V > 0.0 && raw->battery_voltage_scatter_V > 0.0)
    {
        double n[4];
        ivl_sim_normal4(&w->rng, IVL_SIM_DRAW_BATTERY, 0, n);
        const double drawn = raw->battery_voltage_V + raw->battery_voltage_scatter_V * n[0];
        w->rotor.open_circuit_V = (drawn > LEAST_V) ? drawn : LEAST_V;
    }
}

void ivl_sim_group_init(const ivl_sim_model_t *model, ivl_sim_group_t *group)
{
    const ivl_sim_foot_t free_feet[IVL_SIM_LEGS] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    memset(group, 0, sizeof *group);
    group->model = model;
    ivl_sim_kin_t resting;
    memset(&resting, 0, sizeof resting);
    resting.q_WB[3] = 1.0;
    ivl_sim_world_rest_legs(model, &resting);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        // an empty lane is computed along with the others: it must hold numbers
        ivl_sim_lane_set(&group->state, lane, &resting);
        ivl_sim_contact_set(model, &group->contact, lane, free_feet);
    }
}

void ivl_sim_world_place(ivl_sim_group_t *group, int lane, const ivl_sim_kin_t *kin)
{
    ivl_sim_world_t *w = &group->world[lane];
    ivl_sim_lane_set(&group->state, lane, kin);
    w->restart = true;
    w->gave_up = false;
    w->d_min_m = w->model->raw.world_ceiling_height_m - kin->p_WB_m[2];
}

ivl_sim_kin_t ivl_sim_world_kin(const ivl_sim_group_t *group, int lane)
{
    ivl_sim_kin_t kin;
    ivl_sim_lane_get(&group->state, lane, &kin);
    return kin;
}

void ivl_sim_world_start(ivl_sim_group_t *group, int lane, const ivl_sim_rng_t *rng, const double p_W_m[3], const double v_W_mps[3])
{
    ivl_sim_start_state_t start;
    memset(&start, 0, sizeof start);
    memcpy(start.p_W_m, p_W_m, sizeof start.p_W_m);
    memcpy(start.v_W_mps, v_W_mps, sizeof start.v_W_mps);
    start.q_WB[3] = 1.0;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        start.rotor_radps[i] = group->model->rotor_speed_hover_radps;
    }
    ivl_sim_world_start_from(group, lane, rng, &start);
}

/// Nose-up pitch of an attitude, within half a turn: the branch on which the integral of the rate begins.
static double nose_up_of(const double q_WB[4])
{
    const ivl_rot_t R = ivl_rot_from_quat(q_WB);
    return ivl_sim_atan2(R.row[2].x, R.row[0].x);
}

/// A start that turns: the feet go along as points of the body.
static void turn_legs(ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t  rate_W = ivl_rot_apply(&R, ivl_d3_load(kin->w_B_radps));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t arm = ivl_d3_sub(ivl_d3_load(kin->p_foot_W_m[i]), ivl_d3_load(kin->p_WB_m));
        ivl_d3_store(kin->v_foot_W_mps[i], ivl_d3_add(ivl_d3_load(kin->v_WB_mps), ivl_d3_cross(rate_W, arm)));
    }
}

/// Accelerations of the vehicle that was in this lane before must not reach the new one: what is no number would, even through a step of
/// no length.
static void forget_rates(ivl_sim_group_t *group, int lane)
{
    double *last = (double *)&group->last;
    for (size_t i = (size_t)lane; i < sizeof group->last / sizeof *last; i += IVL_SIM_LANES)
    {
        last[i] = 0.0;
    }
}

void ivl_sim_world_start_from(ivl_sim_group_t *group, int lane, const ivl_sim_rng_t *rng, const ivl_sim_start_state_t *start)
{
    const ivl_sim_model_t *model = group->model;
    ivl_sim_world_t       *w = &group->world[lane];
    ivl_sim_kin_t          kin;
    memset(&kin, 0, sizeof kin);
    memcpy(kin.p_WB_m, start->p_W_m, sizeof kin.p_WB_m);
    memcpy(kin.v_WB_mps, start->v_W_mps, sizeof kin.v_WB_mps);
    memcpy(kin.q_WB, start->q_WB, sizeof kin.q_WB);
    memcpy(kin.w_B_radps, start->w_B_radps, sizeof kin.w_B_radps);
    kin.pitch_rad = nose_up_of(kin.q_WB);
    ivl_sim_world_rest_legs(model, &kin);
    turn_legs(&kin);
    // all but the sensors, whose queue is large and needs no clearing
    memset(w, 0, offsetof(ivl_sim_world_t, sensors));
    memset(&w->firmware, 0, sizeof *w - offsetof(ivl_sim_world_t, firmware));
    w->model = model;
    w->rng = *rng;
    w->graded_s = model->raw.step_flight_s * model->raw.step_scale_norm;
    w->step_s = w->graded_s;
    ivl_sim_contact_set(model, &group->contact, lane, w->foot);
    ivl_sim_rotor_init(model, &w->rotor);
    memcpy(w->rotor.speed_radps, start->rotor_radps, sizeof w->rotor.speed_radps);
    memcpy(w->rotor.command_radps, start->rotor_radps, sizeof w->rotor.command_radps);
    draw_scatter(w);
    draw_battery(w, start->battery_V);
    ivl_sim_sensors_init(model, rng, &kin, &w->sensors);
    model->core.init(group->port, lane, &model->firmware, &w->firmware);
    forget_rates(group, lane);
    ivl_sim_world_place(group, lane, &kin);
    group->active[lane] = true;
}

void ivl_sim_world_rebase(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t   *w = &group->world[lane];
    ivl_sim_sensors_t *s = &w->sensors;
    const double       past_s = w->t_s;
    s->next_s -= past_s;
    s->held.t_s -= past_s;
    for (int i = 0; i < IVL_SIM_POSE_QUEUE; i++)
    {
        s->queue[i].t_s -= past_s;
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        w->t_touch_s[i] -= past_s;
        w->stuck_order[i] = 0;
    }
    w->t_s = 0.0;
    w->n_tick = 1;
    w->n_step = 0;
    w->n_evaluation = 0;
    w->n_order = 0;
    w->impact = (ivl_sim_impact_t){.happened = false};
    memset(w->plate_touched, 0, sizeof w->plate_touched);
    w->d_min_m = w->model->raw.world_ceiling_height_m - group->state.p_WB_m.z[lane];
}

// ---- events -------------------------------------------------------------------------------------------------------------

/// Height of a plate's highest point above the body origin depends on the world's z axis in body axes alone.
static ivl_d3_t up_of(const ivl_sim_state_t *s, int lane)
{
    const double x = s->q_WB[0][lane], y = s->q_WB[1][lane], z = s->q_WB[2][lane], w = s->q_WB[3][lane];
    return ivl_d3(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y));
}

/// Distances that make an event when they pass zero: of feet that may stick, and of plates that have not touched yet.
static void gaps(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane, double gap[IVL_SIM_GAPS])
{
    const ivl_sim_params_t *raw = &w->model->raw;
    const double            room = raw->world_ceiling_height_m - s->p_WB_m.z[lane];
    const bool              near = room < w->model->reach_m + NEAR_MARGIN_M;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const bool may_touch = near && (w->foot[i] == IVL_SIM_FOOT_FREE) && !w->detached[i];
        gap[i] = may_touch ? raw->world_ceiling_height_m - s->p_foot_W_m[i].z[lane] - raw->leg_foot_radius_m : FAR_M;
    }
    const ivl_d3_t up = near ? up_of(s, lane) : ivl_d3(0.0, 0.0, 1.0);
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        const bool may_touch = near && !w->plate_touched[i];
        gap[IVL_SIM_LEGS + i] = may_touch ? room - ivl_sim_plate_top(&w->model->plate[i], up) : FAR_M;
    }
}

static double hermite(double g0, double d0, double g1, double d1, double x)
{
    const double a = 2.0 * (g0 - g1) + d0 + d1, b = 3.0 * (g1 - g0) - 2.0 * d0 - d1;
    return ((a * x + b) * x + d0) * x + g0;
}

/// Share of a step at which a cubic, given by values and slopes at both ends, first falls to zero; NO_EVENT if it does not.
static double first_zero(double g0, double d0, double g1, double d1, double tolerance)
{
    double lo = 0.0, hi = 1.0;
    if (g1 >= -tolerance)
    {
        // the only way in and out again is a minimum in between
        if (!(d0 < 0.0 && d1 > 0.0))
        {
            return NO_EVENT;
        }
        const double a = 3.0 * (2.0 * (g0 - g1) + d0 + d1), b = 2.0 * (3.0 * (g1 - g0) - 2.0 * d0 - d1);
        const double root = b * b - 4.0 * a * d0;
        hi = (root > 0.0) ? 2.0 * d0 / (-b - sqrt(root)) : 1.0;
        if (!(hi > 0.0 && hi < 1.0) || hermite(g0, d0, g1, d1, hi) >= -tolerance)
        {
            return NO_EVENT;
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

/// Share of the tried step after which the earliest event happens.
static double event_share(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    const double    *g0 = w->trial.gap_m, dt = w->trial.dt_s;
    double           share = NO_EVENT;
    double          *g1 = w->trial.gap_after_m;
    gaps(w, &group->next, lane, g1);
    for (int i = 0; i < IVL_SIM_GAPS; i++)
    {
        double s = NO_EVENT;
        if (i >= IVL_SIM_LEGS)
        {
            s = (g1[i] < -PLATE_TOLERANCE_M) ? g0[i] / (g0[i] - g1[i]) : NO_EVENT;
        }
        else if (g1[i] < FAR_M)
        {
            // a foot rings: cubic through height and speed, so that a touch within the step is not missed
            const double d0 = -dt * group->state.v_foot_W_mps[i].z[lane], d1 = -dt * group->next.v_foot_W_mps[i].z[lane];
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

/// Four stuck feet hold the body redundantly, and near the posture in which the lines of the legs meet in one point it can
/// turn a little all the same: there a step must not turn it far, or the truss pumps energy.
static double longest_step(const ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    const double            most = smaller(w->impact.happened ? raw->step_swing_s : raw->step_flight_s, w->model->step.longest_s);
    if (ivl_sim_world_count_stuck(w) < IVL_SIM_LEGS)
    {
        return most;
    }
    const ivl_d3_t turn = ivl_d3(most * s->w_B_radps.x[lane], most * s->w_B_radps.y[lane], most * s->w_B_radps.z[lane]);
    const double   square = ivl_d3_dot(turn, turn);
    if (!(square > raw->step_turn_rad * raw->step_turn_rad))
    {
        return most;
    }
    const double turns = sqrt(square) / raw->step_turn_rad;
    return most / ((turns < IVL_SIM_TURNS_MAX) ? turns : IVL_SIM_TURNS_MAX);
}

/// After an event the motion begins anew, with a short step; from there it grows.
static void restart_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, int lane)
{
    const double scale = w->model->raw.step_scale_norm;
    w->graded_s = smaller(w->model->raw.step_touch_s * scale, longest_step(w, s, lane) * scale);
    w->step_s = w->graded_s;
}

static ivl_sim_pace_t pace_of(const ivl_sim_rate_t *rate, int lane)
{
    return (ivl_sim_pace_t){rate->swing_norm[lane], rate->turn2_per_s2[lane], rate->stretch_norm[lane]};
}

/// Grows, up to what is accurate; and no longer than the legs allow at present.
static void grow_step(ivl_sim_world_t *w, const ivl_sim_state_t *s, const ivl_sim_rate_t *rate, int lane)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    w->graded_s = smaller(w->graded_s * raw->step_growth_norm, longest_step(w, s, lane) * raw->step_scale_norm);
    const ivl_sim_pace_t pace = pace_of(rate, lane);
    w->step_s = ivl_sim_step_longest(&w->model->step, &pace, w->graded_s);
}

/// Feet and plates that have arrived at the ceiling.  Feet that arrive together are stopped together.
static void handle_touches(ivl_sim_group_t *group, int lane, const double gap[IVL_SIM_GAPS])
{
    ivl_sim_world_t *w = &group->world[lane];
    bool             event = false, foot_event = false;
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
        restart_step(w, &group->state, lane);
    }
}

/// Held feet: a sliding one sticks after the delay or lifts off, a stuck one comes off beyond the adhesion.
/// @return true if any did: the forces have jumped
static bool handle_held(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t        *w = &group->world[lane];
    const ivl_sim_params_t *raw = &w->model->raw;
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
        else if (w->foot[i] == IVL_SIM_FOOT_SLIDING && w->t_s >= w->t_touch_s[i] + raw->leg_stick_delay_s - TIME_SLACK_S)
        {
            hold(group, lane, i, IVL_SIM_FOOT_STUCK);
            stop_held_feet(group, lane);
            event = true;
        }
        else if (w->detached[i])
        {
            const double gap = raw->world_ceiling_height_m - group->state.p_foot_W_m[i].z[lane] - raw->leg_foot_radius_m;
            w->detached[i] = !(gap > REARM_GAP_M);
        }
    }
    if (event)
    {
        restart_step(w, &group->state, lane);
    }
    return event;
}

// ---- one step -----------------------------------------------------------------------------------------------------------

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
        if (w->foot[i] == IVL_SIM_FOOT_SLIDING && wait > TIME_SLACK_S && wait < step)
        {
            step = wait;
        }
    }
    // an excess of rounding size is no reason for two steps
    return (step < w->left_s * (1.0 - 1.0e-6)) ? w->left_s / ceil(w->left_s / step - 1.0e-6) : w->left_s;
}

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
        const ivl_sim_airflow_t body = {s->p_WB_m.z[lane],
                                        {s->v_WB_mps.x[lane], s->v_WB_mps.y[lane], s->v_WB_mps.z[lane]},
                                        {s->q_WB[0][lane], s->q_WB[1][lane], s->q_WB[2][lane], s->q_WB[3][lane]}};
        w->trial.rotor = w->rotor;
        thrust = ivl_sim_rotor_step(w->model, &w->trial.rotor, &body, dt);
    }
    group->dt_s[lane] = dt;
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
        gaps(w, &group->state, lane, w->trial.gap_m);
    }
    else
    {
        memcpy(w->trial.gap_m, w->trial.gap_after_m, sizeof w->trial.gap_m);
    }
    handle_touches(group, lane, w->trial.gap_m);
    w->trial.starting = w->restart;
    w->restart = false;
    w->trial.n_try = 0;
    propose(group, lane, w->trial.starting ? 0.0 : choose_step(w, plates_press(&group->last, lane), group->contact.any_sliding));
}

/// Four stuck feet hold the body redundantly.  Where two of these constraints nearly coincide the forces change with the rates
/// faster than any step that is accurate elsewhere follows: a prediction of the body's rate that is off by more than half
/// of it is one to try again from.
static bool mispredicted(const ivl_sim_group_t *group, int lane)
{
    if (ivl_sim_world_count_stuck(&group->world[lane]) < IVL_SIM_LEGS)
    {
        return false;
    }
    const ivl_w3_t *met = &group->rate.alpha_B_radps2, *last = &group->last.alpha_B_radps2, *w = &group->state.w_B_radps;
    const ivl_d3_t  change = ivl_d3(met->x[lane] - last->x[lane], met->y[lane] - last->y[lane], met->z[lane] - last->z[lane]);
    const ivl_d3_t  rate = ivl_d3(w->x[lane], w->y[lane], w->z[lane]);
    const double    dt = group->world[lane].trial.dt_s;
    return dt * dt * ivl_d3_dot(change, change) > ivl_d3_dot(rate, rate) + STILL_RADPS * STILL_RADPS;
}

/// Longest step that the forces which the tried one has met allow.
static double longest_retry(const ivl_sim_group_t *group, int lane)
{
    const ivl_sim_world_t *w = &group->world[lane];
    const ivl_sim_pace_t   pace = pace_of(&group->rate, lane);
    const double           tried = w->trial.dt_s;
    double                 most = plates_press(&group->rate, lane) ? choose_step(w, true, group->contact.any_sliding) : tried;
    if (!ivl_sim_step_allowed(&w->model->step, &pace, IVL_SIM_TRIED_MORE, tried))
    {
        most = smaller(most, ivl_sim_step_longest(&w->model->step, &pace, tried));
    }
    return mispredicted(group, lane) ? smaller(most, 0.5 * tried) : most;
}

/// Looks at the step that was tried.
/// @return true if it stands; if not, another has been proposed
static bool judge(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (handle_held(group, lane))
    {
        w->trial.n_try = 0;  // the forces have jumped: begin again from here
        return false;
    }
    if (w->trial.starting || w->trial.n_try >= IVL_SIM_RETRIES_MAX)
    {
        return true;
    }
    const double most = longest_retry(group, lane);
    // where a motion that is none meets the ceiling says nothing, and to step there would take for ever
    const bool   locate = w->trial.n_try < IVL_SIM_LOCATE_MAX && !ivl_sim_world_diverged(&group->next, lane);
    const double share = locate ? event_share(group, lane) : NO_EVENT;
    const double dt = (share < 1.0) ? share * w->trial.dt_s : w->trial.dt_s;
    if (dt < w->trial.dt_s || most < w->trial.dt_s - TIME_SLACK_S)
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
    return !(rate_radps < 1.0e6 && fabs(s->p_WB_m.z[lane]) < 1.0e6);
}

static void accept(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    if (w->trial.starting)
    {
        gaps(w, &group->next, lane, w->trial.gap_after_m);
        return;
    }
    if (w->trial.powered)
    {
        w->rotor = w->trial.rotor;
    }
    w->t_s += w->trial.dt_s;
    w->left_s -= w->trial.dt_s;
    w->n_step++;
    if (ivl_sim_world_diverged(&group->next, lane))
    {
        w->left_s = 0.0;  // the tick ends here, and with it the landing
    }
    const double d = w->model->raw.world_ceiling_height_m - group->next.p_WB_m.z[lane];
    w->d_min_m = (d < w->d_min_m) ? d : w->d_min_m;
    grow_step(w, &group->next, &group->rate, lane);
}

/// One lane of a struct that is made of wide numbers only.
static void copy_lane(void *to, const void *from, size_t size, int lane)
{
    double       *t = to;
    const double *f = from;
    for (size_t i = (size_t)lane; i < size / sizeof *t; i += IVL_SIM_LANES)
    {
        t[i] = f[i];
    }
}

/// state = next and last = rate, in the lanes where the step stands.
static void commit(ivl_sim_group_t *group, const bool stands[IVL_SIM_LANES])
{
    bool all = true;
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        all = all && stands[lane];
    }
    if (all)
    {
        group->state = group->next;
        group->last = group->rate;
        return;
    }
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (stands[lane])
        {
            copy_lane(&group->state, &group->next, sizeof group->state, lane);
            copy_lane(&group->last, &group->rate, sizeof group->last, lane);
        }
    }
}

bool ivl_sim_world_ready(const ivl_sim_group_t *group, int lane)
{
    return !(group->world[lane].left_s > TIME_SLACK_S);
}

static void set_due(ivl_sim_world_t *w, double span_s)
{
    w->left_s = span_s;
    w->evaluations_left = ivl_sim_step_evaluations(&w->model->step, span_s);
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
        stands[lane] = moving[lane] && judge(group, lane);
        if (stands[lane])
        {
            accept(group, lane);
            group->world[lane].trial.n_try = 0;
        }
    }
    commit(group, stands);
}

static bool all_ready(const ivl_sim_group_t *group)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (group->active[lane] && !ivl_sim_world_ready(group, lane))
        {
            return false;
        }
    }
    return true;
}

void ivl_sim_group_advance(ivl_sim_group_t *group, double dt_s)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (group->active[lane])
        {
            set_due(&group->world[lane], dt_s);
        }
    }
    while (!all_ready(group))
    {
        ivl_sim_group_step(group);
    }
}

static void body_of(const ivl_sim_state_t *s, int lane, ivl_sim_kin_t *kin)
{
    ivl_d3_store(kin->p_WB_m, ivl_d3(s->p_WB_m.x[lane], s->p_WB_m.y[lane], s->p_WB_m.z[lane]));
    ivl_d3_store(kin->v_WB_mps, ivl_d3(s->v_WB_mps.x[lane], s->v_WB_mps.y[lane], s->v_WB_mps.z[lane]));
    ivl_d3_store(kin->w_B_radps, ivl_d3(s->w_B_radps.x[lane], s->w_B_radps.y[lane], s->w_B_radps.z[lane]));
    for (int i = 0; i < 4; i++)
    {
        kin->q_WB[i] = s->q_WB[i][lane];
    }
}

static void fly(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t       *w = &group->world[lane];
    const ivl_sim_model_t *model = w->model;
    if (model->core.has_autopilot)
    {
        model->core.step(group->port, lane, &model->firmware, &w->firmware, &w->in, &w->out);
    }
    else
    {
        ivl_sim_autopilot_step(model, group->port, lane, &w->in, &w->autopilot, &w->firmware, &w->out);
    }
}

void ivl_sim_world_tick(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t       *w = &group->world[lane];
    const ivl_sim_model_t *model = w->model;
    // time is a count of ticks, so that it does not drift
    w->t_s = (double)w->n_tick * model->tick_s;
    w->n_tick++;
    set_due(w, (double)w->n_tick * model->tick_s - w->t_s);
    if (model->core.every_tick || !ivl_motors_latched_off(&w->firmware))
    {
        ivl_sim_kin_t kin;  // of which sensors need the body's part
        body_of(&group->state, lane, &kin);
        const double a[3] = {group->last.a_WB_mps2.x[lane], group->last.a_WB_mps2.y[lane], group->last.a_WB_mps2.z[lane]};
        ivl_sim_sensors_read(model, &w->rng, &kin, a, w->t_s, &w->sensors, &w->in);
        fly(group, lane);
        ivl_sim_rotor_command(model, &w->rotor, w->out.thrust_N);
        const bool approaches = w->firmware.phase == IVL_PHASE_APPROACH;
        w->n_approach_tick += approaches ? 1 : 0;
        w->n_valid_tick += (approaches && w->out.ceiling.valid) ? 1 : 0;
    }
}

int ivl_sim_world_count_stuck(const ivl_sim_world_t *w)
{
    int n = 0;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        n += (w->foot[i] == IVL_SIM_FOOT_STUCK) ? 1 : 0;
    }
    return n;
}
