/// @file ivl_vision_solve.h
/// Least squares with whole numbers: eight unknowns, the last three of which are asked for.
#ifndef IVL_VISION_SOLVE_H
#define IVL_VISION_SOLVE_H

#include <stdbool.h>
#include <stdint.h>

enum
{
    IVL_VISION_TERMS = 8,   ///< offset, gain, gain times three polynomials of the row, motion
    IVL_VISION_MOTION = 5,  ///< the first of the three terms of the motion
    IVL_VISION_NUISANCE_RIDGE_BITS = 10
};

/// Sums over the pixels.
typedef struct
{
    int64_t normal[IVL_VISION_TERMS][IVL_VISION_TERMS];  ///< products of the terms; the upper triangle is filled
    int64_t right[IVL_VISION_TERMS];                     ///< products with the residual
    int64_t residual;                                    ///< sum of its squares
} ivl_vision_sums_t;

/// The factors of the scaled normal matrix, and the solution.
typedef struct
{
    int64_t lower_q26[IVL_VISION_TERMS][IVL_VISION_TERMS];
    int64_t pivot_q30[IVL_VISION_TERMS];
    int     shift[IVL_VISION_TERMS];  ///< a term was divided by 2^shift
    int     shift_residual;
    int64_t x_q30[IVL_VISION_TERMS];           ///< the unknowns
    int64_t left;                              ///< sum of the squares that the solution leaves
    int64_t inverse_q20[3][IVL_VISION_TERMS];  ///< rows of the inverse of the scaled matrix that belong to the motion
} ivl_vision_solution_t;

/// Solves (A + ridge) x = b; the ridge holds offset and gains, whose part of a picture without contrast would be anything.
/// @return false if the pixels do not determine the unknowns
bool ivl_vision_solve(const ivl_vision_sums_t *sums, ivl_vision_solution_t *solution);

/// What a part of the right-hand side contributes to the three terms of the motion, Q30.
void ivl_vision_contribution(const ivl_vision_solution_t *solution, const int64_t right[IVL_VISION_TERMS], int64_t motion_q30[3]);

#endif  // IVL_VISION_SOLVE_H
