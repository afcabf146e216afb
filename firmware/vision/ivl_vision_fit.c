#include "ivl_vision_fit.h"

#include <string.h>

#include "ivl_vision_fixed.h"
#include "ivl_vision_image.h"
#include "ivl_vision_warp.h"

enum
{
    BASIS = 5,        ///< of a pixel: 1, grey value, and the three terms of the motion
    PRODUCTS = 15,    ///< of them, upper triangle by rows
    POLYNOMIALS = 3,  ///< of the row, which the gain may follow
    ROW_GAINS = 2,    ///< the first of their terms
    ROW_PIXELS = IVL_VISION_WINDOW_W + 2,
    MIN_PIXELS_SHARE = 2,  ///< at least one pixel of so many must be seen
    GRADIENT_SCALE = 4,    ///< a gradient is the sum of four pixels, four times the mean change over one
    STEEPEST = 8192        ///< of a gradient, a power of two
};

/// Where a product of two terms of the basis stands among the 15.
static const uint8_t AT[BASIS][BASIS] = {{0, 1, 2, 3, 4}, {1, 5, 6, 7, 8}, {2, 6, 9, 10, 11}, {3, 7, 10, 12, 13}, {4, 8, 11, 13, 14}};
/// A term of the basis among the unknowns.
static const uint8_t UNKNOWN[BASIS] = {0, 1, IVL_VISION_MOTION, IVL_VISION_MOTION + 1, IVL_VISION_MOTION + 2};

/// Three rows of the warped picture, and how a row is seen.
typedef struct
{
    int16_t warped[3][ROW_PIXELS];
    int32_t u_q12[IVL_VISION_WINDOW_W];  ///< direction of each column
    int32_t s_q20, s_step_q20;           ///< n'm at the first column, and its change
    int32_t v_q12;
} view_t;

/// Sums of a segment of a row; 15 pixels do not overflow.
typedef struct
{
    int32_t normal[PRODUCTS], right[BASIS], residual;
} sums_t;

void ivl_vision_fit_start(ivl_vision_belief_t *belief, uint32_t exposure_now_us, uint32_t exposure_then_us)
{
    const int32_t gain_q12 = (int32_t)ivl_vision_clamp((int64_t)((uint64_t)exposure_now_us * 4096u / exposure_then_us), 16 * 4096);
    belief->offset = 0;
    for (int i = 0; i < IVL_VISION_WINDOW_H + 2; i++)
    {
        belief->gain_q12[i] = gain_q12;
    }
}

static inline int32_t rounded_q12(int32_t a)
{
    return (a + 2048) >> 12;
}

/// Adds pixels [first, end) of a row.  `below` and `above` are rows of the warped picture, which begins one pixel before the window.
static void add_pixels(const view_t *view, const int16_t *const warped[3], const int16_t *now, int width, int first, int end, sums_t *sums)
{
    sums_t  s = *sums;
    int32_t s_q20 = view->s_q20 + first * view->s_step_q20;
    for (int i = first; i < end; i++, s_q20 += view->s_step_q20)
    {
        const int16_t *w = warped[1] + i + 1, *n = now + i;
        const int32_t  up = warped[0][i + 1], down = warped[2][i + 1], grey = w[0];
        if ((up | down | grey | w[-1] | w[1] | n[0] | n[-1] | n[1] | n[-width] | n[width]) < 0)
        {
            continue;
        }
        const int32_t facing_q12 = s_q20 >> 8;
        const int32_t qx = rounded_q12((w[1] - w[-1] + n[1] - n[-1]) * facing_q12);
        const int32_t qy = rounded_q12((down - up + n[width] - n[-width]) * facing_q12);
        const int32_t qz = -rounded_q12(view->u_q12[i] * qx + view->v_q12 * qy);
        // steeper than from black to white: products of 15 such would not fit
        if ((uint32_t)((qx + STEEPEST) | (qy + STEEPEST) | (qz + STEEPEST)) >= 2u * STEEPEST)
        {
            continue;
        }
        const int32_t r = n[0] - grey;
        s.normal[0] += 1;
        s.normal[1] += grey;
        s.normal[2] += qx;
        s.normal[3] += qy;
        s.normal[4] += qz;
        s.normal[5] += grey * grey;
        s.normal[6] += grey * qx;
        s.normal[7] += grey * qy;
        s.normal[8] += grey * qz;
        s.normal[9] += qx * qx;
        s.normal[10] += qx * qy;
        s.normal[11] += qx * qz;
        s.normal[12] += qy * qy;
        s.normal[13] += qy * qz;
        s.normal[14] += qz * qz;
        s.right[0] += r;
        s.right[1] += grey * r;
        s.right[2] += qx * r;
        s.right[3] += qy * r;
        s.right[4] += qz * r;
        s.residual += r * r;
    }
    *sums = s;
}

