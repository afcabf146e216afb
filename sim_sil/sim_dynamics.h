/// @file sim_dynamics.h
/// Rigid body with four articulated legs: accelerations, impulses of a sticking foot, energy, one Runge-Kutta step.
///
/// Coordinates: pose and velocity of the body, and position and velocity of each foot; one length constraint a leg.  A
/// stuck foot is a foot of infinite mass: its inverse mass is set to zero, and the same equations hold.  [MODEL sec. 4]
#ifndef IVL_SIM_DYNAMICS_H
#define IVL_SIM_DYNAMICS_H

#include "sim_model.h"

/// Everything that is integrated.  40 doubles, so that a Runge-Kutta stage is ten four-lane operations.
typedef struct
{
    double p_WB_m[3];
    double pitch_rad; ///< nose-up rotation about b_y, unwrapped: the integral of -w_y
    double v_WB_mps[3];
    double pad_v;
    double q_WB[4]; ///< x, y, z, w
    double w_B_radps[3];
    double pad_w;
    double p_foot_W_m[3][IVL_SIM_LEGS];
    double v_foot_W_mps[3][IVL_SIM_LEGS];
} ivl_sim_kin_t;

typedef enum
{
    IVL_SIM_FOOT_FREE,
    IVL_SIM_FOOT_SLIDING, ///< pressed on the ceiling, not yet stuck
    IVL_SIM_FOOT_STUCK,
} ivl_sim_foot_t;

/// Which feet hold on, and what follows from it.  Rebuilt by ivl_sim_contact_set() at an event, constant in between.
typedef struct
{
    ivl_sim_foot_t foot[IVL_SIM_LEGS];
    double inverse_mass[IVL_SIM_LEGS]; ///< of the foot node, 1/kg; 0 when stuck
    double sliding[IVL_SIM_LEGS];      ///< 1 for a sliding foot, else 0
    bool any_sliding;
    double mass[6][6];         ///< body and hip ends of the legs, about the body origin, body axes
    double inverse_mass6[6][6]; ///< of `mass`
} ivl_sim_contact_t;

/// Forces that are constant during one step.
typedef struct
{
    double thrust_N;          ///< along body z, at the body origin
    double torque_B_Nm[3];
} ivl_sim_load_t;

/// What an evaluation finds besides the accelerations.
typedef struct
{
    double a_WB_mps2[3];                 ///< of the body origin, world axes
    double pull_N[IVL_SIM_LEGS];         ///< pull of a held foot away from the ceiling; < 0 presses
    bool plate_touches[IVL_SIM_PLATES];
} ivl_sim_forces_t;

void ivl_sim_contact_init(const ivl_sim_model_t *model, ivl_sim_contact_t *contact);
void ivl_sim_contact_set(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, int leg, ivl_sim_foot_t foot);

/// Time derivative of the state.  `rate` has the layout of the state.                         [MODEL eq. 4.9 - 4.12]
void ivl_sim_rate(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                  const ivl_sim_kin_t *state, ivl_sim_kin_t *rate, ivl_sim_forces_t *forces);

/// One classical Runge-Kutta step of length dt_s; `rate` is ivl_sim_rate() at the start.
void ivl_sim_rk4(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                 const ivl_sim_kin_t *rate, double dt_s, const ivl_sim_kin_t *state, ivl_sim_kin_t *next);

/// Velocities after feet of `contact` that move are brought to rest at once, without rebound: the projection of the
/// motion, in the metric of the kinetic energy, on what the new constraints allow.             [MODEL eq. 4.14]
void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, ivl_sim_kin_t *state);

/// Kinetic, gravitational and elastic energy, J.                                               [MODEL eq. 4.15]
double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *state);

/// Linear momentum (3) and angular momentum about the world's origin (3), SI.
void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *state, double linear[3], double angular[3]);

/// Height of the highest point of a plate minus that of the ceiling: > 0 while it presses.
double ivl_sim_plate_overlap(const ivl_sim_model_t *model, const ivl_sim_kin_t *state, int plate);

#endif // IVL_SIM_DYNAMICS_H
