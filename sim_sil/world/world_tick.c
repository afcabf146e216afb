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
    const double t_s = (double)w->n_tick * model->tick_s;
    group->progress.t_s[lane] = t_s;
    w->n_tick++;
    set_due(group, lane, (double)w->n_tick * model->tick_s - t_s);
    if (model->core.every_tick || !ivl_motors_latched_off(&w->firmware))
    {
        ivl_sim_kin_t kin;  // of which sensors need the body's part
        body_of(&group->state, lane, &kin);
        ivl_sim_scene_t scene = {.model = model, .kin = &kin, .surface_height_m = ivl_sim_world_surface_m(group, lane)};
        ivl_d3_store(scene.a_W_mps2, ivl_w3_lane(&group->last.a_WB_mps2, lane));
        ivl_sim_sensors_read(&scene, &w->rng, t_s, &w->sensors, &w->in);
        fly(group, lane);
        ivl_sim_rotor_command(model, &group->rotor, lane, w->out.thrust_N);
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
