/// @file cf_tables.c
/// Parameters and log variables that are served: those of the list in cf_names.h, and the app's own.
#include <math.h>
#include <string.h>

#include "app_convert.h"
#include "cf_names.h"
#include "cf_vehicle.h"
#include "controller.h"
#include "log.h"
#include "param.h"

extern uint8_t        tumbleCheckEnabled;
extern struct param_s sdk_params_ivl[];
extern struct log_s   sdk_logs_ivl[];

#define THE ivl_cf_the

// ---- what follows from a write.  A value out of range is put back into it.

static const double D_CEIL_M[2] = {0.02, 10.0};

static double limited(double value, double lo, double hi, double otherwise)
{
    return (value >= lo && value <= hi) ? value : otherwise;
}

static void reset_written(void)
{
    if (THE.set.sim.reset != 0u)
    {
        THE.set.sim.reset = 0;
        ivl_cf_world_reset(&THE);
    }
}

static void start_written(void)
{
    if (THE.set.sim.start >= IVL_SIM_START_STATE && THE.set.sim.start != IVL_CF_START_AS_FLOWN)
    {
        THE.set.sim.start = IVL_CF_START_AS_FLOWN;
    }
}

static void numbers_written(void)
{
    const double ceiling_m = THE.model.raw.world_ceiling_height_m;
    THE.set.sim.d_ceil_m = limited(THE.set.sim.d_ceil_m, D_CEIL_M[0], D_CEIL_M[1], 0.5);
    THE.set.sim.speed_mps = limited(THE.set.sim.speed_mps, 0.0, 100.0, 0.0);
    THE.set.sim.angle_deg = limited(THE.set.sim.angle_deg, 0.0, 90.0, 0.0);
    THE.set.sim.start_x_m = (float)limited((double)THE.set.sim.start_x_m, -50.0, 50.0, 0.0);
    THE.set.sim.start_y_m = (float)limited((double)THE.set.sim.start_y_m, -50.0, 50.0, 0.0);
    THE.set.sim.start_z_m = (float)limited((double)THE.set.sim.start_z_m, 0.0, ceiling_m - THE.model.reach_m, 0.5 * ceiling_m);
    THE.set.sim.vbat_V = (float)limited((double)THE.set.sim.vbat_V, 0.0, 30.0, 0.0);
    THE.set.sim.cell_V = (float)limited((double)THE.set.sim.cell_V, 0.0, 30.0, 0.0);
    THE.set.sim.wall_x_m = (float)limited((double)THE.set.sim.wall_x_m, 0.0, 50.0, 0.0);
    THE.set.sim.wall_y_m = (float)limited((double)THE.set.sim.wall_y_m, 0.0, 50.0, 0.0);
    THE.set.takeoff_mps = (float)limited((double)THE.set.takeoff_mps, 0.01, 100.0, 0.5);
    THE.set.landing_mps = (float)limited((double)THE.set.landing_mps, 0.01, 100.0, 0.5);
}

/// 0 chooses the app, as it does on the drone.  Each of the stock firmware's controllers is the one stock law here.
static void controller_written(void)
{
    const bool    was_stock = THE.runs_stock;
    const uint8_t asked = THE.set.controller;
    THE.runs_stock = asked >= IVL_CF_CONTROLLER_STOCK && asked < IVL_CF_CONTROLLER_APP;
    if (!THE.runs_stock)
    {
        THE.set.controller = IVL_CF_CONTROLLER_APP;
        if (was_stock)
        {
            controllerOutOfTreeInit();
        }
    }
    if (THE.runs_stock && asked != IVL_CF_CONTROLLER_STOCK)
    {
        ivl_cf_print("CONTROLLER: %u flies the simulated stock law; its own gains change nothing\n", (unsigned)asked);
    }
    ivl_cf_stock_reset(&THE.stock);
}

static void estimation_written(void)
{
    if (THE.set.reset_estimation != 0u)
    {
        THE.set.reset_estimation = 0;
        ivl_cf_begin_estimate(&THE);
    }
}

static void health_written(void)
{
    THE.set.prop_test = THE.set.battery_test = 0;
    ivl_cf_print("HEALTH: the simulated vehicle has no tests of propellers and battery\n");
}

/// What a task, a memory and an assertion of the firmware would say.
static void system_written(void)
{
    if (THE.set.task_dump != 0u)
    {
        ivl_cf_print("Task dump\nLoad\tStack left\tName\nthe simulated vehicle has no tasks\n");
    }
    if (THE.set.assert_info != 0u)
    {
        ivl_cf_print("No assertion has failed: the simulated vehicle ends where the firmware would stop\n");
    }
    if (THE.set.storage_stats != 0u)
    {
        ivl_cf_print("STORAGE: the simulated vehicle keeps a value for each persistent parameter\n");
    }
    uint8_t *const asked[] = {&THE.set.task_dump, &THE.set.assert_info, &THE.set.storage_stats};
    for (size_t i = 0; i < sizeof asked / sizeof asked[0]; i++)
    {
        if (*asked[i] != 0u)
        {
            *asked[i] = 0;
        }
    }
}

