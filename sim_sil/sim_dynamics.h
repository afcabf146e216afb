/// @file sim_dynamics.h
/// Rigid body with four articulated legs: accelerations, the impulse of a sticking foot, energy, momentum.
///
/// Coordinates: pose and velocity of the body, and position and velocity of each foot; one length constraint a leg.  A
/// stuck foot is a foot of infinite mass: its inverse mass is set to zero, and the same equations hold.  [MODEL sec. 4]
/// Eight rollouts stand side by side in the lanes of each number.
#ifndef IVL_SIM_DYNAMICS_H
#define IVL_SIM_DYNAMICS_H

#include "sim_model.h"

/// Stabilisation of the length constraints: their error decays at this rate.  It only removes what truncation and rounding
/// leave; the motion does not depend on it.                                                        [MODEL eq. 4.7]
#define IVL_SIM_STABILISATION_PER_S 150.0

/// Near +-90 degrees sideways the first hinge's axis falls into the rod (gimbal lock of the universal joint): its lever arm
/// cos(beta) is kept above this value.
#define IVL_SIM_COS_SIDEWAYS_MIN 0.05

/// State of eight vehicles; W world axes, B body axes.
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

/// State of one vehicle.  The same numbers in the same order: lane i of an ivl_sim_state_t is one of these.
typedef struct
{
    double p_WB_m[3], v_WB_mps[3], w_B_radps[3], q_WB[4], pitch_rad;
    double p_foot_W_m[IVL_SIM_LEGS][3], v_foot_W_mps[IVL_SIM_LEGS][3];
} ivl_sim_kin_t;

_Static_assert(sizeof(ivl_sim_state_t) == IVL_SIM_LANES * sizeof(ivl_sim_kin_t), "a lane is a vehicle");

typedef enum
{
    IVL_SIM_FOOT_FREE,
    IVL_SIM_FOOT_SLIDING,  ///< pressed on the ceiling, not yet stuck
    IVL_SIM_FOOT_STUCK,
} ivl_sim_foot_t;

enum
{
    IVL_SIM_PACKED = 21  ///< upper triangle of a symmetric 6 x 6 matrix, row by row
};

/// Which feet hold on, and what follows from it.  Changes at an event only.
typedef struct
{
    ivl_wide_t inverse_mass[IVL_SIM_LEGS];  ///< of the foot, 1/kg; 0 when stuck
    ivl_wide_t sliding[IVL_SIM_LEGS];       ///< 1 for a sliding foot, else 0
    ivl_wide_t mass6[IVL_SIM_PACKED];       ///< body and hip ends of the legs, about the body origin, body axes
    ivl_wide_t inverse_mass6[IVL_SIM_PACKED];
    bool       any_sliding;  ///< in any lane
} ivl_sim_contact_t;

/// Forces that are constant during one step.
typedef struct
{
    ivl_wide_t thrust_N;  ///< along body z
    ivl_w3_t   torque_B_Nm;
} ivl_sim_load_t;

/// Accelerations, and what else an evaluation finds.
typedef struct
{
    ivl_w3_t   a_WB_mps2;
    ivl_w3_t   alpha_B_radps2;
    ivl_w3_t   a_foot_W_mps2[IVL_SIM_LEGS];
    ivl_wide_t pull_N[IVL_SIM_LEGS];       ///< pull of a held foot away from the ceiling; < 0 presses
    ivl_wide_t overlap_m[IVL_SIM_PLATES];  ///< highest point of a plate above the ceiling; > 0 presses
    ivl_wide_t swing_norm;                 ///< inverse inertia of the fastest swing of a leg, over that of a free leg at rest
    ivl_wide_t turn2_per_s2;               ///< square of the rate at which the fastest rod turns
    ivl_wide_t stretch_norm;               ///< largest error of a rod's length, over the length
} ivl_sim_rate_t;

void ivl_sim_lane_get(const ivl_sim_state_t *state, int lane, ivl_sim_kin_t *kin);
void ivl_sim_lane_set(ivl_sim_state_t *state, int lane, const ivl_sim_kin_t *kin);

/// Tells lane `lane` which feet hold on.
void ivl_sim_contact_set(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, int lane, const ivl_sim_foot_t foot[IVL_SIM_LEGS]);

/// One step of every lane, each of its own length: leapfrog with one evaluation, at the middle of the step, with the
/// velocities there predicted from the last one.  dt = 0 evaluates without moving, to begin.     [MODEL eq. 7.1 - 7.5]
/// @param[in] last   of the lane's previous step, or of a step of length 0 after a discontinuity
/// @param[out] next, rate
void ivl_sim_leapfrog(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load, const ivl_wide_t *dt_s,
                      const ivl_sim_state_t *state, const ivl_sim_rate_t *last, ivl_sim_state_t *next, ivl_sim_rate_t *rate);

/// Velocities after held feet that still move are brought to rest at once, without rebound: the projection of the
/// motion, in the metric of the kinetic energy, on what the constraints allow.                   [MODEL eq. 4.14]
void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_foot_t foot[IVL_SIM_LEGS], ivl_sim_kin_t *kin);

/// Kinetic, gravitational and elastic energy, J.                                                 [MODEL eq. 4.15]
double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin);

/// Linear momentum, and angular momentum about the world's origin, SI.
void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double linear[3], double angular[3]);

/// Height of the highest point of a plate above the body origin.
/// @param[in] up  the world's z axis in body axes
double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t up);

#endif  // IVL_SIM_DYNAMICS_H
