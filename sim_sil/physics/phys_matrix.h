/// @file phys_matrix.h
/// 6 x 6 matrices, which act on twists: velocity of the body origin and angular velocity.
#ifndef IVL_PHYS_MATRIX_H
#define IVL_PHYS_MATRIX_H

#include <string.h>

enum
{
    IVL_SIM_TWIST = 6
};

/// Inverse of a symmetric positive definite matrix, by Gauss-Jordan elimination (no pivoting is needed).
static inline void ivl_sim_invert6(const double a[IVL_SIM_TWIST][IVL_SIM_TWIST], double inverse[IVL_SIM_TWIST][IVL_SIM_TWIST])
{
    double m[IVL_SIM_TWIST][2 * IVL_SIM_TWIST];
    for (int i = 0; i < IVL_SIM_TWIST; i++)
    {
        for (int j = 0; j < IVL_SIM_TWIST; j++)
        {
            m[i][j] = a[i][j];
            m[i][IVL_SIM_TWIST + j] = (i == j) ? 1.0 : 0.0;
        }
    }
    for (int p = 0; p < IVL_SIM_TWIST; p++)
    {
        const double pivot = 1.0 / m[p][p];
        for (int j = 0; j < 2 * IVL_SIM_TWIST; j++)
        {
            m[p][j] *= pivot;
        }
        for (int i = 0; i < IVL_SIM_TWIST; i++)
        {
            const double f = (i == p) ? 0.0 : m[i][p];
            for (int j = 0; j < 2 * IVL_SIM_TWIST; j++)
            {
                m[i][j] -= f * m[p][j];
            }
        }
    }
    for (int i = 0; i < IVL_SIM_TWIST; i++)
    {
        memcpy(inverse[i], &m[i][IVL_SIM_TWIST], sizeof inverse[i]);
    }
}

#endif  // IVL_PHYS_MATRIX_H
