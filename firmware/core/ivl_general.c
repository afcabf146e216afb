/// @file ivl_general.c
#include "ivl_general.h"

#include "ivl_math.h"

static const float MIDDLE_X_MPS = 1.4f;
static const float MIDDLE_Z_MPS = 1.6f;
static const float PER_MPS = 0.5f;

// no threshold beyond these, whatever the numbers of a form
static const float RREV_PER_S_MIN = 0.5f;
static const float RREV_PER_S_MAX = 20.0f;

ivl_point_t ivl_general_point(const ivl_seen_t *seen)
{
    const float d_m = seen->ceiling.d_ceil_m;
    const float vx_mps = ivl_clamp(-seen->cues.of_y_radps * d_m, 0.0f, IVL_GENERAL_V_MPS_MAX);
    const float vz_mps = ivl_clamp(seen->cues.rrev_per_s * d_m, 0.0f, IVL_GENERAL_V_MPS_MAX);
    return (ivl_point_t){vx_mps, vz_mps, (vx_mps - MIDDLE_X_MPS) * PER_MPS, (vz_mps - MIDDLE_Z_MPS) * PER_MPS};
}

float ivl_general_poly2(const float c[], float x, float z)
{
    return c[0] + x * (c[1] + x * c[3] + z * c[4]) + z * (c[2] + z * c[5]);
}

float ivl_general_poly3(const float c[], float x, float z)
{
    const float xx = x * x, zz = z * z;
    return ivl_general_poly2(c, x, z) + xx * (x * c[6] + z * c[7]) + zz * (x * c[8] + z * c[9]);
}

ivl_action_t ivl_general_action(const float rest[], const ivl_seen_t *seen, const ivl_point_t *p, float threshold_per_s)
{
    const float *go = rest + IVL_GENERAL_N_MOMENT;
    const float  p_land = ivl_logistic(ivl_general_poly3(go + 1, p->x, p->z));
    const float  moment_Nm = rest[0] + rest[1] * p->x + rest[2] * p->z;
    return (ivl_action_t){
        .flip = seen->cues.rrev_per_s >= ivl_clamp(threshold_per_s, RREV_PER_S_MIN, RREV_PER_S_MAX),
        .go = p_land >= go[0],
        .moment_Nm = (moment_Nm > 0.0f) ? moment_Nm : 0.0f,
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
