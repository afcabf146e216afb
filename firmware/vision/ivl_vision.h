/// @file ivl_vision.h
/// Cues of a surface from the pictures of a camera that looks along body z: RREV, OF_x and OF_y with their own standard deviation.
/// [CAMERA sections 1 to 4]
///
/// A direct fit of a plane to two pictures: the earlier one is drawn as it would look from the place of the present one, and three numbers
/// of the motion, a gain that may change from row to row, and an offset make the difference small.  Rotation and normal of the surface are
/// told, so that only the displacement over the distance is left to be seen.
///
/// Whole numbers only, no heap, no globals, no clock: the same bits on every processor.  Time is that of the middle of the exposure of the
/// middle row.  A camera has x along body x (its rows), y along body y, z along body z (its optical axis).
#ifndef IVL_VISION_H
#define IVL_VISION_H

#include <stdbool.h>
#include <stdint.h>

enum
{
    IVL_VISION_WIDTH = 80,  ///< of the binned picture that is worked on
    IVL_VISION_HEIGHT = 60,
    IVL_VISION_PIXELS = IVL_VISION_WIDTH * IVL_VISION_HEIGHT,
    IVL_VISION_SLOTS = 4,    ///< pictures that are kept: a pair is up to three frames apart
    IVL_VISION_COLUMNS = 4,  ///< blocks of the window, for the standard deviation
    IVL_VISION_BANDS = 6,
    IVL_VISION_WINDOW_W = 60,  ///< largest window: 15 pixels a block, as many as a sum of 32 bits holds
    IVL_VISION_WINDOW_H = 48,
    IVL_VISION_FLAT_COLUMNS = 21,  ///< nodes of the flat field
    IVL_VISION_FLAT_ROWS = 16
};

/// A camera, and what is asked of its readings.
typedef struct
{
    uint16_t        bin;           ///< pixels of the sensor, each way, that make one: 2 or 4; with a Bayer sensor 4
    uint16_t        window_w;      ///< central part that is used, multiple of 4, 32 .. 60
    uint16_t        window_h;      ///< multiple of 6, 24 .. 48
    uint16_t        horizon_q12;   ///< closing of a pair over the distance that is aimed at: RREV times the time between the pictures
    uint16_t        attitude_q16;  ///< standard deviation of the given attitude, rad; up to 0.1
    int32_t         focal_q16;     ///< focal length in binned pixels, 16 .. 128
    int32_t         centre_x_q16;  ///< principal point in binned pixels; (0, 0) is the middle of the first pixel
    int32_t         centre_y_q16;
    int32_t         radial_q16[2];  ///< distortion: r' = r (1 + k1 r^2 + k2 r^4), both over the focal length
    const uint16_t *flat_q12;       ///< gain that makes a white wall even, 4096 is 1: 16 rows of 21 nodes, 4 pixels apart; NULL: none
} ivl_vision_cfg_t;

/// A picture and how the camera was held.
typedef struct
{
    const uint8_t *pixels;         ///< rows from y = 0 on, (80 bin) x (60 bin)
    uint32_t       t_us;           ///< middle of the exposure of the middle row; wraps
    uint32_t       exposure_us;    ///< 1 .. 100 000
    int32_t        turn_q30[4];    ///< since the last picture, x y z w: takes vectors of this camera to those of the last one
    int32_t        normal_q30[3];  ///< of the surface, pointing into it, in the camera's axes
} ivl_vision_frame_t;

typedef enum
{
    IVL_VISION_VALID,
    IVL_VISION_FIRST,      ///< no earlier picture
    IVL_VISION_INPUT,      ///< time, rotation or normal cannot be
    IVL_VISION_TEXTURE,    ///< too little to see: nothing, or only lines
    IVL_VISION_RESIDUAL,   ///< the pictures do not agree
    IVL_VISION_RANGE,      ///< a motion beyond what two pictures can tell
    IVL_VISION_UNCERTAIN,  ///< the standard deviation is too large
    IVL_VISION_STATUS_COUNT
} ivl_vision_status_t;

/// What two pictures tell.  Not valid: all cues are 0.
typedef struct
{
    uint32_t t_us;  ///< that the cues belong to: between the two pictures
    int32_t  rrev_q16_per_s;
    int32_t  of_x_q16_radps;
    int32_t  of_y_q16_radps;
    int32_t  sigma_rrev_q16_per_s;  ///< standard deviation
    int32_t  sigma_of_q16_radps;    ///< of the larger one
    uint32_t gap_us;                ///< between the pictures
    uint8_t  status;                ///< ivl_vision_status_t
    uint8_t  quality;               ///< contrast over residual, 0 .. 255
    uint8_t  frames;                ///< apart
    uint8_t  started;               ///< 1: found without a prediction
} ivl_vision_out_t;

/// A picture that is kept.
typedef struct
{
    int16_t  pixel[IVL_VISION_PIXELS];  ///< 16 times the grey value of the sensor
    uint32_t t_us;
    uint32_t exposure_us;
    int32_t  turn_q30[9];  ///< rows of the rotation that takes vectors of the newest camera to those of this one
    bool     filled;
} ivl_vision_slot_t;

/// Sums of a block of the window: what 15 pixels of a row give is added in 32 bits, the rest in 64.
typedef struct
{
    int64_t normal[15];  ///< upper triangle of the products of the five terms
    int64_t right[5];    ///< products with the residual
} ivl_vision_block_t;

/// All memory; the caller owns it.
typedef struct
{
    ivl_vision_slot_t  slot[IVL_VISION_SLOTS];
    int16_t            scratch[IVL_VISION_PIXELS];  ///< the picture before it is rectified, then coarser ones
    ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS];
    uint32_t           newest;               ///< slot of the newest picture
    int32_t            motion_q20_per_s[3];  ///< V / d of the last reading, in the axes of its newer camera
    uint32_t           motion_t_us;          ///< the instant it belongs to
    bool               predicts;             ///< the last reading was valid
} ivl_vision_state_t;

/// @return false if a number of the configuration is out of its range
bool ivl_vision_init(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state);

/// Takes a picture.  Not re-entrant for one state; time 1 to 2 million instructions.
void ivl_vision_step(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state, const ivl_vision_frame_t *frame, ivl_vision_out_t *out);

#endif  // IVL_VISION_H
