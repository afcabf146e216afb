/// @file app_senses.h
/// What the core is told about motion and range, from what the SDK hands round in one call of the controller.
///
/// On the drone the app calls this; the simulator calls it for landings in the process of the host, so that a landing is the same landing
/// whether it is flown there, by the software vehicle or by the drone.
#ifndef APP_SENSES_H
#define APP_SENSES_H
#include "ivl_attitude.h"
#include "ivl_sense.h"
#include "stabilizer_types.h"

/// What is remembered from one call to the next.  All zero: nothing was sensed yet.
typedef struct
{
    ivl_attitude_t attitude;
    ivl_vec3_t     p_seen_W_m;     ///< position of the last call
    uint64_t       t_pose_us;      ///< when it last changed
    bool           has_pose;       ///< there was a last call
    float          range_seen_mm;  ///< of the last call
} app_senses_t;

/// Attitude alone: follows the estimator, or is carried on with the gyro.  A part of app_sense_motion; by itself for a call in which nothing
/// else can have changed.
void app_sense_attitude(app_senses_t *senses, const sensorData_t *sensors, const state_t *state, ivl_phase_t phase, float loop_s);

/// Motion: converts into the core's units, carries the attitude on with the gyro, and dates the position by its last change.
/// @param[in] phase   of the core, before this call: attitude follows the estimator where an estimator for upright flight can be right
/// @param[in] loop_s  time between two calls
/// @param[out] in     its clocks, position, velocity, attitude, rate and force; the rest stays
void app_sense_motion(app_senses_t *senses, const sensorData_t *sensors, const state_t *state, ivl_phase_t phase, float loop_s,
                      uint64_t now_us, ivl_in_t *in);

/// Range: a value that differs from the last one is a new reading, one that does not lets the last reading grow old.
/// @param[in] range_mm  0: there is no such sensor
/// @param[in,out] range the last reading
void app_sense_range(app_senses_t *senses, float range_mm, uint64_t now_us, ivl_reading_t *range);
#endif  // APP_SENSES_H
