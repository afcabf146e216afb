/// @file ivl_vision_fit.h
/// One pass of the fit: the earlier picture is drawn as the present camera would see it, and what is left tells how to move.
///
/// A point of the surface that the present camera sees in the direction m, the earlier one sees in the direction R (I + p n') m: R takes
/// vectors of the present camera to those of the earlier one, n is the normal, p the displacement over the present distance.
/// [CAMERA eq. 2.1]
#ifndef IVL_VISION_FIT_H
#define IVL_VISION_FIT_H

#include "ivl_vision.h"
#include "ivl_vision_solve.h"

/// Two pictures of one size, and the part of the present one that is looked at.
typedef struct
{
    const int16_t *now, *then;
    int            width, height;
    int32_t        focal_q16, centre_x_q16, centre_y_q16;
    int            window_w, window_h;
} ivl_vision_pair_t;

/// What is known of the two cameras, and what is believed of motion and light.
typedef struct
{
    int32_t turn_q30[9];                        ///< R, row by row
    int32_t normal_q30[3];                      ///< n
    int32_t p_q30[3];                           ///< displacement over distance
    int32_t gain_q12[IVL_VISION_WINDOW_H + 2];  ///< of the earlier picture, for each row of the window and one above and below
    int32_t offset;
} ivl_vision_belief_t;

typedef struct
{
    int32_t n_pixels;
    int64_t residual;  ///< sum of the squares that the pass leaves
    int64_t
        contrast_q8;  ///< least information about any part of the motion, over what noise of the size of the residual would feign; 256 is equal
    int64_t variance_q60[3][3];  ///< of the motion, from the scatter of the blocks
    int32_t step_q30[3];         ///< by how much this pass moved p
} ivl_vision_fit_t;

/// A gain that makes up for the exposures.
void ivl_vision_fit_start(ivl_vision_belief_t *belief, uint32_t exposure_now_us, uint32_t exposure_then_us);

/// @param[out] block  work space; NULL: no variance is asked for
/// @return false if the window leaves the earlier picture, or shows too little
bool ivl_vision_fit_pass(const ivl_vision_pair_t *pair, ivl_vision_belief_t *belief,
                         ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS], ivl_vision_fit_t *fit);

#endif  // IVL_VISION_FIT_H
