/// @file cf.c
/// The vehicle's life: start, the millisecond, and requests that go straight through.
#include "cf.h"

#include <stdio.h>
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"
#include "controller.h"

ivl_cf_t ivl_cf_the;

static const float    ACC_FILTER_HZ = 30.0f;
static const float    SIGMA_M_MIN = 1.0e-3f, SIGMA_M_MAX = 100.0f;
static const uint32_t RANGE_MS = 100;  // period of the distance sensor
static const double   RANGE_M_MAX = 4.0;
static const uint16_t RANGE_NONE_MM = 32767;

// ---- start

static bool fits(const ivl_sim_model_t *model, uint32_t *tick_ms)
{
    const uint32_t rates_hz[] = {1000, 500, 250};
    for (size_t i = 0; i < sizeof rates_hz / sizeof rates_hz[0]; i++)
    {
        const float hz = (float)rates_hz[i];
        if (model->firmware.tick_hz >= hz && model->firmware.tick_hz <= hz)
        {
            *tick_ms = 1000u / rates_hz[i];
            return true;
        }
    }
    return false;
}

static void boot_settings(ivl_cf_t *cf)
{
    cf->set = (ivl_cf_settings_t){
        .controller = IVL_CF_CONTROLLER_APP,
        .estimator = IVL_CF_ESTIMATOR_KALMAN,
        .start = IVL_CF_START_AS_FLOWN,
        .d_ceil_m = 0.5,
        .start_z_m = (float)(0.5 * cf->model.raw.world_ceiling_height_m),
        .stab_roll = 1,
        .stab_pitch = 1,
        .ext_pos_sigma_m = 0.01f,
        .ext_quat_sigma_rad = 4.5e-3f,
        .deck = 1,
    };
}

/// The app as flashed: its configuration is that of the vehicle, and the host has yet to put one in force.
static void boot_app(ivl_cf_t *cf)
{
    const ivl_cfg_t *cfg = &cf->model.firmware;
    ivl_cf_platform = (ivl_cf_platform_t){cfg->arm_x_m / APP_SQRT_HALF, cfg->mass_kg, cfg->motor_thrust_N_max, cfg->torque_per_thrust_m};
    app_boot(cfg);
    controllerOutOfTreeInit();
    cf->set.selftest_passed = controllerOutOfTreeTest() ? 1 : 0;
    app_task_start();
}

ivl_cf_t *ivl_cf_open(const ivl_sim_model_t *model, uint64_t seed, char *error, size_t error_size)
{
    ivl_cf_t *const cf = &ivl_cf_the;
    uint32_t        tick_ms;
    if (cf->is_open)
    {
        (void)snprintf(error, error_size, "vehicle: open already; a process has one");
        return NULL;
    }
    if (!fits(model, &tick_ms))
    {
        (void)snprintf(error, error_size, "firmware.tick_hz: %g is none of the stabilizer's rates, 1000, 500 and 250 Hz",
                       (double)model->firmware.tick_hz);
        return NULL;
    }
    memset(cf, 0, sizeof *cf);
    cf->model = *model;
    cf->model.core = ivl_cf_core;
    cf->tick_ms = tick_ms;
    cf->seed = seed;
    cf->to_app.most = IVL_CF_PACKETS_IN_MAX;
    cf->from_app.most = IVL_CF_PACKETS_MAX;
    cf->acc_share = (float)(1.0 - ivl_sim_exp(-2.0 * IVL_SIM_PI * (double)ACC_FILTER_HZ * model->tick_s));
    cf->has_range = model->raw.range_rate_hz > 0.0;
    cf->range_up_mm = RANGE_NONE_MM;
    cf->state.attitudeQuaternion.w = 1.0f;
    boot_settings(cf);
    ivl_cf_supervisor_init(&cf->supervisor);
    ivl_cf_commander_init(&cf->commander);
    ivl_cf_planner_init(&cf->planner);
    ivl_cf_estimate_reset(&cf->estimate);
    ivl_cf_power_full(&cf->power);
    if (!ivl_cf_tables_open(cf))
    {
        (void)snprintf(error, error_size, "vehicle: the app has more parameters or log variables than the tables hold");
        return NULL;
    }
    boot_app(cf);
    ivl_sim_group_init(&cf->model, &cf->group);
    cf->group.port = cf->model.core.open(cf->model.core.context);
    ivl_cf_world_boot(cf);
    cf->is_open = true;
    return cf;
}

void ivl_cf_close(ivl_cf_t *cf)
{
    cf->model.core.close(cf->group.port);
    cf->is_open = false;
}

