/// @file ivl_formula.c
#include "ivl_formula.h"

#include <math.h>

// a first-order low-pass has forgotten 95 % of its start after this many time constants
static const float SETTLED_TAUS = 3.0f;
#define SETTLED_N 3u

void ivl_formula_start(ivl_formula_t *formula)
{
    *formula = (ivl_formula_t){0};
}

void ivl_formula_push(const ivl_cfg_t *cfg, ivl_formula_t *formula, float rrev_per_s, float period_s, float a_mps2)
{
    if (formula->n > 0u)
    {
        const float rate_per_s2 = (rrev_per_s - formula->last_per_s) / period_s;
        const float middle_per_s = 0.5f * (rrev_per_s + formula->last_per_s);
        // the first difference is taken over as it is
        const float share = (formula->n > 1u) ? period_s / (cfg->rrev_tau_s + period_s) : 1.0f;
        formula->rrev_per_s += share * (middle_per_s - formula->rrev_per_s);
        formula->rate_per_s2 += share * (rate_per_s2 - formula->rate_per_s2);
        formula->a_mps2 += share * (a_mps2 - formula->a_mps2);
        formula->share = share;
        formula->period_s = period_s;
        formula->settled_s += period_s;
    }
    formula->last_per_s = rrev_per_s;
    formula->n++;
}

ivl_formula_distance_t ivl_formula_compute(const ivl_cfg_t *cfg, float rrev_per_s, float rate_per_s2, float a_mps2, float rrev_var,
                                           float rate_var, float a_var)
{
    const float denom_per_s2 = rate_per_s2 - rrev_per_s * rrev_per_s;
    if ((fabsf(a_mps2) >= cfg->accel_mps2_min) && (fabsf(denom_per_s2) >= cfg->denom_per_s2_min) && (a_mps2 * denom_per_s2 > 0.0f))
    {
        const float per_denom = 1.0f / denom_per_s2;
        const float d_m = a_mps2 * per_denom;
        const float denom_var = rate_var + 4.0f * rrev_per_s * rrev_per_s * rrev_var;
        return (ivl_formula_distance_t){
            .d_m = d_m,
            .sigma_m = sqrtf(a_var + d_m * d_m * denom_var) * fabsf(per_denom),
            .valid = true,
        };
    }
    return (ivl_formula_distance_t){0};
}

ivl_formula_distance_t ivl_formula_distance(const ivl_cfg_t *cfg, const ivl_formula_t *formula)
{
    if (!((formula->n >= SETTLED_N) && (formula->settled_s >= SETTLED_TAUS * cfg->rrev_tau_s)))
    {
        return (ivl_formula_distance_t){0};
    }
    // white noise of variance r behind the low-pass: r s / (2 - s), its difference quotient: r (s / T)^2 2 / (2 - s)
    const float sigma = cfg->rrev_sigma_per_s + cfg->rrev_sigma_norm * fabsf(formula->rrev_per_s);
    const float kept = sigma * sigma * formula->share / (2.0f - formula->share);
    // what the low-pass itself adds to the denominator: the spread of a growing RREV within its memory, (RREV' tau)^2
    const float spread_per_s = formula->rate_per_s2 * cfg->rrev_tau_s;
    const float spread_var = spread_per_s * spread_per_s * spread_per_s * spread_per_s;
    const float rate_var = 2.0f * kept * formula->share / (formula->period_s * formula->period_s) + spread_var;
    const float a_var = cfg->kf_b_sigma_mps2 * cfg->kf_b_sigma_mps2 + cfg->kf_q_m2ps3 / formula->period_s;
    return ivl_formula_compute(cfg, formula->rrev_per_s, formula->rate_per_s2, formula->a_mps2, kept, rate_var, a_var);
}
