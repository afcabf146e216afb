#include "record.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "ivl_port.h"
#include "sim_model.h"

enum
{
    LANES = 8,  // of a group of worlds
    FILE_BUFFER = 1 << 20,
    N_FLOATS = 19  // p, v, q, w, f, readings
};

_Static_assert((int)IVL_PORT_SLOTS >= (int)LANES, "a slot for each lane");

/// What is wrong with the inputs of a lane, and for how many more ticks.
typedef struct
{
    uint32_t n_left;
    uint32_t kind;
    uint32_t field;
    float    value;
    uint64_t t_us, t_pose_us;  ///< when it began
} fault_t;

typedef struct
{
    FILE     *requests, *replies;
    uint64_t  random;
    double    fault_norm;
    bool      open, bad;
    ivl_cfg_t cfg[LANES];  ///< as spoiled
    fault_t   fault[LANES];
    bool      has_vitals[LANES];  ///< this vehicle tells of battery, radio and autopilot
    uint32_t  n_request[LANES];
} recorder_t;

// ---- random numbers: splitmix64 -----------------------------------------------------------------------------------------

static uint64_t draw(recorder_t *r)
{
    r->random += 0x9e3779b97f4a7c15u;
    uint64_t z = r->random;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint32_t below(recorder_t *r, uint32_t n)
{
    return (uint32_t)((draw(r) >> 32) % n);
}

static bool chance(recorder_t *r, double p)
{
    return (double)(draw(r) >> 11) * 0x1.0p-53 < p;
}

static float between(recorder_t *r, float lo, float hi)
{
    return lo + (hi - lo) * (float)(draw(r) >> 40) * 0x1.0p-24f;
}

// ---- faults -------------------------------------------------------------------------------------------------------------

enum
{
    FAULT_NUMBER,  ///< one number of the sensed state is replaced
    FAULT_POSE_STALE,
    FAULT_POSE_FUTURE,
    FAULT_CLOCK_STANDS,
    FAULT_CLOCK_BACK,
    FAULT_QUATERNION_ZERO,
    FAULT_REQUEST_NONE,  ///< no such request
    FAULT_REQUEST_IDLE,
    FAULT_REQUEST_HOVER,
    FAULT_REQUEST_ABORT,
    FAULT_REQUEST_BAD,  ///< arguments that are no numbers
    FAULT_TINY,         ///< velocities and rates are denormal, and good
    FAULT_WILD,         ///< velocities and rates are high, and good: motors saturate
    FAULT_UPSIDE_DOWN,
    FAULT_IMPACT,
    FAULT_HANGING,
    FAULT_VITALS,    ///< battery, radio or autopilot
    FAULT_READINGS,  ///< of camera, ranging and flow sensor: any value at any time
    FAULT_COUNT
};

static const float NUMBERS[] = {NAN,      -NAN,      INFINITY, -INFINITY, FLT_MAX, -FLT_MAX, 1.0e9f,
                                1.0e-42f, -1.0e-45f, FLT_MIN,  -0.0f,     0.0f,    -49.9f,   199.9f};

static float *number_of(ivl_in_t *in, uint32_t i)
{
    float *const fields[N_FLOATS] = {
        &in->p_WB_m.x,   &in->p_WB_m.y,   &in->p_WB_m.z,   &in->v_WB_mps.x,  &in->v_WB_mps.y,  &in->v_WB_mps.z,  &in->q_WB.x,
        &in->q_WB.y,     &in->q_WB.z,     &in->q_WB.w,     &in->w_B_radps.x, &in->w_B_radps.y, &in->w_B_radps.z, &in->f_B_mps2.x,
        &in->f_B_mps2.y, &in->f_B_mps2.z, &in->rrev.value, &in->range.value, &in->flow.value,
    };
    return fields[i];
}

/// Short faults are the most frequent, the longest outlast every patience of the core.
static void begin_fault(recorder_t *r, fault_t *fault, const ivl_in_t *in)
{
    *fault = (fault_t){.n_left = 1u + below(r, 1u << below(r, 8)),
                       .kind = (below(r, 3) == 0u) ? (uint32_t)FAULT_NUMBER : below(r, FAULT_COUNT),
                       .field = below(r, N_FLOATS),
                       .value = NUMBERS[below(r, sizeof NUMBERS / sizeof NUMBERS[0])],
                       .t_us = in->t_us,
                       .t_pose_us = in->t_pose_us};
}

static void spoil_request(const fault_t *fault, ivl_command_t *cmd)
{
    switch (fault->kind)
    {
    case FAULT_REQUEST_NONE:
        cmd->request = (ivl_request_t)(fault->field * 0x01010101u + (uint32_t)IVL_REQUEST_COUNT);
        break;
    case FAULT_REQUEST_IDLE:
        cmd->request = IVL_REQUEST_IDLE;
        break;
    case FAULT_REQUEST_HOVER:
        cmd->request = IVL_REQUEST_HOVER;
        cmd->p_hover_W_m.z = (fault->field < 2u) ? fault->value : cmd->p_hover_W_m.z;
        break;
    case FAULT_REQUEST_ABORT:
        cmd->request = IVL_REQUEST_ABORT;
        break;
    default:
        cmd->request = IVL_REQUEST_APPROACH;
        cmd->speed_mps = fault->value;
        cmd->angle_rad = fault->value;
        break;
    }
}

static void spoil_motion(recorder_t *r, const fault_t *fault, ivl_in_t *in)
{
    const float v = (fault->kind == FAULT_WILD) ? 40.0f : 1.0e-40f, w = (fault->kind == FAULT_WILD) ? 900.0f : 1.0e-41f;
    in->v_WB_mps = (ivl_vec3_t){between(r, -v, v), between(r, -v, v), between(r, -v, v)};
    in->w_B_radps = (ivl_vec3_t){between(r, -w, w), between(r, -w, w), between(r, -w, w)};
}

static const ivl_vitals_t GOOD_VITALS = {.given = true,
                                         .configured = true,
                                         .can_fly = true,
                                         .stock_idle = true,
                                         .vbat_V = 4.0f,
                                         .link_age_s = 0.01f,
                                         .setpoint_age_s = 0.01f,
                                         .host_age_s = 0.02f,
                                         .p_sigma_m = 0.005f};

static void spoil_vitals(const fault_t *fault, ivl_vitals_t *vitals)
{
    uint8_t *const flags[] = {&vitals->configured, &vitals->can_fly, &vitals->bypassed, &vitals->stock_idle};
    float *const   values[] = {&vitals->vbat_V, &vitals->link_age_s, &vitals->setpoint_age_s, &vitals->host_age_s, &vitals->p_sigma_m};
    if (fault->field < 4u)
    {
        *flags[fault->field] = !*flags[fault->field];
    }
    else
    {
        *values[fault->field % 5u] = fault->value;
    }
}

/// New at each tick, so that the core has the most to do; some from the future, some old, some wildly off.
static void spoil_readings(recorder_t *r, const fault_t *fault, ivl_in_t *in)
{
    const float limits[] = {25.0f, 5.0f, 50.0f};
    for (uint32_t i = 0; i < 3u; i++)
    {
        ivl_reading_t *const readings[] = {&in->rrev, &in->range, &in->flow};
        readings[i]->t_us = in->t_us - below(r, (fault->field < 4u) ? 150000u : 3000u) + ((fault->field == 5u) ? 2000u : 0u);
        readings[i]->value = between(r, (fault->field < 10u) ? -limits[i] : 0.0f, limits[i]);
        readings[i]->valid = (uint8_t)(below(r, 8) != 0u);
    }
}

static void spoil(recorder_t *r, const fault_t *fault, ivl_in_t *in)
{
    switch (fault->kind)
    {
    case FAULT_NUMBER:
        *number_of(in, fault->field) = fault->value;
        break;
    case FAULT_POSE_STALE:
        in->t_pose_us = fault->t_pose_us;
        break;
    case FAULT_POSE_FUTURE:
        in->t_pose_us = in->t_us + 1u + fault->field;
        break;
    case FAULT_CLOCK_STANDS:
        in->t_us = fault->t_us;
        break;
    case FAULT_CLOCK_BACK:
        in->t_us = 2u * fault->t_us - in->t_us;
        break;
    case FAULT_QUATERNION_ZERO:
        in->q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 0.0f};
        break;
    case FAULT_TINY:
    case FAULT_WILD:
        spoil_motion(r, fault, in);
        break;
    case FAULT_UPSIDE_DOWN:
        in->q_WB = (ivl_quat_t){0.0f, 1.0f, 0.0f, 0.0f};
        break;
    case FAULT_IMPACT:
        in->f_B_mps2.x = 20.0f + 5.0f * (float)fault->field;
        break;
    case FAULT_HANGING:
        in->f_B_mps2 = (ivl_vec3_t){0.0f, 0.0f, -9.81f};
        break;
    case FAULT_VITALS:
        spoil_vitals(fault, &in->vitals);
        break;
    case FAULT_READINGS:
        spoil_readings(r, fault, in);
        break;
    default:
        spoil_request(fault, &in->cmd);
        break;
    }
}

