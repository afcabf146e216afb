/// @file cf_stabilizer.c
/// One tick of the stabilizer's task: what is sensed, who drives the motors, with what thrust.  It stands where the world has its core.
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"

// what a core's clock shows when the world's clock is 0
static const uint64_t CORE_ZERO_US = 1000000;
static const float    PWM_MAX = 65535.0f;

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
    (void)port, (void)lane, (void)cfg;
    const ivl_state_t before = ivl_app.state;
    ivl_init(&ivl_app.cfg, &ivl_app.state);
    ivl_app.state.diag = before.diag;
    ivl_app.state.policy = before.policy;
    ivl_app.state.has_policy = before.has_policy;
    ivl_app.handover = (ivl_handover_t){0.0f, 0.0f};
    ivl_app.recorder.last_phase = IVL_PHASE_IDLE;
    *state = ivl_app.state;
}

static ivl_status_t commit(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)port, (void)lane, (void)cfg;
    ivl_policy_t wanted = *policy;
    wanted.id.seq = ivl_app.state.policy.id.seq;
    const ivl_status_t status = ivl_policy_commit(&ivl_app.cfg, &ivl_app.state, &wanted);
    *state = ivl_app.state;
    return status;
}

// ---- in

static bool follows_estimator(ivl_phase_t phase)
{
    return phase == IVL_PHASE_IDLE || phase == IVL_PHASE_READY || phase == IVL_PHASE_APPROACH || phase == IVL_PHASE_ABORTED;
}

static void shift(ivl_reading_t *reading, uint64_t shift_us)
{
    reading->t_us += (reading->t_us > 0u) ? shift_us : 0u;  // 0: there is no such sensor
}

static void sense(ivl_cf_t *cf, const ivl_in_t *in)
{
    const ivl_in_t before = cf->sensed;
    const uint64_t shift_us = cf->zero_us - CORE_ZERO_US;
    cf->sensed = *in;
    cf->sensed.t_us += shift_us;
    cf->sensed.t_pose_us += shift_us;
    shift(&cf->sensed.rrev, shift_us);
    shift(&cf->sensed.range, shift_us);
    shift(&cf->sensed.flow, shift_us);
    if (cf->set.estimator != IVL_CF_ESTIMATOR_KALMAN)
    {
        // the others have no position: it stands still and grows old
        cf->sensed.t_pose_us = before.t_pose_us;
        cf->sensed.p_WB_m = before.p_WB_m;
        cf->sensed.v_WB_mps = before.v_WB_mps;
    }
    else if (cf->set.pose_source != 0u)
    {
        ivl_cf_estimate_fill(&cf->estimate, follows_estimator(ivl_app.state.phase), (float)cf->model.tick_s, &cf->sensed);
    }
    const ivl_vec3_t f = cf->sensed.f_B_mps2;
    const float      now_g[3] = {f.x / APP_MPS2_PER_G, f.y / APP_MPS2_PER_G, f.z / APP_MPS2_PER_G};
    for (int i = 0; i < 3; i++)
    {
        cf->acc_g[i] += cf->acc_share * (now_g[i] - cf->acc_g[i]);
    }
}

// ---- out

static float mean_norm(const float thrust_N[4])
{
    return app_norm_of_N(0.25f * (thrust_N[0] + thrust_N[1] + thrust_N[2] + thrust_N[3]));
}

static void add(float thrust_N[4], float norm)
{
    // nothing to add must not touch a bit
    for (int i = 0; i < 4 && (norm < 0.0f || norm > 0.0f); i++)
    {
        thrust_N[i] = ivl_clamp(thrust_N[i] + norm * THRUST_MAX, 0.0f, THRUST_MAX);
    }
}

static void drive_stock(ivl_cf_t *cf, const ivl_cf_setpoint_t *setpoint, float thrust_N[4])
{
    const ivl_in_t    *in = &cf->sensed;
    const ivl_sample_t sample = {in->t_us, in->t_pose_us, in->p_WB_m, in->v_WB_mps, in->q_WB, in->w_B_radps, in->f_B_mps2};
    ivl_cf_stock_step(&cf->stock, &cf->model.firmware, &sample, setpoint, (float)cf->model.tick_s, thrust_N);
}

/// The app's part of a tick.
static void drive_app(ivl_cf_t *cf, const ivl_cf_setpoint_t *setpoint, float thrust_N[4])
{
    app_t *const        app = &ivl_app;
    const float         tick_s = (float)cf->model.tick_s;
    const float         age_s = (float)ivl_cf_commander_age_ms(&cf->commander, ivl_cf_now_ms(cf)) * APP_S_PER_MS;
    const ivl_command_t command = app->in.cmd;
    app->in = cf->sensed;
    app->in.cmd = command;
    app_look_around(app, ivl_cf_setpoint_idle(setpoint), age_s, ivl_cf_time_us(cf));
    app_step(app);
    if (app->out.stock_allowed)
    {
        if (app->owner == APP_OWNER_CORE)
        {
            ivl_cf_stock_reset(&cf->stock);
        }
        drive_stock(cf, setpoint, thrust_N);
        const float norm = mean_norm(thrust_N);
        add(thrust_N, app_fade_into_stock(app, norm, tick_s) - norm);
    }
    else
    {
        memcpy(thrust_N, app->out.thrust_N, sizeof app->out.thrust_N);
        add(thrust_N, app_fade_into_core(app, app_norm_of_N(0.25f * app->out.thrust_total_N), tick_s));
    }
}

static void bypass(const ivl_cf_t *cf, float thrust_N[4])
{
    for (int i = 0; i < 4 && cf->set.bypass != 0u; i++)
    {
        thrust_N[i] = (float)cf->set.bypass_pwm[(cf->set.bypass == 1u) ? i : 0] / PWM_MAX * THRUST_MAX;
    }
}

static void step(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    (void)lane, (void)cfg;
    ivl_cf_t *const         cf = port;
    const ivl_cf_setpoint_t setpoint = ivl_cf_setpoint(cf);
    float                   thrust_N[4];
    sense(cf, in);
    if (cf->set.controller == IVL_CF_CONTROLLER_APP)
    {
        drive_app(cf, &setpoint, thrust_N);
    }
    else
    {
        drive_stock(cf, &setpoint, thrust_N);
    }
    if (!ivl_cf_supervisor_motors_allowed(&cf->supervisor))
    {
        memset(thrust_N, 0, sizeof thrust_N);
    }
    bypass(cf, thrust_N);
    memcpy(cf->motor_N, thrust_N, sizeof cf->motor_N);
    *state = ivl_app.state;
    *out = ivl_app.out;
    memcpy(out->thrust_N, thrust_N, sizeof out->thrust_N);
}

const ivl_sim_core_t ivl_cf_core = {
    .context = &ivl_cf_the, .open = open_port, .close = close_port, .init = init, .commit = commit, .step = step, .every_tick = true};
