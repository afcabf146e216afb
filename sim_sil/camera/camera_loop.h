/// @file camera_loop.h
/// Pictures in the loop: a rendered camera and its estimator as the eye of a world.                                 [CAMERA section 7]
#ifndef IVL_CAMERA_LOOP_H
#define IVL_CAMERA_LOOP_H

#include <stddef.h>

#include "camera_eye.h"
#include "camera_render.h"
#include "sim_model.h"

/// Writes down what a landing's camera saw; pictures beyond the capacity are counted, not written.
typedef struct
{
    ivl_sim_look_t   *looks;
    ivl_vision_out_t *readings;
    uint8_t          *grey;  ///< NULL: the pictures are not kept
    size_t            capacity, n;
} ivl_camera_film_t;

/// What all landings of a world share.
typedef struct
{
    ivl_camera_t         camera;
    ivl_camera_texture_t texture;  ///< whose texels somebody else owns
    double               period_s;
    ivl_camera_film_t   *film;  ///< NULL: nothing is written down
} ivl_camera_loop_t;

/// Numbers of the camera of a world.
ivl_camera_params_t ivl_camera_of_world(const ivl_sim_params_t *raw);

/// Gives the model's camera a surface to look at.
/// @param[in] texture  whose texels must live as long as the model
/// @return the loop, which the model's eye uses from now on and the caller frees; NULL without memory, and the model has no eye then
ivl_camera_loop_t *ivl_camera_loop_attach(const ivl_camera_texture_t *texture, ivl_sim_model_t *model);

/// Lets a model look with a loop that exists.
void ivl_camera_loop_use(ivl_camera_loop_t *loop, ivl_sim_model_t *model);

#endif  // IVL_CAMERA_LOOP_H
