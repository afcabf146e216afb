/// @file sequences.c
/// Random sequences of what a host, a link and a vehicle can do to the app, and what must hold after each millisecond of them:
///
/// - a flip has a policy, a request that the host has sent, its time in READY, and is in the region of the policy that is in force;
/// - no motor turns in a phase whose motors are off, nor after a flip until the vehicle has rested or another cycle has begun;
/// - IDLE is obeyed in every phase, ABORT in every phase before the trigger, whatever else is under way;
/// - policy and configuration that are in force change in IDLE and READY, and in IDLE, alone.
///
/// The checks have a model of their own: they look at packets that were sent, the vehicle's motion and its motors, not at the app's reasons.
/// The first sequence that breaks one is made shorter until nothing can be left out of it, and printed.
///
/// usage: sequences NUMBER [SEED] [--traitor]     with --traitor one of the events changes the policy behind the app's back
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app.h"
#include "app_channel.h"
#include "app_ivl.h"
#include "controller.h"
#include "player.h"
#include "policy_fixture.h"
#include "sdk_double.h"
#include "unity.h"

enum
{
    HEARTBEAT_MS = 50,
    ANSWER_MS_MAX = 30  // of a packet that waits for one before it, and of its own
};

#define HOVER_THRUST (65535.0f * 0.0325f * 9.81f / (4.0f * 0.18f))

static const float H_CEIL_M = 2.1f;
static const float SLACK_S = 0.0045f;  // a tick at 250 Hz, and rounding

typedef enum
{
    WAIT,     // a: ms
    POLICY,   // a: threshold, b: moment
    NO_GO,    // a policy that expects no landing
    BROKEN,   // a policy packet with one byte changed: a, b
    COMMAND,  // a: request, b: 0 as it should be, else an old number or a value out of range
    WRITE,    // a: which parameter, b: value
    COMMIT,   // what was written
    MOTION,   // a: vertical speed, b: along the ceiling
    PLACE,    // a: height
    TURN,     // a: attitude
    TOUCH,    // a: what the accelerometer feels
    VITALS,   // a: which of them, b: good or bad
    STOCK,    // a: the stock controller wants to fly or not
    SWITCH,   // another controller, or the app's start again
    NOISE,    // a packet of random bytes: a, b seed them
    READING,  // of a camera
    TRAITOR,  // only with --traitor
    EVENTS
} kind_t;

static const char *const NAMES[EVENTS] = {"wait", "policy", "no-go",  "broken policy", "command", "write", "commit",  "motion", "place",
                                          "turn", "touch",  "vitals", "stock",         "switch",  "noise", "reading", "traitor"};

// ---- the model

typedef struct
{
    bool        heartbeat;    ///< the host repeats what it has asked for
    uint8_t     wanted;       ///< request that was last sent and not refused
    bool        has_command;  ///< since the start, a command was taken
    uint16_t    seq;
    int         heartbeat_ms;
    float       v_mps[2];  ///< along the ceiling and up
    bool        runs;      ///< the app's controller is the one that is called
    ivl_phase_t phase;     ///< after the last millisecond
    int         ready_ms;  ///< in READY without a break
    int         away_ms;   ///< the link has been down
    bool        landed;    ///< a flip was begun: motors are off but in it
    float       rest_ms;   ///< upright, at rest, nobody wants to fly
    uint32_t    n_trigger, policy_crc, policy_seq, cfg_crc;
    uint32_t    n_step;    ///< of the stabilizer that was looked at last
    bool        is_cycle;  ///< READY was seen since IDLE
    int         stop_ms;   ///< since a request to stop has left the host; -1: none is under way
    uint8_t     stop;
} model_t;

static model_t     model;
static const char *broken;
static bool        has_traitor;
static uint64_t    n_flips, n_ms, n_seen[EVENTS], n_in_phase[IVL_PHASE_COUNT];

static void breaks(const char *what)
{
    broken = what;
    TEST_ABORT();
}

static void must(bool holds, const char *what)
{
    if (!holds)
    {
        breaks(what);
    }
}