/// Legendre's polynomials of degree 1 to 3 over the window's height, Q10.
static void row_polynomials(int row, int height, int32_t t_q10[POLYNOMIALS])
{
    const int32_t t = (2 * row + 1 - height) * 1024 / height, t2 = t * t / 1024;
    t_q10[0] = t;
    t_q10[1] = (3 * t2 - 1024) / 2;
    t_q10[2] = t * (5 * t2 - 3 * 1024) / 2048;
}

/// Adds what the terms "gain times polynomial" have in common with all others, from the sums of one row.
static void add_row_gains(const int32_t t_q10[POLYNOMIALS], const int64_t normal[PRODUCTS], const int64_t right[BASIS],
                          ivl_vision_sums_t *sums)
{
    for (int j = 0; j < POLYNOMIALS; j++)
    {
        for (int b = 0; b < BASIS; b++)
        {
            const int     other = UNKNOWN[b], mine = ROW_GAINS + j;
            const int64_t part = (normal[AT[1][b]] * t_q10[j]) >> 10;
            sums->normal[(other < mine) ? other : mine][(other < mine) ? mine : other] += part;
        }
        for (int k = j; k < POLYNOMIALS; k++)
        {
            sums->normal[ROW_GAINS + j][ROW_GAINS + k] += (normal[AT[1][1]] * (t_q10[j] * t_q10[k] >> 10)) >> 10;
        }
        sums->right[ROW_GAINS + j] += (right[1] * t_q10[j]) >> 10;
    }
}

static void add_basis(const int64_t normal[PRODUCTS], const int64_t right[BASIS], ivl_vision_sums_t *sums)
{
    for (int a = 0; a < BASIS; a++)
    {
        for (int b = a; b < BASIS; b++)
        {
            sums->normal[UNKNOWN[a]][UNKNOWN[b]] += normal[AT[a][b]];
        }
        sums->right[UNKNOWN[a]] += right[a];
    }
}

static void add_segment(const sums_t *segment, int64_t normal[PRODUCTS], int64_t right[BASIS])
{
    for (int k = 0; k < PRODUCTS; k++)
    {
        normal[k] += segment->normal[k];
    }
    for (int k = 0; k < BASIS; k++)
    {
        right[k] += segment->right[k];
    }
}

/// One row of the window into all sums.
static void add_row(const ivl_vision_pair_t *pair, const view_t *view, const int16_t *const warped[3], const int16_t *now, int row,
                    ivl_vision_block_t *blocks, ivl_vision_sums_t *sums)
{
    int64_t normal[PRODUCTS] = {0}, right[BASIS] = {0};
    for (int column = 0; column < IVL_VISION_COLUMNS; column++)
    {
        sums_t    segment = {.residual = 0};
        const int width = pair->window_w / IVL_VISION_COLUMNS;
        add_pixels(view, warped, now, pair->width, column * width, (column + 1) * width, &segment);
        add_segment(&segment, normal, right);
        sums->residual += segment.residual;
        if (blocks)
        {
            add_segment(&segment, blocks[column].normal, blocks[column].right);
        }
    }
    int32_t t_q10[POLYNOMIALS];
    row_polynomials(row, pair->window_h, t_q10);
    add_basis(normal, right, sums);
    add_row_gains(t_q10, normal, right, sums);
}

/// Direction of pixels, and how much they face the surface.
static void look_along_row(const ivl_vision_pair_t *pair, const int32_t normal_q30[3], int x0, int y, view_t *view)
{
    const int64_t u = (int64_t)(x0 * 65536 - pair->centre_x_q16) * 65536 / pair->focal_q16;
    const int64_t v = (int64_t)(y * 65536 - pair->centre_y_q16) * 65536 / pair->focal_q16;
    const int64_t step = ((int64_t)1 << 32) / pair->focal_q16;
    view->v_q12 = (int32_t)(v >> 4);
    view->s_q20 = (int32_t)((normal_q30[0] * u + normal_q30[1] * v + (int64_t)normal_q30[2] * 65536) >> 26);
    view->s_step_q20 = (int32_t)((normal_q30[0] * step) >> 26);
}

