#define _POSIX_C_SOURCE 200809L
#include "crtp_loop.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "crtp_control.h"
#include "crtp_params.h"
#include "crtp_power.h"
#include "crtp_udp.h"

enum
{
    STEPS_A_TURN = 50,     // of the vehicle, then the sockets are looked at again
    PACKETS_A_TURN = 256,  // from the socket, then the vehicle gets its turn
    BURST = 64,            // packets that fit into any client's buffer at once
    WAIT_US_MAX = 100000,  // a signal is noticed within this
    MEET_US = 10000,       // others are answered so often: what they send costs the client nothing
    PROBE_US = 100000,     // a client who says nothing is sent something so often
    DATAGRAM_BYTES = 256
};

static uint64_t wall_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
}

// ---- out

static void send_datagram(ivl_crtp_loop_t *loop, const ivl_crtp_datagram_t *d)
{
    if (ivl_crtp_faults_idle(&loop->faults, loop->now_us))
    {
        ivl_crtp_udp_send(loop->fd, d->peer, d->bytes, d->size);
    }
    else
    {
        ivl_crtp_faults_put(&loop->faults, loop->now_us, d);
    }
}

static void send_to(ivl_crtp_loop_t *loop, uint64_t peer, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_datagram_t d = {.direction = IVL_CRTP_TO_HOST, .peer = peer};
    d.size = (uint8_t)ivl_crtp_bytes(packet, d.bytes);
    send_datagram(loop, &d);
}

static void send_to_client(void *context, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_loop_t *loop = context;
    loop->credit = (loop->credit > -BURST) ? loop->credit - 1.0 : loop->credit;
    if (loop->session.live)
    {
        send_to(loop, loop->session.peer, packet);
    }
}

static void send_null(ivl_crtp_loop_t *loop, uint64_t peer)
{
    const ivl_crtp_datagram_t d = {.direction = IVL_CRTP_TO_HOST, .peer = peer, .size = 1, .bytes = {IVL_CRTP_NULL_HEADER}};
    send_datagram(loop, &d);
}

// ---- clients

static void own_changed(void *context);

// a client's faults end with it, or it could lock out everybody who comes after
static void end_session(ivl_crtp_loop_t *loop)
{
    ivl_crtp_link(&loop->crtp, false);
    loop->crtp.own.fault = loop->crtp.own.fault_kept;
    own_changed(loop);
}

// A packet to the client shows whether he is still there: if his socket is closed, the system says so.
static void probe_client(ivl_crtp_loop_t *loop, uint64_t every_us)
{
    if (loop->now_us - loop->probed_us >= every_us)
    {
        loop->probed_us = loop->now_us;
        send_null(loop, loop->session.peer);
    }
}

// Another one wants the vehicle.  If the client is silent he has it as soon as all that has come is heard.
static void meet_foreigner(ivl_crtp_loop_t *loop, const ivl_crtp_datagram_t *d)
{
    char text[40];
    if (ivl_crtp_session_is_silent(&loop->session, loop->now_us))
    {
        return;
    }
    loop->crtp.own.n_foreign++;
    probe_client(loop, MEET_US);
    if (ivl_crtp_is_link_source(d) && (loop->now_us - loop->told_us >= MEET_US))
    {
        loop->told_us = loop->now_us;
        ivl_crtp_packet_t packet = ivl_crtp_packet(IVL_CRTP_PORT_CONSOLE, 0);
        ivl_crtp_udp_text(loop->session.peer, text, sizeof text);
        ivl_crtp_put_bytes(&packet, "Busy: ", 6);
        ivl_crtp_put_bytes(&packet, text, strlen(text));
        ivl_crtp_put_bytes(&packet, "\n", 1);
        send_to(loop, d->peer, &packet);
    }
}

// The radio's processor acknowledges the packets of the client, and of anybody if there is none.  They take no place, and keep none.
static void switch_power(ivl_crtp_loop_t *loop, const ivl_crtp_datagram_t *d)
{
    ivl_crtp_packet_t reply;
    if (!ivl_crtp_session_may(&loop->session, loop->now_us, d))
    {
        meet_foreigner(loop, d);
        return;
    }
    ivl_crtp_power(&loop->crtp, d->bytes, d->size, &reply);
    send_to(loop, d->peer, &reply);
}

static void arrive(ivl_crtp_loop_t *loop, const ivl_crtp_datagram_t *d)
{
    if (ivl_crtp_is_power(d->bytes, d->size))
    {
        switch_power(loop, d);
        return;
    }
    const bool is_null = (d->size > 0u) && ((d->bytes[0] & 0xF3u) == 0xF3u);
    if (is_null && !(loop->session.live && (d->peer == loop->session.peer)))
    {
        send_null(loop, d->peer);
        return;
    }
    const ivl_crtp_who_t who = ivl_crtp_session_hear(&loop->session, loop->now_us, d);
    if (who == IVL_CRTP_FOREIGN)
    {
        meet_foreigner(loop, d);
        return;
    }
    if (who == IVL_CRTP_NEW)
    {
        loop->probed_us = loop->told_us = 0;  // the first one who wants this client's place is met at once
        ivl_crtp_link(&loop->crtp, true);
    }
    if (is_null)
    {
        send_null(loop, d->peer);
        return;
    }
    ivl_crtp_receive(&loop->crtp, d->bytes, d->size);
}

