/// @file sim_eye.h
/// A camera of a world and what reads its pictures: whatever renders, so that world and physics know nothing of pictures.
#ifndef IVL_SIM_EYE_H
#define IVL_SIM_EYE_H

#include <stdbool.h>
#include <stdint.h>

#include "sim_rng.h"

/// The body in the middle of the exposure of a picture, in the axes of the surface: origin on it, x forward, y left, z into it.
typedef struct
{
    double t_s;
    double p_SB_m[3];
    double q_SB[4];  ///< x y z w
    double v_SB_mps[3];
    double w_B_radps[3];
    double q_told_SB[4];  ///< the attitude as the vehicle knows it
} ivl_sim_look_t;

/// What a picture and the ones before it tell.
typedef struct
{
    bool   valid;
    double age_s;  ///< from the instant that the cues belong to, to the middle of the picture's exposure
    double rrev_per_s, of_y_radps;
} ivl_sim_seen_t;

/// A place where cameras look.  Each thread that flies landings opens one port; a port holds one camera per lane.
typedef struct
{
    void *context;  ///< argument of open; NULL: there is no camera
    void *(*open)(void *context, int lanes);
    void (*close)(void *port);
    /// A new landing: nothing has been seen yet.
    void (*start)(void *port, int lane, const ivl_sim_rng_t *rng);
    /// @param[in] picture  its number in this landing
    void (*look)(void *port, int lane, uint32_t picture, const ivl_sim_look_t *at, ivl_sim_seen_t *seen);
} ivl_sim_eye_t;

#endif  // IVL_SIM_EYE_H
