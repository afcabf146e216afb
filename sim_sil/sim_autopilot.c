#include "sim_autopilot.h"

#include <math.h>
#include <string.h>

#include "app_convert.h"

/// Of the SDK's ranging sensor: nothing found.
static const float RANGE_NONE_MM = 32767.0f;
static const float MM_PER_M = 1000.0f;

/// Calls of the controller a second, whatever the rate of the core.
static const double LOOP_HZ = (double)RATE_MAIN_LOOP;

static Axis3f axis3(ivl_vec3_t a, float unit)
{
    return (Axis3f){a.x / unit, a.y / unit, a.z / unit};
}

/// One unit in the last place, at least.
static float next_to(float x)
{
    return x + (1.0e-9f + 1.2e-7f * fabsf(x));
}

static ivl_vec3_t told_position(ivl_sim_told_t *told, const ivl_in_t *sensed)
{
    if (sensed->t_pose_us != told->t_pose_us)
    {
        const bool is_same = memcmp(&told->p_W_m, &sensed->p_WB_m, sizeof told->p_W_m) == 0;
        told->t_pose_us = sensed->t_pose_us;
        told->p_W_m = sensed->p_WB_m;
        told->p_W_m.x = is_same ? next_to(told->p_W_m.x) : told->p_W_m.x;
    }
    return told->p_W_m;
}

void ivl_sim_sdk_of(ivl_sim_told_t *told, const ivl_in_t *sensed, sensorData_t *sensors, state_t *state)
{
    const ivl_quat_t q = sensed->q_WB;
    const ivl_vec3_t p = told_position(told, sensed), v = sensed->v_WB_mps;
    *sensors = (sensorData_t){.acc = axis3(sensed->f_B_mps2, APP_MPS2_PER_G), .gyro = axis3(sensed->w_B_radps, APP_RADPS_PER_DEGPS)};
    *state = (state_t){
        .attitudeQuaternion = {q.x, q.y, q.z, q.w}, .position = {.x = p.x, .y = p.y, .z = p.z}, .velocity = {.x = v.x, .y = v.y, .z = v.z}};
}

float ivl_sim_sdk_range_mm(const ivl_reading_t *range)
{
    if (range->t_us == 0u)
    {
        return 0.0f;
    }
    const float mm = floorf(range->value * MM_PER_M + 0.5f);
    return (range->valid != 0u && mm >= 0.0f && mm < RANGE_NONE_MM) ? mm : RANGE_NONE_MM;
}

float ivl_sim_motor_N(const ivl_sim_model_t *model, float norm, float max_N, float idle_N)
{
    const float asked_N = ivl_clamp(norm, 0.0f, 1.0f) * max_N;
    const float made_N = (asked_N < (float)model->raw.rotor_thrust_least_N) ? 0.0f : asked_N;
    return (made_N < idle_N) ? idle_N : made_N;
}

bool ivl_sim_autopilot_decide(const ivl_sim_model_t *model, void *port, int lane, const ivl_in_t *sensed, ivl_sim_autopilot_t *autopilot,
                              ivl_state_t *firmware, ivl_out_t *out, ivl_reference_t *ref)
{
    const ivl_sim_core_t *core = &model->core;
    const int             n_loop = (model->tick_s * LOOP_HZ > 1.5) ? (int)(model->tick_s * LOOP_HZ + 0.5) : 1;
    const float           loop_s = (float)(model->tick_s / n_loop);
    ivl_in_t             *in = &autopilot->in;
    bool                  follows = false;
    sensorData_t          sensors;
    state_t               state;
    ivl_sim_sdk_of(&autopilot->told, sensed, &sensors, &state);
    in->cmd = sensed->cmd;
    in->rrev = sensed->rrev;
    in->flow = sensed->flow;
    app_sense_motion(&autopilot->senses, &sensors, &state, firmware->phase, loop_s, sensed->t_us, in);
    app_sense_range(&autopilot->senses, ivl_sim_sdk_range_mm(&sensed->range), sensed->t_us, &in->range);
    if (core->decide != NULL)
    {
        follows = core->decide(port, lane, &model->firmware, firmware, in, out, ref);
    }
    else
    {
        core->step(port, lane, &model->firmware, firmware, in, out);
    }
    // the controller is called more often than the core, and carries the attitude on with the gyro that it has
    for (int i = 1; i < n_loop; i++)
    {
        app_sense_attitude(&autopilot->senses, &sensors, &state, firmware->phase, loop_s);
    }
    return follows;
}

void ivl_sim_autopilot_drive(const ivl_sim_model_t *model, ivl_out_t *out)
{
    const float max_N = model->firmware.motor_thrust_N_max;
    const float idle_N = app_stops_motors(out) ? 0.0f : (float)model->raw.rotor_thrust_idle_N;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        out->thrust_N[i] = ivl_sim_motor_N(model, out->thrust_N[i] / max_N, max_N, idle_N);
    }
}
