/// @file ivl_formula.h
/// Distance from RREV, its derivative and the acceleration, d = a / (RREV' - RREV^2) [P eq. 7]: undefined at constant speed.
#ifndef IVL_FORMULA_H
#define IVL_FORMULA_H
#include "ivl_cfg.h"

/// RREV, its difference quotient and the acceleration behind equal first-order low-passes: they lag by the same time, and belong together.
typedef struct
{
    float    rrev_per_s;
    float    rate_per_s2;
    float    a_mps2;
    float    last_per_s;  ///< last measured RREV
    float    share;       ///< of the last step of the low-pass: period / (tau + period)
    float    period_s;    ///< between the last two measurements
    float    settled_s;   ///< since the first one
    uint32_t n;           ///< measurements
} ivl_formula_t;

typedef struct
{
    float d_m;      ///< at the instant that the low-passes show
    float sigma_m;  ///< standard deviation
    bool  valid;    ///< false: acceleration or denominator is too small, or their quotient negative; the others are 0
} ivl_formula_distance_t;

/// No measurement yet.
void ivl_formula_start(ivl_formula_t *formula);

/// One measured RREV.                                                                                        [MODEL eq. 13.11 - 13.13]
/// @param[in] period_s  since the last one, > 0
/// @param[in] a_mps2    mean acceleration towards the ceiling in between
void ivl_formula_push(const ivl_cfg_t *cfg, ivl_formula_t *formula, float rrev_per_s, float period_s, float a_mps2);

/// The formula with its guards.                                                                              [MODEL eq. 13.14, 13.15]
/// @param[in] rate_var,rrev_var,a_var  variances of the three arguments
ivl_formula_distance_t ivl_formula_compute(const ivl_cfg_t *cfg, float rrev_per_s, float rate_per_s2, float a_mps2, float rrev_var,
                                           float rate_var, float a_var);

/// The formula on what the low-passes show; invalid until they have settled.
ivl_formula_distance_t ivl_formula_distance(const ivl_cfg_t *cfg, const ivl_formula_t *formula);
#endif  // IVL_FORMULA_H
