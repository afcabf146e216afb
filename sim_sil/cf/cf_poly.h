/// @file cf_poly.h
/// Ways in space as polynomials of seventh degree: one piece, fitted to both of its ends or read from an uploaded trajectory.
#ifndef IVL_CF_POLY_H
#define IVL_CF_POLY_H
#include "ivl_types.h"

enum
{
    IVL_CF_POLY_AXES = 4,  ///< x, y, z, yaw
    IVL_CF_POLY_N = 8      ///< coefficients of an axis
};

/// Where a way is at a time.
typedef struct
{
    ivl_vec3_t p_W_m, v_W_mps, a_W_mps2;
    float      yaw_rad, yawrate_radps;  ///< the yaw is not wrapped
} ivl_cf_goal_t;

/// Coefficients in ascending powers of the time in seconds; laid out as in the trajectory memory of the stock firmware.
typedef struct
{
    float c[IVL_CF_POLY_AXES][IVL_CF_POLY_N];
    float duration_s;
} ivl_cf_piece_t;

/// From one goal to another, with a third derivative of 0 at both ends.
/// @param[in] duration_s  0 or less: the piece stands at its end
ivl_cf_piece_t ivl_cf_piece_between(const ivl_cf_goal_t *from, const ivl_cf_goal_t *to, float duration_s);

/// Coefficients of an axis from the control points of a Bezier curve.
/// @param[in] n  points, 1 .. IVL_CF_POLY_N
void ivl_cf_piece_bezier(float c[IVL_CF_POLY_N], const float *points, int n, float duration_s);

/// @param[in] t_s  since the start of the piece
ivl_cf_goal_t ivl_cf_piece_at(const ivl_cf_piece_t *piece, float t_s);

/// Nearest to zero of all angles that mean the same.
float ivl_cf_wrapped(float angle_rad);
#endif  // IVL_CF_POLY_H
