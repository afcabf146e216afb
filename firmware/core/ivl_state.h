/// @file ivl_state.h
/// Everything that the core remembers between ticks.  Owned by the caller, written only by the core.
#ifndef IVL_STATE_H
#define IVL_STATE_H
#include "ivl_contact.h"
#include "ivl_controller.h"
#include "ivl_distance.h"
#include "ivl_trigger.h"

/// Counters of events; they never decrease (they wrap after 2^32).
typedef struct
{
    uint32_t n_tick;
    uint32_t n_bad_pose;        ///< ticks whose sensed state was refused
    uint32_t n_bad_command;     ///< ticks whose command was refused
    uint32_t n_policy_refused;  ///< policies refused: form, range or phase
    uint32_t n_abort;           ///< entries into ABORTED
    uint32_t n_trigger;         ///< triggers fired
    uint32_t n_no_go;           ///< approaches called off: no-go, or no cue at the last moment
} ivl_diag_t;

/// What the safety rules remember.
typedef struct
{
    ivl_vitals_t vitals;      ///< this tick's
    uint8_t      rule;        ///< ivl_rule_t that holds in the present phase, 0 if none
    uint8_t      act;         ///< ivl_act_t that follows from it
    uint8_t      cause;       ///< ivl_rule_t that last ended a phase of this arm cycle, 0 if none did
    bool         locked_out;  ///< the vehicle may hang or lie anywhere: no other controller gets the motors
    float        rest_s;      ///< how long it has rested upright since
} ivl_guard_t;

/// Values that follow from the configuration, made once by ivl_init.
typedef struct
{
    float         dt_s;
    float         tan_tilt_cmd_max;
    float         cos_tilt_abort;
    ivl_surface_t surface;
    bool          cfg_good;  ///< false: ivl_cfg_check refused the configuration, the core stays in IDLE
} ivl_derived_t;

/// What was decided about this approach, go or no-go, and what it rests on.  The first five are zero before, but for `asked`.
typedef struct
{
    bool  asked;        ///< it is to be decided in this tick
    bool  made;         ///< it was decided; a go stands once there is no way back
    bool  go;           ///< the flip may start
    float p_land;       ///< probability of a landing that decided it, the lowest that was asked; 0: no cue was ever valid then
    float d_ceil_m;     ///< distance at which it was decided; likewise
    float room_m;       ///< so far the vehicle may still rise: from the last valid cue, carried on since
    float sure_m;       ///< and so much of that is not sure
    float v_close_mps;  ///< closing speed, carried on likewise
} ivl_decision_t;

/// What LEVEL_OUT remembers; ABORTED goes on with it.
typedef struct
{
    bool  rises;      ///< on the way up, from the begin of the approach on
    float h_m;        ///< height along the surface's normal at which to hover in the end
    float rest_s;     ///< how long the reference has been at rest there
    float along_mps;  ///< velocity of the reference along the surface, once the vehicle comes no nearer: forward
    float vy_mps;     ///< and to the left
} ivl_level_t;

typedef struct
{
    ivl_phase_t    phase;
    uint32_t       n_phase_tick;  ///< ticks spent in this phase
    bool           has_policy;    ///< a policy was committed
    bool           triggered;     ///< the trigger has fired in this arm cycle
    bool           abort_cut;     ///< ABORTED has lost the sensed state or has landed: motors stay off
    ivl_derived_t  derived;
    ivl_sense_t    sense;
    ivl_policy_t   policy;
    ivl_action_t   action;  ///< what the policy decided in the last tick of an approach
    ivl_decision_t decision;
    ivl_approach_t approach;
    ivl_level_t    level;
    ivl_vec3_t     p_hold_W_m;  ///< where READY, ABORTED and LEVEL_OUT hover
    float          landed_s;    ///< ABORTED: how long the reference has been at land_height
    ivl_guard_t    guard;
    ivl_contact_t  contact;
    ivl_snapshot_t snapshot;  ///< latched at the trigger tick, cleared when the next arm cycle starts
    ivl_diag_t     diag;
    ivl_distance_t distance;  ///< last, since it is the largest: offsets of the others stay short
} ivl_state_t;
#endif  // IVL_STATE_H
