/// @file phys_rotor.h
/// Four rotors on one battery: lag on the rotor speed, thrust and torque proportional to its square, speed limited by the voltage.
/// Several vehicles stand side by side in the lanes of each number.
#ifndef IVL_PHYS_ROTOR_H
#define IVL_PHYS_ROTOR_H

#include "phys_state.h"

/// What the air at the rotors depends on.
typedef struct
{
    ivl_wide_t        gap_m;     ///< from the body origin to the surface
    const ivl_w3_t   *v_WB_mps;  ///< velocity of the body origin
    const ivl_wide_t *q_WB;      ///< x, y, z, w
} ivl_sim_airflow_t;

typedef struct
{
    ivl_wide_t speed_radps[IVL_SIM_MOTORS];
    ivl_wide_t command_radps[IVL_SIM_MOTORS];
    ivl_wide_t scatter[IVL_SIM_MOTORS];  ///< factor on each thrust, 1 without scatter
    ivl_wide_t open_circuit_V;           ///< of the battery, without load; 0: a supply that never sags
} ivl_sim_rotors_t;

/// Rotors of one vehicle that hover, and stay there.
void ivl_sim_rotor_init(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, int lane);

/// The same speeds, and commands, in one lane.
void ivl_sim_rotor_set(ivl_sim_rotors_t *rotors, int lane, const double radps[IVL_SIM_MOTORS]);

/// New thrust commands in the lanes that `which` names, N per motor; beyond [0, thrust_max] they saturate.  The battery's present voltage scales
/// what comes of them.                                                                            [MODEL eq. 2.6 - 2.8]
void ivl_sim_rotor_command(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, const ivl_mask_t *which, const ivl_wide_t thrust_N[4]);

/// Voltage under the load of the present rotor speeds, V; 0 for a supply that never sags.         [MODEL eq. 2.6]
double ivl_sim_rotor_voltage(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors, int lane);

/// Vehicles of which a rotor turns or is told to; the others have nothing to advance.
ivl_mask_t ivl_sim_rotor_turn(const ivl_sim_rotors_t *rotors);

/// Advances the rotors of all lanes, each by its own dt.                                         [MODEL eq. 2.3, 2.4, 2.9]
/// @param[in] flow   motion of the bodies at the start of the step, for ceiling effect and inflow
/// @param[out] next  rotors after the step; may be `rotors`
/// @param[out] load  force and moment on the body, each averaged over dt
void ivl_sim_rotor_step(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors, const ivl_sim_airflow_t *flow, const ivl_wide_t *dt_s,
                        ivl_sim_rotors_t *next, ivl_sim_load_t *load);

#endif  // IVL_PHYS_ROTOR_H