static void place_written(void)
{
    const uint8_t where = THE.set.sim.place;
    if (where != 0u)
    {
        THE.set.sim.place = 0;
        ivl_cf_world_place(&THE, where == IVL_CF_PLACE_AT_START);
    }
}

static void info_written(void)
{
    if (THE.supervisor.dump_info != 0u)
    {
        THE.supervisor.dump_info = 0;
        ivl_cf_print("SUP: State: %s\n", ivl_cf_supervisor_name(THE.supervisor.state));
        ivl_cf_print("SUP: Conditions: 0x%lx\n", (unsigned long)THE.supervisor.conditions);
    }
}

// ---- the list, as tables

enum
{
    N = 0,
    C = 1,
    P = 2,
    R = 4,
    CP = C | P,
    CR = C | R
};

#define HELD_VALUE(type_, group_, name_, access, value) .group_##_##name_ = value,
static const ivl_cf_held_t FIRST = {IVL_CF_PARAMS(IVL_CF_NOTHING, HELD_VALUE)};

#define PARAM_ROW(type_, group_, name_, access)                                                                                            \
    .group = #group_, .name = #name_, .type = IVL_CF_PARAM_##type_, .read_only = ((access) & R) != 0, .persistent = ((access) & P) != 0,   \
    .core = ((access) & C) != 0
#define LIVE_PARAM(type_, group_, name_, access, where, then)                                                                              \
    {PARAM_ROW(type_, group_, name_, access), .address = &(where), .changed = then},
