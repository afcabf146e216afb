/// @file ivl_distance.c
/// Measurements are late, each by its own delay; the accelerometer is late too.  An estimate therefore stands at the sampling instant of its
/// last measurement, and what the accelerometer told since then carries it to the present tick.
#include "ivl_distance.h"

#include "ivl_math.h"

// no vehicle accelerates like this in an approach; an impact may read more
static const float A_MPS2_MAX = 200.0f;

// a reading that arrived longer ago is none
static const uint64_t READING_US_MAX = 100000u;

// the expected RREV is linear in the distance only far enough from the ceiling
static const float LINEAR_D_M_MIN = 0.05f;

// v / d is no nearly linear function of a distance that may well be zero: a start is this many standard deviations away, or is put there
static const float START_SIGMAS = 2.0f;

// after so many refusals in a row the estimate is wrong and not the measurements: it becomes uncertain again, the speed more than at a hover
#define GATED_RUN_MAX 5u
static const float RESTART_V_SIGMA_NORM = 10.0f;

// a difference quotient over less time is noise
static const float PERIOD_S_MIN = 0.001f;

// readings from before stay looked at; the history's old ticks need no clearing
static void start(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_sense_t *sense)
{
    ivl_history_start(&distance->history);
    ivl_formula_start(&distance->formula);
    const float d_m = cfg->h_ceil_m - sense->rel.height_m, d_m_min = START_SIGMAS * cfg->kf_d_sigma_m;
    ivl_filter_start(&distance->filter, (d_m > d_m_min) ? d_m : d_m_min, sense->rel.close_mps, cfg->kf_d_sigma_m, cfg->kf_v_sigma_mps,
                     cfg->kf_b_sigma_mps2);
    distance->motion = (ivl_motion_t){0.0f, 0.0f};
    distance->since_s = 0.0f;
    distance->range_d_m = 0.0f;
    distance->has_range = false;
    distance->n_taken = 0;
    distance->n_gated = 0;
    distance->n_gated_run = 0;
    distance->running = true;
}

typedef struct
{
    float        value;
    float        age_s;   ///< of its sampling instant
    float        span_s;  ///< from the instant of the estimate to that of the measurement; negative if it comes late
    ivl_motion_t motion;  ///< at that instant
} measurement_t;

typedef enum
{
    MEASURED_RREV,
    MEASURED_RANGE
} measured_t;

// a reading that is new, valid, in range and not from before the start
static bool read(const ivl_cfg_t *cfg, const ivl_distance_t *distance, uint64_t t_us, const ivl_reading_t *reading, float lo, float hi,
                 float delay_s, measurement_t *m)
{
    const uint64_t age_us = t_us - reading->t_us;
    if ((reading->valid == 0u) || (age_us > READING_US_MAX) || !((reading->value >= lo) && (reading->value <= hi)))
    {
        return false;
    }
    m->value = reading->value;
    m->age_s = (float)(uint32_t)age_us * 1.0e-6f + delay_s;
    m->span_s = distance->since_s - m->age_s;
    const float ago_s = m->age_s - cfg->accel_delay_s;
    return ivl_history_at(&distance->history, ago_s, ago_s * cfg->tick_hz, &m->motion);
}

static bool read_rrev(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_in_t *in, measurement_t *m)
{
    if ((cfg->d_source == (uint8_t)IVL_SOURCE_RANGE) || (in->rrev.t_us == distance->t_rrev_us))
    {
        return false;
    }
    distance->t_rrev_us = in->rrev.t_us;
    return read(cfg, distance, in->t_us, &in->rrev, -cfg->rrev_per_s_max, cfg->rrev_per_s_max, cfg->rrev_delay_s, m);
}

static bool read_range(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_in_t *in, measurement_t *m)
{
    if ((cfg->d_source == (uint8_t)IVL_SOURCE_FORMULA) || (in->range.t_us == distance->t_range_us))
    {
        return false;
    }
    distance->t_range_us = in->range.t_us;
    return read(cfg, distance, in->t_us, &in->range, cfg->range_m_min, cfg->range_m_max, cfg->range_delay_s, m);
}

// what the accelerometer adds over a time t from the instant of the estimate on: change of speed, and way beyond v t
static ivl_motion_t gained(const ivl_distance_t *distance, ivl_motion_t at, float t_s)
{
    return (ivl_motion_t){at.v_mps - distance->motion.v_mps, at.p_m - distance->motion.p_m - distance->motion.v_mps * t_s};
}

// ---- filter

