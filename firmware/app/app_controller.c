/// @file app_controller.c
/// The controller hooks of the SDK: convert in, step the core or call the stock controller, convert out.  Runs in the stabilizer's task.
#include <string.h>

#include "FreeRTOS.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "controller.h"
#include "controller_pid.h"
#include "crtp.h"
#include "pm.h"
#include "supervisor.h"
#include "task.h"
#include "usec_time.h"

static const float LOOP_S = 1.0f / RATE_MAIN_LOOP;

app_t ivl_app;

// ---- start

static void start_core(app_t *app)
{
    // a second start comes from switching controllers: what was in the air then may be anywhere now
    const bool was_active = (app->state.phase != IVL_PHASE_IDLE) || app->state.guard.locked_out;
    ivl_init(&app->cfg, &app->state);
    app->state.guard.locked_out = was_active;
    app->in.cmd.request = IVL_REQUEST_IDLE;
    app->out = (ivl_out_t){.stock_allowed = !was_active};
    app->owner = was_active ? APP_OWNER_CORE : APP_OWNER_STOCK;
    app->attitude = (ivl_attitude_t){.q_WB = {0.0f, 0.0f, 0.0f, 1.0f}};
}

void controllerOutOfTreeInit(void)
{
    static bool is_registered;
    if (!is_registered)
    {
        is_registered = true;
        app_config_defaults(&ivl_app.cfg);
        ivl_app.staged = ivl_app.cfg;
        ivl_record_init(&ivl_app.recorder);
        app_memory_register();
    }
    controllerPidInit();
    start_core(&ivl_app);
}

bool controllerOutOfTreeTest(void)
{
    return controllerPidTest() && (ivl_cfg_check(&ivl_app.cfg) == IVL_OK);
}

// ---- in

static void take_requests(app_t *app, uint64_t now_us)
{
    app_config_request_t *const config = &app->config_in.value;
    if (atomic_load(&app->config_in.full) && !atomic_load(&app->config_out.full))
    {
        (void)app_put(&app->config_out, app_config_apply(app, config));
        atomic_store(&app->config_in.full, false);
    }
    ivl_policy_t policy;
    if (!atomic_load(&app->policy_out.full) && app_take(&app->policy_in, &policy))
    {
        const ivl_status_t           status = ivl_policy_commit(&app->cfg, &app->state, &policy);
        const ivl_policy_t           now = app->state.policy;
        const ivl_wire_policy_echo_t echo = {policy.seq, (int8_t)status, now.seq, now.rrev_c_per_s, now.moment_y_Nm};
        (void)app_put(&app->policy_out, echo);
    }
    if (app_take(&app->command_in, &app->in.cmd))
    {
        app->t_host_us = now_us;
        app->has_host = true;
    }
}

// an estimator for upright flight is followed only where the vehicle is upright
static bool follows_estimator(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_IDLE) || (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_ABORTED);
}

static void sense(app_t *app, const sensorData_t *sensors, const state_t *state, uint64_t now_us)
{
    ivl_in_t *in = &app->in;
    in->t_us = now_us;
    in->p_WB_m = app_p_W_m(state);
    in->v_WB_mps = app_v_W_mps(state);
    in->w_B_radps = app_w_B_radps(sensors);
    in->f_B_mps2 = app_f_B_mps2(sensors);
    ivl_attitude_update(&app->attitude, app_q_WB(state), follows_estimator(app->state.phase), in->w_B_radps, LOOP_S);
    in->q_WB = app->attitude.q_WB;

    // the SDK's state carries no time: an estimator that stands still is seen by a position that does
    if (memcmp(&app->p_seen_W_m, &in->p_WB_m, sizeof in->p_WB_m) != 0)
    {
        app->p_seen_W_m = in->p_WB_m;
        app->t_pose_us = now_us;
    }
    in->t_pose_us = app->t_pose_us;
}

