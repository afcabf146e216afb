/// @file ivl_guard.h
/// Safety rules as a table: one row a rule says in which phases it applies, on what condition, what follows, and whether
/// a flight that it ended may be scored.
/// None of them needs the host; none of them aborts a flip.  The phase table (ivl_phase.c) turns what follows into a phase.
#ifndef IVL_GUARD_H
#define IVL_GUARD_H
#include "ivl_state.h"

/// What follows when a rule holds.  In IDLE every rule that holds refuses to arm.
typedef enum
{
    IVL_ACT_NONE,
    IVL_ACT_REFUSE,  ///< stay in IDLE
    IVL_ACT_ABORT,   ///< level-out if it is in an approach, level hover, then landing
    IVL_ACT_ATTACH,  ///< motors off: contact or hanging was sensed
    IVL_ACT_CUT,     ///< motors off
    IVL_ACT_HOLD,    ///< the trigger does not fire in this tick
    IVL_ACT_LEVEL    ///< no-go: keep off the ceiling, then hover
} ivl_act_t;

/// First rule of the table that holds in the present phase, IVL_RULE_NONE if none does.  O(rules), no side effect.
ivl_rule_t ivl_guard_find(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen);

/// What follows from a rule; IVL_ACT_NONE for IVL_RULE_NONE and for a number that is none.
ivl_act_t ivl_guard_act(ivl_rule_t rule);

/// True if a flight that this rule ended says nothing about its policy: it is discarded, not scored.  IVL_RULE_NONE is of that kind: somebody
/// has asked for the end.
bool ivl_guard_discards(ivl_rule_t rule);

/// True if the row of this rule names this phase.
bool ivl_guard_applies(ivl_rule_t rule, ivl_phase_t phase);

#ifndef IVL_NO_TEXT
/// Lower-case name of a rule ("battery"), "?" for a number that is none.  Static storage.
const char *ivl_guard_name(ivl_rule_t rule);
#endif

/// Re-arm lock-out, once per tick after the phase is known.  It begins with the trigger, and when ABORTED has cut the motors.  It ends with a
/// new arm cycle, or in IDLE once the vehicle has rested upright for rearm_s while the autopilot around the core asks for no thrust.
void ivl_guard_lock_out(const ivl_cfg_t *cfg, ivl_state_t *state);
#endif  // IVL_GUARD_H
