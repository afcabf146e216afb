/// @file camera_texture.h
/// The look of a surface: a square that repeats, and coarser and coarser means of it, so that a far surface does not sparkle.
#ifndef IVL_CAMERA_TEXTURE_H
#define IVL_CAMERA_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

enum
{
    IVL_CAMERA_TEXTURE_LEVELS = 12
};

/// Four neighbouring pixels.
typedef float   ivl_camera_four_t __attribute__((vector_size(16)));
typedef int32_t ivl_camera_whole_t __attribute__((vector_size(16)));

typedef struct
{
    const uint16_t *level[IVL_CAMERA_TEXTURE_LEVELS];  ///< 65535 is white
    int             size;                              ///< of the finest, a power of two
    int             size_bits;                         ///< its binary logarithm
    int             n_levels;
    double          texels_per_m;
    float           at_x_texel, at_y_texel;  ///< of the surface's origin
} ivl_camera_texture_t;

/// Number of texels of all levels.
size_t ivl_camera_texture_texels(int size);

/// Means of 2 x 2 into the coarser levels.
/// @param[in,out] texels  the finest level first, room for all of them
void ivl_camera_texture_init(uint16_t *texels, int size, double length_m, ivl_camera_texture_t *texture);

/// Brightness at a place, 0 .. 1, seen by a pixel of a footprint of 2^level texels; level may lie between two.
float ivl_camera_texture_look(const ivl_camera_texture_t *texture, float x_texel, float y_texel, float level);

/// The same of four pixels at once, with the same bits.
ivl_camera_four_t ivl_camera_texture_look_four(const ivl_camera_texture_t *texture, ivl_camera_four_t x_texel, ivl_camera_four_t y_texel,
                                               float level);

#endif  // IVL_CAMERA_TEXTURE_H