static bool motors_turn(void)
{
    if (sdk.control.controlMode != controlModeForce)
    {
        return sdk.control.thrust > 0.0f;
    }
    bool turns = false;
    for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++)
    {
        turns = turns || (sdk.control.normalizedForces[i] != 0.0f);
        must((sdk.control.normalizedForces[i] >= 0.0f) && (sdk.control.normalizedForces[i] <= 1.0f), "a motor's command is none");
    }
    return turns;
}

static bool is_off(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_COAST) || (phase == IVL_PHASE_ATTACHED) || (phase == IVL_PHASE_DONE);
}

// the region is that of the threshold: no other form in these sequences ever says go
static void check_flip(void)
{
    const ivl_state_t    *state = &ivl_app.state;
    const ivl_snapshot_t *s = &state->snapshot;
    const float           d_m = H_CEIL_M - sdk.state.position.z;
    n_flips++;
    must(state->has_policy, "a flip without a policy");
    must(model.wanted == IVL_REQUEST_APPROACH, "a flip that nobody has asked for");
    must(state->policy.n == 2u, "a flip of a policy that expects no landing");
    must(model.is_cycle, "a flip that one packet has led to from IDLE");
    must(1.0e-3f * (float)model.ready_ms + SLACK_S >= ivl_app.cfg.ready_s_min, "a flip without its time in READY");
    must(sdk.state.velocity.z + 1.0e-3f >= (d_m - 0.02f) * state->policy.theta[0], "a flip outside the policy's region");
    must((s->policy.crc == model.policy_crc) && (s->policy.seq == state->policy.id.seq), "a flip of another policy");
    must(sdk.can_fly && (sdk.vbat_V > 3.0f), "a flip of a vehicle that may not fly");
    must(1.0e-3f * (float)model.away_ms <= ivl_app.cfg.link_s_max + SLACK_S, "a flip of a vehicle whose link is down");
}

static void check_motors(ivl_phase_t phase)
{
    const bool turns = motors_turn();
    must(!turns || !is_off(phase), "a motor turns in a phase that has it off");
    must(!turns || !model.landed || (phase == IVL_PHASE_FLIP), "a motor turns after a flip");
    must(!turns || (phase != IVL_PHASE_IDLE) || (sdk.control.controlMode == controlModeLegacy), "the core turns a motor in IDLE");
}

// the check sums are made anew only where a byte is another one: they cost more than all the rest
static void look_at_what_is_in_force(uint32_t *crc, uint32_t *cfg_crc)
{
    static ivl_policy_t policy;
    static ivl_cfg_t    cfg;
    static uint32_t     policy_crc;
    static uint32_t     cfg_crc_seen;
    if (memcmp(&policy, &ivl_app.state.policy, sizeof policy) != 0)
    {
        memcpy(&policy, &ivl_app.state.policy, sizeof policy);
        policy_crc = ivl_policy_crc(&ivl_app.state.policy);
    }
    if (memcmp(&cfg, &ivl_app.cfg, sizeof cfg) != 0)
    {
        memcpy(&cfg, &ivl_app.cfg, sizeof cfg);
        cfg_crc_seen = ivl_cfg_crc(&ivl_app.cfg);
    }
    *crc = policy_crc;
    *cfg_crc = cfg_crc_seen;
}

static void check_in_force(void)
{
    const ivl_policy_id_t now = ivl_app.state.policy.id;
    uint32_t              crc, cfg_crc;
    look_at_what_is_in_force(&crc, &cfg_crc);
    const bool is_same = (now.seq == model.policy_seq) && (crc == model.policy_crc);
    const bool is_open = (model.phase == IVL_PHASE_IDLE) || (model.phase == IVL_PHASE_READY);
    must(is_open || is_same, "a policy changed in flight");
    must((model.phase == IVL_PHASE_IDLE) || (cfg_crc == model.cfg_crc), "a configuration changed in flight");
    model.policy_crc = crc;
    model.policy_seq = now.seq;
    model.cfg_crc = cfg_crc;
}

static bool is_before_trigger(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_LEVEL_OUT);
}

