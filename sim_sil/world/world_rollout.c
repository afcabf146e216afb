#include "world_rollout.h"

#include "ivl_level_out.h"
#include "phys_energy.h"
#include "phys_plates.h"
#include "world_step_size.h"

#include <float.h>

static const char *const END_NAMES[] = {"contact_time", "missed",     "missed_time", "time_max",
                                        "refused",      "not_finite", "step_limit",  "no_go"};
_Static_assert(sizeof END_NAMES / sizeof END_NAMES[0] == IVL_SIM_END_COUNT, "a name for each end");

// Outcomes are compared byte by byte: there must be none that no field owns.
#define FIELD_SIZE(c_type, name, count, np, unit, lo, hi, dflt, doc) +sizeof(c_type) * (count)
_Static_assert(sizeof(ivl_sim_outcome_t) == 0 IVL_SIM_OUTCOME_FIELDS(FIELD_SIZE), "a gap between two fields");

static const double QUATERNION_SLACK = 1.0e-3;  // of the squared length of a stated attitude

const char *ivl_sim_end_name(int end)
{
    return (end >= 0 && end < IVL_SIM_END_COUNT) ? END_NAMES[end] : "?";
}

/// The approach in the world, where the vehicle flies it: the velocity that the specification gives is as seen from the surface.
typedef struct
{
    double speed_mps, angle_rad;  ///< of a surface at rest those of the specification
    double sine, cosine;
    double flees_mps;  ///< speed of the surface along its normal
} approach_t;

static approach_t approach_of(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec)
{
    const ivl_sim_params_t *raw = &model->raw;
    approach_t              a = {
        .speed_mps = spec->speed_mps[0], .angle_rad = spec->angle_deg[0] * (IVL_SIM_PI / 180.0), .flees_mps = raw->surface_speed_away_mps};
    ivl_sim_sincos(a.angle_rad, &a.sine, &a.cosine);
    if (fabs(raw->surface_speed_along_mps) + fabs(raw->surface_speed_away_mps) > 0.0)
    {
        const double along = a.speed_mps * a.cosine + raw->surface_speed_along_mps, rising = a.speed_mps * a.sine + a.flees_mps;
        a.speed_mps = sqrt(along * along + rising * rising);
        a.angle_rad = ivl_sim_atan2(rising, along);
        a.sine = (a.speed_mps > 0.0) ? rising / a.speed_mps : 1.0;
        a.cosine = (a.speed_mps > 0.0) ? along / a.speed_mps : 0.0;
    }
    return a;
}

/// Distance from the plane of the cues at which a level rollout starts.                          [MODEL eq. 6.1, 6.2]
static double start_distance(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec, const approach_t *a)
{
    const double accel = (double)model->firmware.approach_accel_mps2, hold_s = model->raw.start_hold_time_s;
    const double path = 0.5 * a->speed_mps * a->speed_mps / accel + a->speed_mps * hold_s;
    switch ((ivl_sim_start_t)spec->start[0])
    {
    case IVL_SIM_START_FLOWN:
        return ivl_sim_larger(a->sine * path - a->flees_mps * (a->speed_mps / accel + hold_s), model->raw.start_room_m);
    case IVL_SIM_START_AT_TRIGGER:
        return spec->d_ceil_m[0];
    case IVL_SIM_START_IMPARTED:
    case IVL_SIM_START_STATE:
    case IVL_SIM_START_COUNT:
    default:
        return (a->speed_mps * a->sine - a->flees_mps) * 1.0;
    }
}

/// Level and without rotation: hovering for `flown`, else at the approach velocity.
static void level_start(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec, ivl_sim_start_state_t *start)
{
    const approach_t         a = approach_of(model, spec);
    const ivl_sim_surface_t *surface = &model->surface;
    const ivl_d3_t           n = surface->normal_W, forward = ivl_sim_surface_forward(surface);
    const double             height = ivl_sim_surface_height(surface, 0.0);
    const double             plane = height + model->raw.world_sensed_gap_offset_m;
    const double             speed = (spec->start[0] == IVL_SIM_START_FLOWN) ? 0.0 : a.speed_mps;
    const ivl_d3_t           foot = ivl_d3_sub(surface->point_W_m, ivl_d3_scale(height, n));
    const ivl_d3_t           approach = ivl_d3_add(ivl_d3_scale(speed * a.cosine, forward), ivl_d3_scale(speed * a.sine, n));
    ivl_d3_store(start->p_W_m, ivl_d3_add(foot, ivl_d3_scale(plane - start_distance(model, spec, &a), n)));
    ivl_d3_store(start->v_W_mps, approach);
    start->q_WB[3] = 1.0;
}

