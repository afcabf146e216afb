/// @file cf_senses.c
/// What the SDK hands round in a tick of the world: the sensed state as sensors and estimator of the stock firmware give it.
#include <math.h>

#include "app_convert.h"
#include "cf_vehicle.h"

// what a core's clock shows when the world's clock is 0
static const uint64_t CORE_ZERO_US = 1000000;
static const float    DEG_PER_RAD = 57.2957795f;

static void shift(ivl_reading_t *reading, uint64_t shift_us)
{
    reading->t_us += (reading->t_us > 0u) ? shift_us : 0u;  // 0: there is no such sensor
}

/// The world's clock is set back with each start, the vehicle's goes on.
static ivl_in_t in_vehicle_time(const ivl_cf_t *cf, const ivl_in_t *in)
{
    const uint64_t shift_us = cf->zero_us - CORE_ZERO_US;
    ivl_in_t       shifted = *in;
    shifted.t_us += shift_us;
    shifted.t_pose_us += shift_us;
    shift(&shifted.rrev, shift_us);
    shift(&shifted.range, shift_us);
    shift(&shifted.flow, shift_us);
    return shifted;
}

static void estimate(ivl_cf_t *cf, const ivl_in_t *before)
{
    if (cf->set.estimator != IVL_CF_ESTIMATOR_KALMAN)
    {
        // the others have no position: it stands still and grows old
        cf->sensed.t_pose_us = before->t_pose_us;
        cf->sensed.p_WB_m = before->p_WB_m;
        cf->sensed.v_WB_mps = before->v_WB_mps;
    }
    else if (cf->set.sim.pose_source != 0u)
    {
        ivl_cf_estimate_fill(&cf->estimate, (float)cf->model.tick_s, &cf->sensed);
    }
    else
    {
        ivl_cf_frame_apply(&cf->frame, &cf->sensed);
    }
}

void ivl_cf_begin_estimate(ivl_cf_t *cf)
{
    const float     *to = cf->set.initial_m, yaw_rad = cf->set.initial_yaw_rad;
    const ivl_vec3_t to_m = {to[0], to[1], to[2]};
    const float      most = IVL_SENSE_P_M_MAX;
    ivl_cf_estimate_reset(&cf->estimate);
    // what is no number, or nowhere, is where the vehicle is
    const bool is_place =
        ivl_vec3_within(to_m, most) && ivl_within(yaw_rad, most) && !(ivl_vec3_within(to_m, 0.0f) && ivl_within(yaw_rad, 0.0f));
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const ivl_quat_t    q = {(float)kin.q_WB[0], (float)kin.q_WB[1], (float)kin.q_WB[2], (float)kin.q_WB[3]};
    cf->frame = (ivl_cf_frame_t){
        .is_other = is_place,
        .from_W_m = {(float)kin.p_WB_m[0], (float)kin.p_WB_m[1], (float)kin.p_WB_m[2]},
        .to_m = to_m,
        .turn_rad = is_place ? ivl_cf_wrapped(yaw_rad - ivl_cf_yaw_of(q)) : 0.0f,
    };
}

/// Degrees, the pitch nose up: the other way than a turn about y.
static attitude_t euler_of(ivl_quat_t q_WB)
{
    const ivl_axes_t r = ivl_axes_of(q_WB);
    const double     sin_pitch = -(double)r.x.z, rest = 1.0 - sin_pitch * sin_pitch;
    return (attitude_t){
        .roll = (float)ivl_sim_atan2((double)r.y.z, (double)r.z.z) * DEG_PER_RAD,
        .pitch = -(float)ivl_sim_atan2(sin_pitch, sqrt((rest > 0.0) ? rest : 0.0)) * DEG_PER_RAD,
        .yaw = (float)ivl_sim_atan2((double)r.x.y, (double)r.x.x) * DEG_PER_RAD,
    };
}

static void filter_force(ivl_cf_t *cf)
{
    const Axis3f acc = cf->sensors.acc;
    const float  now_g[3] = {acc.x, acc.y, acc.z};
    for (int i = 0; i < 3; i++)
    {
        cf->acc_g[i] += cf->acc_share * (now_g[i] - cf->acc_g[i]);
    }
}

void ivl_cf_sense(ivl_cf_t *cf, const ivl_in_t *in)
{
    const ivl_in_t before = cf->sensed;
    cf->sensed = in_vehicle_time(cf, in);
    estimate(cf, &before);
    ivl_sim_sdk_of(&cf->told, &cf->sensed, &cf->sensors, &cf->state);
    cf->state.attitude = euler_of(cf->sensed.q_WB);
    filter_force(cf);
    if (cf->has_range)
    {
        cf->range_mm[IVL_CF_UP] = (uint16_t)ivl_sim_sdk_range_mm(&cf->sensed.range);
    }
    if (cf->model.has_readings)
    {
        app_camera_says(&cf->sensed.rrev, &cf->sensed.flow);
    }
}