// ---- the millisecond

static void run_app(ivl_cf_t *cf)
{
    if (cf->to_app.n > 0 || app_task_is_pressed() || cf->t_ms >= cf->app_wake_ms)
    {
        app_task_once();
    }
}

static void supervise(ivl_cf_t *cf)
{
    const ivl_cf_supervisor_in_t in = {
        .now_ms = ivl_cf_now_ms(cf),
        .acc_g = {cf->acc_g[0], cf->acc_g[1], cf->acc_g[2]},
        .motors_run = cf->motor_N[0] > 0.0f || cf->motor_N[1] > 0.0f || cf->motor_N[2] > 0.0f || cf->motor_N[3] > 0.0f,
        .setpoint_age_ms = ivl_cf_commander_age_ms(&cf->commander, ivl_cf_now_ms(cf)),
    };
    if (ivl_cf_supervisor_update(&cf->supervisor, &in))
    {
        const ivl_cf_state_t state = cf->supervisor.state;
        if (state == IVL_CF_STATE_LOCKED || state == IVL_CF_STATE_CRASHED)
        {
            ivl_cf_print("SUP: %s, %s required\n", ivl_cf_supervisor_name(state), (state == IVL_CF_STATE_LOCKED) ? "reboot" : "recovery");
        }
    }
}

/// Upwards along the body's axis, to the ceiling.
static void look_up(ivl_cf_t *cf)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const double        up_z = ivl_rot_from_quat(kin.q_WB).row[2].z;
    const double        room_m = cf->model.raw.world_ceiling_height_m - kin.p_WB_m[2];
    const bool          seen = up_z > 0.5 && room_m >= 0.0 && room_m <= RANGE_M_MAX * up_z;
    cf->range_up_mm = RANGE_NONE_MM;
    if (seen)
    {
        cf->range_up_mm = (uint16_t)(room_m / up_z * 1000.0 + 0.5);
    }
}

/// With poses from outside the estimator is as certain as they are, and less and less without them.  The simulated motion capture claims to be
/// certain whatever its noise: in the process of the host no rule asks, and here none must.
static void judge_estimate(ivl_cf_t *cf)
{
    const float fresh_s = 0.1f, drift_mps = 0.5f;
    const float age_s = (float)(ivl_cf_time_us(cf) - cf->sensed.t_pose_us) * APP_S_PER_US;
    const float drift_m = (age_s > fresh_s) ? drift_mps * age_s : 0.0f;
    const float sigma_m = (cf->set.pose_source != 0u) ? cf->set.ext_pos_sigma_m + drift_m : SIGMA_M_MIN;
    const float told_m = ivl_clamp(sigma_m, SIGMA_M_MIN, SIGMA_M_MAX);
    cf->variance_m2 = told_m * told_m;
}

static void draw_power(ivl_cf_t *cf)
{
    const float weight_N = cf->model.firmware.mass_kg * cf->model.firmware.gravity_mps2;
    const float thrust_N = cf->motor_N[0] + cf->motor_N[1] + cf->motor_N[2] + cf->motor_N[3];
    ivl_cf_power_step(&cf->power, thrust_N / weight_N, cf->set.vbat_V, IVL_CF_PLANNER_MS);
}

void ivl_cf_step(ivl_cf_t *cf)
{
    cf->t_ms++;
    run_app(cf);
    if (cf->t_ms % IVL_CF_PLANNER_MS == 0)
    {
        ivl_cf_plan(cf);
        judge_estimate(cf);
        draw_power(cf);
    }
    if (cf->t_ms % IVL_CF_SUPERVISOR_MS == 0)
    {
        supervise(cf);
    }
    if (!cf->has_range && cf->t_ms % RANGE_MS == 0)
    {
        look_up(cf);
    }
    if (cf->t_ms % cf->tick_ms == 0)
    {
        ivl_cf_world_tick(cf);
    }
    else
    {
        ivl_cf_stabilize(cf);
    }
}

uint64_t ivl_cf_time_us(const ivl_cf_t *cf)
{
    return cf->t_ms * 1000u;
}

void ivl_cf_link(ivl_cf_t *cf, bool up)
{
    cf->link_up = up;
}

// ---- what waits

size_t ivl_cf_console_take(ivl_cf_t *cf, char *text, size_t size)
{
    return ivl_cf_text_take(&cf->text, text, size);
}

bool ivl_cf_app_receive(ivl_cf_t *cf, const uint8_t *bytes, size_t size)
{
    return ivl_cf_packets_put(&cf->to_app, bytes, size);
}

