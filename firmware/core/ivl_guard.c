/// @file ivl_guard.c
/// The rules.  Read the table first; docs/SAFETY.md says on which property of the vehicle each row rests.
#include "ivl_guard.h"

#include "ivl_math.h"

// ---- conditions: pure questions about this tick.  Written in positive form and negated, so that a NaN counts as the bad case.

#define CONDITION(name) static bool name(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen)
#define UNUSED(x)       ((void)(x))

static bool elapsed(const ivl_state_t *state, float limit_s)
{
    return (float)state->n_phase_tick * state->derived.dt_s >= limit_s;
}

static bool inside(float x, float lo, float hi)
{
    return (x >= lo) && (x <= hi);
}

CONDITION(never)
{
    UNUSED(cfg), UNUSED(state), UNUSED(seen);
    return false;
}

CONDITION(not_configured)
{
    UNUSED(cfg), UNUSED(seen);
    return state->guard.vitals.given && !state->guard.vitals.configured;
}

CONDITION(motors_bypassed)
{
    UNUSED(cfg), UNUSED(seen);
    return state->guard.vitals.given && state->guard.vitals.bypassed;
}

// after a landing only HOVER starts the next cycle: a forgotten APPROACH must not
CONDITION(not_rearmed)
{
    UNUSED(cfg), UNUSED(seen);
    return state->triggered && (state->sense.cmd.request != IVL_REQUEST_HOVER);
}

CONDITION(battery_below_rest)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.vbat_V >= cfg->vbat_V_rest_min);
}

CONDITION(state_old)
{
    UNUSED(cfg), UNUSED(seen);
    return !state->sense.pose_usable;
}

CONDITION(tipped_over)
{
    UNUSED(cfg), UNUSED(seen);
    return !(state->sense.up_z >= state->derived.cos_tilt_abort);
}

CONDITION(command_old)
{
    UNUSED(cfg), UNUSED(seen);
    return !state->sense.cmd_usable;
}

CONDITION(may_not_fly)
{
    UNUSED(cfg), UNUSED(seen);
    return state->guard.vitals.given && !state->guard.vitals.can_fly;
}

CONDITION(link_down)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.link_age_s <= cfg->link_s_max);
}

CONDITION(setpoint_old)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.setpoint_age_s <= cfg->setpoint_s_max);
}

CONDITION(host_silent)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.host_age_s <= cfg->host_s_max);
}

CONDITION(battery_below)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.vbat_V >= cfg->vbat_V_min);
}

CONDITION(outside_fence)
{
    UNUSED(seen);
    const ivl_vec3_t p = state->sense.sample.p_WB_m;
    return !(inside(p.x, cfg->fence_x_m_min, cfg->fence_x_m_max) && inside(p.y, cfg->fence_y_m_min, cfg->fence_y_m_max) &&
             inside(p.z, cfg->fence_z_m_min, cfg->fence_z_m_max));
}

CONDITION(too_fast)
{
    UNUSED(seen);
    const ivl_vec3_t v = state->sense.sample.v_WB_mps;
    return !(ivl_dot(v, v) <= cfg->speed_abort_mps * cfg->speed_abort_mps);
}

CONDITION(position_uncertain)
{
    UNUSED(seen);
    return state->guard.vitals.given && !(state->guard.vitals.p_sigma_m <= cfg->p_sigma_m_max);
}

CONDITION(too_close)
{
    UNUSED(state);
    return seen->ceiling.valid && (seen->ceiling.d_ceil_m < cfg->d_abort_m);
}

CONDITION(approach_too_long)
{
    UNUSED(seen);
    return elapsed(state, cfg->approach_s_max);
}

CONDITION(level_out_too_long)
{
    UNUSED(seen);
    return elapsed(state, cfg->level_out_s_max);
}

CONDITION(contact)
{
    UNUSED(seen);
    return (cfg->cut_on_contact != 0u) && state->contact.contact;
}

CONDITION(hanging)
{
    UNUSED(cfg), UNUSED(seen);
    return state->contact.hanging;
}

CONDITION(inputs_lost)
{
    UNUSED(cfg), UNUSED(seen);
    return !(state->sense.pose_usable && state->sense.cmd_usable);
}

CONDITION(flip_too_long)
{
    UNUSED(seen);
    return elapsed(state, cfg->flip_s_max);
}

CONDITION(coast_over)
{
    UNUSED(seen);
    return elapsed(state, cfg->coast_s_max);
}

CONDITION(unable_to_hover)
{
    return state_old(cfg, state, seen) || tipped_over(cfg, state, seen);
}

// on the floor, or the descent has ended long enough ago for it
static const float SETTLE_S = 2.0f;