// ---- writing ------------------------------------------------------------------------------------------------------------

static void write_down(recorder_t *r, const ivl_port_request_t *request, int32_t status, const ivl_state_t *state, const ivl_out_t *out)
{
    ivl_port_reply_t reply;
    memset(&reply, 0, sizeof reply);
    reply.status = status;
    reply.n_request = r->n_request[request->slot]++;
    reply.state = *state;
    if (out != NULL)
    {
        reply.out = *out;
    }
    if (fwrite(request, sizeof *request, 1, r->requests) != 1 || fwrite(&reply, sizeof reply, 1, r->replies) != 1)
    {
        r->bad = true;
    }
}

/// All bytes defined: files of the same landings are the same.
static ivl_port_request_t new_request(ivl_port_operation_t operation, int lane)
{
    ivl_port_request_t request;
    memset(&request, 0, sizeof request);
    request.operation = (uint32_t)operation;
    request.slot = (uint32_t)lane;
    return request;
}

static void *open_port(void *context)
{
    recorder_t *r = context;
    r->bad = r->bad || r->open;
    r->open = true;
    return r;
}

static void close_port(void *port)
{
    ((recorder_t *)port)->open = false;
}

static void init(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state)
{
    recorder_t        *r = port;
    ivl_port_request_t request = new_request(IVL_PORT_INIT, lane);
#define COPY(c_type, group, name, field, unit, lo, hi, dflt, doc) request.with.cfg.field = cfg->field;
    IVL_PARAMS(COPY)  // not the padding, which is not defined
#undef COPY
    if (chance(r, r->fault_norm))
    {
        request.with.cfg.mass_kg = NUMBERS[below(r, sizeof NUMBERS / sizeof NUMBERS[0])];
    }
    memset(&r->fault[lane], 0, sizeof r->fault[lane]);
    r->has_vitals[lane] = chance(r, 0.5);
    r->n_request[lane] = 0;
    r->cfg[lane] = request.with.cfg;
    ivl_init(&r->cfg[lane], state);
    write_down(r, &request, IVL_OK, state, NULL);
}