static void look_along_columns(const ivl_vision_pair_t *pair, int x0, view_t *view)
{
    for (int i = 0; i < pair->window_w; i++)
    {
        view->u_q12[i] = (int32_t)((((int64_t)((x0 + i) * 65536 - pair->centre_x_q16)) * 4096) / pair->focal_q16);
    }
}

static void sum_up(const ivl_vision_pair_t *pair, const ivl_vision_belief_t *belief, const ivl_vision_map_t *map,
                   ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS], ivl_vision_sums_t *sums)
{
    const int x0 = (pair->width - pair->window_w) / 2, y0 = (pair->height - pair->window_h) / 2;
    view_t    view;
    look_along_columns(pair, x0, &view);
    memset(sums, 0, sizeof *sums);
    for (int i = 0; i < pair->window_h + 2; i++)
    {
        ivl_vision_warp_row(pair, map, x0 - 1, y0 - 1 + i, pair->window_w + 2, belief->gain_q12[i], belief->offset, view.warped[i % 3]);
        if (i >= 2)
        {
            const int            row = i - 2;
            const int16_t *const warped[3] = {view.warped[row % 3], view.warped[(row + 1) % 3], view.warped[(row + 2) % 3]};
            look_along_row(pair, belief->normal_q30, x0, y0 + row, &view);
            add_row(pair, &view, warped, pair->now + (y0 + row) * pair->width + x0, row,
                    block ? block[row * IVL_VISION_BANDS / pair->window_h] : NULL, sums);
        }
    }
}

/// W(p) W(step) is W(p + step + p (n'step)).
static void move(ivl_vision_belief_t *belief, const int32_t step_q30[3])
{
    const int64_t along = ivl_vision_shift((int64_t)belief->normal_q30[0] * step_q30[0] + (int64_t)belief->normal_q30[1] * step_q30[1] +
                                               (int64_t)belief->normal_q30[2] * step_q30[2],
                                           30);
    for (int k = 0; k < 3; k++)
    {
        const int64_t p = belief->p_q30[k] + step_q30[k] + ivl_vision_shift(belief->p_q30[k] * along, 30);
        belief->p_q30[k] = (int32_t)ivl_vision_clamp(p, IVL_VISION_ONE_Q30 / 2);
    }
}

/// Gain of each row and offset; neither may leave what a lamp can do.
static void lighten(ivl_vision_belief_t *belief, int height, const int64_t x_q30[IVL_VISION_TERMS])
{
    for (int i = 0; i < height + 2; i++)
    {
        int32_t t_q10[POLYNOMIALS];
        row_polynomials(i - 1, height, t_q10);
        int64_t change_q30 = IVL_VISION_ONE_Q30 + ivl_vision_clamp(x_q30[1], IVL_VISION_ONE_Q30);
        for (int j = 0; j < POLYNOMIALS; j++)
        {
            change_q30 += (ivl_vision_clamp(x_q30[ROW_GAINS + j], IVL_VISION_ONE_Q30) * t_q10[j]) >> 10;
        }
        const int64_t gain = (belief->gain_q12[i] * change_q30) >> 30;
        belief->gain_q12[i] = (int32_t)((gain < 256) ? 256 : ((gain > 65536) ? 65536 : gain));
    }
    belief->offset = (int32_t)ivl_vision_clamp(belief->offset + (x_q30[0] >> 30), IVL_VISION_PIXEL_MAX);
}

/// What one block says of the motion beyond what all of them say: its right-hand side less its matrix times the solution.
static void scatter(const ivl_vision_block_t *block, const ivl_vision_solution_t *solution, int band, int64_t motion_q30[3])
{
    int64_t g[BASIS], right[IVL_VISION_TERMS] = {0};
    int32_t t_q10[POLYNOMIALS];
    row_polynomials(band, IVL_VISION_BANDS, t_q10);
    int64_t gain_q30 = solution->x_q30[1];
    for (int j = 0; j < POLYNOMIALS; j++)
    {
        gain_q30 += (ivl_vision_clamp(solution->x_q30[ROW_GAINS + j], IVL_VISION_ONE_Q30) * t_q10[j]) >> 10;
    }
    for (int a = 0; a < BASIS; a++)
    {
        g[a] = block->right[a];
        for (int b = 0; b < BASIS; b++)
        {
            const int64_t x_q30 = (b == 1) ? gain_q30 : solution->x_q30[UNKNOWN[b]];
            g[a] -= ivl_vision_scale(block->normal[AT[a][b]], -8) * (ivl_vision_clamp(x_q30, (int64_t)1 << 40) >> 14) >> 8;
        }
        right[UNKNOWN[a]] = g[a];
    }
    for (int j = 0; j < POLYNOMIALS; j++)
    {
        right[ROW_GAINS + j] = (g[1] * t_q10[j]) >> 10;
    }
    ivl_vision_contribution(solution, right, motion_q30);
}

