/// @file camera_params.h
/// The numbers of a simulated camera: one line each, from which the struct, the table for Python and the range check follow.
#ifndef IVL_CAMERA_PARAMS_H
#define IVL_CAMERA_PARAMS_H

/// X(name, unit, lo, hi, default, doc)
#define IVL_CAMERA_PARAMS(X)                                                                                                               \
    X(width_px, "px", 160.0, 320.0, 160.0, "columns of the sensor: 160 or 320, which the estimator bins to 80")                            \
    X(focal_px, "px", 40.0, 400.0, 90.5, "focal length in pixels of the sensor; 90.5 of 160 is a field of view of 83 degrees")             \
    X(radial_1, "1", -0.5, 0.5, 0.0, "distortion k1: r' = r (1 + k1 r^2 + k2 r^4), r over the focal length")                               \
    X(radial_2, "1", -0.5, 0.5, 0.0, "distortion k2")                                                                                      \
    X(vignetting, "1", 0.0, 2.0, 0.5, "light falls as 1 / (1 + vignetting r^2)^2; 1 is the fourth power of the cosine")                    \
    X(exposure_s, "s", 1.0e-5, 0.05, 0.004, "time for which a row is exposed")                                                             \
    X(row_time_s, "s", 0.0, 2.0e-4, 6.4e-5, "between the exposures of two rows; 0: all at once")                                           \
    X(blur_samples, "1", 0.0, 16.0, 0.0, "instants of an exposure that each pixel is the mean of; 0: one, and 2 x 2 pixels share four")    \
    X(white, "1", 10.0, 255.0, 200.0, "grey value of a white surface in the middle of the picture")                                        \
    X(electrons_per_grey, "1", 1.0, 1000.0, 20.0, "electrons of one grey value: shot noise is the root of their number")                   \
    X(read_noise, "1", 0.0, 20.0, 0.7, "noise of a pixel in the dark, grey values")                                                        \
    X(black, "1", 0.0, 64.0, 0.0, "grey value without light")                                                                              \
    X(flicker_norm, "1", 0.0, 1.0, 0.0, "amplitude of the light's flicker over its mean")                                                  \
    X(flicker_hz, "Hz", 10.0, 1000.0, 100.0, "its frequency, twice that of the mains")                                                     \
    X(mount_height_m, "m", -0.1, 0.1, 0.0, "camera above the body origin, along body z")                                                   \
    X(mount_roll_rad, "rad", -0.2, 0.2, 0.0, "tilt of the camera about body x, which nobody knows of")                                     \
    X(mount_pitch_rad, "rad", -0.2, 0.2, 0.0, "tilt of the camera about body y, which nobody knows of")                                    \
    X(board_x_m, "m", 0.0, 100.0, 0.0, "length of the board along x; 0: the surface has no end")                                           \
    X(board_y_m, "m", 0.0, 100.0, 0.0, "its width along y")                                                                                \
    X(board_at_x_m, "m", -100.0, 100.0, 0.0, "middle of the board")                                                                        \
    X(board_at_y_m, "m", -100.0, 100.0, 0.0, "middle of the board")                                                                        \
    X(background, "1", 0.0, 1.0, 0.1, "brightness beyond the board, of white")

#define IVL_CAMERA_MEMBER(name, unit, lo, hi, dflt, doc) double name;
typedef struct
{
    IVL_CAMERA_PARAMS(IVL_CAMERA_MEMBER)
} ivl_camera_params_t;
#undef IVL_CAMERA_MEMBER

#endif  // IVL_CAMERA_PARAMS_H
