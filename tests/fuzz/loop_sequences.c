/// @file loop_sequences.c
/// Random sequences of what clients, an operator and a bad link can do to the software vehicle through its server's loop, and what must hold
/// after each millisecond of the vehicle:
///
/// - who has the vehicle keeps it: nothing that another one sends meanwhile is obeyed or put in force, not even by the radio's processor, and
///   answers go to nobody else;
/// - a flip has a policy, a request of somebody who had the vehicle, and the policy's region; it begins from READY, or on a simulated path;
/// - no motor turns in a phase whose motors are off;
/// - IDLE is obeyed in every phase and ABORT before the trigger, at once, if the link lets them through;
/// - a policy in force changes in IDLE and READY alone, a configuration in IDLE alone;
/// - when all clients have gone, the next one is answered within what their faults may last together, whatever they have set.
///
/// The loop is the real one, with the vehicle behind it; sockets and clock are made here.
#include <math.h>
#include <setjmp.h>
#include <time.h>

#include "app_ivl.h"
#include "cf/cf_vehicle.h"
#include "crtp/crtp_loop.h"
#include "crtp/crtp_udp.h"
#include "player.h"
#include "policy_fixture.h"
#include "sim_fixture.h"

int  __real_clock_gettime(clockid_t clock, struct timespec *t);
int  __wrap_clock_gettime(clockid_t clock, struct timespec *t);
void __real_ivl_crtp_step(ivl_crtp_t *crtp);
void __wrap_ivl_crtp_step(ivl_crtp_t *crtp);

extern uint8_t tumbleCheckEnabled;

enum
{
    CLIENTS = 3,
    NOBODY = -1,
    UNSURE = -2,  ///< the model cannot say: the link loses or delays, or a client was silent or gone when another one spoke
    VEHICLE_FD = 1,
    CONTROL_FD = 2,
    INBOX = 64,
    TAGS = 4000,     ///< commands and policies of a sequence
    ANSWER_MS = 30,  ///< of the vehicle
    SURE_US = 900000,
    // a freeze and a cut of a minute each, one after the other, packets that are delayed by 20 s both ways, and the silence of the one who has gone
    AWAY_US_MAX = 162000000
};

typedef enum
{
    WAIT,     // a: ms
    CONNECT,  // a: client
    CLOSE,    // a: client
    NOTHING,  // a: client; a packet that says nothing
    POLICY,   // a: client and threshold, b: moment
    COMMAND,  // a: client, b: request
    WRITE,    // a: client and parameter, b: value
    NOISE,    // a: client, b: seed
    POWER,    // a: client, b: which; only from a stranger: it must not be obeyed
    CONTROL,  // a: which line
    SILENCE,  // longer than a client may be silent
    TRAITOR,  // only with --traitor: the loop takes a stranger for the client
    EVENTS
} kind_t;

static const char *const NAMES[EVENTS] = {"wait",  "connect", "close", "nothing", "policy",  "command",
                                          "write", "noise",   "power", "control", "silence", "traitor"};

static bool has_traitor;

// ---- the world around the loop

typedef struct
{
    ivl_crtp_udp_event_t event;
    int                  fd;
    uint64_t             peer;
    size_t               size;
    uint8_t              bytes[64];
} arrival_t;

static struct
{
    uint64_t              now_us, until_us;
    volatile sig_atomic_t stop;
    arrival_t             inbox[INBOX];
    int                   n_inbox;
    bool                  is_open[CLIENTS];
    unsigned              n_answers[CLIENTS];
} around;

static ivl_sim_model_t model_of_vehicle;
static ivl_crtp_loop_t loop;

static uint64_t peer_of(int client)
{
    return 1000u + (uint64_t)client;
}

static int client_of(uint64_t peer)
{
    return ((peer >= 1000u) && (peer < 1000u + CLIENTS)) ? (int)(peer - 1000u) : NOBODY;
}

