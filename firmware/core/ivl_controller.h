/// @file ivl_controller.h
/// Stage 5c: geometric tracking controller on SE(3) (Lee, Leok, McClamroch 2010), heading 0, no integral terms, with the desired rate.
#ifndef IVL_CONTROLLER_H
#define IVL_CONTROLLER_H
#include "ivl_approach.h"
#include "ivl_math.h"

/// The vertical force asked for never falls below this part of the weight: it keeps the thrust direction defined, the vehicle upright
/// and its roll and pitch under control.
static const float IVL_LIFT_NORM_MIN = 0.2f;

/// Total thrust along b_z and moment in B.
typedef struct
{
    ivl_num_t  thrust_N;  ///< >= 0
    ivl_vec3_t moment_B_Nm;
} ivl_wrench_t;

/// Wrench that brings the sampled state to the reference.
/// @param[in] sample        a good sample, quaternion of unit length
/// @param[in] tan_tilt_max  tangent of cfg->tilt_cmd_rad_max: the horizontal force is limited to this times the vertical one
ivl_wrench_t ivl_controller_compute(const ivl_cfg_t *cfg, const ivl_sample_t *sample, const ivl_reference_t *ref, float tan_tilt_max);
#endif  // IVL_CONTROLLER_H
