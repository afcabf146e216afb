/// @file sim_autopilot.h
/// The autopilot between the world and the flight core: what the world's sensors say passes the units of the SDK and the app's own
/// conversion, what the core asks of the motors passes the SDK's share of the largest thrust.
///
/// Units cost bits (rad/s to deg/s and back is not always the same number), and the app makes more of its input than units: it carries the
/// attitude on through a flip and dates positions.  So landings in the process of the host and on the emulated chip come by here, through the
/// functions that the software vehicle and the drone run.
#ifndef IVL_SIM_AUTOPILOT_H
#define IVL_SIM_AUTOPILOT_H
#include "app_senses.h"
#include "sim_model.h"

/// The estimator's last word.  All zero: none yet.
typedef struct
{
    uint64_t   t_pose_us;  ///< sampling instant
    ivl_vec3_t p_W_m;
} ivl_sim_told_t;

/// What an autopilot remembers.  All zero: it has just started.
typedef struct
{
    ivl_sim_told_t told;
    app_senses_t   senses;
    ivl_in_t       in;  ///< as the core has seen it last
} ivl_sim_autopilot_t;

/// What the SDK hands round for a sensed state: gyro in deg/s, accelerometer in g, quaternion, position and velocity as they are.  The Euler
/// angles, which the app does not use, stay 0.
///
/// The position of an estimator that works is never the same twice.  That of a simulated one may be, in a hover without noise: then a new
/// sample is told with its last bit changed.
void ivl_sim_sdk_of(ivl_sim_told_t *told, const ivl_in_t *sensed, sensorData_t *sensors, state_t *state);

/// What the SDK says of a range: whole millimetres; 0 without a sensor, 32767 if it has found nothing.
float ivl_sim_sdk_range_mm(const ivl_reading_t *range);

/// The share of the largest thrust as the motors take it, N.                                          [MODEL eq. 2.11]
/// @param[in] max_N   largest thrust
/// @param[in] idle_N  thrust of a motor of which nothing is asked
float ivl_sim_motor_N(const ivl_sim_model_t *model, float norm, float max_N, float idle_N);

/// One tick of the core in lane `lane` of a port, on what the sensors say, up to the tracking controller if the core can be halted there.
/// @param[in] sensed  with the command to the core
/// @param[out] ref    what the controller is to follow, if the result is true
/// @return false: out->thrust_N is complete
bool ivl_sim_autopilot_decide(const ivl_sim_model_t *model, void *port, int lane, const ivl_in_t *sensed, ivl_sim_autopilot_t *autopilot,
                              ivl_state_t *firmware, ivl_out_t *out, ivl_reference_t *ref);

/// The end of that tick.
/// @param[in,out] out  its motor thrusts become what the motors are given
void ivl_sim_autopilot_drive(const ivl_sim_model_t *model, ivl_out_t *out);

#endif  // IVL_SIM_AUTOPILOT_H
