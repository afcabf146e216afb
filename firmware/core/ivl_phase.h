/// @file ivl_phase.h
/// Phases as a table: one row a phase says what the motors do, and the exits in order of priority.
#ifndef IVL_PHASE_H
#define IVL_PHASE_H
#include "ivl_state.h"

/// What drives the motors.
typedef enum
{
    IVL_DRIVE_OFF,
    IVL_DRIVE_HOVER,     ///< track state->p_hold_W_m
    IVL_DRIVE_APPROACH,  ///< track the approach path
    IVL_DRIVE_LAND,      ///< level out, if there is anything to; then track state->p_hold_W_m, which descends after a while
    IVL_DRIVE_LEVEL,     ///< rise without drive, then brake along the ceiling and hover below
    IVL_DRIVE_FLIP       ///< front pair makes the policy's moment
} ivl_drive_t;

/// Follow the exits of the table until the phase is stable (each phase at most once per tick), with the entry action of each phase.
void ivl_phase_update(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen);

/// What drives the motors in the present phase: the row's entry, but OFF in ABORTED once the vehicle was lost or has landed.
ivl_drive_t ivl_phase_drive(const ivl_state_t *state);

#ifndef IVL_NO_TEXT
/// Lower-case name of a phase ("approach"), "?" for a number that is none.  Static storage.
const char *ivl_phase_name(ivl_phase_t phase);
#endif

/// True if no motor can run again before a new request cycle (IDLE, then HOVER): in coast, attached, done, and in aborted once the
/// vehicle was lost or has landed.
bool ivl_motors_latched_off(const ivl_state_t *state);
#endif  // IVL_PHASE_H
