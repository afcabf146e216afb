/// @file cf_poly.c
/// One axis from (x0, v0, a0) to (x1, v1, a1) in the time T, with a third derivative of 0 at both ends.  With velocities and accelerations
/// scaled by T and T^2, what is left to be covered is h = x1 - x0 - v0 - a0/2, k = v1 - v0 - a0, l = a1 - a0, and then
///   c4 = 35 h - 15 k + 5/2 l,  c5 = -84 h + 39 k - 7 l,  c6 = 70 h - 34 k + 13/2 l,  c7 = -20 h + 10 k - 2 l
#include "cf_poly.h"

#include <math.h>
#include <string.h>

#include "ivl_math.h"

static const float PI_F = 3.14159265f;
static const float GRAVITY_MPS2 = 9.81f;

float ivl_cf_wrapped(float angle_rad)
{
    const float turns = floorf(angle_rad / (2.0f * PI_F) + 0.5f);
    return angle_rad - 2.0f * PI_F * turns;
}

/// From powers of the share of the duration to powers of the time.
static void stretch(float c[IVL_CF_POLY_N], float T)
{
    float scale = 1.0f;
    for (int i = 0; i < IVL_CF_POLY_N; i++)
    {
        c[i] *= scale;
        scale /= T;
    }
}

static void fit(float c[IVL_CF_POLY_N], float T, const float from[3], const float to[3])
{
    memset(c, 0, IVL_CF_POLY_N * sizeof c[0]);
    if (!(T > 0.0f))
    {
        c[0] = to[0], c[1] = to[1], c[2] = 0.5f * to[2];
        return;
    }
    const float v0 = T * from[1], a0 = T * T * from[2], v1 = T * to[1], a1 = T * T * to[2];
    const float h = to[0] - from[0] - v0 - 0.5f * a0, k = v1 - v0 - a0, l = a1 - a0;
    c[0] = from[0], c[1] = v0, c[2] = 0.5f * a0;
    c[4] = 35.0f * h - 15.0f * k + 2.5f * l;
    c[5] = -84.0f * h + 39.0f * k - 7.0f * l;
    c[6] = 70.0f * h - 34.0f * k + 6.5f * l;
    c[7] = -20.0f * h + 10.0f * k - 2.0f * l;
    stretch(c, T);
}

ivl_cf_piece_t ivl_cf_piece_between(const ivl_cf_goal_t *from, const ivl_cf_goal_t *to, float duration_s)
{
    ivl_cf_piece_t piece = {.duration_s = (duration_s > 0.0f) ? duration_s : 0.0f};
    const float    x[2][3] = {{from->p_W_m.x, from->v_W_mps.x, from->a_W_mps2.x}, {to->p_W_m.x, to->v_W_mps.x, to->a_W_mps2.x}};
    const float    y[2][3] = {{from->p_W_m.y, from->v_W_mps.y, from->a_W_mps2.y}, {to->p_W_m.y, to->v_W_mps.y, to->a_W_mps2.y}};
    const float    z[2][3] = {{from->p_W_m.z, from->v_W_mps.z, from->a_W_mps2.z}, {to->p_W_m.z, to->v_W_mps.z, to->a_W_mps2.z}};
    const float    yaw[2][3] = {{from->yaw_rad, from->yawrate_radps, 0.0f}, {to->yaw_rad, to->yawrate_radps, 0.0f}};
    fit(piece.c[0], duration_s, x[0], x[1]);
    fit(piece.c[1], duration_s, y[0], y[1]);
    fit(piece.c[2], duration_s, z[0], z[1]);
    fit(piece.c[3], duration_s, yaw[0], yaw[1]);
    return piece;
}

/// c_j = n! / (n - j)! * sum over i <= j of (-1)^(i + j) x_i / (i! (j - i)!), of the curve of degree n over 0 .. 1.
void ivl_cf_piece_bezier(float c[IVL_CF_POLY_N], const float *points, int n, float duration_s)
{
    static const float FACTORIAL[IVL_CF_POLY_N] = {1.0f, 1.0f, 2.0f, 6.0f, 24.0f, 120.0f, 720.0f, 5040.0f};
    const int          degree = n - 1;
    memset(c, 0, IVL_CF_POLY_N * sizeof c[0]);
    for (int j = 0; j <= degree; j++)
    {
        for (int i = 0; i <= j; i++)
        {
            const float sign = ((i + j) % 2 == 0) ? 1.0f : -1.0f;
            c[j] += sign * points[i] / (FACTORIAL[i] * FACTORIAL[j - i]);
        }
        c[j] *= FACTORIAL[degree] / FACTORIAL[degree - j];
    }
    if (degree > 0)
    {
        stretch(c, duration_s);
    }
}

/// Value, rate and second derivative of one axis.
static void evaluate(const float c[IVL_CF_POLY_N], float t, float out[3])
{
    float x = 0.0f, v = 0.0f, a = 0.0f;
    for (int i = IVL_CF_POLY_N - 1; i >= 0; i--)
    {
        const float n = (float)i;
        x = x * t + c[i];
        v = (i >= 1) ? v * t + n * c[i] : v;
        a = (i >= 2) ? a * t + n * (n - 1.0f) * c[i] : a;
    }
    out[0] = x, out[1] = v, out[2] = a;
}

/// The rate about the body's axis: a tilted vehicle turns its heading with the upright part of it.
static float about_body(float yawrate_radps, ivl_vec3_t a_W_mps2)
{
    const ivl_vec3_t thrust = ivl_add(a_W_mps2, ivl_vec3(0.0f, 0.0f, GRAVITY_MPS2));
    const float      norm = sqrtf(ivl_dot(thrust, thrust));
    return (norm > 0.0f) ? yawrate_radps * thrust.z / norm : yawrate_radps;
}

ivl_cf_goal_t ivl_cf_piece_at(const ivl_cf_piece_t *piece, float t_s)
{
    float axis[IVL_CF_POLY_AXES][3];
    for (int i = 0; i < IVL_CF_POLY_AXES; i++)
    {
        evaluate(piece->c[i], t_s, axis[i]);
    }
    ivl_cf_goal_t goal = {
        .p_W_m = {axis[0][0], axis[1][0], axis[2][0]},
        .v_W_mps = {axis[0][1], axis[1][1], axis[2][1]},
        .a_W_mps2 = {axis[0][2], axis[1][2], axis[2][2]},
        .yaw_rad = axis[3][0],
    };
    goal.yawrate_radps = about_body(axis[3][1], goal.a_W_mps2);
    return goal;
}
