#include "crtp_dispatch.h"

#include <stdio.h>
#include <string.h>

#include "crtp_commands.h"
#include "crtp_logs.h"
#include "crtp_params.h"
#include "crtp_services.h"

// ---- open and close

// what ends a lock-step run early is read where the logs have it
static const uint8_t *byte_of_log(const ivl_crtp_t *crtp, const char *group, const char *name)
{
    uint16_t id;
    if (ivl_crtp_toc_find(&crtp->logs.toc, group, name, &id) && (crtp->logs.rows[id].type == IVL_CF_LOG_U8))
    {
        return crtp->logs.rows[id].address;
    }
    return NULL;
}

bool ivl_crtp_open(ivl_crtp_t *crtp, ivl_cf_t *cf, const ivl_crtp_host_t *host, char *error, size_t error_size)
{
    memset(crtp, 0, sizeof *crtp);
    crtp->cf = cf;
    crtp->host = *host;
    crtp->address = 0xE7u;
    crtp->own.time.speed_factor = 1.0f;
    if (!ivl_crtp_params_open(crtp, error, error_size) || !ivl_crtp_logs_open(crtp, error, error_size))
    {
        ivl_crtp_close(crtp);
        return false;
    }
    crtp->phase = byte_of_log(crtp, "ivl", "phase");
    crtp->ended = byte_of_log(crtp, "sil", "ended");
    if ((crtp->phase == NULL) || (crtp->ended == NULL))
    {
        snprintf(error, error_size, "the vehicle has no log variables ivl.phase and sil.ended of type uint8_t");
        ivl_crtp_close(crtp);
        return false;
    }
    return true;
}

void ivl_crtp_close(ivl_crtp_t *crtp)
{
    ivl_crtp_params_close(crtp);
    ivl_crtp_logs_close(crtp);
}

// ---- packets

enum
{
    ZERO_BYTES = 14,    // of a set-point of port 3
    CLOSING_MS = 1500,  // from cflib's last set-point to the end of its socket: 1.2 s at most
    HAND_BACK_MS = 400  // before a set-point is old
};

static bool is_zero(const ivl_crtp_packet_t *packet)
{
    bool zero = (packet->port == IVL_CRTP_PORT_COMMANDER) && (packet->size == ZERO_BYTES);
    for (size_t i = 0; zero && (i < packet->size); i++)
    {
        zero = packet->data[i] == 0u;
    }
    return zero;
}

static void let_zero_act(ivl_crtp_t *crtp)
{
    crtp->holds_zero = false;
    (void)ivl_cf_set_rpyt(crtp->cf, 0.0f, 0.0f, 0.0f, 0);
    crtp->zero_until_ms = ivl_crtp_time_ms(crtp) + HAND_BACK_MS;
}

// It is nobody's any more, and would lock the vehicle when it is old.
static void hand_back(ivl_crtp_t *crtp)
{
    crtp->ends_with_zero = false;
    ivl_cf_notify_stop(crtp->cf, 0);
}

// cflib ends each connection with a set-point of zeros.  By radio it never leaves; here it arrives, and would take the motors from a vehicle that
// flies on by itself.  There it waits until the client says something else, or for longer than cflib needs to close.
static bool is_held_back(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    if (packet->port == IVL_CRTP_PORT_LINK)
    {
        return false;
    }
    if (crtp->holds_zero)
    {
        let_zero_act(crtp);
    }
    const float factor = crtp->own.time.speed_factor;
    crtp->ends_with_zero = is_zero(packet);
    crtp->holds_zero = crtp->ends_with_zero && ivl_cf_flies_high_level(crtp->cf);
    crtp->zero_until_ms = ivl_crtp_time_ms(crtp) + HAND_BACK_MS;
    if (crtp->holds_zero)
    {
        const float wait_ms = (float)CLOSING_MS * ((factor > 1.0f) ? factor : 1.0f);
        crtp->zero_until_ms = (factor > 0.0f) ? ivl_crtp_time_ms(crtp) + (uint64_t)wait_ms : UINT64_MAX;
    }
    return crtp->holds_zero;
}

static void look_after_zero(ivl_crtp_t *crtp)
{
    if (!crtp->ends_with_zero || (ivl_crtp_time_ms(crtp) < crtp->zero_until_ms))
    {
        return;
    }
    if (crtp->holds_zero)
    {
        let_zero_act(crtp);
        return;
    }
    hand_back(crtp);
}

