/// @file app_tick.c
/// What the stabilizer's task does in every port of the app, whatever the units of its sensors and motors: requests from the other tasks, what
/// is known about the vehicle, the core with its recorder, and the hand-over of the motors.
#include "FreeRTOS.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "crtp.h"
#include "pm.h"
#include "supervisor.h"

app_t ivl_app;

// ---- start

static void register_with_sdk(void)
{
    // the SDK remembers what a vehicle without power would have forgotten
    static bool is_registered;
    if (!is_registered)
    {
        is_registered = true;
        app_memory_register();
#ifdef CONFIG_ENABLE_CPX
        app_cpx_start();
#endif
    }
}

void app_ready(app_t *app)
{
    app->booted = true;
    app->staged = app->cfg;
    app->config_crc = ivl_cfg_crc(&app->cfg);
    app->config_result.bad = (uint8_t)APP_CONFIG_NONE;
    ivl_record_init(&app->recorder);
    register_with_sdk();
}

void app_start_core(app_t *app)
{
    // a second start comes from switching controllers: what was in the air then may be anywhere now
    const bool was_active = (app->state.phase != IVL_PHASE_IDLE) || app->state.guard.locked_out;
    ivl_init(&app->cfg, &app->state);
    app->state.guard.locked_out = was_active;
    app->in.cmd.request = IVL_REQUEST_IDLE;
    app->out = (ivl_out_t){.stock_allowed = !was_active};
    app->owner = was_active ? APP_OWNER_CORE : APP_OWNER_STOCK;
    // what was sensed last stays: an estimator or a sensor that stood still meanwhile is as old as it was
    app->senses.attitude = (ivl_attitude_t){.q_WB = {0.0f, 0.0f, 0.0f, 1.0f}};
}

// ---- each call

void app_take_requests(app_t *app, uint64_t now_us)
{
    app_config_request_t *const config = &app->config_in.value;
    if (atomic_load(&app->config_in.full) && !atomic_load(&app->config_out.full))
    {
        (void)app_put(&app->config_out, app_config_apply(app, config));
        atomic_store(&app->config_in.full, false);
    }
    if (!atomic_load(&app->policy_out.full) && atomic_load(&app->policy_in.full))
    {
        // where it lies: a copy would be too large for the stack
        const ivl_policy_t *const    policy = &app->policy_in.value;
        const ivl_status_t           status = ivl_policy_commit(&app->cfg, &app->state, policy);
        const ivl_policy_id_t        now = app->state.policy.id;
        const ivl_wire_policy_echo_t echo = {policy->id.seq, (int8_t)status, 0u, now.seq, now.crc, now.form};
        atomic_store(&app->policy_in.full, false);
        (void)app_put(&app->policy_out, echo);
    }
    if (app_take(&app->command_in, &app->in.cmd))
    {
        app->t_host_us = now_us;
        app->has_host = true;
    }
    app_reading_take(app);
}

void app_look_around(app_t *app, bool stock_idle, float setpoint_age_s, uint64_t now_us)
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
        .stock_idle = stock_idle,
        .vbat_V = pmGetBatteryVoltage(),
        .link_age_s = app_s_between(app->t_link_us, now_us),
        .setpoint_age_s = setpoint_age_s,
        .host_age_s = app->has_host ? app_s_between(app->t_host_us, now_us) : INFINITY,
        .p_sigma_m = atomic_load(&app->p_sigma_m),
    };
}

// One packet is not to lead from IDLE into a flip: an approach begins from READY, where a request to hover has brought the vehicle before.
static ivl_request_t request_to_obey(const app_t *app)
{
    const bool skips_ready = (app->state.phase == IVL_PHASE_IDLE) && (app->in.cmd.request == IVL_REQUEST_APPROACH);
    return (skips_ready && !app->starts_on_path) ? IVL_REQUEST_IDLE : app->in.cmd.request;
}

void app_step(app_t *app)
{
    const ivl_request_t asked = app->in.cmd.request;
    app_reading_show(app);
    app->in.cmd.request = request_to_obey(app);
    ivl_step(&app->cfg, &app->state, &app->in, &app->out);
    app->in.cmd.request = asked;
    ivl_record_step(&app->recorder, &app->cfg, &app->state, &app->out);
    app_tumble_check_set(app->state.phase);
}

float app_fade_into_core(app_t *app, float mean_norm, float loop_s)
{
    if (app->owner == APP_OWNER_STOCK)
    {
        app->owner = APP_OWNER_CORE;
        ivl_handover_begin(&app->handover, app->collective_norm, mean_norm, app->cfg.handover_s, loop_s);
    }
    // a flip is to be as commanded from its first tick, and a level-out counts on its little thrust
    const ivl_phase_t phase = app->out.phase;
    const bool        fades = (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_ABORTED);
    const float       offset = ivl_handover_next(&app->handover);
    const float       added = (fades && app->out.motors_on) ? offset : 0.0f;
    app->collective_norm = ivl_clamp(mean_norm + added, 0.0f, 1.0f);
    return added;
}

float app_fade_into_stock(app_t *app, float norm, float loop_s)
{
    if (app->owner == APP_OWNER_CORE)
    {
        app->owner = APP_OWNER_STOCK;
        ivl_handover_begin(&app->handover, app->collective_norm, norm, app->cfg.handover_s, loop_s);
        atomic_store(&app->was_handed_back, app->collective_norm > 0.0f);
    }
    const float offset = ivl_handover_next(&app->handover);
    app->collective_norm = (norm > 0.0f) ? ivl_clamp(norm + offset, 0.0f, 1.0f) : norm;
    return app->collective_norm;
}