static void pass_us(uint64_t us)
{
    around.now_us += us;
    around.stop = (around.now_us >= around.until_us) ? 1 : around.stop;
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
    (void)clock;
    pass_us(3);
    t->tv_sec = (time_t)(around.now_us / 1000000u);
    t->tv_nsec = (long)(around.now_us % 1000000u) * 1000;
    return 0;
}

static void put(int fd, ivl_crtp_udp_event_t event, uint64_t peer, const void *bytes, size_t size)
{
    if (around.n_inbox < INBOX)
    {
        arrival_t *a = &around.inbox[around.n_inbox++];
        *a = (arrival_t){.event = event, .fd = fd, .peer = peer, .size = size};
        memcpy(a->bytes, bytes, (size < sizeof a->bytes) ? size : sizeof a->bytes);
    }
}

ivl_crtp_udp_event_t ivl_crtp_udp_take(int fd, uint8_t *bytes, size_t capacity, size_t *size, uint64_t *peer)
{
    for (int i = 0; i < around.n_inbox; i++)
    {
        const arrival_t a = around.inbox[i];
        if (a.fd == fd)
        {
            around.n_inbox--;
            memmove(&around.inbox[i], &around.inbox[i + 1], (size_t)(around.n_inbox - i) * sizeof a);
            *size = a.size;
            *peer = a.peer;
            memcpy(bytes, a.bytes, (a.size < capacity) ? a.size : capacity);
            return a.event;
        }
    }
    return IVL_CRTP_UDP_NOTHING;
}

bool ivl_crtp_udp_tells(uint64_t peer)
{
    return client_of(peer) != NOBODY;
}

void ivl_crtp_udp_wait(int fd_1, int fd_2, uint64_t wait_us)
{
    bool is_waited_for = false;
    for (int i = 0; i < around.n_inbox; i++)
    {
        is_waited_for = is_waited_for || (around.inbox[i].fd == fd_1) || (around.inbox[i].fd == fd_2);
    }
    const uint64_t left_us = (around.until_us > around.now_us) ? around.until_us - around.now_us : 0u;
    pass_us(is_waited_for ? 1u : ((wait_us < left_us) ? wait_us : left_us));
}

void ivl_crtp_udp_text(uint64_t peer, char *text, size_t size)
{
    (void)snprintf(text, size, "127.0.0.1:%d", (int)peer);
}

static void hear_answer(int client, const uint8_t *bytes, size_t size);

void ivl_crtp_udp_send(int fd, uint64_t peer, const void *bytes, size_t size)
{
    const int client = client_of(peer);
    if ((fd != VEHICLE_FD) || (client == NOBODY))
    {
        return;
    }
    if (!around.is_open[client])
    {
        put(VEHICLE_FD, IVL_CRTP_UDP_GONE, peer, "", 0);
        return;
    }
    hear_answer(client, bytes, size);
}

// ---- the model

typedef enum
{
    NEVER_SENT,
    OF_CLIENT,    ///< of the one who had the vehicle
    OF_STRANGER,  ///< of another one: never to be obeyed
    OF_SOMEBODY   ///< the model cannot say
} origin_t;

typedef struct
{
    uint8_t origin, request;
} tag_t;

static struct
{
    int         holder;  ///< who has the vehicle
    uint64_t    heard_us;
    tag_t       command[TAGS], policy[TAGS];
    int         n_tags;
    int         n_stopped;  ///< tag of the last request to stop of the client
    uint8_t     stop;
    int         stop_ms;  ///< of the vehicle, since it was sent; -1: none is awaited
    ivl_phase_t phase;
    uint32_t    n_trigger, policy_crc, policy_seq;
    ivl_cfg_t   cfg;
    bool        was_ready;
    bool        has_reset;  ///< somebody has asked for a landing to begin anew, which leaves every phase between two milliseconds
} model;

static const char *broken;
static jmp_buf     out_of_here;
static uint64_t    n_ms, n_flips, n_seen[EVENTS], n_in_phase[IVL_PHASE_COUNT], n_stops_obeyed, n_strangers;

