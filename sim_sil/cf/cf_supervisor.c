#include "cf_supervisor.h"

#include <math.h>
#include <string.h>

/// The switch of the tumble check: a parameter of the supervisor, and written by the app.
extern uint8_t tumbleCheckEnabled;
uint8_t        tumbleCheckEnabled = 1;

// what counts as tumbled: tilted for long, or upside down for a while
static const float    TILTED_G = 0.5f;
static const uint32_t TILTED_MS = 1000;
static const float    UPSIDE_DOWN_G = -0.2f;
static const uint32_t UPSIDE_DOWN_MS = 100;
static const float    FREE_FALL_G = 0.1f;

static const uint32_t SETPOINT_OLD_MS = 500;
static const uint32_t SETPOINT_DEAD_MS = 2000;
static const uint32_t WATCHDOG_MS = 1000;
static const uint32_t FLYING_MS = 2000;  // since a motor last ran

// ---- the machine

typedef struct
{
    ivl_cf_state_t from;
    uint32_t       set;    // all of these hold
    uint32_t       clear;  // and none of these
    ivl_cf_state_t to;
} exit_t;

// the first row that fits is taken; row by row those of the stock firmware, but for decks and for motors that report their speed
static const exit_t EXITS[] = {
    {IVL_CF_STATE_BOOT, 0, 0, IVL_CF_STATE_CHECKS_FAILED},

    {IVL_CF_STATE_CHECKS_FAILED, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_CHECKS_FAILED, 0, IVL_CF_COND_TUMBLED, IVL_CF_STATE_CHECKS_PASSED},

    {IVL_CF_STATE_CHECKS_PASSED, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_CHECKS_PASSED, IVL_CF_COND_TUMBLED, 0, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_CHECKS_PASSED, IVL_CF_COND_ARMED, 0, IVL_CF_STATE_ARMING},

    {IVL_CF_STATE_ARMING, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_ARMING, IVL_CF_COND_TUMBLED, 0, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_ARMING, 0, IVL_CF_COND_ARMED, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_ARMING, 0, 0, IVL_CF_STATE_READY},

    {IVL_CF_STATE_READY, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_READY, IVL_CF_COND_TUMBLED, 0, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_READY, IVL_CF_COND_PREFLIGHT_OVER, 0, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_READY, 0, IVL_CF_COND_ARMED, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_READY, IVL_CF_COND_FLYING, 0, IVL_CF_STATE_FLYING},

    {IVL_CF_STATE_FLYING, IVL_CF_COND_SETPOINT_DEAD, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_FLYING, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_FLYING, IVL_CF_COND_TUMBLED, 0, IVL_CF_STATE_CRASHED},
    {IVL_CF_STATE_FLYING, 0, IVL_CF_COND_ARMED, IVL_CF_STATE_RESET},
    {IVL_CF_STATE_FLYING, IVL_CF_COND_SETPOINT_OLD, 0, IVL_CF_STATE_LEVEL_OUT},
    {IVL_CF_STATE_FLYING, 0, IVL_CF_COND_FLYING, IVL_CF_STATE_LANDED},

    {IVL_CF_STATE_LANDED, IVL_CF_COND_LANDED_OVER, 0, IVL_CF_STATE_RESET},
    {IVL_CF_STATE_LANDED, 0, IVL_CF_COND_ARMED, IVL_CF_STATE_RESET},
    {IVL_CF_STATE_LANDED, IVL_CF_COND_FLYING, 0, IVL_CF_STATE_FLYING},

    {IVL_CF_STATE_RESET, 0, 0, IVL_CF_STATE_CHECKS_FAILED},

    {IVL_CF_STATE_LEVEL_OUT, IVL_CF_COND_SETPOINT_DEAD, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_LEVEL_OUT, IVL_CF_COND_TUMBLED, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_LEVEL_OUT, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_EXCEPTION},
    {IVL_CF_STATE_LEVEL_OUT, 0, IVL_CF_COND_SETPOINT_OLD | IVL_CF_COND_SETPOINT_DEAD, IVL_CF_STATE_FLYING},

    {IVL_CF_STATE_EXCEPTION, 0, 0, IVL_CF_STATE_LOCKED},

    {IVL_CF_STATE_CRASHED, 0, IVL_CF_COND_CRASHED | IVL_CF_COND_TUMBLED, IVL_CF_STATE_CHECKS_FAILED},
    {IVL_CF_STATE_CRASHED, IVL_CF_COND_ESTOP, 0, IVL_CF_STATE_LOCKED},
};

