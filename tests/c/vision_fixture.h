/// @file vision_fixture.h
/// Pictures for the estimator, made of whole numbers only, so that they have the same bits on every processor.
#ifndef VISION_FIXTURE_H
#define VISION_FIXTURE_H

#include <string.h>

#include "ivl_vision.h"

enum
{
    RAW_W = 160,
    RAW_H = 120,
    RAW_FOCAL_PX = 90
};

static const int32_t ONE_Q30 = 1 << 30;

typedef int32_t surface_t(int32_t x_um, int32_t y_um);

static inline uint32_t mix(uint32_t a, uint32_t b)
{
    uint32_t h = a * 0x9E3779B1u ^ b * 0x85EBCA77u;
    h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
    h = (h ^ (h >> 12)) * 0x297A2D39u;
    return h ^ (h >> 15);
}

static inline int32_t below(int32_t a, int32_t step)
{
    return (a >= 0) ? a / step : -((step - 1 - a) / step);
}

/// Random greys at the corners of squares, and what is between them.
static inline int32_t grain(int32_t x_um, int32_t y_um, int32_t size_um)
{
    const int32_t ix = below(x_um, size_um), iy = below(y_um, size_um);
    const int32_t fx = (x_um - ix * size_um) * 256 / size_um, fy = (y_um - iy * size_um) * 256 / size_um;
    int32_t       corner[4];
    for (int i = 0; i < 4; i++)
    {
        corner[i] = (int32_t)(mix((uint32_t)(ix + i % 2), (uint32_t)(iy + i / 2)) & 255u);
    }
    const int32_t upper = corner[0] * 256 + (corner[1] - corner[0]) * fx, lower = corner[2] * 256 + (corner[3] - corner[2]) * fx;
    return (upper * 256 + (lower - upper) * fy) >> 16;
}

static inline int32_t plaster(int32_t x_um, int32_t y_um)
{
    return 40 + (grain(x_um, y_um, 40000) + grain(x_um, y_um, 90000)) / 3;
}

static inline int32_t white(int32_t x_um, int32_t y_um)
{
    (void)x_um;
    (void)y_um;
    return 140;
}

static inline int32_t lines(int32_t x_um, int32_t y_um)
{
    (void)x_um;
    return grain(0, y_um, 40000);
}

/// A picture of a surface from straight below, at (x, y) and the distance d, with a little noise.
static inline void draw(surface_t *surface, int32_t x_um, int32_t y_um, int32_t d_um, uint32_t seed, uint8_t raw[RAW_W * RAW_H])
{
    for (int i = 0; i < RAW_W * RAW_H; i++)
    {
        const int64_t u = 2 * (i % RAW_W) - (RAW_W - 1), v = 2 * (i / RAW_W) - (RAW_H - 1);
        const int32_t x = x_um + (int32_t)(u * d_um / (2 * RAW_FOCAL_PX)), y = y_um + (int32_t)(v * d_um / (2 * RAW_FOCAL_PX));
        const int32_t noise = (int32_t)(mix((uint32_t)i, seed) % 3u) - 1;
        raw[i] = (uint8_t)(surface(x, y) + noise);
    }
}

static inline ivl_vision_cfg_t vision_cfg(void)
{
    return (ivl_vision_cfg_t){.bin = 2,
                              .window_w = 56,
                              .window_h = 42,
                              .horizon_q12 = 410,
                              .attitude_q16 = 655,
                              .focal_q16 = RAW_FOCAL_PX / 2 * 65536,
                              .centre_x_q16 = 39 * 65536 + 32768,
                              .centre_y_q16 = 29 * 65536 + 32768};
}

static inline ivl_vision_frame_t vision_frame(const uint8_t *raw, uint32_t t_us)
{
    return (ivl_vision_frame_t){
        .pixels = raw, .t_us = t_us, .exposure_us = 4000, .turn_q30 = {0, 0, 0, ONE_Q30}, .normal_q30 = {0, 0, ONE_Q30}};
}

#endif  // VISION_FIXTURE_H
