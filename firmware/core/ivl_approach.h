/// @file ivl_approach.h
/// Stage 5b: the approach generator.  A path in the x-z plane of W, its velocity ramped with constant acceleration, and then as cfg->shape says.
/// Shape REGION holds the present velocity until it has an aim: one tick, unless that tick is busy with a measurement.  It needs the distance of
/// the ceiling.  Known height has it at the start.  A source that estimates has none before the approach has begun: then the aim is the region as
/// if there were room, until the distance is valid for the first time; that once, the aim is made anew.
#ifndef IVL_APPROACH_H
#define IVL_APPROACH_H
#include "ivl_region.h"

/// What the tracking controller is to follow.
typedef struct
{
    ivl_vec3_t p_W_m;
    ivl_vec3_t v_W_mps;
    ivl_vec3_t a_W_mps2;
} ivl_reference_t;

/// How the speed along the path goes on once it has reached the commanded one (cfg->shape).
typedef enum
{
    IVL_SHAPE_HOLD,        ///< it is held
    IVL_SHAPE_ACCELERATE,  ///< it keeps growing, up to speed_max
    IVL_SHAPE_RREV,   ///< it is held until RREV reaches shape_rrev, then RREV is held until shape_speed of it is left, then that is held
    IVL_SHAPE_REGION  ///< it is held; speed and direction are not the commanded ones, but those of ivl_region.h
} ivl_shape_t;

/// What shape REGION waits for.
typedef enum
{
    IVL_APPROACH_NOTHING,
    IVL_APPROACH_AIM,      ///< a tick for its first aim
    IVL_APPROACH_DISTANCE  ///< a valid distance, to aim anew
} ivl_approach_wants_t;

typedef struct
{
    ivl_vec3_t p_W_m;  ///< present point of the path
    float      dir_x;  ///< direction of the path in W, unit length; shape REGION: of the change of velocity
    float      dir_z;
    float      speed_mps;   ///< present speed along the path; shape REGION: change of velocity so far
    float      accel_mps2;  ///< its change in the last tick, per second
    float      target_mps;  ///< speed to be reached
    ivl_aim_t  aim;         ///< velocity to be reached, and the largest acceleration on the way there
    ivl_aim_t  asked;       ///< shape REGION: the commanded velocity
    float      from_x_mps;  ///< shape REGION: velocity in W from which it changes
    float      from_z_mps;
    float      last_mps;   ///< shape RREV: speed at which holding RREV ends
    bool       closing;    ///< shape RREV: RREV is being held
    uint8_t    wants;      ///< shape REGION: ivl_approach_wants_t
    uint8_t    n_put_off;  ///< shape REGION: ticks that the aim has been put off
} ivl_approach_t;

/// Start a path at the present position with the present velocity component along it; a vehicle already at speed just holds it.
/// Shape REGION starts with both components of the velocity.
/// @param[in] angle_rad  above horizontal, -pi..pi; shape REGION: 0..pi/2
void ivl_approach_begin(const ivl_cfg_t *cfg, ivl_approach_t *approach, ivl_vec3_t p_WB_m, ivl_vec3_t v_WB_mps, float speed_mps,
                        float angle_rad);

/// Shape REGION: aim, or aim anew, if that is due.  Once a tick after the one of the begin, before ivl_approach_next.
/// @param[in] busy  this tick has taken a measurement: the aim can wait, for a few ticks
void ivl_approach_aim(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room, bool busy);

/// Reference of this tick; then advance by one tick of dt_s.
/// @param[in] rrev_per_s  present cue, 0 if there is none
ivl_reference_t ivl_approach_next(const ivl_cfg_t *cfg, ivl_approach_t *approach, float rrev_per_s, float dt_s);
#endif  // IVL_APPROACH_H
