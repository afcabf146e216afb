#include "cf_stock.h"

#include <math.h>
#include <string.h>

#include "ivl_math.h"
#include "phys_math.h"

// A wanted point that moves with a wanted velocity waits for the vehicle within this distance.
static const float LEAD_M = 0.3f;
// The same for a heading: half a turn away, the law would not know which way round.
static const float LEAD_RAD = 1.0f;
static const float TILT_RAD_MAX = 0.9f;
static const float PI_F = 3.14159265f;
// A way of a few hundredths of a second asks for tens of g, which no vehicle follows: more than this of an acceleration is left out.
static const float ACCEL_MPS2_MAX = 5.0f;

void ivl_cf_stock_reset(ivl_cf_stock_t *stock)
{
    *stock = (ivl_cf_stock_t){.running = false};
}

float ivl_cf_yaw_of(ivl_quat_t q)
{
    return (float)ivl_sim_atan2(2.0 * (double)(q.w * q.z + q.x * q.y), 1.0 - 2.0 * (double)(q.y * q.y + q.z * q.z));
}

static ivl_vec3_t turned(ivl_vec3_t a, float c, float s)
{
    return ivl_vec3(c * a.x - s * a.y, s * a.x + c * a.y, a.z);
}

// ---- what is wanted

static float drawn_along(float wanted_m, float v_mps, float dt_s, float is_m)
{
    return ivl_clamp(wanted_m + v_mps * dt_s, is_m - LEAD_M, is_m + LEAD_M);
}

static float wrapped(float angle_rad)
{
    return angle_rad - 2.0f * PI_F * floorf(angle_rad / (2.0f * PI_F) + 0.5f);
}

static void want_heading(ivl_cf_stock_t *stock, const ivl_sample_t *now, const ivl_cf_setpoint_t *sp, float dt_s)
{
    const float is_rad = ivl_cf_yaw_of(now->q_WB);
    const float wanted_rad = (sp->yaw == IVL_CF_MODE_ABS) ? sp->yaw_rad : stock->yaw_rad + sp->yawrate_radps * dt_s;
    stock->yaw_rad = wrapped(is_rad + ivl_clamp(wrapped(wanted_rad - is_rad), -LEAD_RAD, LEAD_RAD));
}

static void want_tilt(ivl_cf_stock_t *stock, const ivl_cf_setpoint_t *sp, float dt_s)
{
    const bool roll_turns = sp->roll_mode == IVL_CF_MODE_VELOCITY, pitch_turns = sp->pitch_mode == IVL_CF_MODE_VELOCITY;
    stock->roll = ivl_clamp(roll_turns ? stock->roll + sp->roll * dt_s : sp->roll, -TILT_RAD_MAX, TILT_RAD_MAX);
    stock->pitch = ivl_clamp(pitch_turns ? stock->pitch + sp->pitch * dt_s : sp->pitch, -TILT_RAD_MAX, TILT_RAD_MAX);
}

static ivl_vec3_t limited(ivl_vec3_t a)
{
    return ivl_vec3(ivl_clamp(a.x, -ACCEL_MPS2_MAX, ACCEL_MPS2_MAX), ivl_clamp(a.y, -ACCEL_MPS2_MAX, ACCEL_MPS2_MAX),
                    ivl_clamp(a.z, -ACCEL_MPS2_MAX, ACCEL_MPS2_MAX));
}

/// Horizontal part of the reference, in W.
static void want_xy(ivl_cf_stock_t *stock, const ivl_cfg_t *cfg, const ivl_sample_t *now, const ivl_cf_setpoint_t *sp, float dt_s,
                    ivl_reference_t *ref)
{
    // sticks and body axes are those of the vehicle, wherever it has come on its way to the wanted heading
    const ivl_sincos_t heading = ivl_sincos(ivl_cf_yaw_of(now->q_WB));
    if (sp->xy == IVL_CF_MODE_OFF)
    {
        // no error of position and velocity, and the acceleration that this tilt makes
        const ivl_vec3_t a = {cfg->gravity_mps2 * ivl_tan(stock->pitch), -cfg->gravity_mps2 * ivl_tan(stock->roll), 0.0f};
        stock->p_W_m.x = now->p_WB_m.x, stock->p_W_m.y = now->p_WB_m.y;
        ref->v_W_mps = now->v_WB_mps;
        ref->a_W_mps2 = turned(a, heading.cos, heading.sin);
        return;
    }
    ref->v_W_mps = sp->in_body ? turned(sp->v_mps, heading.cos, heading.sin) : sp->v_mps;
    if (sp->xy == IVL_CF_MODE_ABS)
    {
        stock->p_W_m.x = sp->p_W_m.x, stock->p_W_m.y = sp->p_W_m.y;
        ref->a_W_mps2 = limited(sp->a_W_mps2);
        return;
    }
    if (sp->in_body)
    {
        // the velocity turns with the vehicle: without this the law, which lags behind a point on a circle, flies a larger one
        const float turn_radps = now->w_B_radps.z;
        ref->a_W_mps2 = limited(ivl_vec3(-turn_radps * ref->v_W_mps.y, turn_radps * ref->v_W_mps.x, 0.0f));
    }
    stock->p_W_m.x = drawn_along(stock->p_W_m.x, ref->v_W_mps.x, dt_s, now->p_WB_m.x);
    stock->p_W_m.y = drawn_along(stock->p_W_m.y, ref->v_W_mps.y, dt_s, now->p_WB_m.y);
}

