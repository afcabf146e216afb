/// @file cf_tables.c
/// Parameters and log variables that are served: those of the stock firmware that are modelled, those of the simulator, and the app's own.
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
    if (THE.set.reset != 0u)
    {
        THE.set.reset = 0;
        ivl_cf_world_reset(&THE);
        ivl_cf_param_changed(&THE, &THE.set.reset);
    }
}

static void start_written(void)
{
    if (THE.set.start >= IVL_SIM_START_STATE && THE.set.start != IVL_CF_START_AS_FLOWN)
    {
        THE.set.start = IVL_CF_START_AS_FLOWN;
        ivl_cf_param_changed(&THE, &THE.set.start);
    }
}

static void numbers_written(void)
{
    const double ceiling_m = THE.model.raw.world_ceiling_height_m;
    THE.set.d_ceil_m = limited(THE.set.d_ceil_m, D_CEIL_M[0], D_CEIL_M[1], 0.5);
    THE.set.speed_mps = limited(THE.set.speed_mps, 0.0, 100.0, 0.0);
    THE.set.angle_deg = limited(THE.set.angle_deg, 0.0, 90.0, 0.0);
    THE.set.start_x_m = (float)limited((double)THE.set.start_x_m, -50.0, 50.0, 0.0);
    THE.set.start_y_m = (float)limited((double)THE.set.start_y_m, -50.0, 50.0, 0.0);
    THE.set.start_z_m = (float)limited((double)THE.set.start_z_m, 0.0, ceiling_m - THE.model.reach_m, 0.5 * ceiling_m);
    THE.set.vbat_V = (float)limited((double)THE.set.vbat_V, 0.0, 30.0, 0.0);
}

static void controller_written(void)
{
    const bool was_stock = THE.runs_stock;
    THE.runs_stock = THE.set.controller == IVL_CF_CONTROLLER_STOCK;
    if (!THE.runs_stock)
    {
        THE.set.controller = IVL_CF_CONTROLLER_APP;
        if (was_stock)
        {
            controllerOutOfTreeInit();
        }
    }
    ivl_cf_stock_reset(&THE.stock);
}

static void estimation_written(void)
{
    if (THE.set.reset_estimation != 0u)
    {
        THE.set.reset_estimation = 0;
        ivl_cf_estimate_reset(&THE.estimate);
        ivl_cf_param_changed(&THE, &THE.set.reset_estimation);
    }
}

