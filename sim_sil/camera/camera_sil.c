#include "camera_sil.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum
{
    ROW_DOUBLES = 18,
    NODE_PIXELS = 4
};

/// Part of the picture that is used, the closing of a pair that is aimed at, and 10 mrad of attitude: docs/CAMERA.md says why.
static const uint16_t WINDOW_W = 56, WINDOW_H = 42, HORIZON_Q12 = 410, ATTITUDE_Q16 = 655;

_Static_assert(sizeof(ivl_camera_row_t) == ROW_DOUBLES * sizeof(double), "a row is doubles and nothing else");

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
            const double fall = 1.0 + params->vignetting * s * s * (u * u + v * v);
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
                                  .radial_q16 = {fixed(params->radial_1, 16), fixed(params->radial_2, 16)},
                                  .flat_q12 = (params->vignetting > 0.0) ? eye->flat_q12 : NULL};
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

const ivl_sil_field_t *ivl_sil_camera_table(uint32_t *n_fields, uint32_t *item_size)
{
#define FIELD(name, unit, lo, hi, dflt, doc) {#name, "f8", offsetof(ivl_camera_params_t, name), 1, unit, lo, hi, dflt, doc},
    static const ivl_sil_field_t FIELDS[] = {IVL_CAMERA_PARAMS(FIELD)};
#undef FIELD
    *n_fields = (uint32_t)(sizeof FIELDS / sizeof FIELDS[0]);
    *item_size = (uint32_t)sizeof(ivl_camera_params_t);
    return FIELDS;
}

const ivl_sil_field_t *ivl_sil_vision_table(uint32_t *n_fields, uint32_t *item_size)
{
#define FIELD(name, member, type, unit, doc) {name, type, offsetof(ivl_vision_out_t, member), 1, unit, 0.0, 0.0, 0.0, doc},
    static const ivl_sil_field_t FIELDS[] = {
        FIELD("t", t_us, "u4", "us", "instant of the cues") FIELD("rrev", rrev_q16_per_s, "i4", "1/s", "closing speed over distance") FIELD(
            "of_x", of_x_q16_radps, "i4", "rad/s", "flow about body x") FIELD("of_y", of_y_q16_radps, "i4", "rad/s", "flow about body y")
            FIELD("sigma_rrev", sigma_rrev_q16_per_s, "i4", "1/s", "standard deviation of RREV")
                FIELD("sigma_of", sigma_of_q16_radps, "i4", "rad/s", "standard deviation of the flow")
                    FIELD("gap", gap_us, "u4", "us", "between the two pictures") FIELD("status", status, "u1", "1", "0: valid")
                        FIELD("quality", quality, "u1", "1", "contrast over residual") FIELD("frames", frames, "u1", "1", "of the gap")
                            FIELD("started", started, "u1", "1", "1: without a prediction")};
#undef FIELD
    *n_fields = (uint32_t)(sizeof FIELDS / sizeof FIELDS[0]);
    *item_size = (uint32_t)sizeof(ivl_vision_out_t);
    return FIELDS;
}

void *ivl_sil_texture_create(const uint16_t *texels, uint32_t size, double length_m)
{
    const size_t n = (size_t)size * size;
    if (size == 0 || size > 8192 || (size & (size - 1)) != 0 || !(length_m > 0.0))
    {
        return NULL;
    }
    ivl_camera_texture_t *texture = malloc(sizeof *texture + sizeof(uint16_t) * ivl_camera_texture_texels((int)size));
    if (!texture)
    {
        return NULL;
    }
    uint16_t *own = (uint16_t *)(void *)(texture + 1);
    memcpy(own, texels, n * sizeof *own);
    ivl_camera_texture_init(own, (int)size, length_m, texture);
    return texture;
}

void ivl_sil_texture_free(void *texture)
{
    free(texture);
}

static void row_from(const double *numbers, ivl_camera_row_t *row)
{
    memcpy(row, numbers, sizeof *row);
}

int ivl_sil_camera_run(const void *params, const void *texture, const double *rows, size_t n, uint64_t seed, uint64_t stream, uint8_t *grey,
                       void *readings)
{
    const ivl_sim_rng_t rng = {seed, stream};
    ivl_camera_t       *camera = malloc(sizeof *camera);
    ivl_camera_eye_t   *eye = malloc(sizeof *eye);
    uint8_t            *own = malloc(IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX);
    int                 result = (camera && eye && own) ? 0 : 2;
    if (result == 0 && !ivl_camera_eye_init(params, eye))
    {
        result = 1;
    }
    if (result == 0)
    {
        ivl_camera_init(params, camera);
    }
    const size_t pixels = (result == 0) ? (size_t)camera->width * (size_t)camera->height : 0;
    for (size_t i = 0; i < n && result == 0; i++)
    {
        ivl_camera_row_t row;
        uint8_t         *picture = grey ? grey + i * pixels : own;
        row_from(rows + i * ROW_DOUBLES, &row);
        ivl_camera_render(camera, texture, &row.pose, &rng, (uint32_t)i, picture);
        if (readings)
        {
            ivl_camera_eye_look(eye, picture, row.pose.t_s, row.q_told_SB, (ivl_vision_out_t *)readings + i);
        }
    }
    free(own);
    free(eye);
    free(camera);
    return result;
}

int ivl_sil_vision_run(const void *params, const uint8_t *grey, const double *rows, size_t n, void *readings)
{
    ivl_camera_eye_t *eye = malloc(sizeof *eye);
    int               result = eye ? 0 : 2;
    if (result == 0 && !ivl_camera_eye_init(params, eye))
    {
        result = 1;
    }
    const size_t pixels = (result == 0) ? (size_t)(eye->cfg.bin * eye->cfg.bin) * IVL_VISION_PIXELS : 0;
    for (size_t i = 0; i < n && result == 0; i++)
    {
        ivl_camera_row_t row;
        row_from(rows + i * ROW_DOUBLES, &row);
        ivl_camera_eye_look(eye, grey + i * pixels, row.pose.t_s, row.q_told_SB, (ivl_vision_out_t *)readings + i);
    }
    free(eye);
    return result;
}
