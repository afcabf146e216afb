/// @file app_packets.c
/// Packets of the host, and their echoes.  Runs in the app's task.
#include "FreeRTOS.h"
#include "app_channel.h"
#include "app_ivl.h"
#include "ivl_cfg_name.h"
#include "task.h"
#include "usec_time.h"

#define DEBUG_MODULE "IVL"
#include "debug.h"

// a controller that runs takes a mailbox within a millisecond; this is long enough to be sure that none does
#define POLICY_MS_MAX 20u
// ... and this is long enough for a tick at 500 Hz to act on a command, so that the echo tells what it led to
#define COMMAND_MS 3u
// the same for a commit, which the task only looks at in passing
#define CONFIG_POLLS_MAX 20
// packets that overtake each other are few and near
#define OVERTAKEN_MAX 64u

// not blocking: when nobody listens, an echo is lost, and the host asks again
static void reply(uint8_t *bytes, size_t size)
{
    (void)appchannelSendDataPacket(bytes, size);
}

static void begin_wait(app_t *app, app_waits_t what, uint32_t seq)
{
    app->pending = (app_pending_t){what, seq, T2M(xTaskGetTickCount())};
}

static uint32_t waited_ms(const app_t *app)
{
    return T2M(xTaskGetTickCount()) - app->pending.since_ms;
}

// ---- policy

static void echo_policy(const ivl_wire_policy_echo_t *echo)
{
    uint8_t bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_policy_echo(bytes, echo));
}

// a part that leaves others missing is answered only if it is the last in order: then its sender waits
static void handle_policy(app_t *app, const ivl_wire_policy_t *packet)
{
    const ivl_wire_status_t status = ivl_parts_take(&app->parts, packet);
    if (status == IVL_WIRE_OK)
    {
        (void)app_put(&app->policy_in, app->parts.policy);
        begin_wait(app, APP_WAITS_FOR_POLICY, packet->seq);
    }
    else if ((status != IVL_WIRE_ERR_INCOMPLETE) || ivl_parts_is_last(packet))
    {
        const ivl_policy_id_t        now = app->state.policy.id;
        const ivl_wire_policy_echo_t echo = {
            .seq = packet->seq,
            .status = (int8_t)status,
            .missing = (status == IVL_WIRE_ERR_INCOMPLETE) ? app->parts.missing : (uint16_t)0,
            .seq_in_force = now.seq,
            .crc_in_force = now.crc,
            .form_in_force = now.form,
        };
        echo_policy(&echo);
    }
}

// what is in force is asked of the stabilizer's task, so that the values belong together
static void poll_policy(app_t *app)
{
    ivl_wire_policy_echo_t echo = {.seq = app->pending.seq, .status = IVL_WIRE_ERR_NO_CONTROLLER};
    if (!app_take(&app->policy_out, &echo))
    {
        if (waited_ms(app) < POLICY_MS_MAX)
        {
            return;
        }
        // taken back, so that it does not come into force some other day
        atomic_store(&app->policy_in.full, false);
    }
    app->pending.what = APP_WAITS_FOR_NOTHING;
    echo_policy(&echo);
}

// ---- command

static void echo_command(app_t *app, uint16_t seq, int8_t status)
{
    const ivl_wire_command_echo_t echo = {
        .seq = seq,
        .status = status,
        .request = (uint8_t)app->in.cmd.request,
        .phase = app->out.phase_log,
        .rule = app->state.guard.rule,
        .cause = app->state.guard.cause,
    };
    uint8_t bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_command_echo(bytes, &echo));
}

// A command that a later one has overtaken on its way is no wish of anybody any more; hosts count them up by one.  What stops is always obeyed.
// A number that is further away is that of another host.
static bool is_overtaken(const app_t *app, const ivl_wire_command_t *packet)
{
    const bool     stops = (packet->request == IVL_REQUEST_IDLE) || (packet->request == IVL_REQUEST_ABORT);
    const uint16_t behind = (uint16_t)(app->command_seq - packet->seq);
    return app->has_command && !stops && (behind > 0u) && (behind <= OVERTAKEN_MAX);
}

