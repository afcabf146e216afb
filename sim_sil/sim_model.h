/// @file sim_model.h
/// The constant side of the world: raw parameters, and everything that follows from them, computed here and only here.
///
/// Frames: W world, z up unless the model says otherwise; B body, x forward, y left, z up.  Legs and motors are numbered
/// 1 front-right, 2 rear-right, 3 rear-left, 4 front-left; index 0..3.  SI, radians.
#ifndef IVL_SIM_MODEL_H
#define IVL_SIM_MODEL_H

#include <stdbool.h>
#include <stddef.h>

#include "ivl.h"
#include "phys_math.h"
#include "phys_surface.h"
#include "sim_core.h"
#include "sim_eye.h"
#include "sim_params.h"

enum
{
    IVL_SIM_LEGS = 4,
    IVL_SIM_MOTORS = 4,
    IVL_SIM_CORNERS = 8,  ///< of a plate
    IVL_SIM_PLATES = 2,
    IVL_SIM_PROP_PLATE = 0,
    IVL_SIM_BASE_PLATE = 1,
};

typedef struct
{
    ivl_d3_t corner_B_m[IVL_SIM_CORNERS];
    double   half_m[3];  ///< half sizes
    double   center_z_m;
} ivl_sim_plate_t;

/// A leg is a uniform rod between two nodes, hip and foot; its mass matrix is that of the linear rod element, exact for a
/// rigid rod: kinetic energy = (hip v_h^2 + 2 cross v_h.v_f + foot v_f^2) / 2.              [MODEL eq. 4.1]
typedef struct
{
    ivl_d3_t hip_B_m[IVL_SIM_LEGS];     ///< pivots
    ivl_d3_t rest_B[IVL_SIM_LEGS];      ///< unit vector of the leg at rest
    ivl_d3_t inplane_B[IVL_SIM_LEGS];   ///< unit vector in the leg's vertical plane, direction of growing psi
    ivl_d3_t sideways_B[IVL_SIM_LEGS];  ///< unit vector across that plane, axis of the first hinge
    double   mass_hip_kg;               ///< m / 3
    double   mass_cross_kg;             ///< m / 6
    double   mass_foot_kg;              ///< m / 3 + foot
    double   weight_hip_kg;             ///< m / 2: share of the weight that acts at the hip
    double   weight_foot_kg;            ///< m / 2 + foot
    double   moment_pivot_kgm2;         ///< moment of inertia about the hip
} ivl_sim_leg_model_t;

/// What bounds an integration step: the fastest motion of the vehicle, by its rate of damping g and its frequency w.
typedef struct
{
    double swing_damping_per_s;   ///< g of the fastest swing of a free leg, near rest                 [MODEL eq. 7.7]
    double swing_quarter_per_s2;  ///< w^2 / 4 of it
    double stuck_norm;            ///< share of these that a leg with a stuck foot has, at most
    double damping_per_s;         ///< g of what is slower: drag, joints of stuck feet                 [MODEL eq. 7.9]
    double drift_per_s2;          ///< bound of (dt w)^2 (w^2 + swing^2) for a rod that turns at w        [MODEL eq. 7.10]
    double longest_s;             ///< at which the stabilisation of the rods' lengths is stable
    double shortest_s;            ///< no step is chosen shorter than this, but for those that end at an event
    double evaluations_per_s;     ///< evaluations of the forces that a second of motion may take,
    double evaluations_at_once;   ///< and those that any motion may take on top, for what happens at one instant
} ivl_sim_step_limits_t;

/// Second-order low-pass: y = b0 x0 + b1 x1 + b2 x2 - a0 y1 - a1 y2.
typedef struct
{
    bool   on;
    double b[3], a[2];
} ivl_sim_lowpass_t;

/// Which sensors of one number there are: see world_reading.h.
typedef struct ivl_sim_reading_table ivl_sim_reading_table_t;

typedef struct
{
    ivl_sim_params_t    raw;
    ivl_sim_leg_model_t leg;
    ivl_sim_plate_t     plate[IVL_SIM_PLATES];
    ivl_sim_surface_t   surface;  ///< to land on; of `raw` a ceiling at rest
    ivl_d3_t            up_W;     ///< unit vector against gravity, whose strength is raw.world_gravity_mps2; of `raw` z
    double rotor_x_m[IVL_SIM_MOTORS], rotor_y_m[IVL_SIM_MOTORS], rotor_spin[IVL_SIM_MOTORS];  ///< spin: sign of the torque on B
    double mass_total_kg;
    double rotor_speed_max_radps;
    double rotor_speed_hover_radps;
    double leg_frequency_radps;  ///< of a leg swinging about its hip, body held
    double leg_damping_ratio;
    double reach_m;  ///< largest distance of any point of the vehicle from the body origin
    ivl_sim_step_limits_t          step;
    ivl_cfg_t                      firmware;
    double                         tick_s;  ///< of the firmware
    ivl_sim_lowpass_t              gyro_lowpass, accel_lowpass;
    const ivl_sim_reading_table_t *readings;      ///< sensors of one number beside the state estimate
    bool                           has_readings;  ///< some of them is switched on
    ivl_sim_core_t                 core;          ///< where the firmware runs
    ivl_sim_eye_t                  eye;           ///< the camera of camera.rate, once it has been given a surface to look at
} ivl_sim_model_t;

/// Checks raw parameters and derives the model.
/// @param[in] firmware  flight parameters; those that describe the vehicle and the ceiling are overwritten from `raw`
/// @param[out] error    one line naming the parameter, its value and the allowed range, if the result is false
bool ivl_sim_model_init(ivl_sim_model_t *model, const ivl_sim_params_t *raw, const ivl_cfg_t *firmware, char *error, size_t error_size);

#endif  // IVL_SIM_MODEL_H