static const char *const NAMES[] = {
    [IVL_CF_STATE_BOOT] = "Not initialized",
    [IVL_CF_STATE_CHECKS_FAILED] = "Pre-flight checks not passed",
    [IVL_CF_STATE_CHECKS_PASSED] = "Pre-flight checks passed",
    [IVL_CF_STATE_ARMING] = "Arming",
    [IVL_CF_STATE_READY] = "Ready to fly",
    [IVL_CF_STATE_FLYING] = "Flying",
    [IVL_CF_STATE_LANDED] = "Landed",
    [IVL_CF_STATE_RESET] = "Reset",
    [IVL_CF_STATE_LEVEL_OUT] = "Warning, level out",
    [IVL_CF_STATE_EXCEPTION] = "Exception",
    [IVL_CF_STATE_LOCKED] = "Locked",
    [IVL_CF_STATE_CRASHED] = "Crashed",
};
_Static_assert(sizeof NAMES / sizeof NAMES[0] == IVL_CF_STATE_COUNT, "a name for each state");

ivl_cf_state_t ivl_cf_supervisor_next(ivl_cf_state_t state, uint32_t conditions)
{
    for (size_t i = 0; i < sizeof EXITS / sizeof EXITS[0]; i++)
    {
        const exit_t *e = &EXITS[i];
        if (e->from == state && (conditions & e->set) == e->set && (conditions & e->clear) == 0u)
        {
            return e->to;
        }
    }
    return state;
}

const char *ivl_cf_supervisor_name(ivl_cf_state_t state)
{
    return ((unsigned)state < (unsigned)IVL_CF_STATE_COUNT) ? NAMES[state] : "?";
}

// ---- conditions