static void check_stop(ivl_phase_t phase)
{
    if ((model.stop_ms < 0) || !sdk.controller_runs)
    {
        return;
    }
    const bool obeyed = (model.stop == IVL_REQUEST_IDLE) ? (phase == IVL_PHASE_IDLE) : !is_before_trigger(phase);
    if (obeyed)
    {
        model.stop_ms = -1;
        return;
    }
    model.stop_ms++;
    must(model.stop_ms <= ANSWER_MS_MAX, (model.stop == IVL_REQUEST_IDLE) ? "IDLE is not obeyed" : "ABORT is not obeyed");
}

static bool rests(void)
{
    const Axis3f *acc = &sdk.sensors.acc;
    return (sdk.setpoint.mode.z == modeDisable) && (sdk.pid_thrust == 0.0f) && (fabsf(acc->z - 1.0f) < 0.3f) &&
           (sdk.state.attitudeQuaternion.w > 0.9f);
}

static void remember(ivl_phase_t phase)
{
    model.ready_ms += (phase == IVL_PHASE_READY) ? 1 : 0;
    model.ready_ms = (phase == IVL_PHASE_IDLE) ? 0 : model.ready_ms;
    model.is_cycle = (phase == IVL_PHASE_READY) || (model.is_cycle && (phase != IVL_PHASE_IDLE));
    if ((phase == IVL_PHASE_READY) && (model.phase != IVL_PHASE_READY))
    {
        model.ready_ms = 1;
    }
    // the next cycle may be as far as an approach, its end or an abort within a tick
    if (is_before_trigger(phase) || (phase == IVL_PHASE_ABORTED))
    {
        const bool is_new = (model.phase == IVL_PHASE_IDLE) || is_before_trigger(model.phase) || (model.phase == IVL_PHASE_ABORTED);
        must(is_new, "a cycle that is over goes on");
        model.landed = false;
    }
    if (phase == IVL_PHASE_FLIP)
    {
        model.landed = true;
    }
    model.rest_ms = rests() ? model.rest_ms + 1.0f : 0.0f;
    // rested long enough, the vehicle is anybody's
    if ((phase == IVL_PHASE_IDLE) && (1.0e-3f * model.rest_ms > 0.9f * ivl_app.cfg.rearm_s))
    {
        model.landed = false;
    }
    model.phase = phase;
}

// what the last step of the stabilizer has done, once
static void check(void)
{
    const ivl_phase_t phase = ivl_app.state.phase;
    if (model.n_step == sdk.step)
    {
        return;
    }
    model.n_step = sdk.step;
    n_ms++;
    n_in_phase[phase]++;
    if (sdk.controller_runs && model.runs)
    {
        check_in_force();
        // a configuration that is put in force begins to count anew
        const uint32_t n_trigger = ivl_app.state.diag.n_trigger;
        const bool     is_flip = n_trigger > model.n_trigger;
        model.n_trigger = n_trigger;
        if (is_flip)
        {
            check_flip();
        }
        remember(phase);
        check_motors(phase);
    }
    check_stop(phase);
    model.runs = sdk.controller_runs;
    model.away_ms = sdk.is_connected ? 0 : model.away_ms + 1;
}

// before each step of the stabilizer
static void look(void)
{
    check();
    sdk.state.position.x += 1.0e-3f * model.v_mps[0];
    sdk.state.position.z += 1.0e-3f * model.v_mps[1];
    model.heartbeat_ms++;
}

// ---- what happens

static void let_pass(int ms);

static void deliver(const uint8_t *bytes, size_t size)
{
    memcpy(sdk.incoming.bytes, bytes, size);
    sdk.incoming.size = size;
    for (int i = 0; (i < 60) && ((sdk.incoming.size > 0u) || app_packets_waiting(&ivl_app)); i++)
    {
        sdk.n_sent = 0;
        app_task_once();
    }
    must((sdk.incoming.size == 0u) && !app_packets_waiting(&ivl_app), "a packet waits for ever");
}

static void send_policy(const ivl_policy_t *policy)
{
    for (uint8_t part = 0; part < ivl_parts_count(policy->n); part++)
    {
        const ivl_wire_policy_t packet = packet_of(policy, part);
        uint8_t                 bytes[IVL_WIRE_SIZE_MAX];
        deliver(bytes, ivl_wire_put_policy(bytes, &packet));
    }
}

static ivl_policy_t some_policy(uint8_t a, uint8_t b)
{
    return constant_policy(1u + a, 0.5f * (float)(a % 16u), 0.001f * (float)(b % 12u));
}

