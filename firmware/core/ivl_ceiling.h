/// @file ivl_ceiling.h
/// Distance and closing speed of a surface of known height, d = h_ceil - n.p (a ceiling: h_ceil - z): one of the sources of stage 2 (ivl_distance.h).
#ifndef IVL_CEILING_H
#define IVL_CEILING_H
#include "ivl_sense.h"

typedef struct
{
    float d_ceil_m;     ///< from the origin of B along the ceiling's normal; 0 if invalid
    float v_close_mps;  ///< closing speed, -d(d)/dt; 0 if invalid
    float d_sigma_m;    ///< standard deviation of the distance; 0 if invalid
    float age_s;        ///< age of the sample behind it
    bool  valid;        ///< false: the distance must not be used
} ivl_ceiling_t;

/// With cfg->d_predict the sample is carried on to the present tick at its own velocity.                          [MODEL eq. 13.1]
/// @return .valid is true only for a sample of this tick with d in [d_ceil_m_min, d_ceil_m_max] and height_sigma_m within d_sigma_norm_max of it
ivl_ceiling_t ivl_ceiling_compute(const ivl_cfg_t *cfg, const ivl_sense_t *sense);
#endif  // IVL_CEILING_H