static void must(bool holds, const char *what)
{
    if (!holds)
    {
        broken = what;
        longjmp(out_of_here, 1);
    }
}

/// Nothing is lost, late or twice now.
static bool is_clear(void)
{
    return ivl_crtp_faults_idle(&loop.faults, around.now_us) && (around.now_us >= loop.frozen_until_us) && !loop.crtp.is_off &&
           (loop.crtp.own.cut_ms == 0u) && (loop.crtp.own.freeze_ms == 0u);
}

/// Where the model cannot say who has the vehicle, it takes the loop's word for it, from now on.
static void look_who_has_it(void)
{
    model.holder = loop.session.live ? client_of(loop.session.peer) : NOBODY;
    model.heard_us = loop.session.heard_us;
}

/// Somebody sends something that is no empty packet.
static origin_t origin_of(int client)
{
    const bool has_it = (model.holder == client) && around.is_open[client];
    const bool is_sure = is_clear() && (model.holder != UNSURE);
    if (!is_sure)
    {
        model.holder = UNSURE;
        return OF_SOMEBODY;
    }
    if ((model.holder == NOBODY) || has_it)
    {
        model.holder = client;
        model.heard_us = around.now_us;
        return OF_CLIENT;
    }
    if (around.is_open[model.holder] && (around.now_us < model.heard_us + SURE_US))
    {
        n_strangers++;
        return OF_STRANGER;
    }
    model.holder = UNSURE;
    return OF_SOMEBODY;
}

static void hear_answer(int client, const uint8_t *bytes, size_t size)
{
    const uint8_t port = (uint8_t)(bytes[0] >> 4);
    const bool    says_something = (size > 1u) && (port != IVL_CRTP_PORT_CONSOLE) && (port != IVL_CRTP_PORT_LINK);
    around.n_answers[client]++;
    const bool is_sure = (model.holder >= 0) && around.is_open[model.holder] && is_clear() && (around.now_us < model.heard_us + SURE_US);
    must(!says_something || (model.holder == client) || !is_sure, "an answer goes to a stranger");
}

static bool is_off(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_COAST) || (phase == IVL_PHASE_ATTACHED) || (phase == IVL_PHASE_DONE);
}

static bool is_before_trigger(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_LEVEL_OUT);
}

static bool motors_turn(void)
{
    bool turn = false;
    for (int i = 0; i < 4; i++)
    {
        turn = turn || (ivl_cf_the.motor_N[i] > 0.0f);
        must((ivl_cf_the.motor_N[i] >= 0.0f) && isfinite(ivl_cf_the.motor_N[i]), "a motor's command is none");
    }
    return turn;
}

/// The tag that a command carries in its speed; 0: it has none.
static int tag_of_command(void)
{
    const float speed_mps = app_command()->speed_mps;
    const int   tag = (int)lroundf((speed_mps - 1.0f) * 1000.0f);
    return ((speed_mps >= 1.0f) && (tag > 0) && (tag <= model.n_tags)) ? tag : 0;
}

static void check_flip(void)
{
    const ivl_state_t   *state = app_core_state();
    const ivl_in_t      *in = &ivl_cf_the.sensed;
    const ivl_command_t *cmd = app_command();
    const int            tag = tag_of_command();
    const float          d_m = (float)model_of_vehicle.raw.world_ceiling_height_m - in->p_WB_m.z;
    n_flips++;
    must(state->has_policy, "a flip without a policy");
    must((cmd->request == IVL_REQUEST_APPROACH) && (tag > 0), "a flip that nobody has asked for");
    must(model.command[tag].request == IVL_REQUEST_APPROACH, "a flip by a command of another kind");
    must(tag > model.n_stopped, "a flip by a command that was sent before the last stop");
    must((ivl_cf_the.set.sim.start == IVL_SIM_START_AT_TRIGGER) || (in->v_WB_mps.z + 0.02f >= (d_m - 0.02f) * state->policy.theta[0]),
         "a flip outside the policy's region");
    must(model.was_ready || (ivl_cf_the.set.sim.start != IVL_CF_START_AS_FLOWN), "a flip without READY before it");
}

