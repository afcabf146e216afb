/// @file cf_commander.h
/// Set-points of the stock firmware: who may set them, and how old the present one is.
#ifndef IVL_CF_COMMANDER_H
#define IVL_CF_COMMANDER_H
#include "ivl_types.h"

typedef enum
{
    IVL_CF_PRIORITY_DISABLE,
    IVL_CF_PRIORITY_HIGH_LEVEL,
    IVL_CF_PRIORITY_CRTP,
    IVL_CF_PRIORITY_EXTERN
} ivl_cf_priority_t;

typedef enum
{
    IVL_CF_MODE_OFF,
    IVL_CF_MODE_ABS,
    IVL_CF_MODE_VELOCITY
} ivl_cf_mode_t;

/// All zero: no thrust.  SI, radians, x forward, y left, z up; positive pitch is nose down.
typedef struct
{
    uint32_t      t_ms;                   ///< when it was set
    ivl_cf_mode_t xy;                     ///< OFF: roll and pitch instead
    ivl_cf_mode_t z;                      ///< OFF: thrust instead
    ivl_cf_mode_t roll_mode, pitch_mode;  ///< ABS an angle, VELOCITY a rate
    ivl_cf_mode_t yaw;                    ///< ABS or VELOCITY
    bool          in_body;                ///< horizontal velocity is in heading axes
    ivl_vec3_t    p_W_m, v_mps, a_W_mps2;
    float         roll, pitch;  ///< rad, or rad/s
    float         yaw_rad, yawrate_radps;
    float         thrust_norm;  ///< mean, as a share of the largest
} ivl_cf_setpoint_t;

typedef struct
{
    ivl_cf_setpoint_t setpoint;
    ivl_cf_priority_t priority;
    bool              thrust_locked;  ///< sets of roll, pitch, yaw and thrust: until one with no thrust has come
} ivl_cf_commander_t;

/// No set-point yet: it is as old as the vehicle.
void ivl_cf_commander_init(ivl_cf_commander_t *c);

/// @return true if the set-point is taken: nobody more important has one
bool ivl_cf_commander_set(ivl_cf_commander_t *c, const ivl_cf_setpoint_t *setpoint, ivl_cf_priority_t priority, uint32_t now_ms);

/// The next set-point of anybody is taken.
void ivl_cf_commander_relax(ivl_cf_commander_t *c);

uint32_t ivl_cf_commander_age_ms(const ivl_cf_commander_t *c, uint32_t now_ms);

/// Asks for no thrust.
bool ivl_cf_setpoint_idle(const ivl_cf_setpoint_t *setpoint);

#endif  // IVL_CF_COMMANDER_H
