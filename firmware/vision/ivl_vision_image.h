/// @file ivl_vision_image.h
/// From the sensor's bytes to an even, undistorted picture of 80 x 60, and to coarser ones.
#ifndef IVL_VISION_IMAGE_H
#define IVL_VISION_IMAGE_H

#include "ivl_vision.h"

enum
{
    IVL_VISION_HOLE = -1,         ///< a pixel that shows nothing
    IVL_VISION_PIXEL_MAX = 11500  ///< brightest pixel after the flat field: the squares of 15 such fit into 31 bits
};

/// Bins, evens out and rectifies a picture of the sensor.
/// @param[out] scratch  as large as a picture
void ivl_vision_image_take(const ivl_vision_cfg_t *cfg, const uint8_t *raw, int16_t *scratch, int16_t *pixel);

/// Means of blocks of 2 x 2 pixels; a block with a hole is one.
/// @param[in] width, height  of the finer picture; an odd last column or row is left out
void ivl_vision_image_halve(const int16_t *fine, int width, int height, int16_t *coarse);

#endif  // IVL_VISION_IMAGE_H
