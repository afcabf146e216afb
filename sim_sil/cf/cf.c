/// @file cf.c
/// The vehicle's life: start, the millisecond, and requests that go straight through.
#include "cf.h"

#include <stdio.h>
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"
#include "controller.h"

ivl_cf_t ivl_cf_the;

static const uint8_t RADIO_ADDRESS = 0xE7;  // last byte

static const float ACC_FILTER_HZ = 30.0f;
static const float SIGMA_M_MIN = 1.0e-3f, SIGMA_M_MAX = 100.0f;

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

/// As after power-on.  What belongs to the simulation and not to the vehicle, its decks included, stays as it was.
static void boot_settings(ivl_cf_t *cf)
{
    const ivl_cf_settings_t before = cf->set;
    cf->set = (ivl_cf_settings_t){
        .controller = IVL_CF_CONTROLLER_APP,
        .estimator = IVL_CF_ESTIMATOR_KALMAN,
        .stab_roll = 1,
        .stab_pitch = 1,
        .yaw_mode = 2,
        .takeoff_mps = 0.5f,
        .landing_mps = 0.5f,
        .cppm = {.roll_degps = 720.0f, .pitch_degps = 720.0f, .yaw_degps = 400.0f, .roll_deg = 50.0f, .pitch_deg = 50.0f},
        .ext_pos_sigma_m = 0.01f,
        .low_V = 3.2f,
        .idle_pwm = (cf->model.raw.rotor_thrust_idle_N > 0.0) ? (uint32_t)IVL_CF_IDLE_PWM : 0u,
        .sim = before.sim,
        .has_flow_deck = before.has_flow_deck,
        .has_ranger_deck = before.has_ranger_deck,
        .cpu_id = {before.cpu_id[0], before.cpu_id[1], before.cpu_id[2]},
    };
}