static void check_in_force(void)
{
    const ivl_state_t *state = app_core_state();
    const uint32_t     seq = state->policy.id.seq, crc = state->policy.id.crc;
    const bool         is_idle = (model.phase == IVL_PHASE_IDLE) || (model.has_reset && (state->phase == IVL_PHASE_IDLE));
    const bool         is_open = is_idle || (model.phase == IVL_PHASE_READY);
    const bool         has_other_cfg = memcmp(&model.cfg, &ivl_app.cfg, sizeof model.cfg) != 0;
    must(is_open || ((seq == model.policy_seq) && (crc == model.policy_crc)), "a policy changed in flight");
    must(is_idle || !has_other_cfg, "a configuration changed in flight");
    must((seq == 0u) || (seq > TAGS) || (model.policy[seq].origin != OF_STRANGER), "a policy of a stranger is in force");
    model.policy_seq = seq;
    model.policy_crc = crc;
    model.cfg = ivl_app.cfg;
}

static void check_stop(ivl_phase_t phase)
{
    if (model.stop_ms < 0)
    {
        return;
    }
    if (!is_clear())
    {
        model.stop_ms = -1;
        return;
    }
    const bool obeyed = (model.stop == IVL_REQUEST_IDLE) ? (phase == IVL_PHASE_IDLE) : !is_before_trigger(phase);
    n_stops_obeyed += obeyed ? 1u : 0u;
    model.stop_ms = obeyed ? -1 : model.stop_ms + 1;
    must(model.stop_ms <= ANSWER_MS, (model.stop == IVL_REQUEST_IDLE) ? "IDLE is not obeyed" : "ABORT is not obeyed");
}

static void check(void)
{
    const ivl_state_t *state = app_core_state();
    const ivl_phase_t  phase = state->phase;
    n_ms++;
    n_in_phase[phase]++;
    check_in_force();
    must(model.command[tag_of_command()].origin != OF_STRANGER, "a command of a stranger is obeyed");
    if (state->diag.n_trigger > model.n_trigger)
    {
        check_flip();
    }
    model.n_trigger = state->diag.n_trigger;
    model.was_ready = (phase == IVL_PHASE_READY) || (model.was_ready && (phase != IVL_PHASE_IDLE));
    model.phase = phase;
    const bool has_motors = ivl_cf_the.is_on && (ivl_cf_the.set.controller == IVL_CF_CONTROLLER_APP);
    must(!has_motors || !is_off(phase) || !motors_turn(), "a motor turns in a phase that has it off");
    check_stop(phase);
}

void __wrap_ivl_crtp_step(ivl_crtp_t *crtp)
{
    pass_us(20);
    __real_ivl_crtp_step(crtp);
    check();
}

// ---- what happens

static void let_pass_us(uint64_t us)
{
    around.until_us = around.now_us + us;
    around.stop = 0;
    ivl_crtp_loop_run(&loop, &around.stop);
    // a client who is silent may have given way to another one; a closed socket is noticed as soon as something is sent to it
    const bool may_be_another = (model.holder == UNSURE) || ((model.holder >= 0) && (around.now_us >= model.heard_us + SURE_US)) ||
                                ((model.holder >= 0) && (!around.is_open[model.holder] || !loop.session.live));
    if (may_be_another && is_clear())
    {
        look_who_has_it();
    }
}

static void send(int client, uint8_t header, const void *data, size_t size)
{
    uint8_t bytes[32] = {header};
    around.is_open[client] = true;
    memcpy(bytes + 1, data, size);
    put(VEHICLE_FD, IVL_CRTP_UDP_PACKET, peer_of(client), bytes, size + 1u);
}

