/// @file entry.c
/// The estimator alone, with memory of its own: what tools/vision/machines.py calls on each processor.
#include "ivl_vision.h"

enum
{
    RAW_BYTES = 4 * IVL_VISION_PIXELS
};

/// What a caller writes and reads: the same on every processor.
extern uint8_t          entry_pixels[RAW_BYTES];
extern uint32_t         entry_times_us[2];
extern int32_t          entry_axes_q30[7];
extern ivl_vision_out_t entry_out;

int  entry_begin(int32_t focal_q16, int32_t radial_1_q16, int32_t radial_2_q16);
void entry_step(void);

uint8_t          entry_pixels[RAW_BYTES];
uint32_t         entry_times_us[2];
int32_t          entry_axes_q30[7];
ivl_vision_out_t entry_out;

static ivl_vision_cfg_t   cfg;
static ivl_vision_state_t state;

int entry_begin(int32_t focal_q16, int32_t radial_1_q16, int32_t radial_2_q16)
{
    cfg = (ivl_vision_cfg_t){.bin = 2,
                             .window_w = 56,
                             .window_h = 42,
                             .horizon_q12 = 410,
                             .attitude_q16 = 655,
                             .focal_q16 = focal_q16,
                             .centre_x_q16 = 39 * 65536 + 32768,
                             .centre_y_q16 = 29 * 65536 + 32768,
                             .radial_q16 = {radial_1_q16, radial_2_q16}};
    return ivl_vision_init(&cfg, &state) ? 1 : 0;
}

void entry_step(void)
{
    ivl_vision_frame_t frame = {.pixels = entry_pixels, .t_us = entry_times_us[0], .exposure_us = entry_times_us[1]};
    for (int i = 0; i < 4; i++)
    {
        frame.turn_q30[i] = entry_axes_q30[i];
    }
    for (int i = 0; i < 3; i++)
    {
        frame.normal_q30[i] = entry_axes_q30[4 + i];
    }
    ivl_vision_step(&cfg, &state, &frame, &entry_out);
}
