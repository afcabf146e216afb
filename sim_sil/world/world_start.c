#include "world_group.h"

static const double LEAST_V = 0.01;  // a drawn voltage stays above that of a supply that never sags

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

static void draw_scatter(const ivl_sim_world_t *w, ivl_sim_rotors_t *rotor, int lane)
{
    const double sigma = w->model->raw.rotor_thrust_scatter_norm;
    if (sigma > 0.0)
    {
        double n[4];
        ivl_sim_normal4(&w->rng, IVL_SIM_DRAW_THRUST, 0, n);
        for (int i = 0; i < IVL_SIM_MOTORS; i++)
        {
            const double factor = 1.0 + sigma * n[i];
            rotor->scatter[i][lane] = (factor > 0.0) ? factor : 0.0;
        }
    }
}

/// Open-circuit voltage of this rollout: the one given, or drawn about the model's.
static void draw_battery(const ivl_sim_world_t *w, ivl_sim_rotors_t *rotor, int lane, double battery_V)
{
    const ivl_sim_params_t *raw = &w->model->raw;
    if (battery_V > 0.0)
    {
        rotor->open_circuit_V[lane] = battery_V;
    }
    else if (raw->battery_voltage_V > 0.0 && raw->battery_voltage_scatter_V > 0.0)
    {
        double n[4];
        ivl_sim_normal4(&w->rng, IVL_SIM_DRAW_BATTERY, 0, n);
        const double drawn = raw->battery_voltage_V + raw->battery_voltage_scatter_V * n[0];
        rotor->open_circuit_V[lane] = (drawn > LEAST_V) ? drawn : LEAST_V;
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
        // an empty lane is computed along with the others: it must hold numbers, and be away from the surface
        ivl_sim_lane_set(&group->state, lane, &resting);
        ivl_sim_contact_set(model, &group->contact, lane, free_feet);
        group->progress.surface_m[lane] = ivl_sim_surface_height_of(&model->surface, ivl_d3_load(resting.p_WB_m)) + 2.0 * model->reach_m;
    }
}

void ivl_sim_world_place(ivl_sim_group_t *group, int lane, const ivl_sim_kin_t *kin)
{
    ivl_sim_world_t *w = &group->world[lane];
    ivl_sim_lane_set(&group->state, lane, kin);
    group->progress.restart[lane] = -1;
    group->progress.n_try[lane] = 0;
    w->gave_up = false;
    group->progress.d_min_m[lane] = ivl_sim_world_gap_m(group, lane);
    ivl_sim_world_note_contact(group, lane);
}

void ivl_sim_world_note_contact(ivl_sim_group_t *group, int lane)
{
    const ivl_sim_world_t *w = &group->world[lane];
    ivl_sim_touch_t       *touch = &group->touch;
    bool                   sliding = false, detached = false, all_stuck = true;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const bool is_free = w->foot[i] == IVL_SIM_FOOT_FREE, is_stuck = w->foot[i] == IVL_SIM_FOOT_STUCK;
        touch->may_touch[i][lane] = (is_free && !w->detached[i]) ? -1 : 0;
        touch->hold_N[i][lane] = is_stuck ? w->model->raw.leg_adhesion_N : (is_free ? (double)INFINITY : 0.0);
        sliding = sliding || (w->foot[i] == IVL_SIM_FOOT_SLIDING);
        detached = detached || w->detached[i];
        all_stuck = all_stuck && is_stuck;
    }
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        touch->may_touch[IVL_SIM_LEGS + i][lane] = w->plate_touched[i] ? 0 : -1;
    }
    touch->sliding[lane] = sliding ? -1 : 0;
    touch->detached[lane] = detached ? -1 : 0;
    touch->all_stuck[lane] = all_stuck ? -1 : 0;
    touch->impacted[lane] = w->impact.happened ? -1 : 0;
}

double ivl_sim_world_surface_m(const ivl_sim_group_t *group, int lane)
{
    return group->progress.surface_m[lane] + group->progress.t_s[lane] * ivl_sim_surface_speed(&group->model->surface);
}

double ivl_sim_world_gap_m(const ivl_sim_group_t *group, int lane)
{
    return ivl_sim_world_surface_m(group, lane) -
           ivl_sim_surface_height_of(&group->model->surface, ivl_w3_lane(&group->state.p_WB_m, lane));
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

/// A world at time 0 that has taken no step and touched nothing.
static void begin(ivl_sim_group_t *group, int lane)
{
    const ivl_sim_model_t *model = group->model;
    ivl_sim_progress_t    *progress = &group->progress;
    progress->t_s[lane] = 0.0;
    progress->left_s[lane] = 0.0;
    progress->n_step[lane] = 0;
    progress->n_evaluation[lane] = 0;
    progress->evaluations_left[lane] = 0;
    progress->graded_s[lane] = model->raw.step_flight_s * model->raw.step_scale_norm;
    progress->step_s[lane] = progress->graded_s[lane];
    progress->surface_m[lane] = ivl_sim_surface_height(&model->surface, 0.0);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        group->touch.t_touch_s[i][lane] = 0.0;
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
    memset(w, 0, sizeof *w);
    w->model = model;
    w->rng = *rng;
    begin(group, lane);
    ivl_sim_contact_set(model, &group->contact, lane, w->foot);
    ivl_sim_rotor_init(model, &group->rotor, lane);
    ivl_sim_rotor_set(&group->rotor, lane, start->rotor_radps);
    draw_scatter(w, &group->rotor, lane);
    draw_battery(w, &group->rotor, lane, start->battery_V);
    ivl_sim_sensors_init(model, rng, &kin, &w->sensors);
    ivl_sim_sight_start(model, group->eyes, lane, rng, &w->sight);
    model->core.init(group->port, lane, &model->firmware, &w->firmware);
    // accelerations of the vehicle that was in this lane before must not reach the new one: what is no number would, even
    // through a step of no length
    ivl_sim_rate_lane_clear(&group->last, lane);
    ivl_sim_world_place(group, lane, &kin);
    group->active[lane] = true;
}

void ivl_sim_world_rebase(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t   *w = &group->world[lane];
    ivl_sim_sensors_t *s = &w->sensors;
    const double       past_s = ivl_sim_world_time_s(group, lane);
    s->next_s -= past_s;
    s->held.t_s -= past_s;
    for (int i = 0; i < IVL_SIM_POSE_QUEUE; i++)
    {
        s->queue[i].t_s -= past_s;
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        group->touch.t_touch_s[i][lane] -= past_s;
        w->stuck_order[i] = 0;
    }
    group->progress.surface_m[lane] = ivl_sim_world_surface_m(group, lane);
    group->progress.t_s[lane] = 0.0;
    group->progress.n_step[lane] = 0;
    group->progress.n_evaluation[lane] = 0;
    w->n_tick = 1;
    w->n_order = 0;
    w->impact = (ivl_sim_impact_t){.happened = false};
    memset(w->plate_touched, 0, sizeof w->plate_touched);
    group->progress.d_min_m[lane] = ivl_sim_world_gap_m(group, lane);
    ivl_sim_world_note_contact(group, lane);
}