// expected: v / d.  The equation is multiplied by d, which saves the second division.                         [MODEL eq. 13.8]
static ivl_innovation_t of_rrev(const ivl_cfg_t *cfg, const ivl_filter_t *filter, float rrev_per_s)
{
    const float d_m = (filter->d_m > LINEAR_D_M_MIN) ? filter->d_m : LINEAR_D_M_MIN;
    const float expected_per_s = filter->v_mps / d_m;
    const float sigma_mps = (cfg->rrev_sigma_per_s + cfg->rrev_sigma_norm * fabsf(expected_per_s)) * d_m;
    return (ivl_innovation_t){.h1 = -expected_per_s, .h2 = 1.0f, .y = rrev_per_s * d_m - filter->v_mps, .r = sigma_mps * sigma_mps};
}

static ivl_innovation_t of_range(const ivl_cfg_t *cfg, const ivl_filter_t *filter, float d_m)
{
    return (ivl_innovation_t){.h1 = 1.0f, .h2 = 0.0f, .y = d_m - filter->d_m, .r = cfg->range_sigma_m * cfg->range_sigma_m};
}

static void filter_correct(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_innovation_t *innovation)
{
    ivl_filter_t *filter = &distance->filter;
    if (ivl_filter_correct(filter, innovation, cfg->kf_gate_norm))
    {
        distance->n_taken++;
        distance->n_gated_run = 0;
        return;
    }
    distance->n_gated++;
    distance->n_gated_run++;
    if (distance->n_gated_run >= GATED_RUN_MAX)
    {
        ivl_filter_start(filter, filter->d_m, filter->v_mps, cfg->kf_d_sigma_m, RESTART_V_SIGMA_NORM * cfg->kf_v_sigma_mps,
                         cfg->kf_b_sigma_mps2);
        distance->n_gated_run = 0;
    }
}

static void filter_take(const ivl_cfg_t *cfg, ivl_distance_t *distance, measured_t what, const measurement_t *m, float facing)
{
    ivl_filter_t      *filter = &distance->filter;
    const ivl_motion_t gain = gained(distance, m->motion, m->span_s);
    ivl_filter_predict(filter, m->span_s, gain.v_mps, gain.p_m, cfg->kf_q_m2ps3);
    const ivl_innovation_t innovation = (what == MEASURED_RREV) ? of_rrev(cfg, filter, m->value) : of_range(cfg, filter, m->value * facing);
    filter_correct(cfg, distance, &innovation);
}

static void filter_show(const ivl_cfg_t *cfg, const ivl_distance_t *distance, ivl_ceiling_t *ceiling)
{
    const ivl_filter_t *filter = &distance->filter;
    const float         t_s = distance->since_s;
    const ivl_motion_t  gain = gained(distance, ivl_history_after(&distance->history, cfg->accel_delay_s), t_s);
    const float         dv_mps = filter->b_mps2 * t_s;
    const float         bias_m = distance->has_range ? cfg->range_bias_m : 0.0f;
    ceiling->d_ceil_m = filter->d_m - (filter->v_mps - 0.5f * dv_mps) * t_s - gain.p_m;
    ceiling->v_close_mps = filter->v_mps - dv_mps + gain.v_mps;
    ceiling->d_sigma_m = sqrtf(ivl_filter_d_variance(filter, t_s, cfg->kf_q_m2ps3) + bias_m * bias_m);
    ceiling->valid = distance->n_taken > 0u;
}

// ---- formula

static void formula_take(const ivl_cfg_t *cfg, ivl_distance_t *distance, const measurement_t *m)
{
    if (m->span_s > cfg->d_old_s_max)
    {
        ivl_formula_start(&distance->formula);
    }
    const float span_s = (m->span_s >= PERIOD_S_MIN) ? m->span_s : PERIOD_S_MIN;
    ivl_formula_push(cfg, &distance->formula, m->value, span_s, (m->motion.v_mps - distance->motion.v_mps) / span_s);
    distance->n_taken++;
}

// carried on from the instant that the low-passes show, with d' = -RREV d and the acceleration a = d (RREV' - RREV^2)
static void formula_show(const ivl_cfg_t *cfg, const ivl_distance_t *distance, ivl_ceiling_t *ceiling)
{
    const ivl_formula_t         *formula = &distance->formula;
    const ivl_formula_distance_t at = ivl_formula_distance(cfg, formula);
    const float                  lag_s = distance->since_s + 0.5f * formula->period_s + cfg->rrev_tau_s;
    const float                  denom_per_s2 = formula->rate_per_s2 - formula->rrev_per_s * formula->rrev_per_s;
    const float                  left_norm = 1.0f - lag_s * (formula->rrev_per_s + 0.5f * lag_s * denom_per_s2);
    ceiling->d_ceil_m = at.d_m * left_norm;
    ceiling->v_close_mps = at.d_m * (formula->rrev_per_s + lag_s * denom_per_s2);
    ceiling->d_sigma_m = at.sigma_m * left_norm;
    ceiling->valid = at.valid;
}