static bool is_tumbled(ivl_cf_supervisor_t *s, const ivl_cf_supervisor_in_t *in)
{
    const float *a = in->acc_g;
    s->force_g = sqrtf(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    if (s->crash_g > 0.0f && fabsf(s->force_g - 1.0f) > s->crash_g)
    {
        return true;
    }
    const bool falls = fabsf(a[0]) < FREE_FALL_G && fabsf(a[1]) < FREE_FALL_G && fabsf(a[2]) < FREE_FALL_G;
    if (falls || a[2] >= TILTED_G)
    {
        // the clock stands; a free fall starts it anew
        s->has_tumble = falls && a[2] < TILTED_G;
        s->t_tumble_ms = in->now_ms;
        return false;
    }
    if (!s->has_tumble)
    {
        s->has_tumble = true;
        s->t_tumble_ms = in->now_ms;
    }
    const uint32_t since_ms = in->now_ms - s->t_tumble_ms;
    return (a[2] < UPSIDE_DOWN_G && since_ms > UPSIDE_DOWN_MS) || since_ms > TILTED_MS;
}

static bool is_flying(ivl_cf_supervisor_t *s, const ivl_cf_supervisor_in_t *in)
{
    if (in->motors_run)
    {
        s->has_thrust = true;
        s->t_thrust_ms = in->now_ms;
    }
    return s->has_thrust && in->now_ms - s->t_thrust_ms < FLYING_MS;
}

static uint32_t bit(bool holds, uint32_t condition)
{
    return holds ? condition : 0u;
}

static uint32_t conditions(ivl_cf_supervisor_t *s, const ivl_cf_supervisor_in_t *in)
{
    const bool tumbled = is_tumbled(s, in) && tumbleCheckEnabled != 0u;
    const bool late = s->has_watchdog && in->now_ms - s->t_watchdog_ms >= WATCHDOG_MS;
    const bool waited = s->state == IVL_CF_STATE_READY && in->now_ms - s->t_ready_ms > s->preflight_ms_max;
    const bool rested = s->state == IVL_CF_STATE_LANDED && in->now_ms - s->t_landed_ms > s->landed_ms_max;
    return bit(s->armed, IVL_CF_COND_ARMED) | bit(is_flying(s, in), IVL_CF_COND_FLYING) | bit(tumbled, IVL_CF_COND_TUMBLED) |
           bit(in->setpoint_age_ms > SETPOINT_OLD_MS, IVL_CF_COND_SETPOINT_OLD) |
           bit(in->setpoint_age_ms > SETPOINT_DEAD_MS, IVL_CF_COND_SETPOINT_DEAD) |
           bit(late || s->estop || s->stop != 0u, IVL_CF_COND_ESTOP) | bit(s->crashed, IVL_CF_COND_CRASHED) |
           bit(waited, IVL_CF_COND_PREFLIGHT_OVER) | bit(rested, IVL_CF_COND_LANDED_OVER);
}

// ---- what a new state brings

static void enter(ivl_cf_supervisor_t *s, uint32_t now_ms)
{
    if (s->state == IVL_CF_STATE_READY)
    {
        s->t_ready_ms = now_ms;
    }
    if (s->state == IVL_CF_STATE_LANDED)
    {
        s->t_landed_ms = now_ms;
    }
    s->crashed = s->crashed || s->state == IVL_CF_STATE_CRASHED;
    if (!ivl_cf_supervisor_motors_allowed(s))
    {
        s->armed = false;
    }
    if (s->state == IVL_CF_STATE_CHECKS_PASSED && s->auto_arm != 0u)
    {
        s->armed = true;
    }
}

bool ivl_cf_supervisor_update(ivl_cf_supervisor_t *s, const ivl_cf_supervisor_in_t *in)
{
    s->conditions = conditions(s, in);
    s->tumbled = (s->conditions & IVL_CF_COND_TUMBLED) != 0u;
    const ivl_cf_state_t before = s->state;
    s->state = ivl_cf_supervisor_next(before, s->conditions);
    if (s->state != before)
    {
        enter(s, in->now_ms);
    }
    return s->state != before;
}

// ---- requests

void ivl_cf_supervisor_init(ivl_cf_supervisor_t *s)
{
    *s = (ivl_cf_supervisor_t){.auto_arm = 1, .preflight_ms_max = 30000, .landed_ms_max = 3000};
    tumbleCheckEnabled = 1;
}

void ivl_cf_supervisor_fly(ivl_cf_supervisor_t *s, uint32_t now_ms)
{
    *s = (ivl_cf_supervisor_t){
        .auto_arm = s->auto_arm,
        .preflight_ms_max = s->preflight_ms_max,
        .landed_ms_max = s->landed_ms_max,
        .crash_g = s->crash_g,
        .state = IVL_CF_STATE_FLYING,
        .armed = true,
        .has_thrust = true,
        .t_thrust_ms = now_ms,
    };
}

bool ivl_cf_supervisor_arm(ivl_cf_supervisor_t *s, bool arm)
{
    if (arm != s->armed && arm && s->state != IVL_CF_STATE_CHECKS_PASSED)
    {
        return false;
    }
    s->armed = arm;
    return true;
}

bool ivl_cf_supervisor_recover(ivl_cf_supervisor_t *s)
{
    if (s->crashed && s->tumbled)
    {
        return false;
    }
    s->crashed = false;
    return true;
}

void ivl_cf_supervisor_watchdog(ivl_cf_supervisor_t *s, uint32_t now_ms)
{
    s->has_watchdog = true;
    s->t_watchdog_ms = now_ms;
}

bool ivl_cf_supervisor_motors_allowed(const ivl_cf_supervisor_t *s)
{
    return s->state == IVL_CF_STATE_ARMING || ivl_cf_supervisor_can_fly(s);
}

bool ivl_cf_supervisor_can_fly(const ivl_cf_supervisor_t *s)
{
    return s->state == IVL_CF_STATE_READY || s->state == IVL_CF_STATE_FLYING || s->state == IVL_CF_STATE_LEVEL_OUT ||
           s->state == IVL_CF_STATE_LANDED;
}

bool ivl_cf_supervisor_is_flying(const ivl_cf_supervisor_t *s)
{
    return s->state == IVL_CF_STATE_FLYING || s->state == IVL_CF_STATE_LEVEL_OUT;
}

uint16_t ivl_cf_supervisor_bits(const ivl_cf_supervisor_t *s)
{
    const bool bits[] = {s->state == IVL_CF_STATE_CHECKS_PASSED,
                         s->armed,
                         s->auto_arm != 0u,
                         ivl_cf_supervisor_can_fly(s),
                         ivl_cf_supervisor_is_flying(s),
                         s->tumbled,
                         s->state == IVL_CF_STATE_LOCKED,
                         s->crashed};
    uint16_t   info = 0;
    for (size_t i = 0; i < sizeof bits / sizeof bits[0]; i++)
    {
        info = (uint16_t)(info | (bits[i] ? 1u << i : 0u));
    }
    return info;
}