/// The state that the specification gives.
/// @return false if its quaternion is none
static bool stated_start(const ivl_sim_spec_t *spec, ivl_sim_start_state_t *start)
{
    double square = 0.0;
    for (int i = 0; i < 4; i++)
    {
        square += spec->q_start_WB[i] * spec->q_start_WB[i];
    }
    if (!(fabs(square - 1.0) < QUATERNION_SLACK))
    {
        return false;
    }
    memcpy(start->p_W_m, spec->p_start_W_m, sizeof start->p_W_m);
    memcpy(start->v_W_mps, spec->v_start_W_mps, sizeof start->v_W_mps);
    memcpy(start->w_B_radps, spec->w_start_B_radps, sizeof start->w_B_radps);
    for (int i = 0; i < 4; i++)
    {
        start->q_WB[i] = spec->q_start_WB[i] / sqrt(square);
        start->rotor_radps[i] = (spec->rotor_start_radps[i] < 0.0) ? start->rotor_radps[i] : spec->rotor_start_radps[i];
    }
    start->battery_V = spec->battery_start_V[0];
    return true;
}

ivl_policy_t ivl_sim_policy(int32_t form, const double theta[IVL_SIM_THETAS], bool at_once)
{
    const ivl_form_t *f = ivl_form((uint32_t)form);
    ivl_policy_t      policy = {.id = {.seq = 1, .form = (uint8_t)form}, .n = (f != NULL) ? f->n_params : 0u, .at_once = at_once};
    for (uint32_t i = 0; i < policy.n; i++)
    {
        policy.theta[i] = (float)theta[i];
    }
    policy.id.crc = ivl_policy_crc(&policy);
    return policy;
}

/// Until its time a flip that is timed has a threshold that no cue reaches; from then on the policy flips at once.
static void time_flip(ivl_sim_world_t *world, const ivl_sim_spec_t *spec)
{
    if (spec->flip_at_s[0] > 0.0)
    {
        const double next_s = (double)world->n_tick * world->model->tick_s;
        world->firmware.policy.theta[0] = FLT_MAX;
        world->firmware.policy.at_once = next_s >= spec->flip_at_s[0] - 1.0e-9;
    }
}

static void request_approach(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec, const double p_W_m[3], ivl_command_t *cmd)
{
    const approach_t a = approach_of(model, spec);
    cmd->request = IVL_REQUEST_APPROACH;
    cmd->p_hover_W_m = (ivl_vec3_t){(float)p_W_m[0], (float)p_W_m[1], (float)p_W_m[2]};
    cmd->speed_mps = (float)a.speed_mps;
    cmd->angle_rad = (float)a.angle_rad;
}

/// True if some part of the vehicle reaches beyond the surface: no landing can begin there.
static bool behind_surface(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t  normal = ivl_rot_apply_inverse(&R, model->surface.normal_W);
    const double    height = ivl_sim_surface_height_of(&model->surface, ivl_d3_load(kin->p_WB_m));
    double          top = height;
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        const double plate = height + ivl_sim_plate_top(&model->plate[i], normal);
        top = (plate > top) ? plate : top;
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const double center = ivl_sim_surface_height_of(&model->surface, ivl_d3_load(kin->p_foot_W_m[i]));
        const double foot = center + model->raw.leg_foot_radius_m;
        top = (foot > top) ? foot : top;
    }
    return !(top < ivl_sim_surface_height(&model->surface, 0.0));
}

