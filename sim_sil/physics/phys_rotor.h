/// @file phys_rotor.h
/// Four rotors on one battery: lag on the rotor speed, thrust and torque proportional to its square, speed limited by the voltage.
#ifndef IVL_PHYS_ROTOR_H
#define IVL_PHYS_ROTOR_H

#include "sim_model.h"

/// Force and moment on the body, mean of one step.
typedef struct
{
    double thrust_N;  ///< along body z
    double torque_B_Nm[3];
} ivl_sim_thrust_t;

/// What the air at the rotors depends on.
typedef struct
{
    double gap_m;       ///< from the body origin to the surface
    double v_W_mps[3];  ///< its velocity
    double q_WB[4];
} ivl_sim_airflow_t;

typedef struct
{
    double speed_radps[IVL_SIM_MOTORS];
    double command_radps[IVL_SIM_MOTORS];
    double scatter[IVL_SIM_MOTORS];  ///< factor on each thrust, 1 without scatter
    double open_circuit_V;           ///< of the battery, without load; 0: a supply that never sags
    // of the last step: most steps are alike
    double dt_s;
    double decay_up, decay_down;  ///< exp(-dt/tau)
    double share_up, share_down;  ///< tau/dt
} ivl_sim_rotor_t;

/// Rotors that hover, and stay there.
void ivl_sim_rotor_init(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor);

/// New thrust commands, N per motor; beyond [0, thrust_max] they saturate.  The battery's present voltage scales what comes of them.
///                                                                                               [MODEL eq. 2.6 - 2.8]
void ivl_sim_rotor_command(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor, const float thrust_N[4]);

/// Voltage under the load of the present rotor speeds, V; 0 for a supply that never sags.         [MODEL eq. 2.6]
double ivl_sim_rotor_voltage(const ivl_sim_model_t *model, const ivl_sim_rotor_t *rotor);

/// No rotor turns or is told to: there is nothing to advance.
bool ivl_sim_rotor_still(const ivl_sim_rotor_t *rotor);

/// Advances the rotors by dt and returns force and moment, each averaged over dt.                [MODEL eq. 2.3, 2.4, 2.9]
/// @param[in] body  motion of the body at the start of the step, for ceiling effect and inflow
ivl_sim_thrust_t ivl_sim_rotor_step(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor, const ivl_sim_airflow_t *body, double dt_s);

#endif  // IVL_PHYS_ROTOR_H
