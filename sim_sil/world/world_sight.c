#include "world_sight.h"

#include "world_clock.h"

/// Number of the camera's clock among the draws of sensors' clocks, behind those of the sensors of one number.
static const uint32_t CLOCK = 100;

void ivl_sim_sight_start(const ivl_sim_model_t *model, void *port, int lane, const ivl_sim_rng_t *rng, ivl_sim_sight_t *sight)
{
    if (port == NULL)
    {
        return;
    }
    memset(sight, 0, sizeof *sight);
    sight->next_s = ivl_sim_uniform(rng, IVL_SIM_DRAW_SENSOR_PHASE, CLOCK) / model->raw.camera_rate_hz;
    model->eye.start(port, lane, rng);
}

static void multiply(const double a[4], const double b[4], double q[4])
{
    q[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
    q[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    q[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
    q[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

/// An attitude `age_s` ago, at a constant rate of the body; of unit length.
static void turn_back(const double q[4], const double w_B_radps[3], double age_s, double before[4])
{
    const double x = -0.5 * age_s * w_B_radps[0], y = -0.5 * age_s * w_B_radps[1], z = -0.5 * age_s * w_B_radps[2];
    const double s = 1.0 / sqrt(1.0 + x * x + y * y + z * z), small[4] = {s * x, s * y, s * z, s};
    multiply(q, small, before);
    const double length = sqrt(before[0] * before[0] + before[1] * before[1] + before[2] * before[2] + before[3] * before[3]);
    for (int i = 0; i < 4; i++)
    {
        before[i] /= length;
    }
}

/// Axes of the surface, as a rotation of the world's: rows of R_SW, and the same as a quaternion.
typedef struct
{
    ivl_d3_t forward, left, into;
    double   q_SW[4];
} axes_t;

static axes_t axes_of(const ivl_sim_surface_t *surface)
{
    axes_t         axes = {.forward = ivl_sim_surface_forward(surface), .into = surface->normal_W, .q_SW = {0.0, 0.0, 0.0, 1.0}};
    const ivl_d3_t n = axes.into;
    axes.left = ivl_d3_cross(n, axes.forward);
    // the shortest turn that takes z to the normal, backwards; of a floor half a turn about x
    const double w = 1.0 + n.z, length = sqrt(w * w + n.x * n.x + n.y * n.y);
    if (length > 1.0e-4)
    {
        axes.q_SW[0] = n.y / length;
        axes.q_SW[1] = -n.x / length;
        axes.q_SW[3] = w / length;
    }
    else
    {
        axes.q_SW[0] = 1.0;
        axes.q_SW[3] = 0.0;
    }
    return axes;
}

static void into_axes(const axes_t *axes, ivl_d3_t a_W, double a_S[3])
{
    a_S[0] = ivl_d3_dot(axes->forward, a_W);
    a_S[1] = ivl_d3_dot(axes->left, a_W);
    a_S[2] = ivl_d3_dot(axes->into, a_W);
}

/// From where a picture is taken that fell due `age_s` ago.
static void stand(const ivl_sim_scene_t *scene, double t_s, double age_s, const ivl_in_t *in, ivl_sim_look_t *at)
{
    const ivl_sim_surface_t *surface = &scene->model->surface;
    const ivl_sim_kin_t     *kin = scene->kin;
    const axes_t             axes = axes_of(surface);
    const double             told[4] = {(double)in->q_WB.x, (double)in->q_WB.y, (double)in->q_WB.z, (double)in->q_WB.w};
    const double             rate[3] = {(double)in->w_B_radps.x, (double)in->w_B_radps.y, (double)in->w_B_radps.z};
    const ivl_d3_t           a = ivl_d3_load(scene->a_W_mps2), v = ivl_d3_load(kin->v_WB_mps), u = surface->velocity_W_mps;
    // the surface's point moves along
    const ivl_d3_t seen_from = ivl_d3_add(surface->point_W_m, ivl_d3_scale(t_s - age_s, u));
    const ivl_d3_t back = ivl_d3_scale(age_s, ivl_d3_sub(v, ivl_d3_scale(0.5 * age_s, a)));
    double         before[4];
    at->t_s = t_s - age_s;
    into_axes(&axes, ivl_d3_sub(ivl_d3_sub(ivl_d3_load(kin->p_WB_m), back), seen_from), at->p_SB_m);
    at->p_SB_m[2] = -ivl_sim_scene_distance_m(scene, age_s);
    into_axes(&axes, ivl_d3_sub(ivl_d3_sub(v, ivl_d3_scale(age_s, a)), u), at->v_SB_mps);
    memcpy(at->w_B_radps, kin->w_B_radps, sizeof at->w_B_radps);
    turn_back(kin->q_WB, kin->w_B_radps, age_s, before);
    multiply(axes.q_SW, before, at->q_SB);
    turn_back(told, rate, age_s, before);
    multiply(axes.q_SW, before, at->q_told_SB);
}

static void take(const ivl_sim_params_t *raw, const ivl_sim_rng_t *rng, const ivl_sim_seen_t *seen, ivl_sim_sight_t *sight)
{
    const bool lost = raw->camera_drop_norm > 0.0 && ivl_sim_uniform(rng, IVL_SIM_DRAW_SIGHT_DROP, sight->n_taken) < raw->camera_drop_norm;
    sight->queue[sight->n_taken % IVL_SIM_SIGHT_QUEUE] =
        (ivl_sim_sighting_t){.due_s = sight->next_s + raw->camera_delay_s + raw->camera_transport_s,
                             .sampled_s = sight->next_s - seen->age_s + raw->camera_transport_s,
                             .rrev_per_s = (float)seen->rrev_per_s,
                             .of_y_radps = (float)seen->of_y_radps,
                             .valid = seen->valid ? 1 : 0,
                             .lost = lost ? 1 : 0};
    sight->n_taken++;
}

/// What is not later than what is there already is nothing new, as on the vehicle (app_reading.c).
static void tell(const ivl_sim_sighting_t *sighting, float value, ivl_reading_t *reading)
{
    const uint64_t t_us = ivl_sim_clock_us(sighting->sampled_s);
    if (t_us > reading->t_us)
    {
        *reading = (ivl_reading_t){.t_us = t_us, .value = sighting->valid ? value : 0.0f, .valid = sighting->valid};
    }
}

static void deliver(double t_s, ivl_sim_sight_t *sight, ivl_in_t *in)
{
    while (sight->n_delivered != sight->n_taken)
    {
        const ivl_sim_sighting_t *sighting = &sight->queue[sight->n_delivered % IVL_SIM_SIGHT_QUEUE];
        if (sighting->due_s > t_s + IVL_SIM_TIME_SLACK_S)
        {
            return;
        }
        if (!sighting->lost)
        {
            tell(sighting, sighting->rrev_per_s, &in->rrev);
            tell(sighting, sighting->of_y_radps, &in->flow);
        }
        sight->n_delivered++;
    }
}

void ivl_sim_sight_read(const ivl_sim_scene_t *scene, void *port, int lane, const ivl_sim_rng_t *rng, double t_s, bool looks,
                        ivl_sim_sight_t *sight, ivl_in_t *in)
{
    if (port == NULL)
    {
        return;
    }
    // a tick brings one picture at the most
    if (looks && sight->next_s <= t_s + IVL_SIM_TIME_SLACK_S)
    {
        ivl_sim_look_t at;
        ivl_sim_seen_t seen;
        stand(scene, t_s, t_s - sight->next_s, in, &at);
        scene->model->eye.look(port, lane, sight->n_taken, &at, &seen);
        take(&scene->model->raw, rng, &seen, sight);
        sight->next_s += 1.0 / scene->model->raw.camera_rate_hz;
    }
    deliver(t_s, sight, in);
}
