/// @file cf_planner.h
/// The high-level commander: smooth ways to a point, spirals and uploaded trajectories, as set-points.
///
/// A planned way is one polynomial of seventh degree an axis; an uploaded one is a row of them.  At its end the vehicle stands there for ever,
/// or, after a landing, is stopped.
#ifndef IVL_CF_PLANNER_H
#define IVL_CF_PLANNER_H
#include "cf_commander.h"
#include "cf_trajectory.h"

typedef enum
{
    IVL_CF_PLAN_STOPPED,   ///< gives set-points of no thrust
    IVL_CF_PLAN_FLYING,    ///< on the way, or at its end for ever
    IVL_CF_PLAN_LANDING,   ///< stops at the end of the way
    IVL_CF_PLAN_DISABLED,  ///< the way led nowhere: gives no set-points
} ivl_cf_plan_t;

typedef enum
{
    IVL_CF_WAY_NONE,  ///< none since boot
    IVL_CF_WAY_PLANNED,
    IVL_CF_WAY_PLAIN,
    IVL_CF_WAY_COMPRESSED
} ivl_cf_way_t;

typedef struct
{
    ivl_cf_plan_t  plan;
    ivl_cf_way_t   way;
    uint32_t       t_ms;        ///< when the way began
    float          duration_s;  ///< of all of it
    ivl_cf_piece_t piece;       ///< of a planned way
    // of an uploaded one
    uint32_t              offset;
    uint8_t               n_pieces;
    float                 timescale;  ///< > 1: slower
    bool                  reversed;
    ivl_vec3_t            shift_m;
    float                 shift_yaw_rad;
    ivl_cf_playhead_t     head;
    ivl_cf_trajectories_t uploaded;
    ivl_cf_goal_t         last;  ///< the last goal; while no way is followed, the vehicle itself
} ivl_cf_planner_t;

void ivl_cf_planner_init(ivl_cf_planner_t *planner);

/// At rest at a point, for ever.
void ivl_cf_planner_hover(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, uint32_t now_ms);

/// Where the vehicle is: the next way begins there.
void ivl_cf_planner_tell(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, float yaw_rad);

/// The goal of this very moment is the last one; set-points are made less often.  Where no way is followed, nothing changes.
void ivl_cf_planner_catch_up(ivl_cf_planner_t *planner, uint32_t now_ms);

/// No way is followed: STOPPED or DISABLED.
bool ivl_cf_planner_rests(const ivl_cf_planner_t *planner);

/// Straight up or down from the last goal, from rest to rest.
/// @param[in] plan  FLYING or LANDING
void ivl_cf_planner_lift(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, float z_m, float yaw_rad, float duration_s, uint32_t now_ms);

/// From the last goal, in its motion, to rest at a point.
/// @param[in] linear  at a steady speed instead
void ivl_cf_planner_go(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, bool linear, float duration_s, uint32_t now_ms);

typedef struct
{
    bool  sideways, clockwise;
    float phi_rad;     ///< turned over in all, within two half turns
    float r0_m, r1_m;  ///< radius at start and end, >= 0
    float climb_m;     ///< height gained
    float duration_s;  ///< > 0
} ivl_cf_spiral_t;

/// From the last goal around a centre at its side.
void ivl_cf_planner_spiral(ivl_cf_planner_t *planner, const ivl_cf_spiral_t *spiral, uint32_t now_ms);

/// How an uploaded trajectory is flown.
typedef struct
{
    bool  relative_position;  ///< moved so that it begins at the last goal
    bool  relative_yaw;       ///< also turned to the heading there; has no effect alone, nor on a compressed one
    bool  reversed;
    float timescale;  ///< > 0
} ivl_cf_start_t;

/// @return false if there is no such trajectory, or it cannot be flown like this: a compressed one has neither a time scale nor a way back
bool ivl_cf_planner_start(ivl_cf_planner_t *planner, uint8_t id, const ivl_cf_start_t *how, uint32_t now_ms);

void ivl_cf_planner_stop(ivl_cf_planner_t *planner);

/// Set-point of this moment.  @return false if there is none: DISABLED
bool ivl_cf_planner_next(ivl_cf_planner_t *planner, uint32_t now_ms, ivl_cf_setpoint_t *setpoint);

/// The time of the way is over.
bool ivl_cf_planner_finished(const ivl_cf_planner_t *planner, uint32_t now_ms);

#endif  // IVL_CF_PLANNER_H
