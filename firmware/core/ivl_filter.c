/// @file ivl_filter.c
#include "ivl_filter.h"

#include <math.h>

// far below any variance that matters, far above what underflows in a product
static const float VARIANCE_MIN = 1.0e-12f;

void ivl_filter_start(ivl_filter_t *filter, float d_m, float v_mps, float d_sigma_m, float v_sigma_mps, float b_sigma_mps2)
{
    *filter = (ivl_filter_t){
        .d_m = d_m,
        .v_mps = v_mps,
        .d1 = d_sigma_m * d_sigma_m,
        .d2 = v_sigma_mps * v_sigma_mps,
        .d3 = b_sigma_mps2 * b_sigma_mps2,
    };
}

void ivl_filter_predict(ivl_filter_t *filter, float t_s, float dv_mps, float dp_m, float q_m2ps3)
{
    // d' = d - v t - dp + b t^2 / 2,  v' = v + dv - b t
    const float half_t2 = 0.5f * t_s * t_s;
    filter->d_m += filter->b_mps2 * half_t2 - filter->v_mps * t_s - dp_m;
    filter->v_mps += dv_mps - filter->b_mps2 * t_s;

    // U' = F U
    filter->u13 += half_t2 - t_s * filter->u23;
    filter->u23 -= t_s;
    const float u12 = filter->u12 - t_s;

    // noise of the acceleration: variance c along (-t/2, 1, 0), as a rank-one update of U and D
    const float c = q_m2ps3 * fabsf(t_s);
    const float d2 = filter->d2 + c;
    const float a1 = -0.5f * t_s - u12;
    const float share = c / d2;
    filter->u12 = u12 + share * a1;
    filter->d1 += share * filter->d2 * a1 * a1;
    filter->d2 = d2;
}

static float floored(float variance)
{
    return (variance > VARIANCE_MIN) ? variance : VARIANCE_MIN;
}

bool ivl_filter_correct(ivl_filter_t *filter, const ivl_innovation_t *in, float gate)
{
    const float f1 = in->h1;
    const float f2 = in->h1 * filter->u12 + in->h2;
    const float f3 = in->h1 * filter->u13 + in->h2 * filter->u23;
    const float g1 = filter->d1 * f1, g2 = filter->d2 * f2, g3 = filter->d3 * f3;
    const float s1 = in->r + f1 * g1;
    const float s2 = s1 + f2 * g2;
    const float s3 = s2 + f3 * g3;  // variance of y
    // in positive form: what is no number is refused
    if (!(in->y * in->y <= gate * gate * s3))
    {
        return false;
    }
    const float per_s1 = 1.0f / s1, per_s2 = 1.0f / s2, per_s3 = 1.0f / s3;
    filter->d1 = floored(filter->d1 * in->r * per_s1);
    filter->d2 = floored(filter->d2 * s1 * per_s2);
    filter->d3 = floored(filter->d3 * s2 * per_s3);

    // columns 2 and 3 of U; k1, k2 and g3 become the gain times s3
    const float l2 = f2 * per_s1, l3 = f3 * per_s2;
    const float u12 = filter->u12, u13 = filter->u13, u23 = filter->u23;
    filter->u12 = u12 - l2 * g1;
    const float k1 = g1 + g2 * u12;
    filter->u13 = u13 - l3 * k1;
    filter->u23 = u23 - l3 * g2;
    const float y = in->y * per_s3;
    filter->d_m += (k1 + g3 * u13) * y;
    filter->v_mps += (g2 + g3 * u23) * y;
    filter->b_mps2 += g3 * y;
    return true;
}

float ivl_filter_d_variance(const ivl_filter_t *filter, float t_s, float q_m2ps3)
{
    const float f2 = filter->u12 - t_s;
    const float f3 = filter->u13 + t_s * (0.5f * t_s - filter->u23);
    return filter->d1 + filter->d2 * f2 * f2 + filter->d3 * f3 * f3 + q_m2ps3 * fabsf(t_s * t_s * t_s) * (1.0f / 3.0f);
}