static void health_written(void)
{
    THE.set.prop_test = THE.set.battery_test = 0;
    ivl_cf_print("HEALTH: the simulated vehicle has no tests of propellers and battery\n");
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

// ---- parameters

#define RW(type_, group_, name_, where, then) {.group = group_, .name = name_, .type = type_, .address = &(where), .changed = then},
#define RO(type_, group_, name_, where)       {.group = group_, .name = name_, .type = type_, .read_only = true, .address = &(where)},
#define KEPT(type_, group_, name_, where, then)                                                                                            \
    {.group = group_, .name = name_, .type = type_, .persistent = true, .address = &(where), .changed = then},
#define U8  IVL_CF_PARAM_U8
#define U16 IVL_CF_PARAM_U16
#define U32 IVL_CF_PARAM_U32
#define F32 IVL_CF_PARAM_F32
#define F64 IVL_CF_PARAM_F64

// clang-format off
static const ivl_cf_param_t PARAMS[] = {
    RW(U8,  "sil", "reset",       THE.set.reset, reset_written)
    RW(U8,  "sil", "start",       THE.set.start, start_written)
    RW(U32, "sil", "seed_lo",     THE.set.seed_lo, NULL)
    RW(U32, "sil", "seed_hi",     THE.set.seed_hi, NULL)
    RW(U32, "sil", "stream_lo",   THE.set.stream_lo, NULL)
    RW(U32, "sil", "stream_hi",   THE.set.stream_hi, NULL)
    RW(F64, "sil", "d_ceil",      THE.set.d_ceil_m, numbers_written)
    RW(F64, "sil", "speed",       THE.set.speed_mps, numbers_written)
    RW(F64, "sil", "angle",       THE.set.angle_deg, numbers_written)
    RW(F32, "sil", "start_x",     THE.set.start_x_m, numbers_written)
    RW(F32, "sil", "start_y",     THE.set.start_y_m, numbers_written)
    RW(F32, "sil", "start_z",     THE.set.start_z_m, numbers_written)
    RW(F32, "sil", "vbat",        THE.set.vbat_V, numbers_written)
    RW(U8,  "sil", "pose_source", THE.set.pose_source, estimation_written)
    RW(U8,  "sil", "auto_arm",    THE.supervisor.auto_arm, NULL)

    RW(U8,   "stabilizer", "estimator",  THE.set.estimator, NULL)
    RW(U8,   "stabilizer", "controller", THE.set.controller, controller_written)
    RW(U8,   "stabilizer", "stop",       THE.supervisor.stop, NULL)
    KEPT(U8, "supervisor", "tmblChckEn",  tumbleCheckEnabled, NULL)
    RW(U8,   "supervisor", "infdmp",      THE.supervisor.dump_info, info_written)
    RW(U16,  "supervisor", "prefltTimeout", THE.supervisor.preflight_ms_max, NULL)
    RW(U16,  "supervisor", "landedTimeout", THE.supervisor.landed_ms_max, NULL)
    RW(U8,   "kalman", "resetEstimation", THE.set.reset_estimation, estimation_written)
    RW(F32,  "locSrv", "extPosStdDev",  THE.set.ext_pos_sigma_m, NULL)
    RW(F32,  "locSrv", "extQuatStdDev", THE.set.ext_quat_sigma_rad, NULL)
    RW(U8,   "motorPowerSet", "enable", THE.set.bypass, NULL)
    RW(U16,  "motorPowerSet", "m1", THE.set.bypass_pwm[0], NULL)
    RW(U16,  "motorPowerSet", "m2", THE.set.bypass_pwm[1], NULL)
    RW(U16,  "motorPowerSet", "m3", THE.set.bypass_pwm[2], NULL)
    RW(U16,  "motorPowerSet", "m4", THE.set.bypass_pwm[3], NULL)
    RW(U8,   "flightmode", "althold",       THE.set.alt_hold, NULL)
    RW(U8,   "flightmode", "poshold",       THE.set.pos_hold, NULL)
    RW(U8,   "flightmode", "stabModeRoll",  THE.set.stab_roll, NULL)
    RW(U8,   "flightmode", "stabModePitch", THE.set.stab_pitch, NULL)
    RW(U8,   "flightmode", "stabModeYaw",   THE.set.stab_yaw, NULL)
    RW(U8,   "commander", "enHighLevel", THE.set.high_level, NULL)
    RW(U8,   "health", "startPropTest", THE.set.prop_test, health_written)
    RW(U8,   "health", "startBatTest",  THE.set.battery_test, health_written)
    RW(U8,   "ring", "effect",          THE.set.ring_effect, NULL)
    RO(U8,   "ring", "neffect",         THE.set.ring_n_effect)
    RW(U8,   "ring", "headlightEnable", THE.set.ring_headlight, NULL)
    RO(U8,  "deck", "bcFlow2",       THE.set.deck)
    RO(U8,  "deck", "bcMultiranger", THE.set.deck)
    RO(U8,  "deck", "bcZRanger",     THE.set.no_deck)
    RO(U8,  "deck", "bcZRanger2",    THE.set.no_deck)
    RO(U8,  "deck", "bcFlow",        THE.set.no_deck)
    RO(U8,  "deck", "bcLighthouse4", THE.set.no_deck)
    RO(U8,  "deck", "bcLoco",        THE.set.no_deck)
    RO(U8,  "deck", "bcDWM1000",     THE.set.no_deck)
    RO(U8,  "deck", "bcLedRing",     THE.set.no_deck)
    RO(U8,  "deck", "bcColorLedTop", THE.set.no_deck)
    RO(U8,  "deck", "bcColorLedBot", THE.set.no_deck)
    RO(U32, "firmware", "revision0", THE.set.revision0)
    RO(U16, "firmware", "revision1", THE.set.revision1)
    RO(U8,  "firmware", "modified",  THE.set.modified)
    {.group = "system", .name = "selftestPassed", .type = IVL_CF_PARAM_I8, .read_only = true, .address = &THE.set.selftest_passed},
};
// clang-format on

// ---- log variables: X(c type, group, name, value), with the vehicle cf, its input in, what follows from it e and the truth kin

// clang-format off
#define LOGS(X) \
    X(uint32_t, "sil", "time_ms",  time_ms,  (uint32_t)cf->t_ms) \
    X(uint32_t, "sil", "episode",  episode,  cf->episode.number) \
    X(uint8_t,  "sil", "ended",    ended,    cf->episode.ended) \
    X(uint8_t,  "sil", "grounded", grounded, cf->grounded ? 1u : 0u) \
    X(uint32_t, "sil", "n_pose",   n_pose,   cf->estimate.n) \
    X(float, "stateEstimate", "x",  x,  in->p_WB_m.x) \
    X(float, "stateEstimate", "y",  y,  in->p_WB_m.y) \
    X(float, "stateEstimate", "z",  z,  in->p_WB_m.z) \
    X(float, "stateEstimate", "vx", vx, in->v_WB_mps.x) \
    X(float, "stateEstimate", "vy", vy, in->v_WB_mps.y) \
    X(float, "stateEstimate", "vz", vz, in->v_WB_mps.z) \
    X(float, "stateEstimate", "ax", ax, e.a_g.x) \
    X(float, "stateEstimate", "ay", ay, e.a_g.y) \
    X(float, "stateEstimate", "az", az, e.a_g.z) \
    X(float, "stateEstimate", "roll",  roll,  cf->state.attitude.roll) \
    X(float, "stateEstimate", "pitch", pitch, cf->state.attitude.pitch) \
    X(float, "stateEstimate", "yaw",   yaw,   cf->state.attitude.yaw) \
    X(float, "stateEstimate", "qx", qx, in->q_WB.x) \
    X(float, "stateEstimate", "qy", qy, in->q_WB.y) \
    X(float, "stateEstimate", "qz", qz, in->q_WB.z) \
    X(float, "stateEstimate", "qw", qw, in->q_WB.w) \
    X(float, "stabilizer", "roll",  s_roll,  cf->state.attitude.roll) \
    X(float, "stabilizer", "pitch", s_pitch, cf->state.attitude.pitch) \
    X(float, "stabilizer", "yaw",   s_yaw,   cf->state.attitude.yaw) \
    X(float, "stabilizer", "thrust", s_thrust, 0.25f * (e.pwm[0] + e.pwm[1] + e.pwm[2] + e.pwm[3])) \
    X(float, "gyro", "x", gyro_x, cf->sensors.gyro.x) \
    X(float, "gyro", "y", gyro_y, cf->sensors.gyro.y) \
    X(float, "gyro", "z", gyro_z, cf->sensors.gyro.z) \
    X(float, "acc", "x", acc_x, cf->acc_g[0]) \
    X(float, "acc", "y", acc_y, cf->acc_g[1]) \
    X(float, "acc", "z", acc_z, cf->acc_g[2]) \
    X(uint16_t, "motor", "m1", m1, (uint16_t)e.pwm[0]) \
    X(uint16_t, "motor", "m2", m2, (uint16_t)e.pwm[1]) \
    X(uint16_t, "motor", "m3", m3, (uint16_t)e.pwm[2]) \
    X(uint16_t, "motor", "m4", m4, (uint16_t)e.pwm[3]) \
    X(float,    "pm", "vbat",   vbat,   cf->power.vbat_V) \
    X(uint16_t, "pm", "vbatMV", vbat_mV, (uint16_t)(cf->power.vbat_V * 1000.0f)) \
    X(int8_t,   "pm", "state",  pm_state, ivl_cf_power_state(&cf->power)) \
    X(uint8_t,  "pm", "batteryLevel", battery_level, ivl_cf_power_level(&cf->power)) \
    X(uint16_t, "range", "up", range_up, cf->range_up_mm) \
    X(uint16_t, "supervisor", "info", info, ivl_cf_supervisor_info(cf)) \
    X(uint8_t, "sys", "canfly",    canfly,    ivl_cf_supervisor_motors_allowed(&cf->supervisor) ? 1u : 0u) \
    X(uint8_t, "sys", "isFlying",  is_flying, ivl_cf_supervisor_is_flying(&cf->supervisor) ? 1u : 0u) \
    X(uint8_t, "sys", "isTumbled", is_tumbled, cf->supervisor.tumbled ? 1u : 0u) \
    X(float, "ctrltarget", "x", target_x, cf->commander.setpoint.p_W_m.x) \
    X(float, "ctrltarget", "y", target_y, cf->commander.setpoint.p_W_m.y) \
    X(float, "ctrltarget", "z", target_z, cf->commander.setpoint.p_W_m.z) \
    X(float, "simTruth", "x",  true_x,  (float)kin.p_WB_m[0]) \
    X(float, "simTruth", "y",  true_y,  (float)kin.p_WB_m[1]) \
    X(float, "simTruth", "z",  true_z,  (float)kin.p_WB_m[2]) \
    X(float, "simTruth", "vx", true_vx, (float)kin.v_WB_mps[0]) \
    X(float, "simTruth", "vy", true_vy, (float)kin.v_WB_mps[1]) \
    X(float, "simTruth", "vz", true_vz, (float)kin.v_WB_mps[2]) \
    X(float, "simTruth", "qx", true_qx, (float)kin.q_WB[0]) \
    X(float, "simTruth", "qy", true_qy, (float)kin.q_WB[1]) \
    X(float, "simTruth", "qz", true_qz, (float)kin.q_WB[2]) \
    X(float, "simTruth", "qw", true_qw, (float)kin.q_WB[3]) \
    X(uint8_t, "simTruth", "feet", true_feet, (uint8_t)ivl_sim_world_count_stuck(&cf->group.world[IVL_CF_LANE]))
// clang-format on

static const float PWM_FULL = 65535.0f;

#define MEMBER(c_type, group, name, member, value) c_type member;
static struct
{
    LOGS(MEMBER)
} values;

#define TYPE_OF(member)                                                                                                                    \
    _Generic((values.member),                                                                                                              \
        uint8_t: IVL_CF_LOG_U8,                                                                                                            \
        uint16_t: IVL_CF_LOG_U16,                                                                                                          \
        uint32_t: IVL_CF_LOG_U32,                                                                                                          \
        int8_t: IVL_CF_LOG_I8,                                                                                                             \
        float: IVL_CF_LOG_F32)
#define LOG_LINE(c_type, group_, name_, member, value) {.group = group_, .name = name_, .type = TYPE_OF(member), .address = &values.member},
static const ivl_cf_log_t LOG_TABLE[] = {
    LOGS(LOG_LINE)
    // asked for by the app, so always up to date
    {.group = "kalman", .name = "varPX", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
    {.group = "kalman", .name = "varPY", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
    {.group = "kalman", .name = "varPZ", .type = IVL_CF_LOG_F32, .address = &THE.variance_m2},
};

typedef struct
{
    ivl_vec3_t a_g;  ///< acceleration in W, gravity removed
    float      pwm[4];
} derived_t;

static derived_t derive(const ivl_cf_t *cf)
{
    const ivl_axes_t r = ivl_axes_of(cf->sensed.q_WB);
    derived_t        e;
    const float     *a = cf->acc_g;
    e.a_g = ivl_add(ivl_scale(r.x, a[0]), ivl_add(ivl_scale(r.y, a[1]), ivl_scale(r.z, a[2])));
    e.a_g.z -= 1.0f;
    for (int i = 0; i < 4; i++)
    {
        e.pwm[i] = ivl_clamp(cf->motor_N[i] / cf->model.firmware.motor_thrust_N_max, 0.0f, 1.0f) * PWM_FULL;
    }
    return e;
}

void ivl_cf_logs_refresh(ivl_cf_t *cf)
{
    const ivl_in_t     *in = &cf->sensed;
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const derived_t     e = derive(cf);
#define REFRESH(c_type, group, name, member, value) values.member = (value);
    LOGS(REFRESH)
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
        all_params[n_params++] =
            (ivl_cf_param_t){.group = group, .name = p->name, .type = p->type, .address = p->address, .changed = p->callback};
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

// ---- changes

void ivl_cf_param_changed(ivl_cf_t *cf, const void *address)
{
    for (size_t i = 0; i < n_params && cf->n_changed < IVL_CF_CHANGED_MAX; i++)
    {
        if (all_params[i].address == address)
        {
            cf->changed[cf->n_changed++] = i;
        }
    }
}

bool ivl_cf_param_take_changed(ivl_cf_t *cf, size_t *index)
{
    if (cf->n_changed == 0)
    {
        return false;
    }
    *index = cf->changed[--cf->n_changed];
    return true;
}
