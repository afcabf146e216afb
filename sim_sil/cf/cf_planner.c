/// @file cf_planner.c
/// A way is a polynomial of fifth degree an axis, from position, velocity and acceleration at the start to rest at the end.  With t in units of
/// the duration T, h = p1 - p0 - v0 - a0/2, k = -v0 - a0, l = -a0 (velocities and accelerations scaled by T and T^2):
///   c3 = 10 h - 4 k + l/2,  c4 = -15 h + 7 k - l,  c5 = 6 h - 3 k + l/2
#include "cf_planner.h"

#include <string.h>

#include "ivl_math.h"

static const float PI_F = 3.14159265f;
static const float DURATION_S_MIN = 0.02f;

static float seconds(uint32_t from_ms, uint32_t to_ms)
{
    return (float)(to_ms - from_ms) * 1.0e-3f;
}

/// Nearest to zero of all angles that mean the same.
static float wrapped(float angle_rad)
{
    const float turns = floorf(angle_rad / (2.0f * PI_F) + 0.5f);
    return angle_rad - 2.0f * PI_F * turns;
}

static void fit(float c[6], float p0, float v0, float a0, float p1)
{
    const float h = p1 - p0 - v0 - 0.5f * a0, k = -v0 - a0, l = -a0;
    c[0] = p0;
    c[1] = v0;
    c[2] = 0.5f * a0;
    c[3] = 10.0f * h - 4.0f * k + 0.5f * l;
    c[4] = -15.0f * h + 7.0f * k - l;
    c[5] = 6.0f * h - 3.0f * k + 0.5f * l;
}

void ivl_cf_planner_init(ivl_cf_planner_t *planner)
{
    memset(planner, 0, sizeof *planner);
}

void ivl_cf_planner_hover(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, float yaw_rad, uint32_t now_ms)
{
    planner->last = (ivl_cf_goal_t){.p_W_m = p_W_m, .yaw_rad = yaw_rad};
    ivl_cf_planner_go(planner, IVL_CF_PLAN_FLYING, p_W_m, yaw_rad, DURATION_S_MIN, now_ms);
}

void ivl_cf_planner_tell(ivl_cf_planner_t *planner, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps, float yaw_rad)
{
    planner->last = (ivl_cf_goal_t){.p_W_m = p_W_m, .v_W_mps = v_W_mps, .yaw_rad = yaw_rad};
}

void ivl_cf_planner_go(ivl_cf_planner_t *planner, ivl_cf_plan_t plan, ivl_vec3_t p_W_m, float yaw_rad, float duration_s, uint32_t now_ms)
{
    const ivl_cf_goal_t *from = &planner->last;
    const float          T = (duration_s > DURATION_S_MIN) ? duration_s : DURATION_S_MIN;
    planner->plan = plan;
    planner->t_ms = now_ms;
    planner->duration_s = T;
    fit(planner->coeff[0], from->p_W_m.x, T * from->v_W_mps.x, T * T * from->a_W_mps2.x, p_W_m.x);
    fit(planner->coeff[1], from->p_W_m.y, T * from->v_W_mps.y, T * T * from->a_W_mps2.y, p_W_m.y);
    fit(planner->coeff[2], from->p_W_m.z, T * from->v_W_mps.z, T * T * from->a_W_mps2.z, p_W_m.z);
    // the short way round
    fit(planner->coeff[3], from->yaw_rad, 0.0f, 0.0f, from->yaw_rad + wrapped(yaw_rad - from->yaw_rad));
}

void ivl_cf_planner_stop(ivl_cf_planner_t *planner)
{
    planner->plan = IVL_CF_PLAN_STOPPED;
}

bool ivl_cf_planner_finished(const ivl_cf_planner_t *planner, uint32_t now_ms)
{
    return planner->plan == IVL_CF_PLAN_STOPPED || seconds(planner->t_ms, now_ms) >= planner->duration_s;
}

/// Value, rate and second derivative by time of one axis.
static void evaluate(const float c[6], float x, float T, float out[3])
{
    out[0] = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))));
    out[1] = (c[1] + x * (2.0f * c[2] + x * (3.0f * c[3] + x * (4.0f * c[4] + x * 5.0f * c[5])))) / T;
    out[2] = (2.0f * c[2] + x * (6.0f * c[3] + x * (12.0f * c[4] + x * 20.0f * c[5]))) / (T * T);
}

static ivl_cf_goal_t goal(const ivl_cf_planner_t *planner, uint32_t now_ms)
{
    const float T = planner->duration_s, t = seconds(planner->t_ms, now_ms);
    const bool  over = !(t < T);
    float       axis[4][3];
    for (int i = 0; i < 4; i++)
    {
        evaluate(planner->coeff[i], over ? 1.0f : t / T, T, axis[i]);
        axis[i][1] = over ? 0.0f : axis[i][1];
        axis[i][2] = over ? 0.0f : axis[i][2];
    }
    return (ivl_cf_goal_t){
        .p_W_m = {axis[0][0], axis[1][0], axis[2][0]},
        .v_W_mps = {axis[0][1], axis[1][1], axis[2][1]},
        .a_W_mps2 = {axis[0][2], axis[1][2], axis[2][2]},
        .yaw_rad = wrapped(axis[3][0]),
        .yawrate_radps = axis[3][1],
    };
}

ivl_cf_setpoint_t ivl_cf_planner_next(ivl_cf_planner_t *planner, uint32_t now_ms)
{
    if (planner->plan == IVL_CF_PLAN_LANDING && ivl_cf_planner_finished(planner, now_ms))
    {
        planner->plan = IVL_CF_PLAN_STOPPED;
    }
    if (planner->plan == IVL_CF_PLAN_STOPPED)
    {
        return (ivl_cf_setpoint_t){.z = IVL_CF_MODE_OFF};
    }
    planner->last = goal(planner, now_ms);
    return (ivl_cf_setpoint_t){
        .xy = IVL_CF_MODE_ABS,
        .z = IVL_CF_MODE_ABS,
        .yaw = IVL_CF_MODE_ABS,
        .p_W_m = planner->last.p_W_m,
        .v_mps = planner->last.v_W_mps,
        .a_W_mps2 = planner->last.a_W_mps2,
        .yaw_rad = planner->last.yaw_rad,
    };
}