static ivl_status_t commit(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)cfg;
    recorder_t        *r = port;
    ivl_port_request_t request = new_request(IVL_PORT_COMMIT, lane);
    request.with.policy = *policy;
    const ivl_status_t status = ivl_policy_commit(&r->cfg[lane], state, policy);
    write_down(r, &request, status, state, NULL);
    return status;
}

/// Someone sends a policy in the middle of a landing; it may be good or not.
static void commit_another(recorder_t *r, int lane, ivl_state_t *state)
{
    ivl_policy_t policy = state->policy;
    policy.id.seq = below(r, 1000);
    policy.at_once = false;
    for (uint32_t i = 0; i < policy.n; i++)
    {
        const ivl_form_group_t *group = ivl_form_group_of(ivl_form(policy.id.form), i);
        const float             beyond = 0.07f * (group->hi - group->lo);
        policy.theta[i] = between(r, group->lo - beyond, group->hi + beyond);
    }
    if (chance(r, 0.2))
    {
        policy.theta[below(r, IVL_FORM_PARAMS_MAX)] = NUMBERS[below(r, sizeof NUMBERS / sizeof NUMBERS[0])];
    }
    if (chance(r, 0.1))
    {
        policy.id.form = (uint8_t)below(r, 256);
    }
    policy.id.crc = ivl_policy_crc(&policy);
    (void)commit(r, lane, &r->cfg[lane], state, &policy);
}

static void step(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    (void)cfg;
    recorder_t        *r = port;
    fault_t           *fault = &r->fault[lane];
    ivl_port_request_t request = new_request(IVL_PORT_STEP, lane);
    request.with.in = *in;
    if (r->has_vitals[lane])
    {
        request.with.in.vitals = GOOD_VITALS;
    }
    if (fault->n_left == 0u && chance(r, r->fault_norm))
    {
        begin_fault(r, fault, in);
    }
    if (fault->n_left > 0u)
    {
        fault->n_left--;
        spoil(r, fault, &request.with.in);
    }
    if (chance(r, 0.1 * r->fault_norm))
    {
        commit_another(r, lane, state);
    }
    ivl_step(&r->cfg[lane], state, &request.with.in, out);
    write_down(r, &request, IVL_OK, state, out);
}

static FILE *create_file(const char *path, char *error, size_t error_size)
{
    FILE *file = fopen(path, "wb");
    if (file == NULL)
    {
        snprintf(error, error_size, "%s: cannot be written: %s", path, strerror(errno));
        return NULL;
    }
    setvbuf(file, NULL, _IOFBF, FILE_BUFFER);
    return file;
}

void *ivl_record_create(const char *requests_path, const char *replies_path, double fault_norm, uint64_t seed, char *error,
                        size_t error_size)
{
    recorder_t *r = calloc(1, sizeof *r);
    if (r == NULL)
    {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    r->random = seed;
    r->fault_norm = fault_norm;
    r->requests = create_file(requests_path, error, error_size);
    r->replies = (r->requests != NULL) ? create_file(replies_path, error, error_size) : NULL;
    if (r->replies == NULL)
    {
        if (r->requests != NULL)
        {
            fclose(r->requests);
        }
        free(r);
        return NULL;
    }
    const ivl_port_hello_t hello = ivl_port_hello();
    r->bad = fwrite(&hello, sizeof hello, 1, r->replies) != 1;
    return r;
}

void ivl_record_attach(void *recorder, void *model)
{
    ((ivl_sim_model_t *)model)->core = (ivl_sim_core_t){
        .context = recorder, .open = open_port, .close = close_port, .init = init, .commit = commit, .step = step, .every_tick = true};
}

int ivl_record_close(void *recorder)
{
    recorder_t *r = recorder;
    bool        bad = r->bad;
    bad = (fclose(r->requests) != 0) || bad;
    bad = (fclose(r->replies) != 0) || bad;
    free(r);
    return bad ? -1 : 0;
}