#define HELD_PARAM(type_, group_, name_, access, value)                                                                                    \
    {PARAM_ROW(type_, group_, name_, access), .held = true, .address = &THE.held.group_##_##name_},

static const ivl_cf_param_t PARAMS[] = {IVL_CF_PARAMS(LIVE_PARAM, HELD_PARAM)};

static struct
{
    IVL_CF_LOGS(IVL_CF_MEMBER, IVL_CF_MEMBER)
} values;

#define LOG_ROW(type_, group_, name_, access)                                                                                              \
    .group = #group_, .name = #name_, .type = IVL_CF_LOG_##type_, .address = &values.group_##_##name_, .core = ((access) & C) != 0
#define LIVE_LOG(type_, group_, name_, access, value) {LOG_ROW(type_, group_, name_, access)},
#define HELD_LOG(type_, group_, name_, access, value) {LOG_ROW(type_, group_, name_, access), .held = true},

static const ivl_cf_log_t LOG_TABLE[] = {
    IVL_CF_LOGS(LIVE_LOG, HELD_LOG) /* */
    // asked for by the app, so always up to date
    {.group = "kalman", .name = "varPX", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
    {.group = "kalman", .name = "varPY", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
    {.group = "kalman", .name = "varPZ", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
};

// ---- what log variables show

static const float   PWM_FULL = 65535.0f;
static const float   DEG_PER_RAD = 57.2957795f;
static const float   GYRO_DEGPS_PER_STEP = 2000.0f / 32768.0f;
static const float   PRESSURE_MBAR = 1013.25f, MBAR_PER_M = 0.12f;  // at sea level
static const uint8_t FLOW_MOVES = 0xB0, FLOW_QUALITY = 100;

static int16_t whole(float value)
{
    // what is no number becomes the lower end
    return (int16_t)((value > -32768.0f) ? ((value < 32767.0f) ? value : 32767.0f) : -32768.0f);
}

static int16_t milli(float value)
{
    return whole(value * 1000.0f);
}

static int16_t gyro_steps(float degps)
{
    return whole(degps / GYRO_DEGPS_PER_STEP);
}

static float angle_deg(ivl_cf_mode_t mode, float angle_rad)
{
    return (mode == IVL_CF_MODE_ABS) ? angle_rad * DEG_PER_RAD : 0.0f;
}

/// The largest of the four left out and made positive; the others with a sign and nine bits each.
static uint32_t packed(ivl_quat_t q_WB)
{
    const float q[4] = {q_WB.x, q_WB.y, q_WB.z, q_WB.w};
    uint32_t    largest = 0;
    for (uint32_t i = 1; i < 4; i++)
    {
        largest = (fabsf(q[i]) > fabsf(q[largest])) ? i : largest;
    }
    uint32_t bits = largest;
    for (uint32_t i = 0; i < 4; i++)
    {
        if (i != largest)
        {
            const bool  is_negative = (q[i] < 0.0f) != (q[largest] < 0.0f);
            const float size = fabsf(q[i]) / 0.70710678f * 511.0f + 0.5f;
            bits = bits << 10 | (is_negative ? 0x200u : 0u) | ((size < 511.0f) ? (uint32_t)size : 511u);
        }
    }
    return bits;
}

typedef struct
{
    ivl_vec3_t a_g;                   ///< acceleration in W, gravity removed
    ivl_vec3_t v_B;                   ///< velocity in B
    ivl_vec3_t p_heading, v_heading;  ///< in axes that turn with the heading
    float      pwm[4];
    float      gyro_variance;  ///< of its noise, in steps of the sensor
} derived_t;

static derived_t derive(const ivl_cf_t *cf)
{
    const ivl_axes_t r = ivl_axes_of(cf->sensed.q_WB);
    derived_t        e;
    const float     *a = cf->acc_g;
    e.a_g = ivl_add(ivl_scale(r.x, a[0]), ivl_add(ivl_scale(r.y, a[1]), ivl_scale(r.z, a[2])));
    e.a_g.z -= 1.0f;
    const ivl_in_t    *in = &cf->sensed;
    const ivl_vec3_t   v = in->v_WB_mps, p = in->p_WB_m;
    const ivl_sincos_t h = ivl_sincos(ivl_cf_yaw_of(in->q_WB));
    e.v_B = ivl_vec3(ivl_dot(r.x, v), ivl_dot(r.y, v), ivl_dot(r.z, v));
    e.v_heading = ivl_vec3(h.cos * v.x + h.sin * v.y, h.cos * v.y - h.sin * v.x, v.z);
    e.p_heading = ivl_vec3(h.cos * p.x + h.sin * p.y, h.cos * p.y - h.sin * p.x, p.z);
    const float noise = (float)cf->model.raw.sense_gyro_noise_radps * DEG_PER_RAD / GYRO_DEGPS_PER_STEP;
    e.gyro_variance = noise * noise;
    for (int i = 0; i < 4; i++)
    {
        e.pwm[i] = ivl_clamp(cf->motor_N[i] / cf->model.firmware.motor_thrust_N_max, 0.0f, 1.0f) * PWM_FULL;
    }
    return e;
}

void ivl_cf_logs_refresh(ivl_cf_t *cf)
{
    const ivl_in_t          *in = &cf->sensed;
    const ivl_cf_setpoint_t *sp = &cf->commander.setpoint;
    const ivl_sim_kin_t      kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const derived_t          e = derive(cf);
#define REFRESH(type_, group_, name_, access, value) values.group_##_##name_ = (value);
    IVL_CF_LOGS(REFRESH, REFRESH)
#undef REFRESH
}

// ---- with the app's own

enum
{
    N_PARAMS = sizeof PARAMS / sizeof PARAMS[0],
    N_LOGS = sizeof LOG_TABLE / sizeof LOG_TABLE[0],
    N_APP_MAX = 128
};

static ivl_cf_param_t all_params[N_PARAMS + N_APP_MAX];
static ivl_cf_log_t   all_logs[N_LOGS + N_APP_MAX];
static size_t         n_params, n_logs;

void ivl_cf_tables_boot(ivl_cf_t *cf)
{
    cf->held = FIRST;
}

bool ivl_cf_tables_open(ivl_cf_t *cf)
{
    (void)cf;
    n_params = N_PARAMS;
    n_logs = N_LOGS;
    memcpy(all_params, PARAMS, sizeof PARAMS);
    memcpy(all_logs, LOG_TABLE, sizeof LOG_TABLE);
    // the first row of the app's tables names the group
    const struct param_s *p = sdk_params_ivl;
    for (const char *group = p++->name; p->type != (PARAM_GROUP | PARAM_STOP); p++)
    {
        if (n_params == N_PARAMS + N_APP_MAX)
        {
            return false;
        }
        all_params[n_params++] = (ivl_cf_param_t){.group = group,
                                                  .name = p->name,
                                                  .type = (uint8_t)(p->type & ~PARAM_RONLY),
                                                  .read_only = (p->type & PARAM_RONLY) != 0,
                                                  .address = p->address,
                                                  .changed = p->callback};
    }
    const struct log_s *l = sdk_logs_ivl;
    for (const char *group = l++->name; l->type != (LOG_GROUP | LOG_STOP); l++)
    {
        if (n_logs == N_LOGS + N_APP_MAX)
        {
            return false;
        }
        all_logs[n_logs++] = (ivl_cf_log_t){.group = group, .name = l->name, .type = l->type, .address = l->address};
    }
    return true;
}

const ivl_cf_param_t *ivl_cf_params(const ivl_cf_t *cf, size_t *n)
{
    (void)cf;
    *n = n_params;
    return all_params;
}

const ivl_cf_log_t *ivl_cf_logs(const ivl_cf_t *cf, size_t *n)
{
    (void)cf;
    *n = n_logs;
    return all_logs;
}