bool ivl_sim_rollout_start(ivl_sim_group_t *group, int lane, const ivl_sim_spec_t *spec)
{
    const ivl_sim_model_t *model = group->model;
    ivl_sim_world_t       *world = &group->world[lane];
    const ivl_sim_rng_t    rng = {spec->seed[0], spec->stream[0]};
    ivl_sim_start_state_t  start;
    memset(&start, 0, sizeof start);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        start.rotor_radps[i] = model->rotor_speed_hover_radps;
    }
    if (spec->start[0] != IVL_SIM_START_STATE)
    {
        level_start(model, spec, &start);
    }
    else if (!stated_start(spec, &start))
    {
        return false;
    }
    ivl_sim_world_start_from(group, lane, &rng, &start);
    const ivl_sim_kin_t kin = ivl_sim_world_kin(group, lane);
    if (behind_surface(model, &kin))
    {
        return false;
    }
    request_approach(model, spec, start.p_W_m, &world->in.cmd);
    const bool moves = fabs(model->raw.surface_speed_along_mps) + fabs(model->raw.surface_speed_away_mps) > 0.0;
    if (moves && !ivl_sense_command_good(&model->firmware, &world->in.cmd))
    {
        return false;  // in the world too slow or too fast, or away from a surface that comes nearer
    }
    const ivl_policy_t policy = ivl_sim_policy(spec->form[0], spec->theta, spec->start[0] == IVL_SIM_START_AT_TRIGGER);
    if (spec->flip_at_s[0] > 0.0 && ivl_form((uint32_t)spec->form[0]) != &ivl_form_constant)
    {
        return false;  // where the threshold is, and that there is one, is known of this form alone
    }
    return model->core.commit(group->port, lane, &model->firmware, &world->firmware, &policy) == IVL_OK;
}

void ivl_sim_outcome_clear(ivl_sim_outcome_t *o)
{
    memset(o, 0, sizeof *o);
    double *const fields[] = {o->t_trigger_s,       o->t_impact_s,         o->t_end_s,       o->theta_impact_deg, o->vx_trigger_mps,
                              o->vz_trigger_mps,    o->rate_trigger_radps, o->vx_impact_mps, o->vz_impact_mps,    o->rate_impact_radps,
                              o->d_trigger_m,       o->rrev_trigger,       o->of_y_trigger,  o->d_min_m,          o->d_true_trigger_m,
                              o->d_sigma_trigger_m, o->d_valid_norm,       o->p_land,        o->d_decided_m};
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
    {
        fields[i][0] = (double)NAN;
    }
}

/// Velocity as seen from the surface: forward along it, and towards it.
static void seen_from_surface(const ivl_sim_surface_t *surface, const double v_W_mps[3], double *along_mps, double *closing_mps)
{
    const ivl_d3_t v = ivl_d3_load(v_W_mps);
    *along_mps = ivl_d3_dot(ivl_sim_surface_forward(surface), ivl_sim_surface_tangential(surface, v));
    *closing_mps = ivl_sim_surface_closing(surface, v);
}

/// Truth at the tick at which the flight core triggered, and what it saw.
static void note_trigger(const ivl_sim_group_t *group, int lane, ivl_sim_outcome_t *o)
{
    const ivl_sim_world_t  *world = &group->world[lane];
    const ivl_sim_kin_t     now = ivl_sim_world_kin(group, lane), *before = &now;
    const ivl_state_t      *firmware = &world->firmware;
    const ivl_sim_params_t *raw = &world->model->raw;
    o->triggered[0] = 1;
    o->t_trigger_s[0] = ivl_sim_world_time_s(group, lane);
    seen_from_surface(&world->model->surface, before->v_WB_mps, o->vx_trigger_mps, o->vz_trigger_mps);
    o->rate_trigger_radps[0] = -before->w_B_radps[1];
    o->d_trigger_m[0] = (double)firmware->snapshot.d_ceil_m;
    o->d_true_trigger_m[0] = ivl_sim_world_surface_m(group, lane) + raw->world_sensed_gap_offset_m -
                             ivl_sim_surface_height_of(&world->model->surface, ivl_d3_load(before->p_WB_m));
    o->d_sigma_trigger_m[0] = (double)firmware->snapshot.d_sigma_m;
    o->rrev_trigger[0] = (double)firmware->snapshot.rrev_per_s;
    o->of_y_trigger[0] = (double)firmware->snapshot.of_y_radps;
}

