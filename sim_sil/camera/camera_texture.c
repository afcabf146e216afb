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
