/// @file fuzz_vision.c
/// libFuzzer on the estimator of firmware/vision: each input is a configuration and a few pictures, whose time, exposure, rotation, normal and
/// pixels it chooses.
#include <assert.h>
#include <string.h>

#include "ivl_vision.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum
{
    RAW_MAX = 16 * IVL_VISION_PIXELS,
    HEAD_BYTES = 24,
    FRAME_BYTES = 40,
    FRAMES_MAX = 6
};

static ivl_vision_state_t state;
static uint8_t            raw[RAW_MAX];
static uint16_t           flat[IVL_VISION_FLAT_ROWS * IVL_VISION_FLAT_COLUMNS];

/// A number from `bits` on, most of which the input leaves as it is.
static int32_t word(const uint8_t *at)
{
    int32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

/// Configurations that are possible more often than not.
static ivl_vision_cfg_t cfg_of(const uint8_t *head)
{
    ivl_vision_cfg_t cfg = {.bin = (head[0] & 1u) ? 4 : 2,
                            .window_w = (uint16_t)(32u + 4u * (head[1] % 8u)),
                            .window_h = (uint16_t)(24u + 6u * (head[2] % 5u)),
                            .horizon_q12 = (uint16_t)(40u + 4u * head[3]),
                            .attitude_q16 = head[4],
                            .focal_q16 = (16 + head[5] % 112) * 65536 + head[6],
                            .centre_x_q16 = (20 + head[7] % 40) * 65536 + head[8],
                            .centre_y_q16 = (15 + head[9] % 30) * 65536 + head[10],
                            .radial_q16 = {word(head + 12) % 65536, word(head + 16) % 65536},
                            .flat_q12 = (head[11] & 1u) ? flat : NULL};
    for (size_t i = 0; i < sizeof flat / sizeof flat[0]; i++)
    {
        flat[i] = (uint16_t)(head[20] * 256u + head[21] * i);
    }
    return cfg;
}

/// A picture of bytes that repeat and drift.
static void paint(const uint8_t *at)
{
    for (size_t i = 0; i < RAW_MAX; i++)
    {
        raw[i] = (uint8_t)(at[i % 8u] + at[8u + i / 1280u % 8u] * (i % 160u) / 16u);
    }
}

static ivl_vision_frame_t frame_of(const uint8_t *at, uint32_t t_us)
{
    const int32_t      one = 1 << 30;
    ivl_vision_frame_t frame = {.pixels = raw,
                                .t_us = t_us + at[0] * 1000u,
                                .exposure_us = 1u + (uint32_t)(at[1] * at[2]),
                                .turn_q30 = {word(at + 4) % 4096, word(at + 8) % 4096, word(at + 12) % 4096, one},
                                .normal_q30 = {word(at + 16) % 65536, word(at + 20) % 65536, one}};
    if (at[3] & 1u)
    {
        frame.turn_q30[at[3] / 2u % 4u] = word(at + 4);
    }
    if (at[3] & 2u)
    {
        frame.normal_q30[at[3] / 4u % 3u] = word(at + 16);
    }
    return frame;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < HEAD_BYTES)
    {
        return 0;
    }
    const ivl_vision_cfg_t cfg = cfg_of(data);
    if (!ivl_vision_init(&cfg, &state))
    {
        return 0;
    }
    for (size_t i = 0; i < FRAMES_MAX && size >= HEAD_BYTES + (i + 1) * FRAME_BYTES; i++)
    {
        const uint8_t *at = data + HEAD_BYTES + i * FRAME_BYTES;
        paint(at + 24);
        const ivl_vision_frame_t frame = frame_of(at, (uint32_t)i * 16667u);
        ivl_vision_out_t         out;
        ivl_vision_step(&cfg, &state, &frame, &out);
        assert(out.status < IVL_VISION_STATUS_COUNT);
        assert(out.status == IVL_VISION_VALID ? out.sigma_rrev_q16_per_s > 0 : out.rrev_q16_per_s == 0);
    }
    return 0;
}