/// Variance of the motion from how much the blocks disagree: it holds whatever the residual looks like.
static void variance(const ivl_vision_solution_t *solution, ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS],
                     int32_t focal_q16, ivl_vision_fit_t *fit)
{
    memset(fit->variance_q60, 0, sizeof fit->variance_q60);
    for (int i = 0; i < IVL_VISION_BANDS * IVL_VISION_COLUMNS; i++)
    {
        int64_t z[3];
        scatter(&block[i / IVL_VISION_COLUMNS][i % IVL_VISION_COLUMNS], solution, i / IVL_VISION_COLUMNS, z);
        for (int k = 0; k < 3; k++)
        {
            z[k] = ivl_vision_clamp(z[k], (int64_t)1 << 40) * GRADIENT_SCALE * 65536 / focal_q16;
            z[k] = ivl_vision_clamp(z[k], (int64_t)1 << 28);
        }
        for (int k = 0; k < 9; k++)
        {
            fit->variance_q60[k / 3][k % 3] += z[k / 3] * z[k % 3];
        }
    }
}

/// Contrast over residual: 1 over the trace of the inverse, which is the least eigenvalue or up to a third of it, with each term in units of
/// what noise of one grey value would give it.
static int64_t contrast_q8(const ivl_vision_pair_t *pair, const ivl_vision_solution_t *s)
{
    // mean of u^2 + v^2 over the window, Q12
    const int64_t w = pair->window_w, h = pair->window_h, f = pair->focal_q16 >> 8;
    const int64_t spread_q12 = (w * w + h * h) * ((int64_t)1 << 28) / (12 * f * f);
    int64_t       inverse = 0;
    for (int k = 0; k < 3; k++)
    {
        const int64_t diagonal_q20 = s->inverse_q20[k][IVL_VISION_MOTION + k];
        const int64_t unit_q12 = (k == 2) ? spread_q12 : 4096;
        // inverse of the normal matrix times the residual, Q20: both were divided by powers of two
        const int64_t part =
            ivl_vision_scale(ivl_vision_clamp(diagonal_q20, (int64_t)1 << 36), 2 * (s->shift_residual - s->shift[IVL_VISION_MOTION + k]));
        inverse += (ivl_vision_clamp(part, (int64_t)1 << 40) * unit_q12) >> 12;
    }
    const int64_t residual_q30 = ivl_vision_scale(s->left, 30 - 2 * s->shift_residual);
    const int64_t product_q20 = (ivl_vision_clamp(inverse, (int64_t)1 << 32) * residual_q30) >> 30;
    return ((int64_t)1 << 28) / ((product_q20 > 0) ? product_q20 : 1);
}

bool ivl_vision_fit_pass(const ivl_vision_pair_t *pair, ivl_vision_belief_t *belief,
                         ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS], ivl_vision_fit_t *fit)
{
    ivl_vision_map_t      map;
    ivl_vision_sums_t     sums;
    ivl_vision_solution_t solution;
    if (block)
    {
        memset(block, 0, sizeof(ivl_vision_block_t) * IVL_VISION_BANDS * IVL_VISION_COLUMNS);
    }
    fit->n_pixels = 0;
    if (!ivl_vision_map(pair, belief, (pair->width - pair->window_w) / 2 - 1, (pair->height - pair->window_h) / 2 - 1, &map))
    {
        return false;
    }
    sum_up(pair, belief, &map, block, &sums);
    fit->n_pixels = (int32_t)sums.normal[0][0];
    if (fit->n_pixels * MIN_PIXELS_SHARE < pair->window_w * pair->window_h || !ivl_vision_solve(&sums, &solution))
    {
        return false;
    }
    fit->residual = solution.left;
    for (int k = 0; k < 3; k++)
    {
        const int64_t x = ivl_vision_clamp(solution.x_q30[IVL_VISION_MOTION + k], (int64_t)1 << 40);
        fit->step_q30[k] = (int32_t)ivl_vision_clamp(x * GRADIENT_SCALE * 65536 / pair->focal_q16, IVL_VISION_ONE_Q30 / 4);
    }
    fit->contrast_q8 = contrast_q8(pair, &solution);
    if (block)
    {
        variance(&solution, block, pair->focal_q16, fit);
    }
    move(belief, fit->step_q30);
    lighten(belief, pair->window_h, solution.x_q30);
    return true;
}