/// Nose-up pitch from the attitude itself, on the branch that the integral of the rate tells.
static double pitch_deg(const ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const double    angle = ivl_sim_atan2(R.row[2].x, R.row[0].x);
    const double    turns = floor((kin->pitch_rad - angle) / (2.0 * IVL_SIM_PI) + 0.5);
    return (angle + 2.0 * IVL_SIM_PI * turns) * (180.0 / IVL_SIM_PI);
}

static void note_end(const ivl_sim_group_t *group, int lane, ivl_sim_end_t end, ivl_sim_outcome_t *o)
{
    const ivl_sim_world_t    *world = &group->world[lane];
    const ivl_sim_progress_t *progress = &group->progress;
    o->end_reason[0] = (int32_t)end;
    o->t_end_s[0] = progress->t_s[lane];
    o->n_legs[0] = ivl_sim_world_count_stuck(world);
    memcpy(o->leg_order, world->stuck_order, sizeof o->leg_order);
    o->body_contact[0] = world->plate_touched[IVL_SIM_PROP_PLATE] ? 1 : 0;
    o->base_contact[0] = world->plate_touched[IVL_SIM_BASE_PLATE] ? 1 : 0;
    o->d_min_m[0] = progress->d_min_m[lane];
    const ivl_decision_t *decision = &world->firmware.decision;
    if (decision->made)
    {
        o->decided[0] = 1;
        o->no_go[0] = decision->go ? 0 : 1;
        o->p_land[0] = (double)decision->p_land;
        o->d_decided_m[0] = (double)decision->d_ceil_m;
    }
    o->n_steps[0] = (uint32_t)progress->n_step[lane];
    o->n_ticks[0] = world->n_tick;
    if (world->n_approach_tick > 0)
    {
        o->d_valid_norm[0] = (double)world->n_valid_tick / (double)world->n_approach_tick;
    }
    if (world->impact.happened)
    {
        const ivl_sim_kin_t *kin = &world->impact.kin;
        o->t_impact_s[0] = world->impact.t_s;
        o->theta_impact_deg[0] = pitch_deg(kin);
        seen_from_surface(&world->model->surface, kin->v_WB_mps, o->vx_impact_mps, o->vz_impact_mps);
        o->rate_impact_radps[0] = -kin->w_B_radps[1];
    }
}

/// With the motors cut the centre of mass is a projectile: if its apex plus the reach of the vehicle stays away from the
/// surface, no contact can follow.  The legs' share of the centre of mass lies within `reach` of the origin.
static bool out_of_reach(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double surface_height_m)
{
    double linear[3], angular[3];
    ivl_sim_momentum(model, kin, linear, angular);
    const ivl_sim_surface_t *surface = &model->surface;
    const double             pull = model->raw.world_gravity_mps2 * ivl_d3_dot(model->up_W, surface->normal_W);
    if (pull < 0.0)
    {
        return false;  // it falls on what it faces
    }
    const double rising = ivl_d3_along(surface->normal_W, ivl_d3_load(linear)) / model->mass_total_kg;
    const double closing = rising - ivl_sim_surface_speed(surface);
    const double rise = (closing > 0.0) ? 0.5 * closing * closing / pull : 0.0;
    const double leg_share = 1.0 - model->raw.body_mass_kg / model->mass_total_kg;
    const double reach = model->reach_m * (1.0 + 2.0 * leg_share);
    return ivl_sim_surface_height_of(surface, ivl_d3_load(kin->p_WB_m)) + rise + reach < surface_height_m;
}

// a level-out is over once the vehicle was to hover for this long
static const double HOVER_S = 0.5;

