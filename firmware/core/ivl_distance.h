/// @file ivl_distance.h
/// Stage 2: distance and closing speed of the ceiling, with standard deviation and validity, from the source that cfg->d_source names.
/// The sources that estimate run in APPROACH alone: they begin at a hover, where the closing speed is known.
#ifndef IVL_DISTANCE_H
#define IVL_DISTANCE_H
#include "ivl_ceiling.h"
#include "ivl_filter.h"
#include "ivl_formula.h"
#include "ivl_history.h"

typedef enum
{
    IVL_SOURCE_HEIGHT,   ///< position estimate and known height of the ceiling (ivl_ceiling.h)
    IVL_SOURCE_FORMULA,  ///< RREV, its derivative, accelerometer (ivl_formula.h)
    IVL_SOURCE_FILTER,   ///< Kalman filter on RREV and range, whichever comes, and accelerometer (ivl_filter.h)
    IVL_SOURCE_RANGE     ///< last range, carried on with the sensed velocity
} ivl_source_t;

typedef struct
{
    bool          running;
    bool          measured;  ///< this tick has looked at a measurement
    ivl_motion_t  motion;    ///< history's integrals at the instant of the estimate
    float         since_s;   ///< from that instant to this tick
    ivl_filter_t  filter;
    ivl_formula_t formula;
    float         range_d_m;  ///< source RANGE: distance at the instant of the estimate
    bool          has_range;  ///< a range has been taken
    uint64_t      t_rrev_us;  ///< arrival of the last reading that was looked at
    uint64_t      t_range_us;
    uint32_t      n_taken;  ///< measurements taken since the start
    uint32_t      n_gated;  ///< refused as too far off
    uint32_t      n_gated_run;
    ivl_history_t history;
} ivl_distance_t;

/// True if the distance is that of the present tick, false if it is that of the last sample.
static inline bool ivl_distance_is_present(const ivl_cfg_t *cfg)
{
    return (cfg->d_source != (uint8_t)IVL_SOURCE_HEIGHT) || (cfg->d_predict != 0u);
}

/// One tick.  At most one measurement is taken in a tick; another one that waits is taken in the next.
/// @param[in] is_approach  false: an estimate ends, and the next approach begins anew
/// @return .valid only if the distance is in [d_ceil_m_min, d_ceil_m_max], its standard deviation within d_sigma_norm_max of it, and a
///         measurement not older than d_old_s_max behind it
ivl_ceiling_t ivl_distance_update(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_sense_t *sense, const ivl_in_t *in,
                                  bool is_approach, float dt_s);
#endif  // IVL_DISTANCE_H
