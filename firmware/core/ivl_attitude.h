/// @file ivl_attitude.h
/// Attitude between two outputs of a slow estimator: integrates the gyro.  For the port, before ivl_step; the pipeline does not use it.
#ifndef IVL_ATTITUDE_H
#define IVL_ATTITUDE_H
#include "ivl_types.h"

typedef struct
{
    ivl_quat_t q_WB;    ///< present attitude
    ivl_quat_t q_seen;  ///< last output of the estimator
} ivl_attitude_t;

/// One gyro sample.  An output of the estimator that differs from the last one is taken over, if the estimator is to be followed;
/// else the last attitude turns by w dt.
/// @param[in] q_estimate_WB  present output of the estimator, unit length; a bad one is passed on, for ivl_step to refuse
/// @param[in] is_followed    false in a flip, which an estimator for upright flight need not survive
/// @param[in] w_B_radps      gyro; a turn of up to 0.1 rad a call is right to 1e-4 of itself
void ivl_attitude_update(ivl_attitude_t *attitude, ivl_quat_t q_estimate_WB, bool is_followed, ivl_vec3_t w_B_radps, float dt_s);
#endif  // IVL_ATTITUDE_H
