/// @file ivl_general.c
#include "ivl_general.h"

#include "ivl_math.h"

static const float MIDDLE_X_MPS = 1.4f;
static const float MIDDLE_Z_MPS = 1.6f;
static const float PER_MPS = 0.5f;

// no threshold beyond these, whatever the numbers of a form
static const float RREV_PER_S_MIN = 0.5f;
static const float RREV_PER_S_MAX = 20.0f;

ivl_sensed_t ivl_general_sensed(const ivl_seen_t *seen)
{
    const float d_m = seen->ceiling.d_ceil_m;
    return (ivl_sensed_t){
        .vx_mps = ivl_clamp(-seen->cues.of_y_radps * d_m, 0.0f, IVL_GENERAL_V_MPS_MAX),
        .vz_mps = ivl_clamp(seen->cues.rrev_per_s * d_m, 0.0f, IVL_GENERAL_V_MPS_MAX),
    };
}

ivl_point_t ivl_general_point(ivl_sensed_t v)
{
    return (ivl_point_t){.x = (v.vx_mps - MIDDLE_X_MPS) * PER_MPS, .z = (v.vz_mps - MIDDLE_Z_MPS) * PER_MPS};
}

float ivl_general_poly2(const float c[], ivl_point_t p)
{
    return c[0] + p.x * (c[1] + p.x * c[3] + p.z * c[4]) + p.z * (c[2] + p.z * c[5]);
}

float ivl_general_poly3(const float c[], ivl_point_t p)
{
    const float xx = p.x * p.x, zz = p.z * p.z;
    return ivl_general_poly2(c, p) + xx * (p.x * c[6] + p.z * c[7]) + zz * (p.x * c[8] + p.z * c[9]);
}

static float moment_Nm(const float m[], ivl_point_t p)
{
    const float moment = m[0] + m[1] * p.x + m[2] * p.z;
    return (moment > 0.0f) ? moment : 0.0f;
}

ivl_action_t ivl_general_action(const float rest[], const ivl_seen_t *seen, ivl_point_t p, float threshold_per_s)
{
    const float *go = rest + IVL_GENERAL_N_MOMENT;
    const float  p_land = ivl_logistic(ivl_general_poly3(go + 1, p));
    return (ivl_action_t){
        .flip = seen->cues.rrev_per_s >= ivl_clamp(threshold_per_s, RREV_PER_S_MIN, RREV_PER_S_MAX),
        .go = p_land >= go[0],
        .moment_Nm = moment_Nm(rest, p),
        .p_land = p_land,
    };
}

// the larger product of a factor with the two ends of a coordinate
static float most_of(float factor, float middle_mps)
{
    const float low = factor * ((0.0f - middle_mps) * PER_MPS), high = factor * ((IVL_GENERAL_V_MPS_MAX - middle_mps) * PER_MPS);
    return (low > high) ? low : high;
}

float ivl_general_moment_most_Nm(const float rest[])
{
    const float most = rest[0] + most_of(rest[1], MIDDLE_X_MPS) + most_of(rest[2], MIDDLE_Z_MPS);
    return (most > 0.0f) ? most : 0.0f;
}
