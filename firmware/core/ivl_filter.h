/// @file ivl_filter.h
/// Kalman filter over distance, closing speed and accelerometer bias.  The covariance is kept as P = U D U^T with U unit upper triangular
/// and D > 0: symmetric and positive definite by construction.  The transition is unit upper triangular too, so that a prediction is a
/// product of such matrices.  Pure: no clock, no memory beside the struct.
#ifndef IVL_FILTER_H
#define IVL_FILTER_H
#include <stdbool.h>

typedef struct
{
    float d_m;     ///< distance
    float v_mps;   ///< closing speed
    float b_mps2;  ///< what the accelerometer reads too much, towards the ceiling
    float u12, u13, u23;
    float d1, d2, d3;
} ivl_filter_t;

/// One scalar measurement, linear about the estimate: y = measured - expected, with y = h1 d' + h2 v' + noise of variance r for errors d', v'.
typedef struct
{
    float h1, h2;
    float y;
    float r;  ///< > 0
} ivl_innovation_t;

/// @param[in] d_sigma_m,v_sigma_mps,b_sigma_mps2  standard deviations, > 0; the bias starts at 0
void ivl_filter_start(ivl_filter_t *filter, float d_m, float v_mps, float d_sigma_m, float v_sigma_mps, float b_sigma_mps2);

/// Carry estimate and covariance over a time t, also a negative one.                                          [MODEL eq. 13.5 - 13.7]
/// @param[in] dv_mps   measured change of the closing speed, bias included
/// @param[in] dp_m     measured way towards the ceiling beyond v t, bias included
/// @param[in] q_m2ps3  growth of the speed's variance per time
void ivl_filter_predict(ivl_filter_t *filter, float t_s, float dv_mps, float dp_m, float q_m2ps3);

/// Take in a measurement, unless it is further off than `gate` standard deviations of what is expected.       [MODEL eq. 13.8, 13.9]
/// @return false, and nothing changed, if it was refused
bool ivl_filter_correct(ivl_filter_t *filter, const ivl_innovation_t *innovation, float gate);

/// Variance of the distance a time t later.                                                                       [MODEL eq. 13.10]
float ivl_filter_d_variance(const ivl_filter_t *filter, float t_s, float q_m2ps3);
#endif  // IVL_FILTER_H
