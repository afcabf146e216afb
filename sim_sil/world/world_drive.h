/// @file world_drive.h
/// Tracking controller and mixer of several vehicles at once, from the sources of the flight core.
#ifndef IVL_WORLD_DRIVE_H
#define IVL_WORLD_DRIVE_H

#include "ivl_cfg.h"
#include "world_single.h"

typedef struct
{
    ivl_single_t x, y, z;
} ivl_s3_t;

/// What they are given, as in ivl_sample_t and ivl_reference_t, and what comes of it.
typedef struct
{
    ivl_s3_t     p_WB_m, v_WB_mps, w_B_radps;
    ivl_single_t q_WB[4];  ///< x, y, z, w
    ivl_s3_t     p_ref_W_m, v_ref_W_mps, a_ref_W_mps2;
    float        tan_tilt_max;  ///< follows from the configuration
    ivl_single_t thrust_N[4];   ///< out
} ivl_sim_drive_t;

/// Fills thrust_N.  Each lane has the bits that the flight core computes for one vehicle.
void ivl_sim_drive(const ivl_cfg_t *cfg, ivl_sim_drive_t *drive);

#endif  // IVL_WORLD_DRIVE_H
