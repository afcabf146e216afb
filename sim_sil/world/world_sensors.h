/// @file world_sensors.h
/// What the flight core is told: pose samples at a rate, late, noisy, held, or dead reckoning; attitude, gyro and accelerometer at each
/// tick; readings of further sensors.  Order of effects: low-pass, sampling, offset and noise, clipping, rounding, delay, loss.
#ifndef IVL_WORLD_SENSORS_H
#define IVL_WORLD_SENSORS_H

#include "world_inertial.h"
#include "world_reading.h"

enum
{
    IVL_SIM_POSE_QUEUE = 128  ///< samples under way: more than latency_max * rate_max
};

typedef struct
{
    double t_s;  ///< sampling instant
    double p_W_m[3], v_W_mps[3];
    bool   lost;
} ivl_sim_pose_t;

typedef struct
{
    double                  next_s;                     ///< next sampling instant
    uint32_t                n_taken, n_delivered;       ///< samples taken, and delivered to the core
    ivl_sim_pose_t          queue[IVL_SIM_POSE_QUEUE];  ///< by sample number modulo its size
    ivl_sim_pose_t          held;                       ///< last one delivered
    double                  v_last_W_mps[3];            ///< at the last tick: the accelerometer reads the mean force in between
    uint32_t                n_tick;
    double                  gyro_bias_radps[3], accel_bias_mps2[3];
    ivl_sim_lowpass_state_t gyro_lowpass, accel_lowpass;
    ivl_sim_reckoning_t     reckoning;  ///< with sense.inertial or sense.attitude_integrated
    ivl_sim_reading_t       readings[IVL_SIM_READINGS_MAX];
} ivl_sim_sensors_t;

/// A sensor that has watched the vehicle move at its present velocity for a while.
void ivl_sim_sensors_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, ivl_sim_sensors_t *sensors);

/// Fills the sensed part of the core's input for the tick at time t.
void ivl_sim_sensors_read(const ivl_sim_scene_t *scene, const ivl_sim_rng_t *rng, double t_s, ivl_sim_sensors_t *sensors, ivl_in_t *in);

#endif  // IVL_WORLD_SENSORS_H
