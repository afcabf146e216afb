/// @file phys_state.h
/// State of motion: coordinates are pose and velocity of the body, and position and velocity of each foot.  [MODEL sec. 4]
/// Several rollouts stand side by side in the lanes of each number.
#ifndef IVL_PHYS_STATE_H
#define IVL_PHYS_STATE_H

#include "sim_model.h"

/// State of several vehicles; W world axes, B body axes.
typedef struct
{
    ivl_w3_t   p_WB_m;
    ivl_w3_t   v_WB_mps;
    ivl_w3_t   w_B_radps;
    ivl_wide_t q_WB[4];    ///< x, y, z, w
    ivl_wide_t pitch_rad;  ///< nose-up rotation about b_y, unwrapped: the integral of -w_y
    ivl_w3_t   p_foot_W_m[IVL_SIM_LEGS];
    ivl_w3_t   v_foot_W_mps[IVL_SIM_LEGS];
} ivl_sim_state_t;

/// State of one vehicle: a lane of an ivl_sim_state_t.
typedef struct
{
    double p_WB_m[3], v_WB_mps[3], w_B_radps[3], q_WB[4], pitch_rad;
    double p_foot_W_m[IVL_SIM_LEGS][3], v_foot_W_mps[IVL_SIM_LEGS][3];
} ivl_sim_kin_t;

/// What acts on the vehicles and does not change during one step.
typedef struct
{
    ivl_wide_t thrust_N;  ///< along body z
    ivl_w3_t   torque_B_Nm;
    ivl_wide_t surface_height_m;  ///< in the middle of the step, along the surface's normal
} ivl_sim_load_t;

/// Accelerations, and what else an evaluation finds.
typedef struct
{
    ivl_w3_t   a_WB_mps2;
    ivl_w3_t   alpha_B_radps2;
    ivl_w3_t   a_foot_W_mps2[IVL_SIM_LEGS];
    ivl_wide_t pull_N[IVL_SIM_LEGS];       ///< pull of a held foot away from the surface; < 0 presses
    ivl_wide_t overlap_m[IVL_SIM_PLATES];  ///< highest point of a plate above the surface; > 0 presses
    ivl_wide_t swing_norm;                 ///< inverse inertia of the fastest swing of a leg, over that of a free leg at rest
    ivl_wide_t turn2_per_s2;               ///< square of the rate at which the fastest rod turns
    ivl_wide_t stretch_norm;               ///< largest error of a rod's length, over the length
} ivl_sim_rate_t;

/// Reads and writes one vehicle.
void ivl_sim_lane_get(const ivl_sim_state_t *state, int lane, ivl_sim_kin_t *kin);
void ivl_sim_lane_set(ivl_sim_state_t *state, int lane, const ivl_sim_kin_t *kin);

/// Copies one lane from another state, or other rates.
void ivl_sim_state_lane_copy(ivl_sim_state_t *to, const ivl_sim_state_t *from, int lane);
void ivl_sim_rate_lane_copy(ivl_sim_rate_t *to, const ivl_sim_rate_t *from, int lane);

/// All rates of a lane become 0.
void ivl_sim_rate_lane_clear(ivl_sim_rate_t *rate, int lane);

/// Writes one vehicle into all lanes.
void ivl_sim_lane_spread(ivl_sim_state_t *state, const ivl_sim_kin_t *kin);

#endif  // IVL_PHYS_STATE_H
