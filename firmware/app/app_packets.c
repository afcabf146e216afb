/// @file app_packets.c
/// Packets of the host, and their echoes.  Runs in the app's task.
#include "FreeRTOS.h"
#include "app_channel.h"
#include "app_ivl.h"
#include "task.h"

#define DEBUG_MODULE "IVL"
#include "debug.h"

// a controller that runs takes a mailbox within a tick; this is long enough to be sure that none does
#define WAIT_MS_MAX 20

// not blocking: when nobody listens, an echo is lost, and the host asks again
static void reply(uint8_t *bytes, size_t size)
{
    (void)appchannelSendDataPacket(bytes, size);
}

// what is in force is asked of the stabilizer's task, so that the three values belong together
static void handle_policy(app_t *app, const ivl_wire_policy_t *packet)
{
    const ivl_policy_t     policy = {packet->seq, packet->rrev_c_per_s, packet->moment_y_Nm};
    ivl_wire_policy_echo_t echo = {.seq = packet->seq, .status = IVL_WIRE_ERR_NO_CONTROLLER};
    bool                   answered = false;
    (void)app_put(&app->policy_in, policy);
    for (int ms = 0; !answered && (ms < WAIT_MS_MAX); ms++)
    {
        vTaskDelay(M2T(1));
        answered = app_take(&app->policy_out, &echo);
    }
    if (!answered)
    {
        // taken back, so that it does not come into force some other day
        atomic_store(&app->policy_in.full, false);
    }
    uint8_t bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_policy_echo(bytes, &echo));
}

static void handle_command(app_t *app, const ivl_wire_command_t *packet)
{
    const ivl_command_t command = {
        .request = (ivl_request_t)packet->request,
        .p_hover_W_m = {packet->hover_x_m, packet->hover_y_m, packet->hover_z_m},
        .speed_mps = packet->speed_mps,
        .angle_rad = packet->angle_rad,
    };
    const bool is_good = ivl_sense_command_good(&app->cfg, &command);
    const bool is_put = is_good && app_put(&app->command_in, command);
    int8_t     status = is_put ? IVL_WIRE_OK : IVL_WIRE_ERR_NO_CONTROLLER;
    status = is_good ? status : IVL_WIRE_ERR_RANGE;
    if (is_put)
    {
        // the stabilizer's task empties the mailbox once a millisecond
        vTaskDelay(M2T(3));
        if (atomic_exchange(&app->command_in.full, false))
        {
            status = IVL_WIRE_ERR_NO_CONTROLLER;
        }
    }
    const ivl_wire_command_echo_t echo = {
        .seq = packet->seq,
        .status = status,
        .request = (uint8_t)app->in.cmd.request,
        .phase = app->out.phase_log,
        .rule = app->state.guard.rule,
        .cause = app->state.guard.cause,
    };
    uint8_t bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_command_echo(bytes, &echo));
}

void app_packets_handle(app_t *app, const uint8_t *bytes, size_t size)
{
    ivl_wire_policy_t  policy;
    ivl_wire_command_t command;
    if (ivl_wire_get_policy(bytes, size, &policy))
    {
        handle_policy(app, &policy);
    }
    else if (ivl_wire_get_command(bytes, size, &command))
    {
        handle_command(app, &command);
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
        DEBUG_PRINT("Configuration %lu refused (%d): %s\n", (unsigned long)result.seq, result.status, (name != NULL) ? name : "not now");
        app->staged = app->cfg;
    }
    const ivl_wire_config_echo_t echo = {result.seq, result.status, result.bad, app->config_crc};
    uint8_t                      bytes[IVL_WIRE_SIZE_MAX];
    reply(bytes, ivl_wire_put_config_echo(bytes, &echo));
}

void app_packets_poll_config(app_t *app)
{
    static int          n_waiting;
    app_config_result_t result;
    if (app_take(&app->config_out, &result))
    {
        n_waiting = 0;
        tell_config(app, result);
        return;
    }
    n_waiting = atomic_load(&app->config_in.full) ? n_waiting + 1 : 0;
    if (n_waiting > WAIT_MS_MAX)
    {
        n_waiting = 0;
        result = (app_config_result_t){app->config_in.value.seq, IVL_WIRE_ERR_NO_CONTROLLER, APP_CONFIG_NONE};
        atomic_store(&app->config_in.full, false);
        tell_config(app, result);
    }
}
