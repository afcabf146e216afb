/// @file cf_high_level.c
/// What an operator asks of the high-level commander.  A refusal is also said on the console, since clients do not look at the answer.
#include <errno.h>
#include <math.h>

#include "cf_vehicle.h"
#include "ivl_math.h"

static const float TURN_RAD_MAX = 3600.0f;
static const float METRES_MAX = 1000.0f;
static const float SECONDS_MAX = 3600.0f;
static const float TIMESCALE_MAX = 1000.0f;

void ivl_cf_hl_group(ivl_cf_t *cf, uint8_t mask)
{
    cf->set.group_mask = mask;
}

bool ivl_cf_hl_is_meant(const ivl_cf_t *cf, uint8_t mask)
{
    return mask == 0u || (mask & cf->set.group_mask) != 0u;
}

// ---- refusals

static int refused(const char *what, int error)
{
    const char *const why = (error == EBUSY)    ? "the motors may not run (supervisor.infdmp says why)"
                            : (error == EINVAL) ? "values that make no sense"
                            : (error == EPERM)  ? "not in this state: it flies or lands already"
                                                : "no such trajectory, or it cannot be flown like this";
    if (error != 0)
    {
        ivl_cf_print("HLCMD: %s refused: %s\n", what, why);
    }
    return error;
}

static bool is_duration(float duration_s)
{
    return duration_s >= 0.0f && duration_s <= SECONDS_MAX;
}

/// Values first, then the supervisor, then the planner's own state.
static int judge(const ivl_cf_t *cf, bool good, bool allowed)
{
    if (!good)
    {
        return EINVAL;
    }
    if (!ivl_cf_supervisor_can_fly(&cf->supervisor))
    {
        return EBUSY;
    }
    return allowed ? 0 : EPERM;
}

// ---- up and down

static int lift(ivl_cf_t *cf, bool up, float height_m, float yaw_rad, float duration_s)
{
    const bool allowed = up ? cf->planner.plan == IVL_CF_PLAN_STOPPED : cf->planner.plan != IVL_CF_PLAN_LANDING;
    const bool good = ivl_within(height_m, METRES_MAX) && ivl_within(yaw_rad, TURN_RAD_MAX) && is_duration(duration_s);
    const int  error = judge(cf, good, allowed);
    if (error == 0)
    {
        const ivl_cf_plan_t plan = up ? IVL_CF_PLAN_FLYING : IVL_CF_PLAN_LANDING;
        ivl_cf_planner_lift(&cf->planner, plan, height_m, yaw_rad, duration_s, ivl_cf_now_ms(cf));
    }
    return refused(up ? "take-off" : "landing", error);
}

static float heading(const ivl_cf_t *cf, float yaw_rad, bool use_current_yaw)
{
    return use_current_yaw ? cf->planner.last.yaw_rad : yaw_rad;
}

int ivl_cf_hl_takeoff(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s)
{
    return lift(cf, true, height_m, heading(cf, yaw_rad, use_current_yaw), duration_s);
}

int ivl_cf_hl_land(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s)
{
    return lift(cf, false, height_m, heading(cf, yaw_rad, use_current_yaw), duration_s);
}

/// The mean speed decides how long it takes; one that is 0 or less is that of a parameter.
static int lift_at(ivl_cf_t *cf, bool up, float height_m, float yaw_rad, float speed_mps, float usual_mps)
{
    const float way_m = fabsf(height_m - cf->planner.last.p_W_m.z);
    return lift(cf, up, height_m, yaw_rad, way_m / ((speed_mps > 0.0f) ? speed_mps : usual_mps));
}

int ivl_cf_hl_takeoff_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps)
{
    const float z_m = relative ? cf->planner.last.p_W_m.z + height_m : height_m;
    return lift_at(cf, true, z_m, heading(cf, yaw_rad, use_current_yaw), speed_mps, cf->set.takeoff_mps);
}

int ivl_cf_hl_land_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps)
{
    const float z_m = relative ? cf->planner.last.p_W_m.z - height_m : height_m;
    return lift_at(cf, false, z_m, heading(cf, yaw_rad, use_current_yaw), speed_mps, cf->set.landing_mps);
}

int ivl_cf_hl_stop(ivl_cf_t *cf)
{
    ivl_cf_planner_stop(&cf->planner);
    return 0;
}

// ---- elsewhere

int ivl_cf_hl_go_to(ivl_cf_t *cf, bool relative, bool linear, const float p_W_m[3], float yaw_rad, float duration_s)
{
    ivl_cf_planner_catch_up(&cf->planner, ivl_cf_now_ms(cf));
    const ivl_cf_goal_t *last = &cf->planner.last;
    const ivl_vec3_t     asked = {p_W_m[0], p_W_m[1], p_W_m[2]};
    const ivl_vec3_t     p = relative ? ivl_add(last->p_W_m, asked) : asked;
    const int error = judge(cf, ivl_vec3_within(p, METRES_MAX) && ivl_within(yaw_rad, TURN_RAD_MAX) && is_duration(duration_s), true);
    if (error == 0)
    {
        const float yaw = relative ? last->yaw_rad + yaw_rad : yaw_rad;
        ivl_cf_planner_go(&cf->planner, p, yaw, linear, duration_s, ivl_cf_now_ms(cf));
    }
    return refused("go to", error);
}

int ivl_cf_hl_spiral(ivl_cf_t *cf, const ivl_cf_spiral_t *asked)
{
    ivl_cf_spiral_t s = *asked;
    const bool      good = ivl_within(s.phi_rad, TURN_RAD_MAX) && ivl_within(s.r0_m, METRES_MAX) && ivl_within(s.r1_m, METRES_MAX) &&
                           ivl_within(s.climb_m, METRES_MAX) && is_duration(s.duration_s) && s.duration_s > 0.0f;
    const int       error = judge(cf, good, true);
    if (error == 0)
    {
        s.r0_m = (s.r0_m > 0.0f) ? s.r0_m : 0.0f;
        s.r1_m = (s.r1_m > 0.0f) ? s.r1_m : 0.0f;
        ivl_cf_planner_spiral(&cf->planner, &s, ivl_cf_now_ms(cf));
    }
    return refused("spiral", error);
}

// ---- trajectories

int ivl_cf_hl_define(ivl_cf_t *cf, uint8_t id, const ivl_cf_definition_t *definition)
{
    if (id >= IVL_CF_TRAJECTORIES)
    {
        return refused("definition of a trajectory", ENOEXEC);
    }
    cf->planner.uploaded.defined[id] = *definition;
    return 0;
}

int ivl_cf_hl_start(ivl_cf_t *cf, uint8_t id, const ivl_cf_start_t *how)
{
    int error = judge(cf, how->timescale > 0.0f && how->timescale <= TIMESCALE_MAX, true);
    if (error == 0 && !ivl_cf_planner_start(&cf->planner, id, how, ivl_cf_now_ms(cf)))
    {
        error = ENOEXEC;
    }
    return refused("trajectory", error);
}
