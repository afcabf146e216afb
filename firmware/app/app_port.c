/// @file app_port.c
/// The app for a program that simulates the vehicle around it.  Not part of the drone's build.
#include "app_port.h"

#include <string.h>

#include "app_ivl.h"

void app_boot(const ivl_cfg_t *cfg)
{
    memset(&ivl_app, 0, sizeof ivl_app);
    ivl_app.cfg = *cfg;
    app_ready(&ivl_app);
}

// ---- what only a simulated vehicle does

static void forget_senses(app_t *app)
{
    memset(&app->senses, 0, sizeof app->senses);
    memset(&app->seen, 0, sizeof app->seen);
    memset(&app->in.rrev, 0, sizeof app->in.rrev);
    memset(&app->in.range, 0, sizeof app->in.range);
    memset(&app->in.flow, 0, sizeof app->in.flow);
}

void app_begin_anew(void)
{
    static ivl_policy_t policy;  // too large for a stack of the drone
    app_t *const        app = &ivl_app;
    const ivl_diag_t    diag = app->state.diag;
    const bool          has_policy = app->state.has_policy;
    policy = app->state.policy;
    ivl_init(&app->cfg, &app->state);
    app->state.diag = diag;
    app->state.policy = policy;
    app->state.has_policy = has_policy;
    app->handover = (ivl_handover_t){0.0f, 0.0f};
    app->recorder.last_phase = IVL_PHASE_IDLE;
    forget_senses(app);
}

void app_start_on_path(bool yes)
{
    ivl_app.starts_on_path = yes;
    ivl_app.state.policy.at_once = yes && ivl_app.state.policy.at_once;
}

void app_release(float mean_norm)
{
    app_t *const app = &ivl_app;
    atomic_store(&app->command_in.full, false);
    app->in.cmd = (ivl_command_t){.request = IVL_REQUEST_IDLE};
    if (app->pending.what == APP_WAITS_FOR_COMMAND)
    {
        app->pending.what = APP_WAITS_FOR_NOTHING;
    }
    atomic_store(&app->was_handed_back, false);
    app->owner = APP_OWNER_STOCK;
    app->collective_norm = mean_norm;
}

ivl_status_t app_policy_apply(const ivl_policy_t *policy)
{
    return ivl_policy_commit(&ivl_app.cfg, &ivl_app.state, policy);
}

void app_camera_says(const ivl_reading_t *rrev, const ivl_reading_t *flow)
{
    const app_seen_t seen = {.rrev = *rrev, .flow = *flow};
    (void)app_put(&ivl_app.seen_in[APP_CAMERA_CPX], seen);
}

// ---- what others may know

const ivl_state_t *app_core_state(void)
{
    return &ivl_app.state;
}

const ivl_out_t *app_core_out(void)
{
    return &ivl_app.out;
}

const ivl_command_t *app_command(void)
{
    return &ivl_app.in.cmd;
}

bool app_task_is_pressed(void)
{
    return app_packets_waiting(&ivl_app);
}