static void send_policy(int client, uint8_t a, uint8_t b)
{
    if (model.n_tags + 1 >= TAGS)
    {
        return;
    }
    const int               tag = ++model.n_tags;
    const ivl_wire_policy_t packet = constant_packet((uint32_t)tag, 0.5f * (float)(a % 16u), 0.001f * (float)(b % 12u));
    uint8_t                 bytes[IVL_WIRE_SIZE_MAX];
    model.policy[tag].origin = (uint8_t)origin_of(client);
    send(client, 0xd2u, bytes, ivl_wire_put_policy(bytes, &packet));
}

static void send_command(int client, uint8_t request)
{
    if (model.n_tags + 1 >= TAGS)
    {
        return;
    }
    const int                tag = ++model.n_tags;
    const ivl_wire_command_t packet = {(uint16_t)tag, request, 0.0f, 0.0f, 1.0f, 1.0f + 0.001f * (float)tag, 1.3f};
    uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
    const origin_t           origin = origin_of(client);
    const bool               stops = (request == IVL_REQUEST_IDLE) || (request == IVL_REQUEST_ABORT);
    model.command[tag] = (tag_t){(uint8_t)origin, request};
    if (origin == OF_CLIENT)
    {
        model.n_stopped = stops ? tag : model.n_stopped;
        model.stop = request;
        model.stop_ms = stops ? 0 : -1;
    }
    else if (origin == OF_SOMEBODY)
    {
        model.stop_ms = -1;
    }
    send(client, 0xd2u, bytes, ivl_wire_put_command(bytes, &packet));
}

typedef union
{
    uint8_t  u8;
    uint32_t u32;
    float    f32;
    double   f64;
} value_t;

typedef struct
{
    const char *group, *name;
    size_t      size;
    value_t     values[4];
} writable_t;

// clang-format off
static const writable_t WRITABLE[] = {
    {"ivl", "commit", 4, {{.u32 = 1}, {.u32 = 2}, {.u32 = 3}, {.u32 = 4}}},
    {"sil", "reset", 1, {{.u8 = 1}, {.u8 = 1}, {.u8 = 1}, {.u8 = 0}}},
    {"sil", "start", 1, {{.u8 = 0}, {.u8 = 1}, {.u8 = 2}, {.u8 = 255}}},
    {"sil", "d_ceil", 8, {{.f64 = 0.2}, {.f64 = 0.5}, {.f64 = 0.9}, {.f64 = NAN}}},
    {"fault", "loss", 4, {{.f32 = 0.0f}, {.f32 = 0.3f}, {.f32 = 1.0f}, {.f32 = NAN}}},
    {"fault", "jitter_ms", 4, {{.f32 = 0.0f}, {.f32 = 30.0f}, {.f32 = 1.0e9f}, {.f32 = 0.0f}}},
    {"fault", "reorder", 4, {{.f32 = 0.0f}, {.f32 = 0.5f}, {.f32 = 0.0f}, {.f32 = 2.0f}}},
    {"fault", "freeze_ms", 4, {{.u32 = 20}, {.u32 = 300}, {.u32 = UINT32_MAX}, {.u32 = 0}}},
    {"fault", "cut_ms", 4, {{.u32 = 20}, {.u32 = 300}, {.u32 = UINT32_MAX}, {.u32 = 0}}},
    {"sil", "lockstep", 1, {{.u8 = 0}, {.u8 = 1}, {.u8 = 0}, {.u8 = 0}}},
    {"sil", "run_to_ms", 4, {{.u32 = 200}, {.u32 = 2000}, {.u32 = 0}, {.u32 = 1}}},
    {"sil", "speed_factor", 4, {{.f32 = 1.0f}, {.f32 = 5.0f}, {.f32 = 1.0e-40f}, {.f32 = 0.0f}}},
};
// clang-format on

