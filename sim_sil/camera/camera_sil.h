/// @file camera_sil.h
/// Camera, surface and estimator for Python: pictures along a motion, and what the estimator makes of them.
#ifndef IVL_CAMERA_SIL_H
#define IVL_CAMERA_SIL_H

#include <stddef.h>
#include <stdint.h>

#include "camera_eye.h"
#include "camera_loop.h"
#include "camera_render.h"
#include "sil.h"

/// A row of a motion: a pose, and the attitude that the estimator gets.
typedef struct
{
    ivl_camera_pose_t pose;
    double            q_told_SB[4];
} ivl_camera_row_t;

/// The table of ivl_camera_params_t.
const ivl_sil_field_t *ivl_sil_camera_table(uint32_t *n_fields, uint32_t *item_size);

/// The table of ivl_vision_out_t; cues and their standard deviations in 1/65536 of 1/s and rad/s.
const ivl_sil_field_t *ivl_sil_vision_table(uint32_t *n_fields, uint32_t *item_size);

/// A surface of size x size values, 65535 is white; the size is a power of two.
/// @return NULL if it is not, or there is no memory
void *ivl_sil_texture_create(const uint16_t *texels, uint32_t size, double length_m);
void  ivl_sil_texture_free(void *texture);

/// Pictures along a motion and, if `readings` is given, what the estimator says to each.
/// @param[in] params    ivl_camera_params_t
/// @param[in] rows      n rows of ivl_camera_row_t, as 18 doubles
/// @param[out] grey     n pictures of width x height bytes, or NULL
/// @param[out] readings n rows of ivl_vision_out_t, or NULL
/// @return 0; 1 if the estimator refuses the camera, 2 if there is no memory
int ivl_sil_camera_run(const void *params, const void *texture, const double *rows, size_t n, uint64_t seed, uint64_t stream, uint8_t *grey,
                       void *readings);

/// What the estimator says to given pictures.
/// @param[in] rows  as above; only time and told attitude are read
/// @return 0; 1 if the estimator refuses the camera, 2 if there is no memory
int ivl_sil_vision_run(const void *params, const uint8_t *grey, const double *rows, size_t n, void *readings);

/// Gives a model with camera.rate a surface to look at, once.  The surface must live as long as the model.
/// @return 0; 1 if the estimator refuses the camera, 2 if there is no memory
int ivl_sil_model_camera(void *model, const void *texture);

/// Flies one landing and writes down what its camera saw: the same bits as without.
/// @param[out] rows      capacity rows of ivl_camera_row_t
/// @param[out] readings  capacity rows of ivl_vision_out_t
/// @param[out] grey      capacity pictures, or NULL
/// @return number of pictures, those beyond the capacity included; -1 if the model has no camera, or there is no memory
long ivl_sil_camera_film(const void *model, const void *spec, size_t capacity, double *rows, void *readings, uint8_t *grey, void *outcome);

#endif  // IVL_CAMERA_SIL_H