CONDITION(landed)
{
    UNUSED(seen);
    return (state->landed_s > 0.0f) && ((state->sense.sample.p_WB_m.z <= cfg->land_height_m) || (state->landed_s >= SETTLE_S));
}

CONDITION(no_policy)
{
    UNUSED(cfg), UNUSED(seen);
    return !state->has_policy;
}

CONDITION(has_triggered)
{
    UNUSED(cfg), UNUSED(seen);
    return state->triggered;
}

CONDITION(not_this_tick)
{
    UNUSED(cfg), UNUSED(seen);
    return !(state->sense.pose_fresh && state->sense.cmd_fresh);
}

CONDITION(cue_invalid)
{
    UNUSED(cfg), UNUSED(state);
    return !seen->cues.valid;
}

CONDITION(would_not_land)
{
    UNUSED(cfg), UNUSED(seen);
    return !state->action.go && state->decision.asked;
}

// ---- the table: the first row that holds counts

#define IDLE     (1u << IVL_PHASE_IDLE)
#define READY    (1u << IVL_PHASE_READY)
#define APPROACH (1u << IVL_PHASE_APPROACH)
#define FLIP     (1u << IVL_PHASE_FLIP)
#define COAST    (1u << IVL_PHASE_COAST)
#define ABORTED  (1u << IVL_PHASE_ABORTED)
#define LEVEL    (1u << IVL_PHASE_LEVEL_OUT)
#define BEFORE   (IDLE | READY | APPROACH | LEVEL)

// what a flight that this rule ended says about its policy: nothing, so that it is discarded, or what its outcome says
#define DISCARDS true
#define SCORED   false

// clang-format off
/// X(id of IVL_RULE_, name, phases, condition, act of IVL_ACT_, discards), in the order of ivl_rule_t
#define RULES(X) \
    X(NONE,          "none",          0u,            never,              NONE,   DISCARDS)  \
    /* to arm */                                                                                  \
    X(CONFIG,        "config",        IDLE,          not_configured,     REFUSE, DISCARDS)  \
    X(BYPASS,        "bypass",        IDLE,          motors_bypassed,    REFUSE, DISCARDS)  \
    X(REARM,         "rearm",         IDLE,          not_rearmed,        REFUSE, DISCARDS)  \
    X(BATTERY_REST,  "battery_rest",  IDLE,          battery_below_rest, REFUSE, DISCARDS)  \
    /* before the trigger: refuses to arm, later aborts */                                        \
    X(STATE,         "state",         BEFORE,        state_old,          ABORT,  DISCARDS)  \
    X(TILT,          "tilt",          BEFORE,        tipped_over,        ABORT,  SCORED)    \
    X(COMMAND,       "command",       BEFORE,        command_old,        ABORT,  DISCARDS)  \
    X(SUPERVISOR,    "supervisor",    BEFORE,        may_not_fly,        ABORT,  DISCARDS)  \
    X(LINK,          "link",          BEFORE,        link_down,          ABORT,  DISCARDS)  \
    X(SETPOINT,      "setpoint",      BEFORE,        setpoint_old,       ABORT,  DISCARDS)  \
    X(HOST,          "host",          BEFORE,        host_silent,        ABORT,  DISCARDS)  \
    X(BATTERY,       "battery",       BEFORE,        battery_below,      ABORT,  DISCARDS)  \
    X(FENCE,         "fence",         BEFORE,        outside_fence,      ABORT,  SCORED)    \
    X(SPEED,         "speed",         BEFORE,        too_fast,           ABORT,  SCORED)    \
    X(UNCERTAIN,     "uncertain",     BEFORE,        position_uncertain, ABORT,  DISCARDS)  \
    X(TOO_CLOSE,     "too_close",     APPROACH,      too_close,          ABORT,  SCORED)    \
    X(APPROACH_TIME, "approach_time", APPROACH,      approach_too_long,  ABORT,  SCORED)    \
    X(LEVEL_OUT_TIME, "level_out_time", LEVEL,       level_out_too_long, ABORT,  SCORED)    \
    /* after the trigger: nothing but contact, loss of all senses and the clock ends a flip */    \
    X(CONTACT,       "contact",       FLIP | COAST,  contact,            ATTACH, SCORED)    \
    X(HANG,          "hang",          FLIP | COAST,  hanging,            ATTACH, SCORED)    \
    X(BLIND,         "blind",         FLIP,          inputs_lost,        CUT,    SCORED)    \
    X(FLIP_TIME,     "flip_time",     FLIP,          flip_too_long,      CUT,    SCORED)    \
    X(COAST_TIME,    "coast_time",    COAST,         coast_over,         CUT,    SCORED)    \
    /* after an abort */                                                                          \
    X(LOST,          "lost",          ABORTED,       unable_to_hover,    CUT,    SCORED)    \
    X(LANDED,        "landed",        ABORTED,       landed,             CUT,    SCORED)    \
    /* the trigger */                                                                             \
    X(NO_POLICY,     "no_policy",     APPROACH,      no_policy,          HOLD,   DISCARDS)  \
    X(ONE_SHOT,      "one_shot",      APPROACH,      has_triggered,      HOLD,   SCORED)    \
    /* the policy expects no landing, or there is no cue at the last moment; a command that is not fresh does not hold it up */ \
    X(NO_GO,         "no_go",         APPROACH,      would_not_land,     LEVEL,  SCORED)    \
    X(NOT_FRESH,     "not_fresh",     APPROACH,      not_this_tick,      HOLD,   SCORED)    \
    X(CUE,           "cue",           APPROACH,      cue_invalid,        HOLD,   SCORED)