static bool ended(const ivl_sim_group_t *group, int lane, const ivl_sim_outcome_t *o, ivl_sim_end_t *end)
{
    const ivl_sim_world_t  *world = &group->world[lane];
    const ivl_sim_params_t *raw = &world->model->raw;
    const double            slack = 1.0e-9, t_s = ivl_sim_world_time_s(group, lane);
    if (ivl_sim_world_diverged(&group->state, lane))
    {
        *end = IVL_SIM_END_NOT_FINITE;
        return true;
    }
    if (world->gave_up || group->progress.n_evaluation[lane] >= IVL_SIM_EVALUATIONS_MAX)
    {
        *end = IVL_SIM_END_STEP_LIMIT;
        return true;
    }
    if (world->impact.happened)
    {
        *end = IVL_SIM_END_CONTACT_TIME;
        return t_s >= world->impact.t_s + raw->end_contact_time_s - slack;
    }
    if (t_s >= raw->end_time_max_s - slack)
    {
        *end = IVL_SIM_END_TIME_MAX;
        return true;
    }
    if (o->triggered[0] && t_s >= o->t_trigger_s[0] + raw->end_missed_time_s - slack)
    {
        *end = IVL_SIM_END_MISSED_TIME;
        return true;
    }
    *end = IVL_SIM_END_NO_GO;
    if (world->firmware.phase == IVL_PHASE_LEVEL_OUT && (double)world->firmware.level.rest_s >= HOVER_S)
    {
        return true;
    }
    *end = IVL_SIM_END_MISSED;
    if (!ivl_motors_latched_off(&world->firmware))
    {
        return false;
    }
    const ivl_sim_kin_t kin = ivl_sim_world_kin(group, lane);
    return out_of_reach(world->model, &kin, ivl_sim_world_surface_m(group, lane));
}

void ivl_sim_rollout_row(const ivl_sim_group_t *group, int lane, ivl_sim_trace_t *row)
{
    const ivl_sim_world_t *w = &group->world[lane];
    const ivl_sim_model_t *model = w->model;
    const ivl_sim_kin_t    body = ivl_sim_world_kin(group, lane), *kin = &body;
    memset(row, 0, sizeof *row);
    row->t_s[0] = ivl_sim_world_time_s(group, lane);
    memcpy(row->p_WB_m, kin->p_WB_m, sizeof row->p_WB_m);
    memcpy(row->q_WB, kin->q_WB, sizeof row->q_WB);
    memcpy(row->v_WB_mps, kin->v_WB_mps, sizeof row->v_WB_mps);
    memcpy(row->w_B_radps, kin->w_B_radps, sizeof row->w_B_radps);
    row->pitch_deg[0] = pitch_deg(kin);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        const double speed = group->rotor.speed_radps[i][lane];
        row->thrust_N[i] = group->rotor.scatter[i][lane] * model->raw.rotor_thrust_constant_Ns2 * speed * speed;
        row->thrust_cmd_N[i] = (double)w->out.thrust_N[i];
    }
    row->battery_V[0] = (group->rotor.open_circuit_V[lane] > 0.0) ? ivl_sim_rotor_voltage(model, &group->rotor, lane) : 0.0;
    for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
    {
        for (int axis = 0; axis < 3; axis++)
        {
            row->foot_W_m[3 * leg + axis] = kin->p_foot_W_m[leg][axis];
        }
        row->foot_state[leg] = (int8_t)w->foot[leg];
    }
    row->phase[0] = (int32_t)w->firmware.phase;
    row->body_contact[0] = w->plate_touched[IVL_SIM_PROP_PLATE] ? 1 : 0;
    row->d_ceil_m[0] = ivl_sim_world_gap_m(group, lane);
    row->d_sensed_m[0] = (double)w->out.ceiling.d_ceil_m;
    row->d_sigma_m[0] = (double)w->out.ceiling.d_sigma_m;
    row->rrev_per_s[0] = (double)w->out.cues.rrev_per_s;
    row->of_y_radps[0] = (double)w->out.cues.of_y_radps;
    row->energy_J[0] = ivl_sim_energy(model, kin, ivl_sim_world_surface_m(group, lane));
}

/// A row for each period that has begun; rows stand at ticks of the flight core.
static void trace(ivl_sim_tracer_t *tracer, const ivl_sim_group_t *group, int lane)
{
    if (tracer == NULL || ivl_sim_world_time_s(group, lane) < (double)tracer->n * tracer->period_s - 1.0e-9)
    {
        return;
    }
    if (tracer->n < tracer->capacity)
    {
        ivl_sim_rollout_row(group, lane, &tracer->rows[tracer->n]);
    }
    tracer->n++;
}

void ivl_sim_rollout_note(const ivl_sim_group_t *group, int lane, ivl_sim_outcome_t *o)
{
    const ivl_sim_world_t *world = &group->world[lane];
    if (world->firmware.triggered && !o->triggered[0])
    {
        note_trigger(group, lane, o);
    }
}

