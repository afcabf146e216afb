/// @file app_controller.c
/// The controller hooks of the SDK: convert in, step the core or call the stock controller, convert out.  Runs in the stabilizer's task.
#include <string.h>

#include "FreeRTOS.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "controller.h"
#include "controller_pid.h"
#include "task.h"
#include "usec_time.h"

static const float LOOP_S = 1.0f / RATE_MAIN_LOOP;

// ---- start

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
#ifdef CONFIG_ENABLE_CPX
        app_cpx_start();
#endif
    }
    controllerPidInit();
    app_start_core(&ivl_app);
}

bool controllerOutOfTreeTest(void)
{
    return controllerPidTest() && (ivl_cfg_check(&ivl_app.cfg) == IVL_OK);
}

bool app_has_rate(float tick_hz)
{
    const float rates_hz[] = {RATE_1000_HZ, RATE_500_HZ, RATE_250_HZ};
    bool        has_rate = false;
    for (size_t i = 0; i < sizeof rates_hz / sizeof rates_hz[0]; i++)
    {
        has_rate = has_rate || ((tick_hz >= rates_hz[i]) && (tick_hz <= rates_hz[i]));
    }
    return has_rate;
}

// ---- in

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

// nor does its range: one that changes is new, one that does not grows old
static void sense_range(app_t *app, uint64_t now_us)
{
    const float range_mm = atomic_load(&app->range_mm);
    if ((range_mm > 0.0f) && ((range_mm < app->range_seen_mm) || (range_mm > app->range_seen_mm)))
    {
        app->range_seen_mm = range_mm;
        app->in.range = app_range_reading(range_mm, now_us);
    }
}

static void look_around(app_t *app, const setpoint_t *setpoint, uint64_t now_us)
{
    const bool  is_idle = (setpoint->mode.z == modeDisable) && !(setpoint->thrust > 0.0f);
    const float age_s = (float)(uint32_t)T2M(xTaskGetTickCount() - setpoint->timestamp) * APP_S_PER_MS;
    app_look_around(app, is_idle, age_s, now_us);
}

// ---- out

static void drive_core(app_t *app, control_t *control)
{
    const ivl_out_t *out = &app->out;
    const float      added = app_fade_into_core(app, 0.25f * app_norm_of_N(out->thrust_total_N), LOOP_S);
    control->controlMode = controlModeForce;
    for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++)
    {
        control->normalizedForces[i] = ivl_clamp(app_norm_of_N(out->thrust_N[i]) + added, 0.0f, 1.0f);
    }
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
    const float norm = app_fade_into_stock(app, app_norm_of_stock(control->thrust), LOOP_S);
    if (control->thrust > 0.0f)
    {
        control->thrust = app_stock_of_norm(norm);
    }
}

void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                         const stabilizerStep_t stabilizerStep)
{
    app_t *const   app = &ivl_app;
    const uint64_t now_us = usecTimestamp();
    const uint32_t rate_hz = (uint32_t)app->cfg.tick_hz;

    app_take_requests(app, now_us);
    sense(app, sensors, state, now_us);
    sense_range(app, now_us);
    if (RATE_DO_EXECUTE(rate_hz, stabilizerStep))
    {
        look_around(app, setpoint, now_us);
        app_step(app);
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
