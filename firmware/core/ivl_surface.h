/// @file ivl_surface.h
/// Stage 1b: the vehicle as seen from the plane that it is to land on.  Pure, O(1).
/// The plane's normal n points into the surface and lies in the x-z plane of W, tilted from straight up by cfg->surface_tilt_rad: 0 is a ceiling,
/// pi/2 a wall ahead, pi a floor.  Forward t is the x axis turned along with it: down on a wall, back on a floor.  Heights are along n.
/// Of a ceiling all numbers here have the bits that they would have without a tilt.
#ifndef IVL_SURFACE_H
#define IVL_SURFACE_H
#include "ivl_cfg.h"

/// What follows from the configuration.
typedef struct
{
    float sin;  ///< n = (sin, 0, cos), t = (cos, 0, -sin)
    float cos;
    float up_z_cut;    ///< cosine of half of the turn that a landing needs: there the motors are cut
    float brake_mps2;  ///< acceleration away from the surface that a level-out has
    float late_s;      ///< it begins so much later: a vehicle before a tilted surface has to tilt first
    float aside;       ///< a descent after an abort goes so far along x for each metre, not to come down on a steep slope
} ivl_surface_t;

/// One sensed state, relative to the plane.  For a ceiling: z, v_z, v_x, b_z . z, v'_z, and what hangs upside down.
typedef struct
{
    float height_m;    ///< of the origin of B
    float close_mps;   ///< closing speed, of a surface at rest
    float along_mps;   ///< speed forward along it
    float facing;      ///< cosine of the angle between b_z and n
    float accel_mps2;  ///< acceleration towards the surface, by the accelerometer
    float hung_mps2;   ///< part of the specific force that a vehicle at rest on the surface feels as g
} ivl_relative_t;

/// @param[in] cfg  a configuration that ivl_cfg_check accepts
void ivl_surface_init(const ivl_cfg_t *cfg, ivl_surface_t *surface);

/// @param[in] sample  quaternion of unit length
void ivl_surface_see(const ivl_cfg_t *cfg, const ivl_surface_t *surface, const ivl_sample_t *sample, ivl_relative_t *rel);

/// W vector of a speed along the plane and one away from it; y is kept.
ivl_vec3_t ivl_surface_vec3(const ivl_surface_t *surface, float along, float y, float away);
#endif  // IVL_SURFACE_H
