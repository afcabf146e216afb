/// @file app_senses.c
#include "app_senses.h"

#include <string.h>

#include "app_convert.h"

// an estimator for upright flight is followed only where the vehicle is upright
static bool follows_estimator(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_IDLE) || (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_ABORTED) ||
           (phase == IVL_PHASE_LEVEL_OUT);
}

// the SDK's state carries no time: an estimator that stands still is seen by a position that does
static uint64_t pose_time_us(app_senses_t *senses, ivl_vec3_t p_WB_m, uint64_t now_us)
{
    if (!senses->has_pose || (memcmp(&senses->p_seen_W_m, &p_WB_m, sizeof p_WB_m) != 0))
    {
        senses->has_pose = true;
        senses->p_seen_W_m = p_WB_m;
        senses->t_pose_us = now_us;
    }
    return senses->t_pose_us;
}

void app_sense_attitude(app_senses_t *senses, const sensorData_t *sensors, const state_t *state, ivl_phase_t phase, float loop_s)
{
    ivl_attitude_update(&senses->attitude, app_q_WB(state), follows_estimator(phase), app_w_B_radps(sensors), loop_s);
}

void app_sense_motion(app_senses_t *senses, const sensorData_t *sensors, const state_t *state, ivl_phase_t phase, float loop_s,
                      uint64_t now_us, ivl_in_t *in)
{
    in->t_us = now_us;
    in->p_WB_m = app_p_W_m(state);
    in->v_WB_mps = app_v_W_mps(state);
    in->w_B_radps = app_w_B_radps(sensors);
    in->f_B_mps2 = app_f_B_mps2(sensors);
    app_sense_attitude(senses, sensors, state, phase, loop_s);
    in->q_WB = senses->attitude.q_WB;
    in->t_pose_us = pose_time_us(senses, in->p_WB_m, now_us);
}

void app_sense_range(app_senses_t *senses, float range_mm, uint64_t now_us, ivl_reading_t *range)
{
    if ((range_mm > 0.0f) && ((range_mm < senses->range_seen_mm) || (range_mm > senses->range_seen_mm)))
    {
        senses->range_seen_mm = range_mm;
        *range = app_range_reading(range_mm, now_us);
    }
}