static void send_broken(uint8_t a, uint8_t b)
{
    const ivl_policy_t      policy = some_policy(a, b);
    const ivl_wire_policy_t packet = packet_of(&policy, 0);
    uint8_t                 bytes[IVL_WIRE_SIZE_MAX];
    const size_t            size = ivl_wire_put_policy(bytes, &packet);
    bytes[a % size] ^= (uint8_t)(1u + b % 255u);
    deliver(bytes, size);
}

// what is sent in good order is what the host wants, from the moment it leaves; IDLE and ABORT are then to be obeyed
static void send_command(uint8_t request, uint8_t how)
{
    ivl_wire_command_t packet = {(uint16_t)(model.seq + 1u), request, 0.0f, 0.0f, 1.0f, 2.5f, 1.2f};
    const bool         stops = (request == IVL_REQUEST_IDLE) || (request == IVL_REQUEST_ABORT);
    uint8_t            bytes[IVL_WIRE_SIZE_MAX];
    if (how == 1u)
    {
        packet.seq = (uint16_t)(model.seq - 3u);
    }
    if (how == 2u)
    {
        packet.hover_x_m = NAN;
        packet.speed_mps = INFINITY;
    }
    const bool is_taken = (how != 2u) && ((how != 1u) || stops || !model.has_command);
    must(model.stop_ms < 0, "a request to stop is not obeyed at once");
    if ((request < IVL_REQUEST_COUNT) && is_taken && sdk.controller_runs)
    {
        model.has_command = true;
        model.seq = packet.seq;
        model.wanted = request;
        model.stop = request;
        model.stop_ms = stops ? 0 : -1;
    }
    model.heartbeat_ms = 0;
    deliver(bytes, ivl_wire_put_command(bytes, &packet));
    let_pass(5);
}

static void let_pass(int ms)
{
    for (int t = 0; t < ms; t++)
    {
        if (model.heartbeat && (model.heartbeat_ms >= HEARTBEAT_MS) && (model.wanted != IVL_REQUEST_IDLE))
        {
            model.heartbeat_ms = 0;
            uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
            const ivl_wire_command_t packet = {++model.seq, model.wanted, 0.0f, 0.0f, 1.0f, 2.5f, 1.2f};
            deliver(bytes, ivl_wire_put_command(bytes, &packet));
        }
        sdk.n_sent = 0;
        sdk_double_run(1);
    }
    app_task_once();
}

static void write_some(uint8_t which, uint8_t value)
{
    static const struct
    {
        const char *name;
        float       values[4];
    } ROWS[] = {
        {"ready_s_min", {0.0f, 0.05f, 0.3f, NAN}},    {"host_s_max", {0.5f, 0.2f, 2.0f, 99.0f}},
        {"rearm_s", {1.0f, 0.2f, 2.0f, -1.0f}},       {"tick_hz", {500.0f, 1000.0f, 250.0f, 333.0f}},
        {"attached_s", {1.0f, 0.1f, 0.3f, INFINITY}}, {"flip_s_max", {1.0f, 0.05f, 0.2f, 0.0f}},
    };
    const size_t row = which % (sizeof ROWS / sizeof ROWS[0]);
    sdk_double_write_float(ROWS[row].name, ROWS[row].values[value % 4u]);
}

static void turn(uint8_t a)
{
    static const quaternion_t ATTITUDES[] = {
        {.w = 1.0f}, {.x = 0.13f, .w = 0.99f}, {.y = 0.26f, .w = 0.966f}, {.y = 1.0f}, {.x = 0.71f, .w = 0.71f}};
    const quaternion_t q = ATTITUDES[a % 5u];
    sdk.state.attitudeQuaternion.x = q.x;
    sdk.state.attitudeQuaternion.y = q.y;
    sdk.state.attitudeQuaternion.z = q.z;
    sdk.state.attitudeQuaternion.w = q.w;
}

static void touch(uint8_t a)
{
    static const Axis3f FELT[] = {{.z = 1.0f}, {.x = 6.0f}, {.z = -1.0f}, {.x = 0.0f}, {.y = -2.0f, .z = 0.5f}};
    sdk.sensors.acc = FELT[a % 5u];
    sdk.sensors.gyro.y = (a % 7u == 6u) ? -900.0f : 0.0f;
}

