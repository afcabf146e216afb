#include "sil.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim_width.h"
#include "world_hover.h"
#include "world_replay.h"
#include "world_rollout.h"

enum
{
    THREADS_MAX = 256
};

// Parameters: those of the world, then those of the flight core under "firmware.", as doubles.

typedef struct
{
    ivl_sim_params_t world;
#define MEMBER(c_type, group, name, field, unit, lo, hi, dflt, doc) double firmware_##field;
    IVL_FLIGHT_PARAMS(MEMBER)
#undef MEMBER
} params_t;

#define WORLD_ROW(group, name, suffix, unit, lo, hi, dflt, doc)                                                                            \
    {#group "." #name, "f8", (uint32_t)offsetof(params_t, world.group##_##name##_##suffix), 1, unit, lo, hi, dflt, doc},
#define FIRMWARE_ROW(c_type, group, name, field, unit, lo, hi, dflt, doc)                                                                  \
    {"firmware." name, "f8", (uint32_t)offsetof(params_t, firmware_##field), 1, unit, lo, hi, dflt, doc},
static const ivl_sil_field_t PARAM_FIELDS[] = {IVL_SIM_PARAMS(WORLD_ROW) IVL_FLIGHT_PARAMS(FIRMWARE_ROW)};

#define ITEM_ROW(item, name, count, np, unit, lo, hi, dflt, doc)                                                                           \
    {#name, np, (uint32_t)offsetof(item, name), count, unit, lo, hi, dflt, doc},
#define SPEC_ROW(c_type, name, count, np, unit, lo, hi, dflt, doc)    ITEM_ROW(ivl_sim_spec_t, name, count, np, unit, lo, hi, dflt, doc)
#define OUTCOME_ROW(c_type, name, count, np, unit, lo, hi, dflt, doc) ITEM_ROW(ivl_sim_outcome_t, name, count, np, unit, lo, hi, dflt, doc)
#define TRACE_ROW(c_type, name, count, np, unit, lo, hi, dflt, doc)   ITEM_ROW(ivl_sim_trace_t, name, count, np, unit, lo, hi, dflt, doc)
static const ivl_sil_field_t SPEC_FIELDS[] = {IVL_SIM_SPEC_FIELDS(SPEC_ROW)};
static const ivl_sil_field_t OUTCOME_FIELDS[] = {IVL_SIM_OUTCOME_FIELDS(OUTCOME_ROW)};
static const ivl_sil_field_t TRACE_FIELDS[] = {IVL_SIM_TRACE_FIELDS(TRACE_ROW)};

// clang-format off
/// X(name, unit, expression of the model m, doc)
#define DERIVED(X) \
    X(mass_total_kg, "kg", m->mass_total_kg, "body, legs and feet") \
    X(thrust_to_weight, "1", IVL_SIM_MOTORS * m->raw.rotor_thrust_max_N / (m->mass_total_kg * m->raw.world_gravity_mps2), "all motors at their maximum") \
    X(pitch_moment_max_Nmm, "N mm", 2000.0 * m->raw.rotor_thrust_max_N * m->raw.rotor_x_m, "front pair at its maximum") \
    X(rotor_speed_hover_radps, "rad/s", m->rotor_speed_hover_radps, "each rotor") \
    X(rotor_speed_max_radps, "rad/s", m->rotor_speed_max_radps, "each rotor") \
    X(leg_frequency_radps, "rad/s", m->leg_frequency_radps, "of a leg about its hip, body held, undamped") \
    X(leg_damping_ratio, "1", m->leg_damping_ratio, "of that motion") \
    X(reach_m, "m", m->reach_m, "farthest point of the vehicle from the body origin") \
    X(tick_s, "s", m->tick_s, "period of the flight core")
// clang-format on
#define MEMBER(name, unit, expression, doc) double name;
typedef struct
{
    DERIVED(MEMBER)
} derived_t;
#undef MEMBER
#define DERIVED_ROW(name, unit, expression, doc)                                                                                           \
    {#name, "f8", (uint32_t)offsetof(derived_t, name), 1, unit, 0.0, IVL_SIM_UNLIMITED, IVL_SIM_REQUIRED, doc},
static const ivl_sil_field_t DERIVED_FIELDS[] = {DERIVED(DERIVED_ROW)};

// a recorded flight: any number may have been recorded
#define REPLAY_IN_ROW(name, member, count, np, unit, doc)                                                                                  \
    {#name, np, (uint32_t)offsetof(ivl_in_t, member), count, unit, -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, 0.0, doc},
#define REPLAY_OUT_ROW(c_type, name, np, unit, expression, doc)                                                                            \
    {#name, np, (uint32_t)offsetof(ivl_sim_replay_row_t, name), 1, unit, -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, IVL_SIM_REQUIRED, doc},
static const ivl_sil_field_t REPLAY_IN_FIELDS[] = {IVL_SIM_REPLAY_INPUTS(REPLAY_IN_ROW)};
static const ivl_sil_field_t REPLAY_OUT_FIELDS[] = {IVL_SIM_REPLAY_ROWS(REPLAY_OUT_ROW)};

// clang-format off
/// X(member of ivl_sim_surface_t, unit, doc)
#define SURFACE(X) \
    X(point_W_m, "m", "a point of the surface at time 0") \
    X(normal_W, "1", "unit vector into the surface") \
    X(velocity_W_mps, "m/s", "of the surface")
// clang-format on
#define SURFACE_ROW(name, unit, doc)                                                                                                       \
    {#name, "f8", (uint32_t)offsetof(ivl_sim_surface_t, name), 3, unit, -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, IVL_SIM_REQUIRED, doc},
static const ivl_sil_field_t SURFACE_FIELDS[] = {SURFACE(SURFACE_ROW)};
_Static_assert(sizeof(ivl_d3_t) == 3 * sizeof(double), "a vector is told as three numbers");

typedef struct
{
    const ivl_sil_field_t *fields;
    uint32_t               n, size;
} table_t;

#define TABLE(array, type) {array, (uint32_t)(sizeof array / sizeof array[0]), (uint32_t)sizeof(type)}
static const table_t TABLES[] = {TABLE(PARAM_FIELDS, params_t),
                                 TABLE(SPEC_FIELDS, ivl_sim_spec_t),
                                 TABLE(OUTCOME_FIELDS, ivl_sim_outcome_t),
                                 TABLE(TRACE_FIELDS, ivl_sim_trace_t),
                                 TABLE(DERIVED_FIELDS, derived_t),
                                 TABLE(REPLAY_IN_FIELDS, ivl_in_t),
                                 TABLE(REPLAY_OUT_FIELDS, ivl_sim_replay_row_t),
                                 TABLE(SURFACE_FIELDS, ivl_sim_surface_t)};
_Static_assert(sizeof TABLES / sizeof TABLES[0] == IVL_SIL_TABLE_COUNT, "one table each");

int ivl_sil_abi_version(void)
{
    return IVL_SIL_ABI_VERSION;
}

int ivl_sil_register_bits(int bits)
{
    return (bits == -1 || ivl_sim_width_use(bits)) ? 64 * ivl_sim_width_lanes() : 0;
}

const ivl_sil_field_t *ivl_sil_table(int table, uint32_t *n_fields, uint32_t *item_size)
{
    if (table < 0 || table >= IVL_SIL_TABLE_COUNT)
    {
        return NULL;
    }
    *n_fields = TABLES[table].n;
    *item_size = TABLES[table].size;
    return TABLES[table].fields;
}

static ivl_cfg_t firmware_of(const params_t *p)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);  // those of the vehicle and the ceiling follow from the world
#define ASSIGN(c_type, group, name, field, unit, lo, hi, dflt, doc) cfg.field = (c_type)p->firmware_##field;
    IVL_FLIGHT_PARAMS(ASSIGN)
#undef ASSIGN
    return cfg;
}

/// Ranges are checked on the doubles, before a conversion that would be undefined for a NaN or a large number.
static int firmware_in_range(const params_t *p, char *error, size_t error_size)
{
#define CHECK(c_type, group, name, field, unit, lo, hi, dflt, doc)                                                                         \
    if (!(p->firmware_##field >= (lo) && p->firmware_##field <= (hi)))                                                                     \
    {                                                                                                                                      \
        snprintf(error, error_size, "firmware.%s: %g is outside the allowed range %g .. %g %s", name, p->firmware_##field, (double)(lo),   \
                 (double)(hi), unit);                                                                                                      \
        return 0;                                                                                                                          \
    }
    IVL_FLIGHT_PARAMS(CHECK)
#undef CHECK
    return 1;
}

void *ivl_sil_model_create(const double *params, char *error, size_t error_size)
{
    params_t p;
    memcpy(&p, params, sizeof p);
    if (!firmware_in_range(&p, error, error_size))
    {
        return NULL;
    }
    const ivl_cfg_t  firmware = firmware_of(&p);
    ivl_sim_model_t *model = aligned_alloc(64, (sizeof *model + 63u) & ~(size_t)63u);
    if (model == NULL)
    {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    if (!ivl_sim_model_init(model, &p.world, &firmware, error, error_size))
    {
        free(model);
        return NULL;
    }
    return model;
}

void ivl_sil_model_free(void *model)
{
    ivl_sim_model_t *m = model;
    free(m->eye.context);  // NULL without a camera
    free(m);
}

void ivl_sil_model_derived(const void *model, void *derived)
{
    const ivl_sim_model_t *m = model;
    const derived_t        d = {
#define VALUE(name, unit, expression, doc) .name = (expression),
        DERIVED(VALUE)
#undef VALUE
    };
    memcpy(derived, &d, sizeof d);
}

void ivl_sil_model_surface(const void *model, void *surface)
{
    const ivl_sim_model_t *m = model;
    memcpy(surface, &m->surface, sizeof m->surface);
}

void ivl_sil_surface_forward(const void *surface, double forward_W[3])
{
    ivl_sim_surface_t s;
    memcpy(&s, surface, sizeof s);
    ivl_d3_store(forward_W, ivl_sim_surface_forward(&s));
}

typedef struct
{
    const ivl_sim_model_t *model;
    const ivl_sim_spec_t  *specs;
    ivl_sim_outcome_t     *outcomes;
    ivl_sim_tracer_t      *tracers;  ///< NULL: nothing is recorded
    size_t                 n;
    atomic_size_t          next;
    atomic_ullong          offered, used;  // evaluations: see ivl_sim_work_t
} batch_t;

static bool next_of_batch(void *context, ivl_sim_job_t *job)
{
    batch_t     *batch = context;
    const size_t i = atomic_fetch_add(&batch->next, 1);
    if (i >= batch->n)
    {
        return false;
    }
    *job = (ivl_sim_job_t){&batch->specs[i], &batch->outcomes[i], (batch->tracers == NULL) ? NULL : &batch->tracers[i]};
    return true;
}

static void *fly_batch(void *argument)
{
    batch_t             *batch = argument;
    const ivl_sim_work_t work = ivl_sim_fly(batch->model, next_of_batch, batch);
    atomic_fetch_add(&batch->offered, work.offered);
    atomic_fetch_add(&batch->used, work.used);
    return NULL;
}

static int thread_count(int asked, size_t n)
{
    long         threads = (asked > 0) ? asked : sysconf(_SC_NPROCESSORS_ONLN);
    const size_t lanes = (size_t)ivl_sim_width_lanes(), groups = (n + lanes - 1) / lanes;
    threads = (threads < 1) ? 1 : ((threads > THREADS_MAX) ? THREADS_MAX : threads);
    return ((size_t)threads > groups) ? (int)((groups > 0) ? groups : 1) : (int)threads;
}

static void fly_all(batch_t *batch, int n_threads)
{
    pthread_t thread[THREADS_MAX];
    atomic_init(&batch->next, 0);
    atomic_init(&batch->offered, 0);
    atomic_init(&batch->used, 0);
    const int extra = thread_count(n_threads, batch->n) - 1;
    int       started = 0;
    while (started < extra && pthread_create(&thread[started], NULL, fly_batch, batch) == 0)
    {
        started++;
    }
    fly_batch(batch);  // this thread works too, so that a lack of others only costs time
    for (int i = 0; i < started; i++)
    {
        pthread_join(thread[i], NULL);
    }
}

int ivl_sil_rollouts(const void *model, const void *specs, size_t n, int n_threads, void *outcomes, uint64_t work[2])
{
    batch_t batch = {.model = model, .specs = specs, .outcomes = outcomes, .n = n};
    fly_all(&batch, n_threads);
    if (work != NULL)
    {
        work[0] = atomic_load(&batch.offered);
        work[1] = atomic_load(&batch.used);
    }
    return 0;
}

int ivl_sil_traces(const void *model, const void *specs, size_t n, int n_threads, double period_s, void *rows, size_t capacity,
                   uint64_t *n_rows, void *outcomes)
{
    ivl_sim_tracer_t *tracers = (period_s > 0.0 && n > 0) ? calloc(n, sizeof *tracers) : NULL;
    if (tracers == NULL)
    {
        return (n == 0) ? 0 : -1;
    }
    for (size_t i = 0; i < n; i++)
    {
        tracers[i] = (ivl_sim_tracer_t){.period_s = period_s, .rows = (ivl_sim_trace_t *)rows + i * capacity, .capacity = capacity};
    }
    batch_t batch = {.model = model, .specs = specs, .outcomes = outcomes, .tracers = tracers, .n = n};
    fly_all(&batch, n_threads);
    for (size_t i = 0; i < n; i++)
    {
        n_rows[i] = tracers[i].n;
    }
    free(tracers);
    return 0;
}

/// A batch of one.
typedef struct
{
    ivl_sim_job_t job;
    bool          taken;
} single_t;

static bool next_of_single(void *context, ivl_sim_job_t *job)
{
    single_t  *single = context;
    const bool first = !single->taken;
    single->taken = true;
    *job = single->job;
    return first;
}

long ivl_sil_trace(const void *model, const void *spec, double period_s, void *rows, size_t capacity, void *outcome)
{
    if (!(period_s > 0.0))
    {
        return -1;
    }
    ivl_sim_tracer_t tracer = {.period_s = period_s, .rows = rows, .capacity = capacity};
    single_t         single = {{spec, outcome, &tracer}, false};
    ivl_sim_fly(model, next_of_single, &single);
    return (long)tracer.n;
}

int ivl_sil_replay(const void *model, const void *config, int form, const double *theta, const void *inputs, size_t n, void *rows)
{
    const ivl_policy_t policy = ivl_sim_policy(form, theta, false);
    return (int)ivl_sim_replay(model, config, &policy, inputs, n, rows);
}

int ivl_sil_hover(const void *model, const double *setpoints, size_t n_setpoints, const uint64_t *seeds, size_t n, double period_s,
                  void *rows, size_t n_rows)
{
    ivl_sim_setpoint_t *setpoint = calloc(n * n_setpoints + 1, sizeof *setpoint);
    ivl_sim_hover_t    *flight = calloc(n + 1, sizeof *flight);
    const bool          good = setpoint && flight && period_s > 0.0 && n_rows > 0 && n_setpoints > 0;
    for (size_t i = 0; good && i < n * n_setpoints; i++)
    {
        setpoint[i] = (ivl_sim_setpoint_t){setpoints[4 * i], {setpoints[4 * i + 1], setpoints[4 * i + 2], setpoints[4 * i + 3]}};
    }
    for (size_t i = 0; good && i < n; i++)
    {
        flight[i] = (ivl_sim_hover_t){
            {seeds[2 * i], seeds[2 * i + 1]}, &setpoint[i * n_setpoints], n_setpoints, (ivl_sim_trace_t *)rows + i * n_rows};
    }
    if (good)
    {
        ivl_sim_hover(model, flight, n, period_s, n_rows);
    }
    free(setpoint);
    free(flight);
    return good ? 0 : -1;
}

uint32_t ivl_sil_form(int number, const char **name, const char **doc)
{
    const ivl_form_t *form = ivl_form((uint32_t)number);
    if (form == NULL)
    {
        return 0;
    }
    *name = form->name;
    *doc = form->doc;
    return form->n_params;
}

int ivl_sil_form_group(int number, uint32_t g, ivl_sil_field_t *field, const char **symbols)
{
    const ivl_form_t *form = ivl_form((uint32_t)number);
    if (form == NULL || g >= form->n_groups)
    {
        return -1;
    }
    const ivl_form_group_t *row = &form->groups[g];
    *symbols = row->symbols;
    *field = (ivl_sil_field_t){.name = row->names,
                               .type = "f4",
                               .offset = 0,
                               .count = row->n,
                               .unit = row->unit,
                               .lo = (double)row->lo,
                               .hi = (double)row->hi,
                               .dflt = (double)row->per_unit,
                               .doc = row->doc};
    return 0;
}

int ivl_sil_policy_accepted(const void *model, int form, const double *theta)
{
    const ivl_sim_model_t *m = model;
    const ivl_policy_t     policy = ivl_sim_policy(form, theta, false);
    return (ivl_policy_check(&m->firmware, &policy) == IVL_OK) ? 1 : 0;
}

void ivl_sil_policy_decide(int form, const double *theta, const double *seen, size_t n, double *actions)
{
    const ivl_policy_t policy = ivl_sim_policy(form, theta, false);
    for (size_t i = 0; i < n; i++)
    {
        const double      *in = seen + 3 * i;
        const ivl_seen_t   this_tick = {.ceiling = {.d_ceil_m = (float)in[0], .valid = true},
                                        .cues = {.rrev_per_s = (float)in[1], .of_y_radps = (float)in[2], .valid = true}};
        const ivl_action_t action = ivl_policy_decide(&policy, &this_tick);
        double            *out = actions + 4 * i;
        out[0] = action.flip ? 1.0 : 0.0;
        out[1] = action.go ? 1.0 : 0.0;
        out[2] = (double)action.moment_Nm;
        out[3] = (double)action.p_land;
    }
}

uint32_t ivl_sil_policy_crc(int form, const double *theta)
{
    return ivl_sim_policy(form, theta, false).id.crc;
}

const char *ivl_sil_end_reason(int code)
{
    return ivl_sim_end_name(code);
}

const char *ivl_sil_phase_name(int code)
{
    return (code >= 0 && code < IVL_PHASE_COUNT) ? ivl_phase_name((ivl_phase_t)code) : "?";
}
