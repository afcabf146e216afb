#include "world_group.h"

#include "world_step_size.h"

static void set_due(ivl_sim_group_t *group, int lane, double span_s)
{
    group->progress.left_s[lane] = span_s;
    group->progress.evaluations_left[lane] = ivl_sim_step_evaluations(&group->model->step, span_s);
}

static void body_of(const ivl_sim_state_t *s, int lane, ivl_sim_kin_t *kin)
{
    ivl_d3_store(kin->p_WB_m, ivl_w3_lane(&s->p_WB_m, lane));
    ivl_d3_store(kin->v_WB_mps, ivl_w3_lane(&s->v_WB_mps, lane));
    ivl_d3_store(kin->w_B_radps, ivl_w3_lane(&s->w_B_radps, lane));
    for (int i = 0; i < 4; i++)
    {
        kin->q_WB[i] = s->q_WB[i][lane];
    }
}

/// Puts a vehicle that is to follow a reference into its lane.
static void follow(const ivl_sample_t *sample, const ivl_reference_t *ref, int lane, ivl_sim_drive_t *drive)
{
    const ivl_vec3_t from[] = {sample->p_WB_m, sample->v_WB_mps, sample->w_B_radps, ref->p_W_m, ref->v_W_mps, ref->a_W_mps2};
    ivl_s3_t *const  to[] = {&drive->p_WB_m,    &drive->v_WB_mps,    &drive->w_B_radps,
                             &drive->p_ref_W_m, &drive->v_ref_W_mps, &drive->a_ref_W_mps2};
    for (size_t i = 0; i < sizeof to / sizeof to[0]; i++)
    {
        to[i]->x[lane] = from[i].x;
        to[i]->y[lane] = from[i].y;
        to[i]->z[lane] = from[i].z;
    }
    drive->q_WB[0][lane] = sample->q_WB.x;
    drive->q_WB[1][lane] = sample->q_WB.y;
    drive->q_WB[2][lane] = sample->q_WB.z;
    drive->q_WB[3][lane] = sample->q_WB.w;
}

/// Sensors and flight core of one vehicle, up to the tracking controller.
/// @return true if that is to make the thrusts
static bool decide(ivl_sim_group_t *group, int lane, ivl_reference_t *ref)
{
    ivl_sim_world_t       *w = &group->world[lane];
    const ivl_sim_model_t *model = w->model;
    const double           t_s = ivl_sim_world_time_s(group, lane);
    ivl_sim_kin_t          kin;  // of which sensors need the body's part
    body_of(&group->state, lane, &kin);
    ivl_sim_scene_t scene = {.model = model, .kin = &kin, .surface_height_m = ivl_sim_world_surface_m(group, lane)};
    ivl_d3_store(scene.a_W_mps2, ivl_w3_lane(&group->last.a_WB_mps2, lane));
    ivl_sim_sensors_read(&scene, &w->rng, t_s, &w->sensors, &w->in);
    ivl_sim_sight_read(&scene, group->eyes, lane, &w->rng, t_s, w->firmware.phase <= IVL_PHASE_APPROACH, &w->sight, &w->in);
    if (model->core.has_autopilot)
    {
        model->core.step(group->port, lane, &model->firmware, &w->firmware, &w->in, &w->out);
        return false;
    }
    return ivl_sim_autopilot_decide(model, group->port, lane, &w->in, &w->autopilot, &w->firmware, &w->out, ref);
}

/// What follows from the thrusts of the flight core.
/// @param[out] thrust_N  of this lane
static void drive_motors(ivl_sim_group_t *group, int lane, ivl_wide_t thrust_N[IVL_SIM_MOTORS])
{
    ivl_sim_world_t       *w = &group->world[lane];
    const ivl_sim_model_t *model = w->model;
    if (!model->core.has_autopilot)
    {
        ivl_sim_autopilot_drive(model, &w->out);
    }
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        thrust_N[i][lane] = (double)w->out.thrust_N[i];
    }
    const bool approaches = w->firmware.phase == IVL_PHASE_APPROACH;
    w->n_approach_tick += approaches ? 1 : 0;
    w->n_valid_tick += (approaches && w->out.ceiling.valid) ? 1 : 0;
}

static void begin_tick(ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t *w = &group->world[lane];
    // time is a count of ticks, so that it does not drift
    const double t_s = (double)w->n_tick * group->model->tick_s;
    group->progress.t_s[lane] = t_s;
    w->n_tick++;
    set_due(group, lane, (double)w->n_tick * group->model->tick_s - t_s);
}

void ivl_sim_world_ticks(ivl_sim_group_t *group, const bool due[IVL_SIM_LANES])
{
    const ivl_sim_model_t *model = group->model;
    ivl_sim_drive_t       *drive = &group->drive;
    bool                   follows[IVL_SIM_LANES], any = false;
    ivl_mask_t             steps = {0};
    ivl_wide_t             thrust_N[IVL_SIM_MOTORS] = {{0.0}};
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_world_t *w = &group->world[lane];
        ivl_reference_t  ref;
        follows[lane] = false;
        if (due[lane])
        {
            begin_tick(group, lane);
            steps[lane] = (model->core.every_tick || !ivl_motors_latched_off(&w->firmware)) ? -1 : 0;
        }
        if (steps[lane] && decide(group, lane, &ref))
        {
            follow(&w->firmware.sense.sample, &ref, lane, drive);
            drive->tan_tilt_max = w->firmware.derived.tan_tilt_cmd_max;
            follows[lane] = true;
            any = true;
        }
    }
    if (any)
    {
        ivl_sim_drive(&model->firmware, drive);
    }
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        for (int i = 0; i < IVL_SIM_MOTORS && follows[lane]; i++)
        {
            group->world[lane].out.thrust_N[i] = drive->thrust_N[i][lane];
        }
        if (steps[lane])
        {
            drive_motors(group, lane, thrust_N);
        }
    }
    if (ivl_mask_any(steps))
    {
        ivl_sim_rotor_command(model, &group->rotor, &steps, thrust_N);
    }
}

void ivl_sim_world_tick(ivl_sim_group_t *group, int lane)
{
    bool due[IVL_SIM_LANES] = {false};
    due[lane] = true;
    ivl_sim_world_ticks(group, due);
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
