#include "ivl_vision_image.h"

#include "ivl_vision_fixed.h"

enum
{
    NODE_PIXELS = 4,  ///< between two nodes of the flat field
    ONE_Q12 = 4096,
    /// position in a picture while it is rectified
    FRACTION_BITS = 8
};

/// Sum of a block of 2 x 2 or 4 x 4 bytes, as 16 times their mean.
static inline int32_t binned(const uint8_t *raw, int bin, int stride)
{
    int32_t sum = 0;
    for (int y = 0; y < bin; y++)
    {
        for (int x = 0; x < bin; x += 2)
        {
            sum += raw[y * stride + x] + raw[y * stride + x + 1];
        }
    }
    return (bin == 2) ? 4 * sum : sum;
}

/// Gains of a row of nodes, between the two rows of nodes around row y.
static void gains_of_row(const uint16_t *flat_q12, int y, int32_t gain_q12[IVL_VISION_FLAT_COLUMNS])
{
    const uint16_t *above = flat_q12 + (y / NODE_PIXELS) * IVL_VISION_FLAT_COLUMNS;
    const uint16_t *below = above + IVL_VISION_FLAT_COLUMNS;
    const int       part = y % NODE_PIXELS;
    for (int i = 0; i < IVL_VISION_FLAT_COLUMNS; i++)
    {
        gain_q12[i] = (above[i] * (NODE_PIXELS - part) + below[i] * part + NODE_PIXELS / 2) / NODE_PIXELS;
    }
}

static int16_t evened(int32_t value, int32_t gain_q12)
{
    const int32_t even = (value * gain_q12 + ONE_Q12 / 2) / ONE_Q12;
    return (int16_t)((even > IVL_VISION_PIXEL_MAX) ? IVL_VISION_PIXEL_MAX : even);
}

static void bin_and_even(const ivl_vision_cfg_t *cfg, const uint8_t *raw, int16_t *out)
{
    const int bin = cfg->bin, stride = bin * IVL_VISION_WIDTH;
    int32_t   gain_q12[IVL_VISION_FLAT_COLUMNS];
    for (int i = 0; i < IVL_VISION_FLAT_COLUMNS; i++)
    {
        gain_q12[i] = ONE_Q12;
    }
    for (int y = 0; y < IVL_VISION_HEIGHT; y++)
    {
        if (cfg->flat_q12)
        {
            gains_of_row(cfg->flat_q12, y, gain_q12);
        }
        const uint8_t *row = raw + y * bin * stride;
        for (int node = 0; node < IVL_VISION_WIDTH / NODE_PIXELS; node++)
        {
            const int32_t first = gain_q12[node], rise = gain_q12[node + 1] - first;
            for (int i = 0; i < NODE_PIXELS; i++)
            {
                *out++ = evened(binned(row, bin, stride), first + rise * i / NODE_PIXELS);
                row += bin;
            }
        }
    }
}

/// Factor 1 + k1 r^2 + k2 r^4 of the distance from the principal point, Q16.
static int32_t stretch_q16(const ivl_vision_cfg_t *cfg, int32_t r2_q16)
{
    const int64_t inner = cfg->radial_q16[0] + (((int64_t)cfg->radial_q16[1] * r2_q16) >> 16);
    return (int32_t)(65536 + ((inner * r2_q16) >> 16));
}

/// Value at a position in 1/256 pixel, between the four pixels around it; a hole outside of them.
static int16_t sample(const int16_t *pixel, int32_t x, int32_t y)
{
    if ((uint32_t)x >= (uint32_t)((IVL_VISION_WIDTH - 1) << FRACTION_BITS) ||
        (uint32_t)y >= (uint32_t)((IVL_VISION_HEIGHT - 1) << FRACTION_BITS))
    {
        return IVL_VISION_HOLE;
    }
    const int16_t *at = pixel + (y >> FRACTION_BITS) * IVL_VISION_WIDTH + (x >> FRACTION_BITS);
    const int32_t  fx = x & 255, fy = y & 255;
    const int32_t  above = at[0] * 256 + (at[1] - at[0]) * fx;
    const int32_t  below = at[IVL_VISION_WIDTH] * 256 + (at[IVL_VISION_WIDTH + 1] - at[IVL_VISION_WIDTH]) * fx;
    return (int16_t)((above * 8 + ((below - above) >> 5) * fy + 1024) >> 11);
}

static void rectify(const ivl_vision_cfg_t *cfg, const int16_t *from, int16_t *to)
{
    // 1/f in Q24; coordinates over the focal length in Q16
    const int32_t inverse = (int32_t)(((int64_t)1 << 40) / cfg->focal_q16);
    for (int y = 0; y < IVL_VISION_HEIGHT; y++)
    {
        const int32_t y_q16 = y * 65536 - cfg->centre_y_q16;
        const int32_t v_q16 = (int32_t)(((int64_t)y_q16 * inverse) >> 24);
        const int32_t v2_q16 = (int32_t)(((int64_t)v_q16 * v_q16) >> 16);
        for (int x = 0; x < IVL_VISION_WIDTH; x++)
        {
            const int32_t x_q16 = x * 65536 - cfg->centre_x_q16;
            const int32_t u_q16 = (int32_t)(((int64_t)x_q16 * inverse) >> 24);
            const int32_t s_q16 = stretch_q16(cfg, v2_q16 + (int32_t)(((int64_t)u_q16 * u_q16) >> 16));
            const int32_t from_x = (cfg->centre_x_q16 + (int32_t)(((int64_t)x_q16 * s_q16) >> 16) + 128) >> 8;
            const int32_t from_y = (cfg->centre_y_q16 + (int32_t)(((int64_t)y_q16 * s_q16) >> 16) + 128) >> 8;
            *to++ = sample(from, from_x, from_y);
        }
    }
}

void ivl_vision_image_take(const ivl_vision_cfg_t *cfg, const uint8_t *raw, int16_t *scratch, int16_t *pixel)
{
    if (cfg->radial_q16[0] == 0 && cfg->radial_q16[1] == 0)
    {
        bin_and_even(cfg, raw, pixel);
        return;
    }
    bin_and_even(cfg, raw, scratch);
    rectify(cfg, scratch, pixel);
}

void ivl_vision_image_halve(const int16_t *fine, int width, int height, int16_t *coarse)
{
    for (int y = 0; y + 1 < height; y += 2)
    {
        const int16_t *row = fine + y * width;
        for (int x = 0; x + 1 < width; x += 2)
        {
            const int32_t a = row[x], b = row[x + 1], c = row[x + width], d = row[x + width + 1];
            *coarse++ = ((a | b | c | d) < 0) ? IVL_VISION_HOLE : (int16_t)((a + b + c + d + 2) / 4);
        }
    }
}
