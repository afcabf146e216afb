/// @file ivl_phase.c
/// The phase table and its conditions.  Read the table first.  What must not happen stands in the table of ivl_guard.c.
#include "ivl_phase.h"

#include <string.h>

#include "ivl_guard.h"
#include "ivl_level_out.h"

// ---- conditions: pure questions about the state of this tick

typedef bool (*condition_t)(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen);

#define CONDITION(name) static bool name(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen)
#define UNUSED(x)       ((void)(x))

static bool requested(const ivl_state_t *state, ivl_request_t request)
{
    return state->sense.cmd.request == request;
}

static bool elapsed(const ivl_state_t *state, float limit_s)
{
    return (float)state->n_phase_tick * state->derived.dt_s >= limit_s;
}

// state and command are this tick's
static bool fresh(const ivl_state_t *state)
{
    return state->sense.pose_fresh && state->sense.cmd_fresh;
}

static bool rule_says(const ivl_state_t *state, ivl_act_t act)
{
    return state->guard.act == (uint8_t)act;
}

CONDITION(request_idle)
{
    UNUSED(cfg), UNUSED(seen);
    return requested(state, IVL_REQUEST_IDLE);
}

CONDITION(request_abort)
{
    UNUSED(cfg), UNUSED(seen);
    return requested(state, IVL_REQUEST_ABORT);
}

CONDITION(request_hover)
{
    UNUSED(cfg), UNUSED(seen);
    return requested(state, IVL_REQUEST_HOVER);
}

CONDITION(may_arm)
{
    UNUSED(cfg), UNUSED(seen);
    const bool wanted = requested(state, IVL_REQUEST_HOVER) || requested(state, IVL_REQUEST_APPROACH);
    return wanted && state->derived.cfg_good && fresh(state) && rule_says(state, IVL_ACT_NONE);
}

CONDITION(may_approach)
{
    UNUSED(seen);
    return requested(state, IVL_REQUEST_APPROACH) && state->has_policy && fresh(state) && elapsed(state, cfg->ready_s_min);
}

// ---- conditions: the landing

// a vehicle that rises towards the ceiling, or is fast along it, is not to be steered anywhere
CONDITION(hover_from_rest)
{
    UNUSED(cfg), UNUSED(seen);
    return requested(state, IVL_REQUEST_HOVER) && ivl_level_out_rests(state);
}

CONDITION(triggered)
{
    UNUSED(cfg), UNUSED(seen);
    return !rule_says(state, IVL_ACT_HOLD) && state->action.flip;
}

CONDITION(inverted)
{
    UNUSED(seen);
    return (cfg->cut_at_inverted != 0u) && !(state->sense.up_z > state->derived.surface.up_z_cut);
}

CONDITION(attached_over)
{
    UNUSED(seen);
    return elapsed(state, cfg->attached_s);
}

// ---- the table

// taken when its condition holds, or, without one, when the rule that holds says so; neither of them: the end of a list
typedef struct
{
    condition_t when;
    uint8_t     act;   // ivl_act_t
    uint8_t     next;  // ivl_phase_t
} exit_t;

typedef struct
{
    const exit_t *exits;  // the first one that is taken counts
    uint8_t       drive;  // ivl_drive_t
} row_t;

// clang-format off
#define ON(condition, phase) {.when = (condition), .next = IVL_PHASE_##phase}
#define RULE(says, phase)    {.act = IVL_ACT_##says, .next = IVL_PHASE_##phase}
#define EXITS(...)           (const exit_t[]) {__VA_ARGS__, {.when = NULL}}