static uint16_t id_of(const writable_t *row)
{
    for (size_t i = 0; i < loop.crtp.params.toc.n; i++)
    {
        const ivl_cf_param_t *p = &loop.crtp.params.rows[i];
        if ((strcmp(p->group, row->group) == 0) && (strcmp(p->name, row->name) == 0))
        {
            return (uint16_t)i;
        }
    }
    must(false, "there is no such parameter");
    return 0;
}

static void write_some(int client, size_t which, uint8_t value)
{
    const writable_t *row = &WRITABLE[which % (sizeof WRITABLE / sizeof WRITABLE[0])];
    const uint16_t    id = id_of(row);
    uint8_t           bytes[2 + sizeof(value_t)];
    memcpy(bytes, &id, sizeof id);
    memcpy(bytes + 2, &row->values[value % 4u], row->size);
    // a vehicle that is put elsewhere has nothing to obey
    const bool is_reset = strcmp(row->name, "reset") == 0;
    model.stop_ms = is_reset ? -1 : model.stop_ms;
    model.has_reset = model.has_reset || is_reset;
    (void)origin_of(client);
    send(client, 0x22u, bytes, 2u + row->size);
}

static void send_noise(int client, uint8_t seed)
{
    uint32_t     rng = random_of(seed);
    uint8_t      bytes[31];
    const size_t size = next_random(&rng) % sizeof bytes;
    for (size_t i = 0; i < sizeof bytes; i++)
    {
        bytes[i] = (uint8_t)next_random(&rng);
    }
    // what happens to be good, or switches the power, would be something that the model knows nothing of
    static const uint8_t PORTS[] = {0x50, 0x40, 0x60, 0x10, 0xa0, 0xb0, 0xc0, 0x00};
    (void)origin_of(client);
    send(client, (uint8_t)(PORTS[next_random(&rng) % sizeof PORTS] | 3u), bytes, size);
}

static void control(uint8_t a)
{
    static const char *const LINES[] = {"fault.loss=0.2",     "fault.loss=0",     "fault.delay_ms=5", "fault.delay_ms=0",
                                        "sil.speed_factor=1", "sil.lockstep=0",   "sil.n_rx",         "=",
                                        "fault.cut_ms=0",     "fault.freeze_ms=0"};
    const char *const        line = LINES[a % (sizeof LINES / sizeof LINES[0])];
    put(CONTROL_FD, IVL_CRTP_UDP_PACKET, 5u, line, strlen(line));
}

/// The model knows nothing of a vehicle without power: only what is sure to be refused is sent.
static void ask_for_power(int client, uint8_t which)
{
    static const uint8_t PACKETS[3][3] = {{0xffu, 0xfeu, 0x02u}, {0xf3u, 0xfeu, 0x01u}, {0xffu, 0xfeu, 0xffu}};
    const uint8_t       *packet = PACKETS[which % 3u];
    const bool           is_heard = (model.holder >= 0) && around.is_open[model.holder] && (around.now_us < model.heard_us + SURE_US);
    if (is_heard && (model.holder != client) && is_clear() && (loop.session.peer == peer_of(model.holder)))
    {
        n_strangers++;
        send(client, packet[0], packet + 1, 2u);
        let_pass_us(1500u);
        must(!loop.crtp.is_off, "a stranger switches the power");
    }
}

static void connect(int client)
{
    static const uint8_t LINK_SOURCE[] = {0xf1u};
    around.is_open[client] = true;
    (void)origin_of(client);
    put(VEHICLE_FD, IVL_CRTP_UDP_PACKET, peer_of(client), LINK_SOURCE, sizeof LINK_SOURCE);
}

static void betray(int client)
{
    if (has_traitor && (model.holder >= 0) && (model.holder != client) && is_clear())
    {
        around.is_open[client] = true;
        send_command(client, IVL_REQUEST_HOVER);
        loop.session.peer = peer_of(client);
    }
}