static void vitals(uint8_t a, uint8_t b)
{
    const bool is_good = b % 3u != 0u;
    switch (a % 6u)
    {
    case 0:
        sdk.can_fly = is_good;
        break;
    case 1:
        sdk.is_connected = is_good;
        break;
    case 2:
        sdk.vbat_V = is_good ? 4.0f : 2.6f;
        break;
    case 3:
        sdk.variance_m2 = is_good ? 1.0e-6f : 0.5f;
        break;
    case 4:
        sdk.motor_power_set = is_good ? 0u : 1u;
        break;
    default:
        sdk.has_variance = is_good;
        break;
    }
}

static void switch_controller(uint8_t a)
{
    if (a % 2u == 0u)
    {
        // the stock controller flies for a while, then the app is selected again, which starts it
        sdk.controller_runs = false;
        let_pass(1 + a);
        sdk.controller_runs = true;
    }
    model.is_cycle = false;
    model.landed = model.landed || (ivl_app.state.phase != IVL_PHASE_IDLE) || ivl_app.state.guard.locked_out;
    controllerOutOfTreeInit();
    model.phase = IVL_PHASE_IDLE;
    model.n_trigger = 0;
    model.wanted = IVL_REQUEST_IDLE;
    model.stop_ms = -1;
    model.runs = false;
    model.rest_ms = 0.0f;
}

static void send_noise(uint8_t a, uint8_t b)
{
    uint8_t      bytes[APPCHANNEL_MTU];
    uint32_t     rng = 1u + a + 256u * b;
    const size_t size = next_random(&rng) % sizeof bytes;
    for (size_t i = 0; i < sizeof bytes; i++)
    {
        bytes[i] = (uint8_t)next_random(&rng);
    }
    // a command that happens to be good would be one that the model knows nothing of
    bytes[0] |= 0x80u;
    deliver(bytes, size);
}

static void send_reading(uint8_t a, uint8_t b)
{
    const ivl_wire_reading_t packet = {(uint8_t)(a % 5u), 0.005f * (float)(b % 16u), (a % 9u == 8u) ? NAN : 0.2f * (float)b,
                                       0.1f * (float)a};
    uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
    deliver(bytes, ivl_wire_put_reading(bytes, &packet));
}

static void betray(void)
{
    if (has_traitor && (ivl_app.state.phase == IVL_PHASE_APPROACH))
    {
        ivl_app.state.policy = constant_policy(77, 0.1f, 0.002f);
        let_pass(2);
    }
}

static void happen(const event_t *e)
{
    n_seen[e->kind]++;
    check();
    ivl_policy_t policy;
    switch ((kind_t)e->kind)
    {
    case WAIT:
        let_pass(1 + ((e->b % 4u == 3u) ? 8 : 1) * e->a);
        break;
    case POLICY:
        policy = some_policy(e->a, e->b);
        send_policy(&policy);
        break;
    case NO_GO:
        policy = no_go_policy(e->a);
        send_policy(&policy);
        break;
    case BROKEN:
        send_broken(e->a, e->b);
        break;
    case COMMAND:
        model.heartbeat = e->b % 8u != 7u;
        send_command(e->a % 6u, e->b % 8u);
        break;
    case WRITE:
        write_some(e->a, e->b);
        break;
    case COMMIT:
        sdk_double_write_u32("commit", 1u + e->a);
        let_pass(12);
        break;
    case MOTION:
        model.v_mps[0] = (e->b % 4u == 3u) ? 1.5f : 0.0f;
        model.v_mps[1] = 0.5f * (float)(e->a % 8u) - 0.5f;
        sdk.state.velocity.x = model.v_mps[0];
        sdk.state.velocity.z = model.v_mps[1];
        break;
    case PLACE:
        sdk.state.position.z = 0.01f * (float)(e->a % 205u);
        break;
    case TURN:
        turn(e->a);
        break;
    case TOUCH:
        touch(e->a);
        break;
    case VITALS:
        vitals(e->a, e->b);
        break;
    case STOCK:
        sdk.pid_thrust = (e->a % 2u != 0u) ? HOVER_THRUST : 0.0f;
        sdk.setpoint.mode.z = (e->a % 2u != 0u) ? modeAbs : modeDisable;
        break;
    case SWITCH:
        switch_controller(e->a);
        break;
    case NOISE:
        send_noise(e->a, e->b);
        break;
    case READING:
        send_reading(e->a, e->b);
        break;
    case TRAITOR:
        betray();
        break;
    case EVENTS:
    default:
        break;
    }
}