bool ivl_sim_rollout_ended(const ivl_sim_group_t *group, int lane, ivl_sim_outcome_t *o)
{
    ivl_sim_end_t end;
    const bool    is_over = ended(group, lane, o, &end);
    if (is_over)
    {
        note_end(group, lane, end, o);
    }
    return is_over;
}

/// Positive form: what is no number is refused too.
bool ivl_sim_spec_good(const ivl_sim_spec_t *spec)
{
    bool good = true;
#define WITHIN(c_type, name, count, np, unit, lo, hi, dflt, doc)                                                                           \
    for (int i = 0; i < (count); i++)                                                                                                      \
    {                                                                                                                                      \
        good = good && (double)spec->name[i] >= (double)(lo) && (double)spec->name[i] <= (double)(hi);                                     \
    }
    IVL_SIM_SPEC_FIELDS(WITHIN)
#undef WITHIN
    return good;
}

/// Puts the next landing of the source into a lane, whose first tick is then due; the lane stays empty if there is none.
static void refill(ivl_sim_group_t *group, int lane, ivl_sim_source_t source, void *context, ivl_sim_job_t *job)
{
    group->active[lane] = false;
    while (!group->active[lane] && source(context, job))
    {
        ivl_sim_outcome_clear(job->outcome);
        if (!ivl_sim_spec_good(job->spec))
        {
            job->outcome->end_reason[0] = IVL_SIM_END_REFUSED;
            job->outcome->t_end_s[0] = 0.0;
        }
        else if (ivl_sim_rollout_start(group, lane, job->spec))
        {
            time_flip(&group->world[lane], job->spec);
            trace(job->tracer, group, lane);
        }
        else
        {
            job->outcome->end_reason[0] = IVL_SIM_END_REFUSED;
            job->outcome->t_end_s[0] = 0.0;
            group->active[lane] = false;
        }
    }
}

/// What happens between two ticks, of which the second is then due if there is a landing in the lane.
static void between_ticks(ivl_sim_group_t *group, int lane, ivl_sim_source_t source, void *context, ivl_sim_job_t *job,
                          ivl_sim_work_t *work)
{
    trace(job->tracer, group, lane);
    if (ivl_sim_rollout_ended(group, lane, job->outcome))
    {
        work->used += (uint64_t)group->progress.n_evaluation[lane];
        refill(group, lane, source, context, job);
    }
    else
    {
        time_flip(&group->world[lane], job->spec);
    }
}

static void tick(ivl_sim_group_t *group, const bool due[IVL_SIM_LANES], const ivl_sim_job_t job[IVL_SIM_LANES])
{
    ivl_sim_world_ticks(group, due);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (due[lane])
        {
            ivl_sim_rollout_note(group, lane, job[lane].outcome);
        }
    }
}

ivl_sim_work_t IVL_SIM_OF_WIDTH(ivl_sim_fly)(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context)
{
    ivl_sim_group_t group;
    ivl_sim_job_t   job[IVL_SIM_LANES];
    bool            due[IVL_SIM_LANES], any = false;
    ivl_sim_work_t  work = {0, 0};
    ivl_sim_group_init(model, &group);
    group.port = model->core.open(model->core.context);
    group.eyes = (model->eye.context != NULL) ? model->eye.open(model->eye.context, IVL_SIM_LANES) : NULL;
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        refill(&group, lane, source, context, &job[lane]);
        due[lane] = group.active[lane];
        any = any || due[lane];
    }
    while (any)
    {
        tick(&group, due, job);
        // ends: a tick takes a bounded number of steps, time counts ticks, and a landing ends by its time at the latest
        ivl_sim_group_step(&group);
        work.offered += IVL_SIM_LANES;
        any = false;
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            due[lane] = group.active[lane] && ivl_sim_world_ready(&group, lane);
            if (due[lane])
            {
                between_ticks(&group, lane, source, context, &job[lane], &work);
                due[lane] = group.active[lane];
            }
            any = any || group.active[lane];
        }
    }
    model->core.close(group.port);
    if (group.eyes != NULL)
    {
        model->eye.close(group.eyes);
    }
    return work;
}
