/// @file ivl.h
/// Inverted landing, flight core: the whole API.  Portable C11; no heap, no globals, no clock, no I/O; single precision only.
/// The caller owns four structs: cfg (constant), state (the core's memory), in (one tick's input), out (one tick's output).
/// One instance is not re-entrant; separate instances are independent.  Build with contraction of floating-point expressions off.
///
///     ivl_cfg_t cfg;     ivl_cfg_defaults(&cfg);          // then change what differs
///     ivl_state_t state; ivl_init(&cfg, &state);          // ivl_cfg_check(&cfg) says whether it is good
///     ivl_policy_commit(&cfg, &state, &policy);
///     for each tick: ivl_step(&cfg, &state, &in, &out);   // at cfg.tick_hz
///
/// To port it: docs/PORTING.md.
#ifndef IVL_H
#define IVL_H
#include <math.h>  // before the linkage of C is declared: in C++ it has templates
#ifdef __cplusplus
extern "C"
{
#endif
#include "ivl_guard.h"
#include "ivl_mixer.h"
#include "ivl_phase.h"
#include "ivl_policy.h"
#include "ivl_pwm.h"

/// The output of one tick.  Thrusts are finite and within [0, motor_thrust_N_max], always.
typedef struct
{
    float         thrust_N[4];      ///< M1 front-right, M2 rear-right, M3 rear-left, M4 front-left
    uint16_t      pwm[4];           ///< the same through the thrust curve
    ivl_phase_t   phase;            ///< after this tick's transitions
    uint8_t       phase_log;        ///< the same in one byte, for logs
    bool          motors_on;        ///< the phase drives the motors in this tick
    bool          stock_allowed;    ///< IDLE and not locked out: another controller may have the motors
    ivl_ceiling_t ceiling;          ///< invalid in phases that are latched off
    ivl_cues_t    cues;             ///< invalid in phases that are latched off
    float         pitch_moment_Nm;  ///< moment about b_y that thrust_N makes; negative is nose up
    float         thrust_total_N;
} ivl_out_t;

/// Start from IDLE with nothing remembered.  A bad configuration keeps the core in IDLE for ever.
/// The configuration must not change afterwards without another ivl_init or ivl_reconfigure.
void ivl_init(const ivl_cfg_t *cfg, ivl_state_t *state);

/// Put another configuration in force, in IDLE only.  As ivl_init, but the lock-out of other controllers, and the demand for a HOVER after a
/// landing, stay.
/// @return IVL_OK; or, with nothing changed, IVL_ERR_RANGE or IVL_ERR_PHASE
ivl_status_t ivl_reconfigure(ivl_cfg_t *cfg, ivl_state_t *state, const ivl_cfg_t *wanted);

/// Put a policy in force as a whole, or refuse it as a whole (counted in diag.n_policy_refused).
/// @return IVL_OK; what ivl_policy_check says; IVL_ERR_PHASE in any phase but IDLE and READY
ivl_status_t ivl_policy_commit(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy);

/// One tick: sensed state -> distance -> cues -> phase (with the trigger) -> maneuver or controller -> mixer -> PWM.
void ivl_step(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out);

#ifdef IVL_SIDE_BY_SIDE
/// For a simulator of many vehicles: ivl_step up to the thrusts of the tracking controller, which it computes for all of them at once, and
/// without what follows from the thrusts (pwm, pitch_moment_Nm, thrust_total_N: all 0).
/// @param[out] ref  what the controller is to follow, if the result is true
/// @return false: out->thrust_N is complete
bool ivl_step_decide(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out, ivl_reference_t *ref);
#endif
#ifdef __cplusplus
}
#endif
#endif  // IVL_H
