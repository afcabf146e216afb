/// @file camera_render.h
/// Pictures of a camera that looks along body z at a plane.   [CAMERA section 6]
///
/// Axes of the surface S: origin on it, x forward, y left, z into it; the camera is at z = -d.  A picture is a function of camera, texture,
/// pose and the numbers (seed, stream, picture): no state, the same bits on every machine.
#ifndef IVL_CAMERA_RENDER_H
#define IVL_CAMERA_RENDER_H

#include "camera_params.h"
#include "camera_texture.h"
#include "sim_rng.h"

enum
{
    IVL_CAMERA_WIDTH_MAX = 320,
    IVL_CAMERA_HEIGHT_MAX = 240
};

/// Where the body is in the middle of the exposure of the middle row, and how it moves.
typedef struct
{
    double t_s;
    double p_SB_m[3];
    double q_SB[4];  ///< x y z w
    double v_SB_mps[3];
    double w_B_radps[3];
} ivl_camera_pose_t;

/// A camera with what is the same for all its pictures.
typedef struct
{
    ivl_camera_params_t params;
    int                 width, height;
    double              R_BC[3][3];                                       ///< as it is mounted
    float               u[IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX];  ///< direction of each pixel: (u, v, 1)
    float               v[IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX];
    float               light[IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX];  ///< vignetting
    float               noise[256];                                           ///< standard deviation at a grey value
} ivl_camera_t;

/// Undistorted radius over the distorted one, whose square is r2; both over the focal length.
double ivl_camera_undistorted(const ivl_camera_params_t *params, double r2);

void ivl_camera_init(const ivl_camera_params_t *params, ivl_camera_t *camera);

/// @param[in] picture  number of the picture, for its noise
/// @param[out] grey    width x height bytes
void ivl_camera_render(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const ivl_camera_pose_t *pose,
                       const ivl_sim_rng_t *rng, uint32_t picture, uint8_t *grey);

#endif  // IVL_CAMERA_RENDER_H