// A request to abort does nothing once the trigger has fired: half a flip is worse than a whole one.  IDLE is the kill switch of every phase.
static const row_t ROWS[] = {
    [IVL_PHASE_IDLE] = {EXITS(
        ON(may_arm,          READY)), IVL_DRIVE_OFF},
    [IVL_PHASE_READY] = {EXITS(
        ON(request_idle,     IDLE),
        ON(request_abort,    ABORTED),
        RULE(ABORT,          ABORTED),
        ON(may_approach,     APPROACH)), IVL_DRIVE_HOVER},
    [IVL_PHASE_APPROACH] = {EXITS(
        ON(request_idle,     IDLE),
        ON(request_abort,    ABORTED),
        RULE(ABORT,          ABORTED),
        RULE(LEVEL,          LEVEL_OUT),
        ON(request_hover,    LEVEL_OUT),
        ON(triggered,        FLIP)), IVL_DRIVE_APPROACH},
    [IVL_PHASE_FLIP] = {EXITS(
        ON(request_idle,     IDLE),
        RULE(ATTACH,         ATTACHED),
        RULE(CUT,            COAST),
        ON(inverted,         COAST)), IVL_DRIVE_FLIP},
    [IVL_PHASE_COAST] = {EXITS(
        ON(request_idle,     IDLE),
        RULE(ATTACH,         ATTACHED),
        RULE(CUT,            DONE)), IVL_DRIVE_OFF},
    [IVL_PHASE_ATTACHED] = {EXITS(
        ON(request_idle,     IDLE),
        ON(attached_over,    DONE)), IVL_DRIVE_OFF},
    [IVL_PHASE_DONE] = {EXITS(
        ON(request_idle,     IDLE)), IVL_DRIVE_OFF},
    [IVL_PHASE_ABORTED] = {EXITS(
        ON(request_idle,     IDLE)), IVL_DRIVE_LAND},
    [IVL_PHASE_LEVEL_OUT] = {EXITS(
        ON(request_idle,     IDLE),
        ON(request_abort,    ABORTED),
        RULE(ABORT,          ABORTED),
        ON(hover_from_rest,  READY)), IVL_DRIVE_LEVEL},
};
// clang-format on

// a row for every phase, and the numbers that logs and traces rely on
_Static_assert(sizeof ROWS / sizeof ROWS[0] == (size_t)IVL_PHASE_COUNT, "one row a phase");
_Static_assert(IVL_PHASE_IDLE == 0 && IVL_PHASE_READY == 1 && IVL_PHASE_APPROACH == 2 && IVL_PHASE_FLIP == 3, "phase numbers");
_Static_assert(IVL_PHASE_COAST == 4 && IVL_PHASE_ATTACHED == 5 && IVL_PHASE_DONE == 6 && IVL_PHASE_ABORTED == 7, "phase numbers");
_Static_assert(IVL_PHASE_LEVEL_OUT == 8, "phase numbers");

// ---- what happens on the way into a phase

static void enter_ready(ivl_state_t *state)
{
    state->triggered = false;
    state->guard.cause = IVL_RULE_NONE;
    memset(&state->snapshot, 0, sizeof state->snapshot);
    memset(&state->action, 0, sizeof state->action);
    memset(&state->decision, 0, sizeof state->decision);
    // nothing to level out
    state->level = (ivl_level_t){.h_m = 2.0f * IVL_SENSE_P_M_MAX};
}

static void enter(const ivl_cfg_t *cfg, ivl_state_t *state, ivl_phase_t next, const ivl_seen_t *seen)
{
    const ivl_sample_t *sample = &state->sense.sample;
    state->phase = next;
    state->n_phase_tick = 0;
    switch (next)
    {
    case IVL_PHASE_READY:
        enter_ready(state);
        state->p_hold_W_m = sample->p_WB_m;
        break;
    case IVL_PHASE_APPROACH:
        ivl_level_out_prepare(state);
        // a surface that is tilted turns the path along with it
        ivl_approach_begin(cfg, &state->approach, sample->p_WB_m, sample->v_WB_mps, state->sense.cmd.speed_mps,
                           state->sense.cmd.angle_rad - cfg->surface_tilt_rad);
        break;
    case IVL_PHASE_FLIP:
        state->triggered = true;
        state->diag.n_trigger++;
        ivl_trigger_snapshot(&state->snapshot, sample, seen, &state->policy.id, &state->action);
        break;
    case IVL_PHASE_ABORTED:
        // a vehicle on its way to the ceiling, or along it, levels out first
        if (ivl_level_out_rests(state))
        {
            state->p_hold_W_m = sample->p_WB_m;
        }
        state->abort_cut = false;
        state->landed_s = 0.0f;
        state->diag.n_abort++;
        break;
    case IVL_PHASE_LEVEL_OUT:
        state->diag.n_no_go += rule_says(state, IVL_ACT_LEVEL) ? 1u : 0u;
        break;
    case IVL_PHASE_IDLE:
    case IVL_PHASE_COAST:
    case IVL_PHASE_ATTACHED:
    case IVL_PHASE_DONE:
    case IVL_PHASE_COUNT:
    default:
        break;
    }
}

static void note_cause(ivl_state_t *state)
{
    if (rule_says(state, IVL_ACT_ABORT) || rule_says(state, IVL_ACT_ATTACH) || rule_says(state, IVL_ACT_CUT) ||
        rule_says(state, IVL_ACT_LEVEL))
    {
        state->guard.cause = state->guard.rule;
    }
}

