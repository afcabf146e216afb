/// @file ivl_types.h
/// Plain data types that every stage of the core shares: vectors, phases, requests, status, one sensed sample.
/// Frames: W world, z up; B body, x forward, y left, z up.  SI units, radians, seconds; q_WB turns body vectors into world vectors.
#ifndef IVL_TYPES_H
#define IVL_TYPES_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "ivl_num.h"

typedef struct
{
    ivl_num_t x, y, z;
} ivl_vec3_t;

typedef struct
{
    ivl_num_t x, y, z, w;  ///< w is the scalar part
} ivl_quat_t;

/// Result of an operation that can be refused.  Zero is success, negative values are refusals.
typedef enum
{
    IVL_OK = 0,
    IVL_ERR_RANGE = -1,  ///< a value is not finite or lies outside its stated range
    IVL_ERR_PHASE = -2,  ///< not allowed in the present phase (for example after the trigger)
    IVL_ERR_FORM = -4    ///< no such form of a policy here, or another number of parameters; -3 is of ivl_wire_status_t
} ivl_status_t;

/// Phases of one landing; the numbers are part of the log format.  The transitions stand in the table of ivl_phase.c.
typedef enum
{
    IVL_PHASE_IDLE,      ///< motors off, waiting for a request
    IVL_PHASE_READY,     ///< hover at the commanded point
    IVL_PHASE_APPROACH,  ///< accelerate to the commanded velocity and hold it; the trigger is live
    IVL_PHASE_FLIP,      ///< front pair alone makes the policy's moment
    IVL_PHASE_COAST,     ///< motors off, body rotates freely
    IVL_PHASE_ATTACHED,  ///< motors off, contact or hanging was sensed
    IVL_PHASE_DONE,      ///< motors off until the next request cycle
    IVL_PHASE_ABORTED,  ///< level-out if it is in an approach, level hover, landing, while the sensed state is good; else motors off for good
    IVL_PHASE_LEVEL_OUT,  ///< no-go, or HOVER in an approach: keep off the ceiling, brake, hover below until a HOVER
    IVL_PHASE_COUNT
} ivl_phase_t;

/// What the operator wants.  A level, not an edge: repeating a request changes nothing.
typedef enum
{
    IVL_REQUEST_IDLE,
    IVL_REQUEST_HOVER,
    IVL_REQUEST_APPROACH,
    IVL_REQUEST_ABORT,
    IVL_REQUEST_COUNT
} ivl_request_t;

/// Request of the operator with its arguments; only those arguments are checked that the request uses.
typedef struct
{
    ivl_request_t request;
    ivl_vec3_t    p_hover_W_m;  ///< used by HOVER
    float         speed_mps;    ///< used by APPROACH, latched when the approach starts
    float angle_rad;  ///< used by APPROACH: angle to the surface, 0..pi; below pi/2 forward along it (ivl_surface.h), in the x-z plane of W
} ivl_command_t;

/// Safety rules; the numbers are part of the log format.  What each one says stands in the table of ivl_guard.c.
typedef enum
{
    IVL_RULE_NONE,
    IVL_RULE_CONFIG,
    IVL_RULE_BYPASS,
    IVL_RULE_REARM,
    IVL_RULE_BATTERY_REST,
    IVL_RULE_STATE,
    IVL_RULE_TILT,
    IVL_RULE_COMMAND,
    IVL_RULE_SUPERVISOR,
    IVL_RULE_LINK,
    IVL_RULE_SETPOINT,
    IVL_RULE_HOST,
    IVL_RULE_BATTERY,
    IVL_RULE_FENCE,
    IVL_RULE_SPEED,
    IVL_RULE_UNCERTAIN,
    IVL_RULE_TOO_CLOSE,
    IVL_RULE_APPROACH_TIME,
    IVL_RULE_LEVEL_OUT_TIME,
    IVL_RULE_CONTACT,
    IVL_RULE_HANG,
    IVL_RULE_BLIND,
    IVL_RULE_FLIP_TIME,
    IVL_RULE_COAST_TIME,
    IVL_RULE_LOST,
    IVL_RULE_LANDED,
    IVL_RULE_NO_POLICY,
    IVL_RULE_ONE_SHOT,
    IVL_RULE_NO_GO,
    IVL_RULE_NOT_FRESH,
    IVL_RULE_CUE,
    IVL_RULE_COUNT
} ivl_rule_t;

/// What the port knows about the vehicle beside its motion.  All zero where there is nothing to tell (a world without radio and battery):
/// then every rule about it is satisfied.
typedef struct
{
    uint8_t given;           ///< flags are 0 or not; given 0: the members below mean nothing
    uint8_t configured;      ///< the operator has put a configuration in force since the start
    uint8_t can_fly;         ///< the autopilot around the core lets the motors run
    uint8_t bypassed;        ///< somebody drives the motors past the core
    uint8_t stock_idle;      ///< the autopilot's own set-point asks for no thrust
    float   vbat_V;          ///< battery
    float   link_age_s;      ///< since the link was last up
    float   setpoint_age_s;  ///< of the autopilot's own set-point
    float   host_age_s;      ///< since the last command of the host
    float   p_sigma_m;       ///< standard deviation of the position estimate, largest axis
} ivl_vitals_t;

/// What a sensor beside the state estimate said last; repeated until it says something else.  All zero where there is no such sensor.
typedef struct
{
    uint64_t t_us;   ///< when it arrived at the port; what differs from the last one is new
    float    value;  ///< in the sensor's unit
    uint8_t  valid;  ///< 0: the sensor has found nothing (out of range, saturated)
} ivl_reading_t;

/// One sensed state of the vehicle.
typedef struct
{
    uint64_t   t_us;       ///< the tick's instant
    uint64_t   t_pose_us;  ///< sampling instant of position and velocity, <= t_us
    ivl_vec3_t p_WB_m;
    ivl_vec3_t v_WB_mps;
    ivl_quat_t q_WB;
    ivl_vec3_t w_B_radps;
    ivl_vec3_t f_B_mps2;  ///< specific force in B: (0, 0, +g) at rest and upright, 0 in free fall
} ivl_sample_t;
#endif  // IVL_TYPES_H
