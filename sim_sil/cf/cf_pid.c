/// @file cf_pid.c
/// The SDK's stock controller, as the app and the stabilizer call it: the law of cf_stock.h at the rate of the world's ticks, since between
/// them nothing moves.
#include "app_convert.h"
#include "cf_vehicle.h"
#include "controller_pid.h"

static const float LEGACY_MAX = 32767.0f;

void controllerPidInit(void)
{
    ivl_cf_stock_reset(&ivl_cf_the.stock);
}

bool controllerPidTest(void)
{
    return true;
}

static int16_t legacy(float a)
{
    return (int16_t)ivl_clamp(a, -LEGACY_MAX, LEGACY_MAX);
}

/// Thrusts of the motors in the units of the SDK's mixer, which gives them back (cf_stabilizer.c).
static control_t control_of(const float thrust_N[4])
{
    float m[4];
    for (int i = 0; i < 4; i++)
    {
        m[i] = app_stock_of_norm(app_norm_of_N(thrust_N[i]));
    }
    return (control_t){
        .roll = legacy(0.5f * (m[2] + m[3] - m[0] - m[1])),
        .pitch = legacy(0.5f * (m[0] + m[3] - m[1] - m[2])),
        .yaw = legacy(0.25f * (m[0] + m[2] - m[1] - m[3])),
        .thrust = 0.25f * (m[0] + m[1] + m[2] + m[3]),
        .controlMode = controlModeLegacy,
    };
}

void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                   const stabilizerStep_t stabilizerStep)
{
    ivl_cf_t *const cf = &ivl_cf_the;
    if (stabilizerStep % cf->tick_ms == 0)
    {
        const bool              asks = setpoint->mode.z != modeDisable || setpoint->thrust > 0.0f;
        const ivl_cf_setpoint_t nothing = {.z = IVL_CF_MODE_OFF};
        const ivl_sample_t      sample = {.p_WB_m = app_p_W_m(state),
                                          .v_WB_mps = app_v_W_mps(state),
                                          .q_WB = app_q_WB(state),
                                          .w_B_radps = app_w_B_radps(sensors),
                                          .f_B_mps2 = app_f_B_mps2(sensors)};
        float                   thrust_N[4];
        ivl_cf_stock_step(&cf->stock, &cf->model.firmware, &sample, asks ? &cf->setpoint : &nothing, (float)cf->model.tick_s, thrust_N);
        cf->stock_control = control_of(thrust_N);
    }
    *control = cf->stock_control;
}
