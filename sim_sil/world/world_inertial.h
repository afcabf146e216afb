/// @file world_inertial.h
/// What a vehicle makes of its own gyro and accelerometer: low-passes of the autopilot, attitude by integration, dead reckoning.
#ifndef IVL_WORLD_INERTIAL_H
#define IVL_WORLD_INERTIAL_H

#include "phys_state.h"
#include "sim_rng.h"

/// Three axes behind a second-order Butterworth low-pass, as state of the transposed direct form II.
typedef struct
{
    double s1[3], s2[3];
} ivl_sim_lowpass_state_t;

/// What the vehicle believes without any sensor that looks outside.
typedef struct
{
    double q_WB[4];
    double p_W_m[3], v_W_mps[3];
    double w_last_B_radps[3];
} ivl_sim_reckoning_t;

/// A low-pass that has seen x for ever.
void ivl_sim_lowpass_settle(const ivl_sim_lowpass_t *filter, const double x[3], ivl_sim_lowpass_state_t *state);

/// One sample, in place; nothing happens if the filter is off.
void ivl_sim_lowpass_apply(const ivl_sim_lowpass_t *filter, ivl_sim_lowpass_state_t *state, double x[3]);

/// Start at the truth, off by this rollout's errors (sense.start_*).
void ivl_sim_reckoning_start(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state,
                             ivl_sim_reckoning_t *reckoning);

/// Turn the attitude by one tick of the measured rate (mean of this and the last one).
void ivl_sim_reckoning_turn(const ivl_sim_model_t *model, const double w_B_radps[3], ivl_sim_reckoning_t *reckoning);

/// Move by one tick of the measured specific force, taken at the attitude that the autopilot believes.        [MODEL eq. 13.18]
void ivl_sim_reckoning_move(const ivl_sim_model_t *model, const double q_WB[4], const double f_B_mps2[3], ivl_sim_reckoning_t *reckoning);

#endif  // IVL_WORLD_INERTIAL_H
