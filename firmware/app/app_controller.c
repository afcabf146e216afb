/// @file app_controller.c
/// The controller hooks of the SDK: convert in, step the core or call the stock controller, convert out.  Runs in the stabilizer's task.
#include "FreeRTOS.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "controller.h"
#include "controller_pid.h"
#include "range.h"
#include "task.h"
#include "usec_time.h"

static const float LOOP_S = 1.0f / RATE_MAIN_LOOP;

// ---- start

void controllerOutOfTreeInit(void)
{
    if (!ivl_app.booted)
    {
        app_config_defaults(&ivl_app.cfg);
        app_ready(&ivl_app);
    }
    controllerPidInit();
    app_start_core(&ivl_app);
}

bool controllerOutOfTreeTest(void)
{
    return controllerPidTest() && (ivl_cfg_check(&ivl_app.cfg) == IVL_OK);
}

// ---- in

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
    app_sense_motion(&app->senses, sensors, state, app->state.phase, LOOP_S, now_us, &app->in);
    app_sense_range(&app->senses, rangeGet(rangeUp), now_us, &app->in.range);
    if (RATE_DO_EXECUTE(rate_hz, stabilizerStep))
    {
        look_around(app, setpoint, now_us);
        app_step(app);
        app_idle_step(app);
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
