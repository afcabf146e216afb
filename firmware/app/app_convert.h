/// @file app_convert.h
/// Units and frames of the SDK to those of the core and back: here and nowhere else.
///   gyro deg/s -> rad/s and accelerometer g -> m/s^2, both x forward, y left, z up as the core's B: no sign changes
///   attitude: the quaternion (x, y, z, w, body to world) is taken; the SDK's Euler angles are not, since their pitch has the other sign
///   position and velocity: SI, world z up, as they are
///   range: mm -> m
///   thrust: N per motor -> share of THRUST_MAX (controlModeForce), which the SDK turns into PWM with its battery compensation
///   stock thrust: 0..65535 for the same share
#ifndef APP_CONVERT_H
#define APP_CONVERT_H
#include "ivl.h"
#include "ivl_math.h"
#include "ivl_types.h"
#include "platform_defaults.h"
#include "stabilizer_types.h"

static const float APP_RADPS_PER_DEGPS = 0.0174532925f;
static const float APP_RAD_PER_DEG = 0.0174532925f;
static const float APP_MPS2_PER_G = 9.80665f;
static const float APP_M_PER_MM = 1.0e-3f;
static const float APP_RANGE_MM_MAX = 32000.0f;  // the SDK's driver says 32767 for "nothing found"
static const float APP_S_PER_MS = 1.0e-3f;
static const float APP_S_PER_US = 1.0e-6f;
static const float APP_STOCK_THRUST_MAX = 65535.0f;
static const float APP_SQRT_HALF = 0.70710678f;

static inline ivl_vec3_t app_w_B_radps(const sensorData_t *sensors)
{
    return ivl_scale(ivl_vec3(sensors->gyro.x, sensors->gyro.y, sensors->gyro.z), APP_RADPS_PER_DEGPS);
}

static inline ivl_vec3_t app_f_B_mps2(const sensorData_t *sensors)
{
    return ivl_scale(ivl_vec3(sensors->acc.x, sensors->acc.y, sensors->acc.z), APP_MPS2_PER_G);
}

static inline ivl_quat_t app_q_WB(const state_t *state)
{
    const quaternion_t *q = &state->attitudeQuaternion;
    return (ivl_quat_t){q->x, q->y, q->z, q->w};
}

static inline ivl_vec3_t app_p_W_m(const state_t *state)
{
    return ivl_vec3(state->position.x, state->position.y, state->position.z);
}

static inline ivl_vec3_t app_v_W_mps(const state_t *state)
{
    return ivl_vec3(state->velocity.x, state->velocity.y, state->velocity.z);
}

static inline float app_norm_of_N(float thrust_N)
{
    return thrust_N / THRUST_MAX;
}

static inline float app_norm_of_stock(float thrust)
{
    return thrust / APP_STOCK_THRUST_MAX;
}

static inline float app_stock_of_norm(float norm)
{
    return ivl_clamp(norm, 0.0f, 1.0f) * APP_STOCK_THRUST_MAX;
}

/// True where the core wants motors that stand still: all of them, or the rear pair in the flip.
static inline bool app_stops_motors(const ivl_out_t *out)
{
    return !out->stock_allowed && (!out->motors_on || (out->phase == IVL_PHASE_FLIP));
}

/// A reading of the ranging sensor that arrives now.
static inline ivl_reading_t app_range_reading(float range_mm, uint64_t now_us)
{
    return (ivl_reading_t){.t_us = now_us, .value = range_mm * APP_M_PER_MM, .valid = (range_mm < APP_RANGE_MM_MAX) ? 1u : 0u};
}

/// Time between two instants of the microsecond clock, s; long ones are as good as infinite.
static inline float app_s_between(uint64_t from_us, uint64_t to_us)
{
    const uint64_t us = to_us - from_us;
    return (us < 1000000000u) ? (float)(uint32_t)us * APP_S_PER_US : 1.0e3f;
}

/// Standard deviation of the least certain axis.
static inline float app_sigma_m(float var_x_m2, float var_y_m2, float var_z_m2)
{
    const float xy = (var_x_m2 >= var_y_m2) ? var_x_m2 : var_y_m2;
    // a variance that is no number wins, so that it is seen
    return sqrtf((xy >= var_z_m2) ? xy : var_z_m2) + 0.0f * (var_x_m2 + var_y_m2 + var_z_m2);
}

/// Distance of a motor from the b_x and b_y axes, from the length of the arm.
static inline float app_motor_offset_m(void)
{
    return APP_SQRT_HALF * ARM_LENGTH;
}
#endif  // APP_CONVERT_H