// after a go at the last moment there is no way back, so the flip is no longer asked about
static void decide_once(ivl_state_t *state, const ivl_seen_t *seen)
{
    ivl_decision_t *decision = &state->decision;
    if (decision->asked && (rule_says(state, IVL_ACT_NONE) || rule_says(state, IVL_ACT_LEVEL)))
    {
        const bool is_first = !decision->made;
        decision->made = true;
        decision->go = state->action.go;
        // a go that is asked again rests on the lowest of its probabilities: any of them could have ended it
        if (seen->cues.valid && (is_first || !(state->action.p_land > decision->p_land)))
        {
            decision->p_land = state->action.p_land;
            decision->d_ceil_m = seen->ceiling.d_ceil_m;
        }
    }
}

static bool taken(const exit_t *e, const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen)
{
    return (e->when != NULL) ? e->when(cfg, state, seen) : (e->act == state->guard.act);
}

static bool ends(const exit_t *e)
{
    return (e->when == NULL) && (e->act == (uint8_t)IVL_ACT_NONE);
}

static bool take_exit(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen)
{
    state->decision.asked = false;
    if (state->phase == IVL_PHASE_APPROACH)
    {
        state->action = ivl_policy_decide(&state->policy, seen);
        ivl_level_out_ask(cfg, state, seen);
    }
    const ivl_rule_t rule = ivl_guard_find(cfg, state, seen);
    state->guard.rule = (uint8_t)rule;
    state->guard.act = (uint8_t)ivl_guard_act(rule);
    decide_once(state, seen);
    for (const exit_t *e = ROWS[state->phase].exits; !ends(e); e++)
    {
        if (taken(e, cfg, state, seen))
        {
            if (state->phase != IVL_PHASE_IDLE)
            {
                note_cause(state);
            }
            enter(cfg, state, (ivl_phase_t)e->next, seen);
            // all that could end a level-out was already asked: its rules and requests are among those of the approach
            return e->next != (uint8_t)IVL_PHASE_LEVEL_OUT;
        }
    }
    return false;
}

void ivl_phase_update(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen)
{
    // the bound is never reached: no set of conditions leads round a circle within one tick
    for (int i = 0; (i < (int)IVL_PHASE_COUNT) && take_exit(cfg, state, seen); i++)
    {
    }
    state->n_phase_tick++;
    // only a HOVER request carries a checked hover point; until one comes, READY stays where it began
    if ((state->phase == IVL_PHASE_READY) && requested(state, IVL_REQUEST_HOVER))
    {
        state->p_hold_W_m = state->sense.cmd.p_hover_W_m;
    }
    // a vehicle that was lost once may lie anywhere when it is seen again, one that has landed is to stay: motors off
    if ((state->phase == IVL_PHASE_ABORTED) && !state->abort_cut && rule_says(state, IVL_ACT_CUT))
    {
        state->abort_cut = true;
    }
    ivl_guard_lock_out(cfg, state);
}

ivl_drive_t ivl_phase_drive(const ivl_state_t *state)
{
    const bool cut = (state->phase == IVL_PHASE_ABORTED) && state->abort_cut;
    return cut ? IVL_DRIVE_OFF : (ivl_drive_t)ROWS[state->phase].drive;
}

#ifndef IVL_NO_TEXT
static const char *const NAMES[] = {
    [IVL_PHASE_IDLE] = "idle", [IVL_PHASE_READY] = "ready",     [IVL_PHASE_APPROACH] = "approach",
    [IVL_PHASE_FLIP] = "flip", [IVL_PHASE_COAST] = "coast",     [IVL_PHASE_ATTACHED] = "attached",
    [IVL_PHASE_DONE] = "done", [IVL_PHASE_ABORTED] = "aborted", [IVL_PHASE_LEVEL_OUT] = "level_out",
};
_Static_assert(sizeof NAMES / sizeof NAMES[0] == (size_t)IVL_PHASE_COUNT, "one name a phase");

const char *ivl_phase_name(ivl_phase_t phase)
{
    return ((unsigned)phase < (unsigned)IVL_PHASE_COUNT) ? NAMES[phase] : "?";
}
#endif

bool ivl_motors_latched_off(const ivl_state_t *state)
{
    return (state->phase != IVL_PHASE_IDLE) && (ivl_phase_drive(state) == IVL_DRIVE_OFF);
}