// clang-format on

typedef struct
{
    uint16_t phases;  // bits
    uint8_t  act;     // ivl_act_t
    bool     discards;
} row_t;

#define ROW(id, name, phases, when, act, discards) [IVL_RULE_##id] = {phases, IVL_ACT_##act, discards},
static const row_t ROWS[] = {RULES(ROW)};

_Static_assert(sizeof ROWS / sizeof ROWS[0] == (size_t)IVL_RULE_COUNT, "one row a rule");
_Static_assert(IVL_RULE_COUNT <= 255, "a rule is logged in one byte");
_Static_assert(IVL_PHASE_COUNT <= 16, "a row has one bit a phase");

// a chain of questions, not a loop over the table: the conditions are then part of this function, and none is called through a pointer
#define ASK(id, name, phases, when, act, discards)                                                                                         \
    if ((((phases) & phase) != 0u) && when(cfg, state, seen))                                                                              \
    {                                                                                                                                      \
        return IVL_RULE_##id;                                                                                                              \
    }

ivl_rule_t ivl_guard_find(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen)
{
    const uint32_t phase = 1u << state->phase;
    RULES(ASK)
    return IVL_RULE_NONE;
}

static bool is_rule(ivl_rule_t rule)
{
    return (unsigned)rule < (unsigned)IVL_RULE_COUNT;
}

ivl_act_t ivl_guard_act(ivl_rule_t rule)
{
    return is_rule(rule) ? (ivl_act_t)ROWS[rule].act : IVL_ACT_NONE;
}

bool ivl_guard_discards(ivl_rule_t rule)
{
    return is_rule(rule) && ROWS[rule].discards;
}

bool ivl_guard_applies(ivl_rule_t rule, ivl_phase_t phase)
{
    return is_rule(rule) && ((unsigned)phase < (unsigned)IVL_PHASE_COUNT) && ((ROWS[rule].phases & (1u << phase)) != 0u);
}

#ifndef IVL_NO_TEXT
#define NAME(id, name, phases, when, act, discards) [IVL_RULE_##id] = (name),
static const char *const NAMES[] = {RULES(NAME)};

const char *ivl_guard_name(ivl_rule_t rule)
{
    return is_rule(rule) ? NAMES[rule] : "?";
}
#endif

// ---- lock-out

// what counts as resting upright: within 20 degrees, nearly no rotation, nearly no acceleration
static const float REST_UP_Z_MIN = 0.94f;
static const float REST_RATE_RADPS_MAX = 0.3f;
static const float REST_FORCE_MPS2_TOL = 2.0f;

static bool resting(const ivl_cfg_t *cfg, const ivl_state_t *state)
{
    const ivl_sense_t *sense = &state->sense;
    return state->guard.vitals.given && state->guard.vitals.stock_idle && sense->pose_fresh && (sense->up_z >= REST_UP_Z_MIN) &&
           ivl_vec3_within(sense->sample.w_B_radps, REST_RATE_RADPS_MAX) &&
           ivl_within(sense->sample.f_B_mps2.z - cfg->gravity_mps2, REST_FORCE_MPS2_TOL);
}

void ivl_guard_lock_out(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    ivl_guard_t *guard = &state->guard;
    if ((state->phase == IVL_PHASE_READY) || (state->phase == IVL_PHASE_APPROACH))
    {
        guard->locked_out = false;
    }
    // a flip onto a floor is over in the tick in which it begins
    if ((state->phase == IVL_PHASE_FLIP) || (state->phase == IVL_PHASE_COAST) || ((state->phase == IVL_PHASE_ABORTED) && state->abort_cut))
    {
        guard->locked_out = true;
    }
    guard->rest_s =
        (guard->locked_out && (state->phase == IVL_PHASE_IDLE) && resting(cfg, state)) ? guard->rest_s + state->derived.dt_s : 0.0f;
    if (guard->rest_s > cfg->rearm_s)
    {
        guard->locked_out = false;
    }
}