size_t ivl_cf_app_take(ivl_cf_t *cf, uint8_t bytes[IVL_CF_APP_BYTES])
{
    return ivl_cf_packets_take(&cf->from_app, bytes, IVL_CF_APP_BYTES);
}

// ---- memories

static uint32_t outcome_size(void)
{
    return (uint32_t)(sizeof(ivl_cf_outcome_header_t) + sizeof(ivl_sim_outcome_t));
}

static bool outcome_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    const ivl_cf_episode_t *e = &ivl_cf_the.episode;
    ivl_cf_outcome_header_t header = e->header;
    header.magic = IVL_CF_OUTCOME_MAGIC;
    header.size = (uint32_t)sizeof e->outcome;
    uint8_t all[sizeof header + sizeof e->outcome];
    memcpy(all, &header, sizeof header);
    memcpy(all + sizeof header, &e->outcome, sizeof e->outcome);
    if (address > sizeof all || size > sizeof all - address)
    {
        return false;
    }
    memcpy(bytes, all + address, size);
    return true;
}

static uint32_t world_size(void)
{
    return (uint32_t)sizeof ivl_cf_the.model.raw;
}

static bool world_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    const ivl_sim_params_t *raw = &ivl_cf_the.model.raw;
    if (address > sizeof *raw || size > sizeof *raw - address)
    {
        return false;
    }
    memcpy(bytes, (const uint8_t *)raw + address, size);
    return true;
}

const ivl_cf_memory_t *ivl_cf_memories(const ivl_cf_t *cf, size_t *n)
{
    (void)cf;
    static ivl_cf_memory_t memories[3];
    memories[0] = *ivl_cf_app_memory();
    memories[1] = (ivl_cf_memory_t){.type = IVL_CF_MEMORY_OUTCOME, .size = outcome_size, .read = outcome_read};
    memories[2] = (ivl_cf_memory_t){.type = IVL_CF_MEMORY_WORLD, .size = world_size, .read = world_read};
    *n = sizeof memories / sizeof memories[0];
    return memories;
}

// ---- supervisor

uint16_t ivl_cf_supervisor_info(const ivl_cf_t *cf)
{
    const uint32_t active = (cf->planner.plan != IVL_CF_PLAN_STOPPED) ? 1u << 8 : 0u;
    const uint32_t finished = ivl_cf_planner_finished(&cf->planner, ivl_cf_now_ms(cf)) ? 1u << 9 : 0u;
    return (uint16_t)(ivl_cf_supervisor_bits(&cf->supervisor) | active | finished);
}

bool ivl_cf_arm(ivl_cf_t *cf, bool arm)
{
    return ivl_cf_supervisor_arm(&cf->supervisor, arm);
}

bool ivl_cf_recover(ivl_cf_t *cf)
{
    return ivl_cf_supervisor_recover(&cf->supervisor);
}

void ivl_cf_estop(ivl_cf_t *cf)
{
    cf->supervisor.estop = true;
}

void ivl_cf_estop_watchdog(ivl_cf_t *cf)
{
    ivl_cf_supervisor_watchdog(&cf->supervisor, ivl_cf_now_ms(cf));
}

bool ivl_cf_is_armed(const ivl_cf_t *cf)
{
    return cf->supervisor.armed;
}

// ---- localization

static bool good_pose(const float p_W_m[3], const ivl_quat_t *q)
{
    const bool at_home = ivl_vec3_within(ivl_vec3(p_W_m[0], p_W_m[1], p_W_m[2]), IVL_SENSE_P_M_MAX);
    return at_home && (q == NULL || ivl_within(q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w - 1.0f, 2.0f * IVL_SENSE_Q_NORM2_TOL));
}

bool ivl_cf_ext_position(ivl_cf_t *cf, const float p_W_m[3])
{
    if (!good_pose(p_W_m, NULL))
    {
        return false;
    }
    ivl_cf_estimate_packet(&cf->estimate, ivl_cf_time_us(cf), ivl_vec3(p_W_m[0], p_W_m[1], p_W_m[2]), NULL);
    return true;
}

bool ivl_cf_ext_pose(ivl_cf_t *cf, const float p_W_m[3], const float q_WB[4])
{
    const ivl_quat_t q = {q_WB[0], q_WB[1], q_WB[2], q_WB[3]};
    if (!good_pose(p_W_m, &q))
    {
        return false;
    }
    ivl_cf_estimate_packet(&cf->estimate, ivl_cf_time_us(cf), ivl_vec3(p_W_m[0], p_W_m[1], p_W_m[2]), &q);
    return true;
}
