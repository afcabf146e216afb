#include "camera_texture.h"

size_t ivl_camera_texture_texels(int size)
{
    size_t n = 0;
    for (; size > 0; size /= 2)
    {
        n += (size_t)size * (size_t)size;
    }
    return n;
}

static void halve(const uint16_t *fine, int size, uint16_t *coarse)
{
    for (int y = 0; y < size; y += 2)
    {
        for (int x = 0; x < size; x += 2)
        {
            const uint16_t *at = fine + (size_t)y * (size_t)size + (size_t)x;
            *coarse++ = (uint16_t)((at[0] + at[1] + at[size] + at[size + 1] + 2) / 4);
        }
    }
}

void ivl_camera_texture_init(uint16_t *texels, int size, double length_m, ivl_camera_texture_t *texture)
{
    texture->size = size;
    texture->texels_per_m = size / length_m;
    texture->at_x_texel = 0.0f;
    texture->at_y_texel = 0.0f;
    texture->n_levels = 1;
    texture->size_bits = 0;
    while ((1 << texture->size_bits) < size)
    {
        texture->size_bits++;
    }
    texture->level[0] = texels;
    for (int side = size; side > 1 && texture->n_levels < IVL_CAMERA_TEXTURE_LEVELS; side /= 2)
    {
        uint16_t *coarse = texels + (size_t)side * (size_t)side;
        halve(texels, side, coarse);
        texels = coarse;
        texture->level[texture->n_levels++] = coarse;
    }
}

/// Next whole number below: without a call of the C library, which is most of the time.
static inline int whole(float a)
{
    const int i = (int)a;
    return i - ((a < (float)i) ? 1 : 0);
}

/// Between the four texels around a place of a level.
static float look_at_level(const ivl_camera_texture_t *texture, float x, float y, int level)
{
    const int       side = texture->size >> level, mask = side - 1;
    const uint16_t *texel = texture->level[level];
    const float     scale = 1.0f / (float)(1 << level);
    const float     px = x * scale - 0.5f, py = y * scale - 0.5f;
    const int       ix = whole(px), iy = whole(py);
    const int       x0 = ix & mask, x1 = (ix + 1) & mask, y0 = (iy & mask) * side, y1 = ((iy + 1) & mask) * side;
    const float     fx = px - (float)ix, fy = py - (float)iy;
    const float     a = texel[y0 + x0], b = texel[y0 + x1], c = texel[y1 + x0], d = texel[y1 + x1];
    const float     above = a + (b - a) * fx, below = c + (d - c) * fx;
    return above + (below - above) * fy;
}

float ivl_camera_texture_look(const ivl_camera_texture_t *texture, float x_texel, float y_texel, float level)
{
    const float most = (float)(texture->n_levels - 1);
    const float held = (level < 0.0f) ? 0.0f : ((level > most) ? most : level);
    const int   below = (int)held;
    const float part = held - (float)below;
    const float fine = look_at_level(texture, x_texel, y_texel, below);
    if (below + 1 >= texture->n_levels)
    {
        return fine * (1.0f / 65535.0f);
    }
    return (fine + (look_at_level(texture, x_texel, y_texel, below + 1) - fine) * part) * (1.0f / 65535.0f);
}

/// Next whole numbers below.
static inline ivl_camera_whole_t wholes(ivl_camera_four_t a)
{
    const ivl_camera_whole_t i = __builtin_convertvector(a, ivl_camera_whole_t);
    return i + (a < __builtin_convertvector(i, ivl_camera_four_t));
}

static inline ivl_camera_four_t pick(const uint16_t *texel, ivl_camera_whole_t at)
{
    const ivl_camera_whole_t found = {texel[at[0]], texel[at[1]], texel[at[2]], texel[at[3]]};
    return __builtin_convertvector(found, ivl_camera_four_t);
}

static inline ivl_camera_four_t four_at_level(const ivl_camera_texture_t *texture, ivl_camera_four_t x, ivl_camera_four_t y, int level)
{
    const int                side = texture->size >> level, mask = side - 1, bits = texture->size_bits - level;
    const uint16_t          *texel = texture->level[level];
    const float              scale = 1.0f / (float)(1 << level);
    const ivl_camera_four_t  px = x * scale - 0.5f, py = y * scale - 0.5f;
    const ivl_camera_whole_t ix = wholes(px), iy = wholes(py);
    const ivl_camera_whole_t x0 = ix & mask, x1 = (ix + 1) & mask, y0 = (iy & mask) << bits, y1 = ((iy + 1) & mask) << bits;
    const ivl_camera_four_t  fx = px - __builtin_convertvector(ix, ivl_camera_four_t);
    const ivl_camera_four_t  fy = py - __builtin_convertvector(iy, ivl_camera_four_t);
    const ivl_camera_four_t  a = pick(texel, y0 + x0), b = pick(texel, y0 + x1), c = pick(texel, y1 + x0), d = pick(texel, y1 + x1);
    const ivl_camera_four_t  above = a + (b - a) * fx, below = c + (d - c) * fx;
    return above + (below - above) * fy;
}

ivl_camera_four_t ivl_camera_texture_look_four(const ivl_camera_texture_t *texture, ivl_camera_four_t x_texel, ivl_camera_four_t y_texel,
                                               float level)
{
    const float             most = (float)(texture->n_levels - 1);
    const float             held = (level < 0.0f) ? 0.0f : ((level > most) ? most : level);
    const int               below = (int)held;
    const float             part = held - (float)below;
    const ivl_camera_four_t fine = four_at_level(texture, x_texel, y_texel, below);
    if (below + 1 >= texture->n_levels || !(part > 0.0f))
    {
        return fine * (1.0f / 65535.0f);
    }
    return (fine + (four_at_level(texture, x_texel, y_texel, below + 1) - fine) * part) * (1.0f / 65535.0f);
}
