/// @file cf_planner.h
/// The high-level commander: smooth paths to a point, as set-points.
#ifndef IVL_CF_PLANNER_H
#define IVL_CF_PLANNER_H
#include "cf_commander.h"

typedef enum
{
    IVL_CF_PLAN_STOPPED,  ///< gives set-points of no thrust
    IVL_CF_PLAN_FLYING,   ///< on the way, or at its end for ever
    IVL_CF_PLAN_LANDING   ///< stops at the end of the way
} ivl_cf_plan_t;

/// Position, velocity, acceleration along a path.
typedef struct
{
    ivl_vec3_t p_W_m, v_W_mps, a_W_mps2;
    float      yaw_rad, yawrate_radps;
} ivl_cf_goal_t;

typedef struct
{
    ivl_cf_plan_t plan;
    uint32_t      t_ms;         ///< when the way began
    float         duration_s;   ///< of the way
    float         coeff[4][6];  ///< x, y, z, yaw: polynomial of time since then
    ivl_cf_goal_t last;         ///< the last goal; while stopped, the vehicle itself
} ivl_cf_planner_t;

void ivl_cf_planner_init(ivl_cf_planner_t *planner);

/// At rest at a point, for ever.
void ivl_cf_planner_hover(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, uint32_t now_ms);

/// Where the vehicle is, while the planner is stopped: the next way begins there.
void ivl_cf_planner_tell(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, float yaw_rad);

/// The way from the last goal to rest at a point.
/// @param[in] duration_s  > 0
/// @param[in] plan        FLYING or LANDING
void ivl_cf_planner_go(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, ivl_vec3_t p_W_m, float yaw_rad, float duration_s, uint32_t now_ms);

void ivl_cf_planner_stop(ivl_cf_planner_t *planner);

/// Set-point of this moment.
ivl_cf_setpoint_t ivl_cf_planner_next(ivl_cf_planner_t *planner, uint32_t now_ms);

/// The way is done.
bool ivl_cf_planner_finished(const ivl_cf_planner_t *planner, uint32_t now_ms);

#endif  // IVL_CF_PLANNER_H
