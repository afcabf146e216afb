#include "camera_eye.h"

#include <math.h>
#include <string.h>

enum
{
    NODE_PIXELS = 4
};

/// Part of the picture that is used, the closing of a pair that is aimed at, and 10 mrad of attitude: docs/CAMERA.md says why.
static const uint16_t WINDOW_W = 56, WINDOW_H = 42, HORIZON_Q12 = 410, ATTITUDE_Q16 = 655;

static int32_t fixed(double value, int bits)
{
    return (int32_t)floor(value * (double)((int64_t)1 << bits) + 0.5);
}

/// Gain at each node of the flat field: one over the vignetting, where the distorted node lies.
static void even_out(const ivl_camera_params_t *params, uint16_t *flat_q12)
{
    const double focal = params->focal_px * 80.0 / ((params->width_px > 240.0) ? 320.0 : 160.0);
    for (int y = 0; y < IVL_VISION_FLAT_ROWS; y++)
    {
        for (int x = 0; x < IVL_VISION_FLAT_COLUMNS; x++)
        {
            const double u = (NODE_PIXELS * x - 39.5) / focal, v = (NODE_PIXELS * y - 29.5) / focal;
            const double s = ivl_camera_undistorted(params, u * u + v * v);
            const double fall = 1.0 + params->vignetting_norm * s * s * (u * u + v * v);
            const double gain = 4096.0 * fall * fall;
            *flat_q12++ = (uint16_t)((gain > 65535.0) ? 65535.0 : gain);
        }
    }
}

bool ivl_camera_eye_init(const ivl_camera_params_t *params, ivl_camera_eye_t *eye)
{
    const int bin = (params->width_px > 240.0) ? 4 : 2;
    memset(eye, 0, sizeof *eye);
    even_out(params, eye->flat_q12);
    eye->exposure_s = params->exposure_s;
    eye->cfg = (ivl_vision_cfg_t){.bin = (uint16_t)bin,
                                  .window_w = WINDOW_W,
                                  .window_h = WINDOW_H,
                                  .horizon_q12 = HORIZON_Q12,
                                  .attitude_q16 = ATTITUDE_Q16,
                                  .focal_q16 = fixed(params->focal_px / bin, 16),
                                  .centre_x_q16 = fixed(39.5, 16),
                                  .centre_y_q16 = fixed(29.5, 16),
                                  .radial_q16 = {fixed(params->radial_1_norm, 16), fixed(params->radial_2_norm, 16)},
                                  .flat_q12 = (params->vignetting_norm > 0.0) ? eye->flat_q12 : NULL};
    return ivl_vision_init(&eye->cfg, &eye->state);
}

/// a* b: what takes vectors of the camera b to those of the camera a.
static void between(const double a[4], const double b[4], double q[4])
{
    q[0] = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1];
    q[1] = a[3] * b[1] + a[0] * b[2] - a[1] * b[3] - a[2] * b[0];
    q[2] = a[3] * b[2] - a[0] * b[1] + a[1] * b[0] - a[2] * b[3];
    q[3] = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void ivl_camera_eye_look(ivl_camera_eye_t *eye, const uint8_t *grey, double t_s, const double q_told_SB[4], ivl_vision_out_t *out)
{
    double turn[4] = {0.0, 0.0, 0.0, 1.0};
    if (eye->seen)
    {
        between(eye->q_told, q_told_SB, turn);
    }
    const double      *q = q_told_SB;
    const double       normal[3] = {2.0 * (q[0] * q[2] - q[1] * q[3]), 2.0 * (q[1] * q[2] + q[0] * q[3]),
                                    1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1])};
    const double       sign = (turn[3] < 0.0) ? -1.0 : 1.0;
    ivl_vision_frame_t frame = {
        .pixels = grey, .t_us = (uint32_t)floor(t_s * 1.0e6 + 0.5), .exposure_us = (uint32_t)floor(eye->exposure_s * 1.0e6 + 0.5)};
    for (int i = 0; i < 4; i++)
    {
        frame.turn_q30[i] = fixed(sign * turn[i], 30);
    }
    for (int i = 0; i < 3; i++)
    {
        frame.normal_q30[i] = fixed(normal[i], 30);
    }
    memcpy(eye->q_told, q_told_SB, sizeof eye->q_told);
    eye->seen = true;
    ivl_vision_step(&eye->cfg, &eye->state, &frame, out);
}