// By radio the dongle asks on when a program says nothing.  Here nobody does: as long as the socket is there, the program is.
static void look_after_client(ivl_crtp_loop_t *loop)
{
    ivl_crtp_datagram_t d;
    const bool          is_there = ivl_crtp_udp_tells(loop->session.peer) && ivl_crtp_faults_idle(&loop->faults, loop->now_us);
    if (ivl_crtp_session_expire(&loop->session, loop->now_us, is_there))
    {
        end_session(loop);
    }
    if (ivl_crtp_session_is_silent(&loop->session, loop->now_us))
    {
        probe_client(loop, PROBE_US);
    }
    if (ivl_crtp_session_is_pressed(&loop->session, loop->now_us))
    {
        probe_client(loop, MEET_US);
    }
    if (ivl_crtp_session_next(&loop->session, loop->now_us, &d))
    {
        arrive(loop, &d);
    }
}

// ---- in

static void receive(ivl_crtp_loop_t *loop)
{
    ivl_crtp_datagram_t d = {.direction = IVL_CRTP_TO_VEHICLE};
    for (int i = 0; i < PACKETS_A_TURN; i++)
    {
        size_t                     size = 0;
        const ivl_crtp_udp_event_t event = ivl_crtp_udp_take(loop->fd, d.bytes, sizeof d.bytes, &size, &d.peer);
        if (event == IVL_CRTP_UDP_NOTHING)
        {
            return;
        }
        if (event == IVL_CRTP_UDP_GONE)
        {
            if (ivl_crtp_session_gone(&loop->session, d.peer))
            {
                end_session(loop);
            }
            continue;
        }
        if ((size < 1u) || (size > sizeof d.bytes))
        {
            ivl_crtp_bad(&loop->crtp);
            continue;
        }
        d.size = (uint8_t)size;
        if (ivl_crtp_faults_idle(&loop->faults, loop->now_us))
        {
            arrive(loop, &d);
        }
        else
        {
            ivl_crtp_faults_put(&loop->faults, loop->now_us, &d);
        }
    }
}

static void deliver_delayed(ivl_crtp_loop_t *loop)
{
    ivl_crtp_datagram_t d;
    while (ivl_crtp_faults_take(&loop->faults, loop->now_us, &d))
    {
        if (d.direction == IVL_CRTP_TO_VEHICLE)
        {
            arrive(loop, &d);
        }
        else
        {
            ivl_crtp_udp_send(loop->fd, d.peer, d.bytes, d.size);
        }
    }
}

static void serve_control(ivl_crtp_loop_t *loop)
{
    uint8_t  request[DATAGRAM_BYTES];
    char     reply[IVL_CRTP_CONTROL_BYTES];
    size_t   size = 0;
    uint64_t peer;
    if (loop->control_fd < 0)
    {
        return;
    }
    for (int i = 0; i < PACKETS_A_TURN; i++)
    {
        const ivl_crtp_udp_event_t event = ivl_crtp_udp_take(loop->control_fd, request, sizeof request, &size, &peer);
        if (event == IVL_CRTP_UDP_NOTHING)
        {
            return;
        }
        if (event == IVL_CRTP_UDP_PACKET)
        {
            ivl_crtp_control(&loop->crtp, (const char *)request, (size > sizeof request) ? 0u : size, reply);
            ivl_crtp_udp_send(loop->control_fd, peer, reply, strlen(reply));
        }
    }
}

// ---- faults of the whole process

static void own_changed(void *context)
{
    ivl_crtp_loop_t      *loop = context;
    const ivl_crtp_own_t *own = &loop->crtp.own;
    loop->faults.cfg = own->fault;
    if (own->freeze_ms != loop->freeze_ms)
    {
        loop->freeze_ms = own->freeze_ms;
        loop->frozen_until_us = wall_us() + 1000u * (uint64_t)own->freeze_ms;
    }
}

// both read 0 again when they are over
static void begin_and_end(ivl_crtp_loop_t *loop)
{
    ivl_crtp_own_t *own = &loop->crtp.own;
    own->freeze_ms = 0;
    loop->freeze_ms = 0;
    // begun here and not where it was asked for, so that the answer to the request still gets through
    if (own->cut_ms != loop->cut_ms)
    {
        loop->cut_ms = own->cut_ms;
        loop->faults.cut_until_us = loop->now_us + 1000u * (uint64_t)own->cut_ms;
    }
    if (loop->now_us >= loop->faults.cut_until_us)
    {
        own->cut_ms = 0;
        loop->cut_ms = 0;
    }
}

