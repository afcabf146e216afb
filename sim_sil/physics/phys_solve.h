/// @file phys_solve.h
/// The equations of motion: body and hips with four length constraints.  Part of one evaluation, inlined.  [MODEL eq. 4.10]
#ifndef IVL_PHYS_SOLVE_H
#define IVL_PHYS_SOLVE_H

#include "phys_legs.h"

/// Solves the symmetric positive definite system a x = b of four equations, upper triangle given, by elimination of the
/// first two unknowns at once: two divisions in a row instead of four.
IVL_SIM_INLINE void phys_solve4(ivl_wide_t a[4][4], const ivl_wide_t b[4], ivl_wide_t x[4])
{
    // inverse of the leading block
    const ivl_wide_t d = 1.0 / (a[0][0] * a[1][1] - a[0][1] * a[0][1]);
    const ivl_wide_t p00 = a[1][1] * d, p01 = -a[0][1] * d, p11 = a[0][0] * d;
    // y = inverse * right part, and of the right-hand side
    const ivl_wide_t y02 = p00 * a[0][2] + p01 * a[1][2], y12 = p01 * a[0][2] + p11 * a[1][2];
    const ivl_wide_t y03 = p00 * a[0][3] + p01 * a[1][3], y13 = p01 * a[0][3] + p11 * a[1][3];
    const ivl_wide_t z0 = p00 * b[0] + p01 * b[1], z1 = p01 * b[0] + p11 * b[1];
    // what remains for the last two unknowns
    const ivl_wide_t s22 = a[2][2] - a[0][2] * y02 - a[1][2] * y12;
    const ivl_wide_t s23 = a[2][3] - a[0][2] * y03 - a[1][2] * y13;
    const ivl_wide_t s33 = a[3][3] - a[0][3] * y03 - a[1][3] * y13;
    const ivl_wide_t r2 = b[2] - a[0][2] * z0 - a[1][2] * z1;
    const ivl_wide_t r3 = b[3] - a[0][3] * z0 - a[1][3] * z1;
    const ivl_wide_t e = 1.0 / (s22 * s33 - s23 * s23);
    x[2] = (s33 * r2 - s23 * r3) * e;
    x[3] = (s22 * r3 - s23 * r2) * e;
    x[0] = z0 - y02 * x[2] - y03 * x[3];
    x[1] = z1 - y12 * x[2] - y13 * x[3];
}

/// Solves  M u = b + J^T x,  J u + compliance x = r  for the twist u and the multipliers x.        [MODEL eq. 4.10]
IVL_SIM_INLINE void phys_solve_constrained(const ivl_wide_t inverse6[IVL_SIM_PACKED], const phys_row_t rows[IVL_SIM_LEGS],
                                           const ivl_wide_t b[IVL_SIM_TWIST], const ivl_wide_t r[IVL_SIM_LEGS], ivl_wide_t u[IVL_SIM_TWIST],
                                           ivl_wide_t x[IVL_SIM_LEGS])
{
    ivl_wide_t J[IVL_SIM_LEGS][IVL_SIM_TWIST], W[IVL_SIM_LEGS][IVL_SIM_TWIST], A[4][4], rhs[4];
    IVL_SIM_UNROLL
    for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
    {
        const ivl_wide_t row[IVL_SIM_TWIST] = {rows[leg].g.x,       rows[leg].g.y,       rows[leg].g.z,
                                               rows[leg].hip_x_g.x, rows[leg].hip_x_g.y, rows[leg].hip_x_g.z};
        rhs[leg] = r[leg];
        IVL_SIM_UNROLL
        for (int i = 0; i < IVL_SIM_TWIST; i++)
        {
            J[leg][i] = row[i];
            W[leg][i] = inverse6[ivl_sim_packed(i, 0)] * row[0];
            IVL_SIM_UNROLL
            for (int j = 1; j < IVL_SIM_TWIST; j++)
            {
                W[leg][i] += inverse6[ivl_sim_packed(i, j)] * row[j];
            }
            rhs[leg] -= W[leg][i] * b[i];
        }
        IVL_SIM_UNROLL
        for (int other = 0; other <= leg; other++)
        {
            A[other][leg] = W[leg][0] * J[other][0];
            IVL_SIM_UNROLL
            for (int i = 1; i < IVL_SIM_TWIST; i++)
            {
                A[other][leg] += W[leg][i] * J[other][i];
            }
        }
        A[leg][leg] += rows[leg].compliance;
    }
    phys_solve4(A, rhs, x);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_TWIST; i++)
    {
        u[i] = inverse6[ivl_sim_packed(i, 0)] * b[0];
        IVL_SIM_UNROLL
        for (int j = 1; j < IVL_SIM_TWIST; j++)
        {
            u[i] += inverse6[ivl_sim_packed(i, j)] * b[j];
        }
        IVL_SIM_UNROLL
        for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
        {
            u[i] += W[leg][i] * x[leg];
        }
    }
}

#endif  // IVL_PHYS_SOLVE_H