static void look_around(app_t *app, const setpoint_t *setpoint, uint64_t now_us)
{
    if (crtpIsConnected())
    {
        app->t_link_us = now_us;
    }
    app->in.vitals = (ivl_vitals_t){
        .given = true,
        .configured = app->configured,
        .can_fly = supervisorCanFly(),
        .bypassed = atomic_load(&app->motors_bypassed),
        .stock_idle = (setpoint->mode.z == modeDisable) && !(setpoint->thrust > 0.0f),
        .vbat_V = pmGetBatteryVoltage(),
        .link_age_s = app_s_between(app->t_link_us, now_us),
        .setpoint_age_s = (float)(uint32_t)T2M(xTaskGetTickCount() - setpoint->timestamp) * APP_S_PER_MS,
        .host_age_s = app->has_host ? app_s_between(app->t_host_us, now_us) : INFINITY,
        .p_sigma_m = atomic_load(&app->p_sigma_m),
    };
}

// ---- out

static void drive_core(app_t *app, control_t *control)
{
    const ivl_out_t *out = &app->out;
    const float      mean_norm = 0.25f * app_norm_of_N(out->thrust_total_N);
    if (app->owner == APP_OWNER_STOCK)
    {
        app->owner = APP_OWNER_CORE;
        ivl_handover_begin(&app->handover, app->collective_norm, mean_norm, app->cfg.handover_s, LOOP_S);
    }
    // a flip is to be as commanded from its first tick
    const bool  fades = (out->phase == IVL_PHASE_READY) || (out->phase == IVL_PHASE_APPROACH) || (out->phase == IVL_PHASE_ABORTED);
    const float offset = ivl_handover_next(&app->handover);
    const float added = (fades && out->motors_on) ? offset : 0.0f;
    control->controlMode = controlModeForce;
    for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++)
    {
        control->normalizedForces[i] = ivl_clamp(app_norm_of_N(out->thrust_N[i]) + added, 0.0f, 1.0f);
    }
    app->collective_norm = ivl_clamp(mean_norm + added, 0.0f, 1.0f);
}

// Step 0 belongs to every rate, so that each loop of the stock controller runs at once; a set-point of nothing empties its memory.
static void restart_stock(const sensorData_t *sensors, const state_t *state)
{
    static const setpoint_t nothing;
    control_t               scratch = {.controlMode = controlModeLegacy};
    controllerPid(&scratch, &nothing, sensors, state, 0);
}

static void drive_stock(app_t *app, control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                        stabilizerStep_t step)
{
    const bool is_new = app->owner == APP_OWNER_CORE;
    if (is_new)
    {
        restart_stock(sensors, state);
    }
    controllerPid(control, setpoint, sensors, state, is_new ? 0 : step);
    if (is_new)
    {
        app->owner = APP_OWNER_STOCK;
        ivl_handover_begin(&app->handover, app->collective_norm, app_norm_of_stock(control->thrust), app->cfg.handover_s, LOOP_S);
        atomic_store(&app->was_handed_back, app->collective_norm > 0.0f);
    }
    const float offset = ivl_handover_next(&app->handover);
    if (control->thrust > 0.0f)
    {
        control->thrust = app_stock_of_norm(app_norm_of_stock(control->thrust) + offset);
    }
    app->collective_norm = app_norm_of_stock(control->thrust);
}

void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                         const stabilizerStep_t stabilizerStep)
{
    app_t *const   app = &ivl_app;
    const uint64_t now_us = usecTimestamp();
    const uint32_t rate_hz = (uint32_t)app->cfg.tick_hz;

    take_requests(app, now_us);
    sense(app, sensors, state, now_us);
    if (RATE_DO_EXECUTE(rate_hz, stabilizerStep))
    {
        look_around(app, setpoint, now_us);
        ivl_step(&app->cfg, &app->state, &app->in, &app->out);
        ivl_record_step(&app->recorder, &app->cfg, &app->state, &app->out);
        app_tumble_check_set(app->state.phase);
    }
    if (app->out.stock_allowed)
    {
        drive_stock(app, control, setpoint, sensors, state, stabilizerStep);
    }
    else
    {
        drive_core(app, control);
    }
}