static void happen(const event_t *e)
{
    const int client = e->a % CLIENTS;
    n_seen[e->kind]++;
    switch ((kind_t)e->kind)
    {
    case WAIT:
        let_pass_us(1000u * (1u + e->a));
        return;
    case SILENCE:
        let_pass_us(1200000u);
        return;
    case CONNECT:
        connect(client);
        break;
    case CLOSE:
        around.is_open[client] = false;
        model.stop_ms = (model.holder == client) ? -1 : model.stop_ms;
        break;
    case NOTHING:
        around.is_open[client] = true;
        if (model.holder == client)
        {
            model.heard_us = around.now_us;
        }
        put(VEHICLE_FD, IVL_CRTP_UDP_PACKET, peer_of(client), "\xff", 1);
        break;
    case POLICY:
        send_policy(client, (uint8_t)(e->a / CLIENTS), e->b);
        break;
    case COMMAND:
        send_command(client, (uint8_t)(e->b % 5u));
        break;
    case WRITE:
        write_some(client, e->a / CLIENTS, e->b);
        break;
    case NOISE:
        send_noise(client, e->b);
        break;
    case POWER:
        ask_for_power(client, e->b);
        break;
    case CONTROL:
        control(e->a);
        break;
    case TRAITOR:
        betray(client);
        break;
    case EVENTS:
    default:
        break;
    }
    let_pass_us(1500u);
}

/// All have gone, and the operator has taken back what he has set: the next one is to be answered.
static void check_nobody_is_locked_out(void)
{
    static const char *const LINES[] = {"fault.loss=0", "fault.delay_ms=0"};
    for (int i = 0; i < CLIENTS; i++)
    {
        around.is_open[i] = false;
    }
    model.stop_ms = -1;
    for (size_t i = 0; i < sizeof LINES / sizeof LINES[0]; i++)
    {
        put(CONTROL_FD, IVL_CRTP_UDP_PACKET, 5u, LINES[i], strlen(LINES[i]));
    }
    // time that nobody sees passes in steps of the loop's own; a vehicle that flies on would cost much and show nothing
    loop.crtp.own.time.lockstep = 1;
    loop.crtp.own.time.running = false;
    const uint64_t ends_us = around.now_us + AWAY_US_MAX;
    around.is_open[0] = true;
    around.n_answers[0] = 0;
    while ((around.n_answers[0] == 0u) && (around.now_us < ends_us))
    {
        // who asked for it just before the client went may have switched it off
        send(0, 0xffu, (const uint8_t[]){0xfeu, 0x03u}, 2);
        let_pass_us(1500u);
        around.n_answers[0] = 0;
        connect(0);
        let_pass_us(500000u);
    }
    must(around.n_answers[0] > 0u, "everybody is locked out");
}

// ---- sequences

/// Half of the sequences begin with a landing, since few random ones come as far as that.
static const event_t FLIGHT[] = {{CONNECT, 0, 0}, {WRITE, 0, 0}, {WRITE, 3, 0},   {WRITE, 6, 0},  {POLICY, 9, 8},
                                 {COMMAND, 0, 1}, {WAIT, 30, 0}, {COMMAND, 0, 2}, {WAIT, 250, 0}, {WAIT, 200, 0}};

/// Every other one of the client who is first.
static event_t any_event(uint32_t *rng)
{
    const uint32_t n_kinds = has_traitor ? (uint32_t)EVENTS : (uint32_t)TRAITOR;
    const uint32_t kinds[8] = {WAIT, COMMAND, COMMAND, POLICY, [4] = next_random(rng) % n_kinds};
    const uint32_t which = next_random(rng) % 8u;
    uint8_t        a = (uint8_t)next_random(rng);
    const uint8_t  b = (uint8_t)next_random(rng);
    const event_t  e = {(uint8_t)kinds[(which < 4u) ? which : 4u], a, b};
    if ((e.kind != WAIT) && (e.kind != CONTROL) && (next_random(rng) % 2u == 0u))
    {
        a = (uint8_t)(a - a % CLIENTS);
    }
    return (event_t){e.kind, a, b};
}