// ---- ranging sensor

static void range_show(const ivl_cfg_t *cfg, const ivl_distance_t *distance, const ivl_sense_t *sense, ivl_ceiling_t *ceiling)
{
    const float v_mps = sense->rel.close_mps;
    const float drift_m = cfg->kf_v_sigma_mps * distance->since_s;
    ceiling->d_ceil_m = distance->range_d_m - v_mps * distance->since_s;
    ceiling->v_close_mps = v_mps;
    ceiling->d_sigma_m = sqrtf(cfg->range_sigma_m * cfg->range_sigma_m + cfg->range_bias_m * cfg->range_bias_m + drift_m * drift_m);
    ceiling->valid = distance->n_taken > 0u;
}

// ---- the stage

static bool good(const ivl_cfg_t *cfg, const ivl_ceiling_t *ceiling, float age_s)
{
    // in positive form: what is no number is invalid
    return ceiling->valid && (ceiling->d_ceil_m >= cfg->d_ceil_m_min) && (ceiling->d_ceil_m <= cfg->d_ceil_m_max) &&
           (ceiling->d_sigma_m >= 0.0f) && (ceiling->d_sigma_m <= cfg->d_sigma_norm_max * ceiling->d_ceil_m) && (age_s <= cfg->d_old_s_max);
}

static void take(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_sense_t *sense, measured_t what, const measurement_t *m)
{
    if (cfg->d_source == (uint8_t)IVL_SOURCE_FILTER)
    {
        filter_take(cfg, distance, what, m, sense->rel.facing);
    }
    else if (cfg->d_source == (uint8_t)IVL_SOURCE_FORMULA)
    {
        formula_take(cfg, distance, m);
    }
    else
    {
        distance->range_d_m = m->value * sense->rel.facing;
        distance->n_taken++;
    }
    distance->has_range = distance->has_range || (what == MEASURED_RANGE);
    // the estimate now stands at the instant of this measurement
    distance->motion = m->motion;
    distance->since_s = m->age_s;
}

static ivl_ceiling_t show(const ivl_cfg_t *cfg, const ivl_distance_t *distance, const ivl_sense_t *sense)
{
    const float   age_s = distance->since_s;
    ivl_ceiling_t ceiling = {.age_s = age_s};
    if (cfg->d_source == (uint8_t)IVL_SOURCE_FORMULA)
    {
        formula_show(cfg, distance, &ceiling);
    }
    else if (cfg->d_source == (uint8_t)IVL_SOURCE_FILTER)
    {
        filter_show(cfg, distance, &ceiling);
    }
    else
    {
        range_show(cfg, distance, sense, &ceiling);
    }
    return good(cfg, &ceiling, age_s) ? ceiling : (ivl_ceiling_t){.age_s = age_s};
}

ivl_ceiling_t ivl_distance_update(const ivl_cfg_t *cfg, ivl_distance_t *distance, const ivl_sense_t *sense, const ivl_in_t *in,
                                  bool is_approach, float dt_s)
{
    if (cfg->d_source == (uint8_t)IVL_SOURCE_HEIGHT)
    {
        return ivl_ceiling_compute(cfg, sense);
    }
    distance->measured = false;
    if (!is_approach)
    {
        distance->running = false;
        return (ivl_ceiling_t){0};
    }
    if (!distance->running)
    {
        // the sample of an approach that has just begun is this tick's, or was the last one's
        start(cfg, distance, sense);
        return (ivl_ceiling_t){0};
    }
    ivl_history_push(&distance->history, ivl_clamp(sense->rel.accel_mps2, -A_MPS2_MAX, A_MPS2_MAX), dt_s);
    distance->since_s += dt_s;
    // a tick whose clock or state is bad looks at no measurement
    if (!sense->pose_fresh)
    {
        return (ivl_ceiling_t){0};
    }
    measurement_t m;
    const bool    is_rrev = read_rrev(cfg, distance, in, &m);
    distance->measured = is_rrev || read_range(cfg, distance, in, &m);
    if (distance->measured)
    {
        take(cfg, distance, sense, is_rrev ? MEASURED_RREV : MEASURED_RANGE, &m);
    }
    return show(cfg, distance, sense);
}
