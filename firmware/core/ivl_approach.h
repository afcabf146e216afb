/// @file ivl_approach.h
/// Stage 5b: the approach generator.  A path in the x-z plane of W, its velocity ramped with constant acceleration, and then as cfg->shape says.
/// Shape REGION needs the distance of the ceiling.  Known height has it at the start.  A source that estimates has none before the approach has
/// begun: then the aim is the region as if there were room, until the distance is valid for the first time; that once, the aim is made anew.
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
    ivl_vec3_t from_W_mps;  ///< shape REGION: velocity from which it changes
    bool       open;        ///< shape REGION: the distance was not known so far
    float      last_mps;    ///< shape RREV: speed at which holding RREV ends
    bool       closing;     ///< shape RREV: RREV is being held
} ivl_approach_t;

/// Start a path at the present position with the present velocity component along it; a vehicle already at speed just holds it.
/// Shape REGION starts with both components of the velocity.
/// @param[in] angle_rad  above horizontal, 0..pi/2
/// @param[in] room       read by shape REGION alone
void ivl_approach_begin(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room, ivl_vec3_t p_WB_m, ivl_vec3_t v_WB_mps,
                        float speed_mps, float angle_rad);

/// Shape REGION: aim anew, if the distance is known for the first time.  Before ivl_approach_next.
void ivl_approach_look(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room);

/// Reference of this tick; then advance by one tick of dt_s.
/// @param[in] rrev_per_s  present cue, 0 if there is none
ivl_reference_t ivl_approach_next(const ivl_cfg_t *cfg, ivl_approach_t *approach, float rrev_per_s, float dt_s);
#endif  // IVL_APPROACH_H
