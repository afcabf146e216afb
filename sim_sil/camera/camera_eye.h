/// @file camera_eye.h
/// The estimator of a rendered camera, as the processor of its deck would run it.
#ifndef IVL_CAMERA_EYE_H
#define IVL_CAMERA_EYE_H

#include "camera_render.h"
#include "ivl_vision.h"

/// The estimator and its memory, and the flat field that it is given.
typedef struct
{
    ivl_vision_cfg_t   cfg;
    ivl_vision_state_t state;
    uint16_t           flat_q12[IVL_VISION_FLAT_ROWS * IVL_VISION_FLAT_COLUMNS];
    double             q_told[4];  ///< with the last picture
    double             exposure_s;
    bool               seen;
} ivl_camera_eye_t;

/// An estimator that knows this camera: its focal length, distortion and flat field, but not how it is tilted.
/// @return false if the estimator refuses the camera
bool ivl_camera_eye_init(const ivl_camera_params_t *params, ivl_camera_eye_t *eye);

/// Shows a picture to the estimator.
void ivl_camera_eye_look(ivl_camera_eye_t *eye, const uint8_t *grey, double t_s, const double q_told_SB[4], ivl_vision_out_t *out);

#endif  // IVL_CAMERA_EYE_H