static void tell_faults(ivl_crtp_loop_t *loop)
{
    ivl_crtp_own_t *own = &loop->crtp.own;
    own->n_lost = loop->faults.n_lost;
    own->n_duplicated = loop->faults.n_duplicated;
    own->n_reordered = loop->faults.n_reordered;
}

// ---- time

// Faster than real time the vehicle could say more than the client can read: then it waits for him.
static bool may_send(ivl_crtp_loop_t *loop)
{
    const ivl_crtp_time_t *time = &loop->crtp.own.time;
    const bool             is_paced = (time->lockstep == 0u) && (time->speed_factor > 0.0f);
    return is_paced || (loop->credit > 0.0);
}

static void refill(ivl_crtp_loop_t *loop)
{
    loop->credit += (double)(loop->now_us - loop->refilled_us) * loop->packets_per_s / 1e6;
    loop->credit = (loop->credit > BURST) ? BURST : loop->credit;
    loop->refilled_us = loop->now_us;
}

static void advance(ivl_crtp_loop_t *loop)
{
    ivl_crtp_t *crtp = &loop->crtp;
    refill(loop);
    for (int i = 0; (i < STEPS_A_TURN) && may_send(loop); i++)
    {
        const uint64_t vehicle_us = ivl_cf_time_us(crtp->cf);
        const uint64_t target_us = ivl_crtp_time_target_us(&crtp->own.time, loop->now_us, vehicle_us);
        ivl_cf_skip(crtp->cf, crtp->own.time.skipped_us);
        crtp->own.time.skipped_us = 0;
        if (vehicle_us + 1000u > target_us)
        {
            return;
        }
        ivl_crtp_step(crtp);
    }
}

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return (a < b) ? a : b;
}

static void wait_for_something(ivl_crtp_loop_t *loop)
{
    uint64_t wake_us = loop->now_us + WAIT_US_MAX;
    if (loop->now_us < loop->frozen_until_us)
    {
        // only the control channel is awake
        ivl_crtp_udp_wait(-1, loop->control_fd, earlier(wake_us, loop->frozen_until_us) - loop->now_us);
        return;
    }
    uint64_t vehicle_wake_us = ivl_crtp_time_wake_us(&loop->crtp.own.time, ivl_cf_time_us(loop->crtp.cf));
    if ((vehicle_wake_us <= loop->now_us) && !may_send(loop))
    {
        vehicle_wake_us = loop->now_us + 1u + (uint64_t)((1.0 - loop->credit) * 1e6 / loop->packets_per_s);
    }
    wake_us = earlier(wake_us, earlier(vehicle_wake_us, ivl_crtp_faults_next_us(&loop->faults)));
    if (wake_us > loop->now_us)
    {
        ivl_crtp_udp_wait(loop->fd, loop->control_fd, wake_us - loop->now_us);
    }
}

static void turn(ivl_crtp_loop_t *loop)
{
    loop->now_us = wall_us();
    serve_control(loop);
    if (loop->now_us < loop->frozen_until_us)
    {
        return;
    }
    begin_and_end(loop);
    receive(loop);
    deliver_delayed(loop);
    tell_faults(loop);
    look_after_client(loop);
    advance(loop);
}

// ---- open, run, close

bool ivl_crtp_loop_open(ivl_crtp_loop_t *loop, ivl_cf_t *cf, const ivl_crtp_loop_cfg_t *cfg, char *error, size_t error_size)
{
    memset(loop, 0, sizeof *loop);
    ivl_crtp_faults_init(&loop->faults);
    const ivl_crtp_host_t host = {.context = loop, .send = send_to_client, .own_changed = own_changed};
    if (!ivl_crtp_open(&loop->crtp, cf, &host, error, error_size))
    {
        return false;
    }
    loop->crtp.address = cfg->address;
    loop->crtp.own.time.speed_factor = cfg->speed_factor;
    loop->crtp.own.time.lockstep = cfg->lockstep ? 1u : 0u;
    loop->crtp.own.fault = loop->crtp.own.fault_kept = cfg->fault;
    ivl_crtp_params_take_defaults(&loop->crtp);
    loop->faults.cfg = cfg->fault;
    loop->fd = cfg->fd;
    loop->control_fd = cfg->control_fd;
    loop->packets_per_s = (double)cfg->packets_per_s;
    loop->credit = BURST;
    loop->refilled_us = wall_us();
    return true;
}

void ivl_crtp_loop_close(ivl_crtp_loop_t *loop)
{
    ivl_crtp_close(&loop->crtp);
    ivl_crtp_faults_free(&loop->faults);
}

void ivl_crtp_loop_run(ivl_crtp_loop_t *loop, const volatile sig_atomic_t *stop)
{
    while (*stop == 0)
    {
        turn(loop);
        wait_for_something(loop);
    }
}