static void want_z(ivl_cf_stock_t *stock, const ivl_sample_t *now, const ivl_cf_setpoint_t *sp, float dt_s, ivl_reference_t *ref)
{
    ref->a_W_mps2.z = 0.0f;
    if (sp->z == IVL_CF_MODE_OFF)
    {
        stock->p_W_m.z = now->p_WB_m.z;
        ref->v_W_mps.z = now->v_WB_mps.z;
    }
    else if (sp->z == IVL_CF_MODE_ABS)
    {
        stock->p_W_m.z = sp->p_W_m.z;
        ref->v_W_mps.z = sp->v_mps.z;
        ref->a_W_mps2.z = limited(sp->a_W_mps2).z;
    }
    else
    {
        ref->v_W_mps.z = sp->v_mps.z;
        stock->p_W_m.z = drawn_along(stock->p_W_m.z, sp->v_mps.z, dt_s, now->p_WB_m.z);
    }
}

static void begin(ivl_cf_stock_t *stock, const ivl_sample_t *now)
{
    *stock = (ivl_cf_stock_t){.running = true, .yaw_rad = ivl_cf_yaw_of(now->q_WB), .p_W_m = now->p_WB_m};
}

// ---- the law

/// Seen from axes turned by the wanted heading, where the law wants heading 0.  They turn, too: a vehicle that turns with them is at rest.
/// @param[in] turn_radps  of these axes
static ivl_wrench_t wrench(const ivl_cf_stock_t *stock, const ivl_cfg_t *cfg, const ivl_sample_t *now, const ivl_reference_t *ref,
                           float turn_radps)
{
    const ivl_axes_t   axes = ivl_axes_of(now->q_WB);
    const ivl_vec3_t   up_B = {axes.x.z, axes.y.z, axes.z.z};
    const ivl_sincos_t full = ivl_sincos(stock->yaw_rad), half = ivl_sincos(0.5f * stock->yaw_rad);
    const ivl_quat_t   q = now->q_WB;
    ivl_sample_t       sample = *now;
    sample.p_WB_m = turned(now->p_WB_m, full.cos, -full.sin);
    sample.v_WB_mps = turned(now->v_WB_mps, full.cos, -full.sin);
    sample.w_B_radps = ivl_sub(now->w_B_radps, ivl_scale(up_B, turn_radps));
    sample.q_WB = (ivl_quat_t){
        half.cos * q.x + half.sin * q.y,
        half.cos * q.y - half.sin * q.x,
        half.cos * q.z - half.sin * q.w,
        half.cos * q.w + half.sin * q.z,
    };
    const ivl_reference_t seen = {
        .p_W_m = turned(ref->p_W_m, full.cos, -full.sin),
        .v_W_mps = turned(ref->v_W_mps, full.cos, -full.sin),
        .a_W_mps2 = turned(ref->a_W_mps2, full.cos, -full.sin),
    };
    return ivl_controller_compute(cfg, &sample, &seen, ivl_tan(TILT_RAD_MAX));
}

void ivl_cf_stock_step(ivl_cf_stock_t *stock, const ivl_cfg_t *cfg, const ivl_sample_t *now, const ivl_cf_setpoint_t *sp, float dt_s,
                       float thrust_N[4])
{
    if (ivl_cf_setpoint_idle(sp))
    {
        ivl_cf_stock_reset(stock);
        memset(thrust_N, 0, 4u * sizeof thrust_N[0]);
        return;
    }
    if (!stock->running)
    {
        begin(stock, now);
    }
    ivl_reference_t ref = {.p_W_m = {0.0f, 0.0f, 0.0f}};
    want_heading(stock, now, sp, dt_s);
    want_tilt(stock, sp, dt_s);
    want_xy(stock, cfg, now, sp, dt_s, &ref);
    want_z(stock, now, sp, dt_s, &ref);
    ref.p_W_m = stock->p_W_m;
    ivl_wrench_t asked = wrench(stock, cfg, now, &ref, (sp->yaw == IVL_CF_MODE_VELOCITY) ? sp->yawrate_radps : 0.0f);
    if (sp->z == IVL_CF_MODE_OFF)
    {
        asked.thrust_N = 4.0f * cfg->motor_thrust_N_max * ivl_clamp(sp->thrust_norm, 0.0f, 1.0f);
    }
    ivl_mixer_thrusts(cfg, &asked, thrust_N);
}
