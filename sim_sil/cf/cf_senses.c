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