static sequence_t make(uint32_t seed)
{
    uint32_t   rng = random_of(seed);
    sequence_t s = {.n = 0};
    const int  whole = (int)(sizeof FLIGHT / sizeof FLIGHT[0]);
    const int  keep = (next_random(&rng) % 2u == 0u) ? 0 : whole - (int)(next_random(&rng) % 3u);
    for (int i = 0; i < keep; i++)
    {
        add(&s, FLIGHT[i]);
        if (next_random(&rng) % 12u == 0u)
        {
            add(&s, any_event(&rng));
        }
    }
    for (int more = 1 + (int)(next_random(&rng) % 20u); more > 0; more--)
    {
        add(&s, any_event(&rng));
    }
    return s;
}

// ---- a vehicle that has just booted

static struct
{
    ivl_cf_t                cf;
    app_t                   app;
    ivl_crtp_loop_t         loop;
    ivl_crtp_param_state_t *params;
} booted;

static void open_once(void)
{
    const ivl_crtp_loop_cfg_t cfg = {.fd = VEHICLE_FD, .control_fd = CONTROL_FD, .speed_factor = 1.0f, .packets_per_s = 8000};
    const ivl_sim_params_t    params = fixture_params();
    char                      error[200] = "";
    model_of_vehicle = fixture_model(&params);
    ivl_cf_t *const cf = ivl_cf_open(&model_of_vehicle, 1, error, sizeof error);
    if ((cf == NULL) || !ivl_crtp_loop_open(&loop, cf, &cfg, error, sizeof error))
    {
        fprintf(stderr, "loop_sequences: %s\n", error);
        exit(2);
    }
    const size_t n = loop.crtp.params.toc.n;
    booted.cf = ivl_cf_the;
    booted.app = ivl_app;
    booted.loop = loop;
    booted.params = calloc(n, sizeof *booted.params);
    if (booted.params == NULL)
    {
        exit(2);
    }
    memcpy(booted.params, loop.crtp.params.state, n * sizeof *booted.params);
}

static void boot(void)
{
    ivl_crtp_faults_free(&loop.faults);
    app_task_start();
    tumbleCheckEnabled = 1;
    ivl_cf_the = booted.cf;
    ivl_app = booted.app;
    loop = booted.loop;
    memcpy(loop.crtp.params.state, booted.params, loop.crtp.params.toc.n * sizeof *booted.params);
    ivl_cf_logs_refresh(&ivl_cf_the);
    memset(&around, 0, sizeof around);
    memset(&model, 0, sizeof model);
    around.now_us = 10000000u;
    loop.refilled_us = around.now_us;
    model.holder = NOBODY;
    model.stop_ms = -1;
}

static const char *play(const sequence_t *s)
{
    broken = NULL;
    if (setjmp(out_of_here) == 0)
    {
        boot();
        let_pass_us(20000u);
        for (int i = 0; i < s->n; i++)
        {
            happen(&s->event[i]);
        }
        let_pass_us(30000u);
        check_nobody_is_locked_out();
    }
    return broken;
}

static void tell(unsigned long number)
{
    printf("loop_sequences: %lu, %llu ms, %llu flips, nothing broken; %llu packets of strangers, %llu stops obeyed\n", number,
           (unsigned long long)n_ms, (unsigned long long)n_flips, (unsigned long long)n_strangers, (unsigned long long)n_stops_obeyed);
}

static bool all_was_visited(unsigned long number)
{
    bool all = (n_flips > number / 200u) && (n_strangers > number) && (n_stops_obeyed > number / 10u);
    for (int i = 0; i < TRAITOR; i++)
    {
        all = all && (n_seen[i] > 0u);
    }
    return all;
}

void setUp(void)
{
}

void tearDown(void)
{
}

int main(int argc, char **argv)
{
    const player_t player = {"loop_sequences", NAMES, make, play, tell, all_was_visited};
    around.until_us = UINT64_MAX;
    open_once();
    return play_as_asked(&player, argc, argv, &has_traitor);
}
