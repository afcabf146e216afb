/// @file cf_stabilizer.c
/// The stabilizer's task, once a millisecond: the controller, then the motors.  In a tick of the world it stands where the world has its core,
/// and what is sensed comes first; the motors follow its command of that call.
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"
#include "controller.h"
#include "controller_pid.h"

static const float PWM_MAX = 65535.0f;

static void *open_port(void *context)
{
    return context;
}

static void close_port(void *port)
{
    (void)port;
}

/// A world that starts anew has a core that starts anew, but what the host has set stays, and counters never decrease.
static void init(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state)
{
    (void)lane, (void)cfg;
    ivl_cf_t *const cf = port;
    cf->told = (ivl_sim_told_t){.t_pose_us = 0};
    app_begin_anew();
    *state = *app_core_state();
}

static ivl_status_t commit(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)port, (void)lane, (void)cfg;
    ivl_policy_t wanted = *policy;
    wanted.id.seq = app_core_state()->policy.id.seq;
    const ivl_status_t status = app_policy_apply(&wanted);
    *state = *app_core_state();
    return status;
}

// ---- out

/// Thrust grows with the square of the duty cycle, nearly.
static float idle_N(const ivl_cf_t *cf)
{
    const float share = (float)cf->set.idle_pwm / (float)IVL_CF_IDLE_PWM;
    return (float)cf->model.raw.rotor_thrust_idle_N * share * share;
}

bool ivl_cf_motors_run(const ivl_cf_t *cf)
{
    bool run = false;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        run = run || cf->motor_N[i] > idle_N(cf);
    }
    return run;
}

static void give(const ivl_cf_t *cf, float thrust_N[4], float norm_1, float norm_2, float norm_3, float norm_4)
{
    const float norm[4] = {norm_1, norm_2, norm_3, norm_4};
    for (int i = 0; i < 4; i++)
    {
        thrust_N[i] = ivl_sim_motor_N(&cf->model, norm[i], THRUST_MAX, idle_N(cf));
    }
}

/// The SDK's mixer for X.  Motors 1 and 4 are in front, 1 and 2 on the right.
static void distribute(const ivl_cf_t *cf, const control_t *control, float thrust_N[4])
{
    if (control->controlMode == controlModeForce)
    {
        const float *norm = control->normalizedForces;
        give(cf, thrust_N, norm[0], norm[1], norm[2], norm[3]);
        return;
    }
    const float t = app_norm_of_stock(control->thrust), y = (float)control->yaw / PWM_MAX;
    const float r = 0.5f * (float)control->roll / PWM_MAX, p = 0.5f * (float)control->pitch / PWM_MAX;
    give(cf, thrust_N, t - r + p + y, t - r - p - y, t + r - p + y, t + r + p - y);
}

static void bypass(const ivl_cf_t *cf, float thrust_N[4])
{
    for (int i = 0; i < 4 && cf->set.bypass != 0u; i++)
    {
        thrust_N[i] = (float)cf->set.bypass_pwm[(cf->set.bypass == 1u) ? i : 0] / PWM_MAX * THRUST_MAX;
    }
}

// ---- the task

/// The members of a set-point that the app looks at; the stock controller takes the others from the vehicle.
static setpoint_t sdk_setpoint(const ivl_cf_setpoint_t *sp)
{
    const stab_mode_t modes[] = {[IVL_CF_MODE_OFF] = modeDisable, [IVL_CF_MODE_ABS] = modeAbs, [IVL_CF_MODE_VELOCITY] = modeVelocity};
    return (setpoint_t){.timestamp = sp->t_ms, .thrust = app_stock_of_norm(sp->thrust_norm), .mode = {.z = modes[sp->z]}};
}

void ivl_cf_stabilize(ivl_cf_t *cf)
{
    if (!cf->is_on)
    {
        memset(cf->motor_N, 0, sizeof cf->motor_N);
        return;
    }
    cf->setpoint = ivl_cf_setpoint(cf);
    const setpoint_t       setpoint = sdk_setpoint(&cf->setpoint);
    const stabilizerStep_t step = (stabilizerStep_t)cf->t_ms;
    if (cf->set.controller == IVL_CF_CONTROLLER_APP)
    {
        controllerOutOfTree(&cf->control, &setpoint, &cf->sensors, &cf->state, step);
    }
    else
    {
        controllerPid(&cf->control, &setpoint, &cf->sensors, &cf->state, step);
    }
    distribute(cf, &cf->control, cf->motor_N);
    if (!ivl_cf_supervisor_motors_allowed(&cf->supervisor))
    {
        memset(cf->motor_N, 0, sizeof cf->motor_N);
    }
    bypass(cf, cf->motor_N);
}

static void step(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    (void)lane, (void)cfg;
    ivl_cf_t *const cf = port;
    ivl_cf_sense(cf, in);
    ivl_cf_stabilize(cf);
    *state = *app_core_state();
    *out = *app_core_out();
    memcpy(out->thrust_N, cf->motor_N, sizeof out->thrust_N);
}

const ivl_sim_core_t ivl_cf_core = {.context = &ivl_cf_the,
                                    .open = open_port,
                                    .close = close_port,
                                    .init = init,
                                    .commit = commit,
                                    .step = step,
                                    .every_tick = true,
                                    .has_autopilot = true};