// ---- sequences

/// Half of the sequences begin with a flight, since few random ones come as far as that.
static const event_t FLIGHT[] = {{COMMIT, 1, 0},
                                 {STOCK, 1, 0},
                                 {POLICY, 8, 8},
                                 {COMMAND, IVL_REQUEST_HOVER, 0},
                                 {WAIT, 200, 0},
                                 {PLACE, 60, 0},
                                 {COMMAND, IVL_REQUEST_APPROACH, 0},
                                 {MOTION, 6, 0},
                                 {WAIT, 100, 3}};

/// Half of them commands and waits.
static event_t any_event(uint32_t *rng)
{
    const uint32_t dice = next_random(rng);
    const uint32_t n_kinds = has_traitor ? (uint32_t)EVENTS : (uint32_t)TRAITOR;
    const uint32_t kinds[8] = {WAIT, WAIT, COMMAND, COMMAND, [4] = (dice >> 8) % n_kinds};
    const uint32_t which = dice % 8u;
    const uint8_t  a = (uint8_t)next_random(rng), b = (uint8_t)next_random(rng);
    return (event_t){(uint8_t)kinds[(which < 4u) ? which : 4u], a, b};
}

static sequence_t make(uint32_t seed)
{
    uint32_t   rng = random_of(seed);
    sequence_t s = {.n = 0};
    const int  keep = (next_random(&rng) % 2u == 0u) ? 0 : (int)(next_random(&rng) % (1u + sizeof FLIGHT / sizeof FLIGHT[0]));
    for (int i = 0; i < keep; i++)
    {
        add(&s, FLIGHT[i]);
        if (next_random(&rng) % 4u == 0u)
        {
            add(&s, any_event(&rng));
        }
    }
    for (int more = 1 + (int)(next_random(&rng) % 30u); more > 0; more--)
    {
        add(&s, any_event(&rng));
    }
    return s;
}

static void boot(void)
{
    static const MemoryHandlerDef_t *memory;
    memset(&ivl_app, 0, sizeof ivl_app);
    sdk_double_reset();
    model = (model_t){.stop_ms = -1, .heartbeat = true};
    sdk.n_receive_left = INT_MAX;
    controllerOutOfTreeInit();
    memory = (sdk.memory != NULL) ? sdk.memory : memory;
    sdk.memory = memory;
    app_task_start();
    sdk_double_run(20);
    sdk.each_ms = look;
    app_task_once();
}

/// @return what it breaks, NULL: nothing
static const char *play(const sequence_t *s)
{
    broken = NULL;
    if (TEST_PROTECT())
    {
        boot();
        for (int i = 0; i < s->n; i++)
        {
            happen(&s->event[i]);
        }
        let_pass(5);
        return NULL;
    }
    return (broken != NULL) ? broken : "the stand-in for the SDK was asked for something that there is not";
}

static bool all_was_visited(unsigned long number)
{
    bool all = n_flips > number / 200u;
    for (int i = 0; i < TRAITOR; i++)
    {
        all = all && (n_seen[i] > 0u);
    }
    for (int i = 0; i < (int)IVL_PHASE_COUNT; i++)
    {
        all = all && (n_in_phase[i] > 0u);
    }
    return all;
}

void setUp(void)
{
}

void tearDown(void)
{
}

static void tell(unsigned long number)
{
    printf("sequences: %lu, %llu ms, %llu flips, nothing broken\n", number, (unsigned long long)n_ms, (unsigned long long)n_flips);
}

int main(int argc, char **argv)
{
    const player_t player = {"sequences", NAMES, make, play, tell, all_was_visited};
    return play_as_asked(&player, argc, argv, &has_traitor);
}