static void handle_command(app_t *app, const ivl_wire_command_t *packet)
{
    const ivl_command_t command = {
        .request = (ivl_request_t)packet->request,
        .p_hover_W_m = {packet->hover_x_m, packet->hover_y_m, packet->hover_z_m},
        .speed_mps = packet->speed_mps,
        .angle_rad = packet->angle_rad,
    };
    if (!ivl_sense_command_good(&app->cfg, &command))
    {
        echo_command(app, packet->seq, IVL_WIRE_ERR_RANGE);
    }
    else if (is_overtaken(app, packet))
    {
        // no answer: its host has asked for something else since
    }
    else if (!app_put(&app->command_in, command))
    {
        echo_command(app, packet->seq, IVL_WIRE_ERR_NO_CONTROLLER);
    }
    else
    {
        app->command_seq = packet->seq;
        app->has_command = true;
        begin_wait(app, APP_WAITS_FOR_COMMAND, packet->seq);
    }
}

static void poll_command(app_t *app)
{
    if (waited_ms(app) >= COMMAND_MS)
    {
        const bool is_left = atomic_exchange(&app->command_in.full, false);
        app->pending.what = APP_WAITS_FOR_NOTHING;
        echo_command(app, (uint16_t)app->pending.seq, is_left ? IVL_WIRE_ERR_NO_CONTROLLER : IVL_WIRE_OK);
    }
}

// ---- all

bool app_packets_waiting(const app_t *app)
{
    return app->pending.what != APP_WAITS_FOR_NOTHING;
}

void app_packets_handle(app_t *app, const uint8_t *bytes, size_t size)
{
    ivl_wire_policy_t  policy;
    ivl_wire_command_t command;
    ivl_wire_reading_t reading;
    if (ivl_wire_get_policy(bytes, size, &policy))
    {
        handle_policy(app, &policy);
    }
    else if (ivl_wire_get_command(bytes, size, &command))
    {
        handle_command(app, &command);
    }
    else if (ivl_wire_get_reading(bytes, size, &reading))
    {
        app_reading_put(app, APP_CAMERA_CHANNEL, &reading, usecTimestamp());
    }
    else
    {
        app->n_bad_packet++;
    }
}

static void tell_config(app_t *app, app_config_result_t result)
{
    app->config_result = result;
    app->config_crc = ivl_cfg_crc(&app->cfg);
    if (result.status != IVL_WIRE_OK)
    {
        const char *name = ivl_cfg_name(result.bad);
        DEBUG_PRINT("Configuration %lu refused (%d): %s%s\n", (unsigned long)result.seq, result.status, (name != NULL) ? name : "not now",
                    app_config_remedy(result.bad));
        app_config_take_back(app);
    }
    const ivl_wire_config_echo_t echo = {result.seq, result.status, result.bad, app->config_crc};
    uint8_t                      bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_config_echo(bytes, &echo));
}

static void poll_config(app_t *app)
{
    app_config_result_t result;
    if (app_take(&app->config_out, &result))
    {
        app->n_config_polls = 0;
        tell_config(app, result);
        return;
    }
    app->n_config_polls = atomic_load(&app->config_in.full) ? app->n_config_polls + 1 : 0;
    if (app->n_config_polls > CONFIG_POLLS_MAX)
    {
        app->n_config_polls = 0;
        result = (app_config_result_t){app->config_in.value.seq, IVL_WIRE_ERR_NO_CONTROLLER, APP_CONFIG_NONE};
        atomic_store(&app->config_in.full, false);
        tell_config(app, result);
    }
}

void app_packets_poll(app_t *app)
{
    if (app->pending.what == APP_WAITS_FOR_POLICY)
    {
        poll_policy(app);
    }
    else if (app->pending.what == APP_WAITS_FOR_COMMAND)
    {
        poll_command(app);
    }
    poll_config(app);
}