void ivl_crtp_receive(ivl_crtp_t *crtp, const uint8_t *bytes, size_t size)
{
    static void (*const HANDLER[IVL_CRTP_PORT_COUNT])(ivl_crtp_t *, const ivl_crtp_packet_t *) = {
        [IVL_CRTP_PORT_PARAM] = ivl_crtp_params_handle,
        [IVL_CRTP_PORT_COMMANDER] = ivl_crtp_rpyt_handle,
        [IVL_CRTP_PORT_MEMORY] = ivl_crtp_memory_handle,
        [IVL_CRTP_PORT_LOG] = ivl_crtp_logs_handle,
        [IVL_CRTP_PORT_LOCALIZATION] = ivl_crtp_localization_handle,
        [IVL_CRTP_PORT_GENERIC] = ivl_crtp_generic_handle,
        [IVL_CRTP_PORT_HIGH_LEVEL] = ivl_crtp_high_level_handle,
        [IVL_CRTP_PORT_SUPERVISOR] = ivl_crtp_supervisor_handle,
        [IVL_CRTP_PORT_PLATFORM] = ivl_crtp_platform_handle,
        [IVL_CRTP_PORT_LINK] = ivl_crtp_link_handle,
    };
    ivl_crtp_packet_t packet;
    crtp->own.n_rx++;
    if (!ivl_crtp_parse(&packet, bytes, size) || (HANDLER[packet.port] == NULL))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    if (!crtp->is_off && !is_held_back(crtp, &packet))
    {
        HANDLER[packet.port](crtp, &packet);
    }
}

// ---- time

static void tell_console(ivl_crtp_t *crtp)
{
    char   text[IVL_CRTP_PAYLOAD_MAX];
    size_t n;
    while ((n = ivl_cf_console_take(crtp->cf, text, sizeof text)) > 0u)
    {
        ivl_crtp_packet_t packet = ivl_crtp_packet(IVL_CRTP_PORT_CONSOLE, 0);
        ivl_crtp_put_bytes(&packet, text, n);
        ivl_crtp_send(crtp, &packet);
    }
}

static void tell_app(ivl_crtp_t *crtp)
{
    uint8_t bytes[IVL_CF_APP_BYTES];
    size_t  n;
    while ((n = ivl_cf_app_take(crtp->cf, bytes)) > 0u)
    {
        ivl_crtp_packet_t packet = ivl_crtp_packet(IVL_CRTP_PORT_PLATFORM, 2);
        ivl_crtp_put_bytes(&packet, bytes, n);
        ivl_crtp_send(crtp, &packet);
    }
}

// whether this millisecond has brought what the client waits for
static bool has_come(ivl_crtp_t *crtp)
{
    ivl_cf_logs_refresh(crtp->cf);
    const uint16_t until = crtp->own.time.run_until;
    const uint8_t  phase = *crtp->phase;
    const bool     entered = (phase != crtp->last_phase) && (phase < 8u) && (((until >> phase) & 1u) != 0u);
    const bool     ended = (*crtp->ended != 0u) && (crtp->last_ended == 0u) && ((until & 0x100u) != 0u);
    crtp->last_phase = phase;
    crtp->last_ended = *crtp->ended;
    return entered || ended;
}

static void end_run(ivl_crtp_t *crtp)
{
    ivl_crtp_time_t *time = &crtp->own.time;
    const bool       early = (time->run_until != 0u) && has_come(crtp);
    if (!time->running || (!early && (ivl_crtp_time_ms(crtp) < time->run_to_ms)))
    {
        return;
    }
    ivl_crtp_time_stop(time, ivl_cf_time_us(crtp->cf));
    if (crtp->is_held)
    {
        crtp->is_held = false;
        ivl_crtp_send(crtp, &crtp->held);
    }
}

void ivl_crtp_step(ivl_crtp_t *crtp)
{
    ivl_cf_step(crtp->cf);
    look_after_zero(crtp);
    if (!crtp->is_off)
    {
        tell_console(crtp);
        tell_app(crtp);
        ivl_crtp_params_step(crtp);
    }
    ivl_crtp_logs_step(crtp);
    end_run(crtp);
}

void ivl_crtp_link(ivl_crtp_t *crtp, bool up)
{
    ivl_cf_link(crtp->cf, up);
    if (!up)
    {
        ivl_crtp_logs_reset(crtp);
        crtp->is_held = false;
        if (crtp->ends_with_zero && !crtp->holds_zero)
        {
            hand_back(crtp);
        }
        crtp->ends_with_zero = crtp->holds_zero = false;
    }
}
