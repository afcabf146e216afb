#include "ivl_vision_warp.h"

#include "ivl_vision_fixed.h"
#include "ivl_vision_image.h"

enum
{
    POSITION_BITS = 10,  ///< of a position in a picture: the numerator in Q23 over the denominator in Q13
    POSITION_ONE = 1 << POSITION_BITS,
    MARGIN_PIXELS = 40  ///< by which the window may leave the earlier picture: no number of a row overflows
};

/// R (I + p n'), Q30.
static void homography(const ivl_vision_belief_t *b, int64_t h_q30[3][3])
{
    for (int i = 0; i < 3; i++)
    {
        const int32_t *r = &b->turn_q30[3 * i];
        const int64_t  rp_q30 =
            ivl_vision_shift((int64_t)r[0] * b->p_q30[0] + (int64_t)r[1] * b->p_q30[1] + (int64_t)r[2] * b->p_q30[2], 30);
        for (int k = 0; k < 3; k++)
        {
            h_q30[i][k] = r[k] + ivl_vision_shift(rp_q30 * b->normal_q30[k], 30);
        }
    }
}

/// True if the corner (x, y) comes from a place in or near the earlier picture.
static bool corner_is_near(const ivl_vision_pair_t *pair, const ivl_vision_map_t *map, int x, int y)
{
    int64_t at[3];
    for (int i = 0; i < 3; i++)
    {
        at[i] = map->row_q23[i][0] * x + map->row_q23[i][1] * y + map->row_q23[i][2];
    }
    const int64_t half = (int64_t)1 << 22, margin = MARGIN_PIXELS * 2 * half;
    return at[2] > half && at[2] < 3 * half && at[0] > -margin && at[0] < 2 * half * pair->width + margin && at[1] > -margin &&
           at[1] < 2 * half * pair->height + margin;
}

bool ivl_vision_map(const ivl_vision_pair_t *pair, const ivl_vision_belief_t *belief, int x0, int y0, ivl_vision_map_t *map)
{
    int64_t h[3][3];
    homography(belief, h);
    if (h[2][2] < IVL_VISION_ONE_Q30 / 2)
    {
        return false;
    }
    // the factor is free: with 1 in the middle, the denominator is least spoiled by its rounding
    int64_t g_q30[3][3];
    for (int i = 0; i < 9; i++)
    {
        g_q30[i / 3][i % 3] = ivl_vision_clamp(h[i / 3][i % 3], (int64_t)1 << 32) * IVL_VISION_ONE_Q30 / h[2][2];
    }
    const int64_t f = pair->focal_q16, cx = pair->centre_x_q16, cy = pair->centre_y_q16;
    // in pixels: numerator rows are f g + c g3, all over f where they are multiplied by a pixel
    for (int k = 0; k < 3; k++)
    {
        map->row_q23[2][k] = g_q30[2][k];
        map->row_q23[0][k] = ((f * g_q30[0][k]) >> 16) + ((cx * g_q30[2][k]) >> 16);
        map->row_q23[1][k] = ((f * g_q30[1][k]) >> 16) + ((cy * g_q30[2][k]) >> 16);
    }
    for (int i = 0; i < 3; i++)
    {
        int64_t      *row = map->row_q23[i];
        const int64_t u = row[0] * 65536 / f, v = row[1] * 65536 / f;
        row[2] = (row[2] - ((u * cx + v * cy) >> 16)) >> 7;
        row[0] = u >> 7;
        row[1] = v >> 7;
    }
    const int x1 = x0 + pair->window_w + 1, y1 = y0 + pair->window_h + 1;
    return corner_is_near(pair, map, x0, y0) && corner_is_near(pair, map, x1, y0) && corner_is_near(pair, map, x0, y1) &&
           corner_is_near(pair, map, x1, y1);
}

/// Between the four pixels around a position.
static inline int32_t between(const int16_t *at, int width, int32_t fx, int32_t fy)
{
    const int32_t a = at[0], b = at[1], c = at[width], d = at[width + 1];
    if ((a | b | c | d) < 0)
    {
        return IVL_VISION_HOLE;
    }
    const int32_t above = a * POSITION_ONE + (b - a) * fx, below = c * POSITION_ONE + (d - c) * fx;
    return (above + ((below - above) >> POSITION_BITS) * fy + POSITION_ONE / 2) >> POSITION_BITS;
}

void ivl_vision_warp_row(const ivl_vision_pair_t *pair, const ivl_vision_map_t *map, int x0, int y, int n, int32_t gain_q12, int32_t offset,
                         int16_t *out)
{
    int32_t at[3], step[3];
    for (int i = 0; i < 3; i++)
    {
        at[i] = (int32_t)(map->row_q23[i][0] * x0 + map->row_q23[i][1] * y + map->row_q23[i][2]);
        step[i] = (int32_t)map->row_q23[i][0];
    }
    const uint32_t x_end = (uint32_t)(pair->width - 1) << POSITION_BITS, y_end = (uint32_t)(pair->height - 1) << POSITION_BITS;
    for (int i = 0; i < n; i++)
    {
        const int32_t over = (at[2] + 512) >> 10;
        const int32_t x = (at[0] + (over >> 1)) / over, py = (at[1] + (over >> 1)) / over;
        int32_t       value = IVL_VISION_HOLE;
        if (at[0] >= 0 && at[1] >= 0 && (uint32_t)x < x_end && (uint32_t)py < y_end)
        {
            value = between(pair->then + (py >> POSITION_BITS) * pair->width + (x >> POSITION_BITS), pair->width, x & (POSITION_ONE - 1),
                            py & (POSITION_ONE - 1));
        }
        if (value >= 0)
        {
            value = ((value * gain_q12 + 2048) >> 12) + offset;
            value = (value < 0) ? 0 : ((value > IVL_VISION_PIXEL_MAX) ? IVL_VISION_PIXEL_MAX : value);
        }
        out[i] = (int16_t)value;
        for (int k = 0; k < 3; k++)
        {
            at[k] += step[k];
        }
    }
}
