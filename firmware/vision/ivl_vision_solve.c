#include "ivl_vision_solve.h"

#include "ivl_vision_fixed.h"

enum
{
    N = IVL_VISION_TERMS
};

/// Least pivot of the scaled matrix: below it the rounding of its entries would decide.
static const int64_t PIVOT_MIN_Q30 = 1 << 18;
/// So a factor is at most sqrt(1 / pivot), here 2^6.
static const int64_t LOWER_MAX_Q26 = (int64_t)1 << 32;
/// And what it multiplies, the square root of a pivot.
static const int64_t SCALED_MAX_Q30 = (int64_t)1 << 30;
/// No unknown is larger than this: what follows fits into 64 bits.
static const int64_t X_MAX_Q30 = (int64_t)1 << 38;

/// Divides each term by a power of two so that its square is between 1/4 and 1.
static bool choose_shifts(const ivl_vision_sums_t *sums, ivl_vision_solution_t *solution)
{
    for (int i = 0; i < N; i++)
    {
        if (sums->normal[i][i] <= 0)
        {
            return false;
        }
        solution->shift[i] = (ivl_vision_bits((uint64_t)sums->normal[i][i]) + 1) / 2;
    }
    solution->shift_residual = (ivl_vision_bits((uint64_t)sums->residual) + 1) / 2;
    return true;
}

/// A scaled entry, Q30.
static int64_t entry(const ivl_vision_sums_t *sums, const ivl_vision_solution_t *solution, int row, int column)
{
    const int64_t a = ivl_vision_scale(sums->normal[column][row], 30 - solution->shift[row] - solution->shift[column]);
    return (row == column && row < IVL_VISION_MOTION) ? a + (a >> IVL_VISION_NUISANCE_RIDGE_BITS) : a;
}

/// L D L' of the scaled matrix, row by row.
static bool factor(const ivl_vision_sums_t *sums, ivl_vision_solution_t *s)
{
    for (int i = 0; i < N; i++)
    {
        // l_ik d_k of this row
        int64_t ld_q30[N];
        for (int j = 0; j < i; j++)
        {
            int64_t a = entry(sums, s, i, j);
            for (int k = 0; k < j; k++)
            {
                a -= ivl_vision_shift(ld_q30[k] * s->lower_q26[j][k], 26);
            }
            ld_q30[j] = ivl_vision_clamp(a, SCALED_MAX_Q30);
            s->lower_q26[i][j] = ivl_vision_clamp(ld_q30[j] * ((int64_t)1 << 26) / s->pivot_q30[j], LOWER_MAX_Q26);
        }
        int64_t pivot = entry(sums, s, i, i);
        for (int k = 0; k < i; k++)
        {
            pivot -= ivl_vision_shift(ld_q30[k] * s->lower_q26[i][k], 26);
        }
        if (pivot < PIVOT_MIN_Q30)
        {
            return false;
        }
        s->pivot_q30[i] = pivot;
    }
    return true;
}

/// A factor times an unknown, which may be large.
static int64_t times(int64_t lower_q26, int64_t y)
{
    return ivl_vision_shift((lower_q26 >> 4) * (y >> 8), 14);
}

/// Solves with the factors; y and the result have the same scale.
static void substitute(const ivl_vision_solution_t *s, int64_t y[N])
{
    for (int i = 1; i < N; i++)
    {
        for (int k = 0; k < i; k++)
        {
            y[i] = ivl_vision_clamp(y[i] - times(s->lower_q26[i][k], y[k]), X_MAX_Q30);
        }
    }
    for (int i = N - 1; i >= 0; i--)
    {
        y[i] = ivl_vision_clamp(y[i], 4 * SCALED_MAX_Q30) * SCALED_MAX_Q30 / s->pivot_q30[i];
        for (int k = i + 1; k < N; k++)
        {
            y[i] -= times(s->lower_q26[k][i], y[k]);
        }
        y[i] = ivl_vision_clamp(y[i], X_MAX_Q30);
    }
}

bool ivl_vision_solve(const ivl_vision_sums_t *sums, ivl_vision_solution_t *s)
{
    if (!choose_shifts(sums, s) || !factor(sums, s))
    {
        return false;
    }
    int64_t y[N], right_q30[N];
    int64_t left_q30 = ivl_vision_scale(sums->residual, 30 - 2 * s->shift_residual);
    for (int i = 0; i < N; i++)
    {
        right_q30[i] = ivl_vision_clamp(ivl_vision_scale(sums->right[i], 30 - s->shift[i] - s->shift_residual), IVL_VISION_ONE_Q30);
        y[i] = right_q30[i];
    }
    substitute(s, y);
    for (int i = 0; i < N; i++)
    {
        left_q30 -= ivl_vision_shift(ivl_vision_clamp(y[i], (int64_t)1 << 32) * right_q30[i], 30);
        s->x_q30[i] = ivl_vision_scale(ivl_vision_clamp(y[i], X_MAX_Q30), s->shift_residual - s->shift[i]);
    }
    // what rounding leaves of nothing
    const int64_t least_q30 = 1 << 8;
    s->left = ivl_vision_scale((left_q30 > least_q30) ? left_q30 : least_q30, 2 * s->shift_residual - 30);
    for (int motion = 0; motion < 3; motion++)
    {
        int64_t unit[N] = {0};
        unit[IVL_VISION_MOTION + motion] = IVL_VISION_ONE_Q30;
        substitute(s, unit);
        for (int i = 0; i < N; i++)
        {
            s->inverse_q20[motion][i] = unit[i] >> 10;
        }
    }
    return true;
}

void ivl_vision_contribution(const ivl_vision_solution_t *s, const int64_t right[N], int64_t motion_q30[3])
{
    for (int motion = 0; motion < 3; motion++)
    {
        int64_t sum = 0;
        for (int i = 0; i < N; i++)
        {
            const int64_t b_q30 = ivl_vision_scale(right[i], 30 - s->shift[i] - s->shift_residual);
            sum += ivl_vision_shift(s->inverse_q20[motion][i] * ivl_vision_clamp(b_q30, (int64_t)1 << 32), 20);
        }
        motion_q30[motion] = ivl_vision_scale(sum, s->shift_residual - s->shift[IVL_VISION_MOTION + motion]);
    }
}
