/// @file camera_params.h
/// The numbers of a simulated camera: one line each, from which its struct, the parameters of the world, and Python's table follow.
#ifndef IVL_CAMERA_PARAMS_H
#define IVL_CAMERA_PARAMS_H

// clang-format off
/// What a picture depends on.  X(group, name, unit_suffix, unit, lo, hi, default, doc), as in sim_params.h
#define IVL_CAMERA_PARAMS(X) \
    X(camera, width, px, "px", 160.0, 320.0, 160.0, "columns of the sensor: 160 or 320, which the estimator bins to 80") \
    X(camera, focal, px, "px", 40.0, 400.0, 90.5, "focal length in pixels of the sensor; 90.5 of 160 is a field of view of 83 degrees") \
    X(camera, radial_1, norm, "1", -0.5, 0.5, 0.0, "distortion k1: r' = r (1 + k1 r^2 + k2 r^4), r over the focal length") \
    X(camera, radial_2, norm, "1", -0.5, 0.5, 0.0, "distortion k2") \
    X(camera, vignetting, norm, "1", 0.0, 2.0, 0.5, "light falls as 1 / (1 + vignetting r^2)^2; 1 is the fourth power of the cosine") \
    X(camera, exposure, s, "s", 1.0e-5, 0.05, 0.004, "time for which a row is exposed") \
    X(camera, row_time, s, "s", 0.0, 2.0e-4, 6.4e-5, "between the exposures of two rows; 0: all at once") \
    X(camera, blur, norm, "1", 0.0, 16.0, 0.0, "instants of an exposure that each pixel is the mean of; 0: one, and 2 x 2 pixels share four") \
    X(camera, white, norm, "1", 10.0, 255.0, 200.0, "grey value of a white surface in the middle of the picture") \
    X(camera, electrons_per_grey, norm, "1", 1.0, 1000.0, 20.0, "electrons of one grey value: shot noise is the root of their number") \
    X(camera, read_noise, norm, "1", 0.0, 20.0, 0.7, "noise of a pixel in the dark, grey values") \
    X(camera, black, norm, "1", 0.0, 64.0, 0.0, "grey value without light") \
    X(camera, flicker, norm, "1", 0.0, 1.0, 0.0, "amplitude of the light's flicker over its mean") \
    X(camera, flicker_rate, hz, "Hz", 10.0, 1000.0, 100.0, "of the light's flicker: twice that of the mains") \
    X(camera, mount_height, m, "m", -0.1, 0.1, 0.0, "camera above the body origin, along body z") \
    X(camera, mount_roll, rad, "rad", -0.2, 0.2, 0.0, "tilt of the camera about body x, which nobody knows of") \
    X(camera, mount_pitch, rad, "rad", -0.2, 0.2, 0.0, "tilt of the camera about body y, which nobody knows of") \
    X(camera, board_x, m, "m", 0.0, 100.0, 0.0, "length of the board along x; 0: the surface has no end") \
    X(camera, board_y, m, "m", 0.0, 100.0, 0.0, "width of the board along y") \
    X(camera, board_at_x, m, "m", -100.0, 100.0, 0.0, "middle of the board") \
    X(camera, board_at_y, m, "m", -100.0, 100.0, 0.0, "middle of the board") \
    X(camera, background, norm, "1", 0.0, 1.0, 0.1, "brightness beyond the board, of white")

/// A camera of a world: when it looks, and when it tells what it saw.
#define IVL_CAMERA_LOOP_PARAMS(X) \
    X(camera, rate, hz, "Hz", 0.0, 250.0, 0.0, "pictures a second of a camera that is rendered; 0: there is none") \
    X(camera, delay, s, "s", 0.0, 0.03, 0.0, "from the middle of a picture's exposure until its reading is sent; a reading says how old it is then") \
    X(camera, transport, s, "s", 0.0, 0.03, 0.0, "from then to the arrival, of which a reading says nothing") \
    X(camera, drop, norm, "1", 0.0, 1.0, 0.0, "chance that a reading is lost on its way") \
    X(camera, texture_length, m, "m", 0.1, 100.0, 2.0, "side of the square of the surface that repeats")
// clang-format on

#define IVL_CAMERA_MEMBER(group, name, suffix, unit, lo, hi, dflt, doc) double name##_##suffix;
typedef struct
{
    IVL_CAMERA_PARAMS(IVL_CAMERA_MEMBER)
} ivl_camera_params_t;
#undef IVL_CAMERA_MEMBER

#endif  // IVL_CAMERA_PARAMS_H