static void open_settings(ivl_cf_t *cf)
{
    cf->set = (ivl_cf_settings_t){
        .sim = {.start = IVL_CF_START_AS_FLOWN, .d_ceil_m = 0.5, .start_z_m = (float)(0.5 * cf->model.raw.world_ceiling_height_m)},
        .cpu_id = {0x00515649u, (uint32_t)(cf->seed >> 32), (uint32_t)cf->seed},
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

/// Power-on, wherever it is.
static void boot(ivl_cf_t *cf)
{
    const uint8_t auto_arm = cf->supervisor.auto_arm;
    boot_settings(cf);
    ivl_cf_supervisor_init(&cf->supervisor);
    cf->supervisor.auto_arm = auto_arm;
    ivl_cf_commander_init(&cf->commander);
    cf->commander.setpoint.t_ms = ivl_cf_now_ms(cf);
    ivl_cf_planner_init(&cf->planner);
    ivl_cf_estimate_reset(&cf->estimate);
    cf->frame = (ivl_cf_frame_t){.is_other = false};
    ivl_cf_stock_reset(&cf->stock);
    ivl_cf_decks_boot(cf);
    cf->runs_stock = false;
    cf->told = (ivl_sim_told_t){.t_pose_us = 0};
    cf->state = (state_t){.attitudeQuaternion = {.w = 1.0f}};
    cf->to_app = (ivl_cf_packets_t){.most = IVL_CF_PACKETS_IN_MAX};
    cf->from_app = (ivl_cf_packets_t){.most = IVL_CF_PACKETS_MAX};
    cf->tester_errors = 0;
    cf->app_wake_ms = 0;
    cf->is_on = true;
    ivl_cf_tables_boot(cf);
    boot_app(cf);
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
    cf->acc_share = (float)(1.0 - ivl_sim_exp(-2.0 * IVL_SIM_PI * (double)ACC_FILTER_HZ * model->tick_s));
    cf->has_range = model->raw.range_rate_hz > 0.0;
    open_settings(cf);
    ivl_cf_supervisor_init(&cf->supervisor);
    ivl_cf_eeprom_init(cf, RADIO_ADDRESS);
    ivl_cf_power_full(&cf->power);
    if (!ivl_cf_tables_open(cf))
    {
        (void)snprintf(error, error_size, "vehicle: the app has more parameters or log variables than the tables hold");
        return NULL;
    }
    boot(cf);
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
        .motors_run = ivl_cf_motors_run(cf),
        .setpoint_age_ms = ivl_cf_commander_age_ms(&cf->commander, ivl_cf_now_ms(cf)),
    };
    if (ivl_cf_supervisor_update(&cf->supervisor, &in))
    {
        const ivl_cf_state_t state = cf->supervisor.state;
        if (state == IVL_CF_STATE_LOCKED || state == IVL_CF_STATE_CRASHED)
        {
            ivl_cf_print("SUP: %s, %s required\n", ivl_cf_supervisor_name(state), (state == IVL_CF_STATE_LOCKED) ? "reboot" : "recovery");
        }
        if (!ivl_cf_supervisor_can_fly(&cf->supervisor) && !ivl_cf_planner_rests(&cf->planner))
        {
            // what was planned is forgotten, or it would go on when the motors may run again
            ivl_cf_planner_stop(&cf->planner);
        }
    }
}

/// With poses from outside the estimator is as certain as they are, and less and less without them.  The simulated motion capture claims to be
/// certain whatever its noise: in the process of the host no rule asks, and here none must.
static void judge_estimate(ivl_cf_t *cf)
{
    const float fresh_s = 0.1f, drift_mps = 0.5f;
    const float age_s = (float)(ivl_cf_time_us(cf) - cf->sensed.t_pose_us) * APP_S_PER_US;
    const float drift_m = (age_s > fresh_s) ? drift_mps * age_s : 0.0f;
    const float sigma_m = (cf->set.sim.pose_source != 0u) ? cf->set.ext_pos_sigma_m + drift_m : SIGMA_M_MIN;
    const float told_m = ivl_clamp(sigma_m, SIGMA_M_MIN, SIGMA_M_MAX);
    cf->variance_m2 = told_m * told_m;
}

/// Whether the cell of the parameters drives the motors; those of a supply that never sags do not weaken.
static bool drives_motors(const ivl_cf_t *cf)
{
    return cf->set.sim.cell_V > 0.0f && cf->model.raw.battery_voltage_V > 0.0;
}

/// Voltage that a parameter says, at this commanded thrust; 0: none does.  A cell that drives the motors sags with what they take, which is
/// more than was commanded where the cell is strong.
static float told_V(const ivl_cf_t *cf, float thrust_N)
{
    const float                empty_V = 0.01f;
    const ivl_cf_simulation_t *set = &cf->set.sim;
    if (set->vbat_V > 0.0f || !(set->cell_V > 0.0f))
    {
        return set->vbat_V;
    }
    const float loaded_V = drives_motors(cf) ? (float)ivl_sim_rotor_voltage(&cf->model, &cf->group.rotor, IVL_CF_LANE)
                                             : set->cell_V - (float)cf->model.raw.battery_sag_VpN * thrust_N;
    return (loaded_V > empty_V) ? loaded_V : empty_V;
}

static void draw_power(ivl_cf_t *cf)
{
    const float weight_N = cf->model.firmware.mass_kg * cf->model.firmware.gravity_mps2;
    const float thrust_N = cf->motor_N[0] + cf->motor_N[1] + cf->motor_N[2] + cf->motor_N[3];
    if (drives_motors(cf))
    {
        cf->group.rotor.open_circuit_V[IVL_CF_LANE] = (double)cf->set.sim.cell_V;
    }
    ivl_cf_power_step(&cf->power, thrust_N / weight_N, told_V(cf, thrust_N), cf->set.low_V, IVL_CF_PLANNER_MS);
}

/// All that runs beside the stabilizer.
static void run_tasks(ivl_cf_t *cf)
{
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
    ivl_cf_decks_step(cf);
}

void ivl_cf_step(ivl_cf_t *cf)
{
    cf->t_ms++;
    if (cf->is_on)
    {
        run_tasks(cf);
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

// ---- power

void ivl_cf_power_off(ivl_cf_t *cf)
{
    cf->is_on = false;
    cf->text = (ivl_cf_text_t){.n = 0};  // what it had to say
}

void ivl_cf_power_on(ivl_cf_t *cf)
{
    if (!cf->is_on)
    {
        cf->episode.running = false;
        boot(cf);
    }
}

void ivl_cf_set_address(ivl_cf_t *cf, uint8_t address)
{
    ivl_cf_eeprom_init(cf, address);
}

uint64_t ivl_cf_time_us(const ivl_cf_t *cf)
{
    return cf->t_ms * 1000u;
}

void ivl_cf_link(ivl_cf_t *cf, bool up)
{
    const bool turns = cf->model.raw.aero_yaw_torque_norm > 0.0;
    if (up && !cf->link_up && !turns)
    {
        ivl_cf_print("SIL: this vehicle cannot turn (aero.yaw_torque is 0): yaw commands change nothing\n");
    }
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

// ---- supervisor

bool ivl_cf_flies_high_level(const ivl_cf_t *cf)
{
    return ivl_cf_supervisor_can_fly(&cf->supervisor) && !ivl_cf_planner_rests(&cf->planner) &&
           cf->commander.priority <= IVL_CF_PRIORITY_HIGH_LEVEL;
}

uint16_t ivl_cf_supervisor_info(const ivl_cf_t *cf)
{
    const uint32_t active = ivl_cf_planner_rests(&cf->planner) ? 0u : 1u << 8;
    const uint32_t finished = ivl_cf_planner_finished(&cf->planner, ivl_cf_now_ms(cf)) ? 1u << 9 : 0u;
    const uint32_t disabled = (cf->planner.plan == IVL_CF_PLAN_DISABLED) ? 1u << 10 : 0u;
    return (uint16_t)(ivl_cf_supervisor_bits(&cf->supervisor) | active | finished | disabled);
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
