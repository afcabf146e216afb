/// @file phys_surface.h
/// The plane that a vehicle lands on: a point of it, its normal, its velocity.  A ceiling is the plane whose normal is up.
///
/// Along the normal a plane is one number, here called its height; so is every point.  The normal points from the room into
/// the surface, so that what is nearer to it is higher.                                            [MODEL sec. 5]
#ifndef IVL_PHYS_SURFACE_H
#define IVL_PHYS_SURFACE_H

#include "phys_wide.h"

typedef struct
{
    ivl_d3_t point_W_m;  ///< of the surface, at time 0
    ivl_d3_t normal_W;   ///< unit vector, into the surface
    ivl_d3_t velocity_W_mps;
} ivl_sim_surface_t;

/// A plane through (0, 0, height) whose normal is tilted from up towards x: a ceiling without, a wall ahead at a right angle.
/// @param[in] along_mps, away_mps  its velocity, forward and along the normal
ivl_sim_surface_t ivl_sim_surface_tilted(double height_m, double tilt_rad, double along_mps, double away_mps);

/// A ceiling at rest.
ivl_sim_surface_t ivl_sim_surface_level(double height_m);

/// Unit vector along the surface that is forward: the world's x axis, turned the shortest way from z up to the normal; for a floor
/// that is about y.
ivl_d3_t ivl_sim_surface_forward(const ivl_sim_surface_t *surface);

/// Height of a point.
IVL_SIM_INLINE double ivl_sim_surface_height_of(const ivl_sim_surface_t *surface, ivl_d3_t p_W_m)
{
    return ivl_d3_along(surface->normal_W, p_W_m);
}

/// Height of several points, one in each lane.
IVL_SIM_INLINE ivl_wide_t ivl_sim_surface_heights_of(const ivl_sim_surface_t *surface, ivl_w3_t p_W_m)
{
    return ivl_d3_is_z(surface->normal_W) ? p_W_m.z : ivl_w3_dot_d3(p_W_m, surface->normal_W);
}

/// Speed at which the surface itself rises, that is, flees.
IVL_SIM_INLINE double ivl_sim_surface_speed(const ivl_sim_surface_t *surface)
{
    return ivl_d3_along(surface->normal_W, surface->velocity_W_mps);
}

/// Height of the surface itself.
IVL_SIM_INLINE double ivl_sim_surface_height(const ivl_sim_surface_t *surface, double t_s)
{
    return ivl_d3_along(surface->normal_W, surface->point_W_m) + t_s * ivl_sim_surface_speed(surface);
}

/// Speed at which a point that moves at v comes nearer.
IVL_SIM_INLINE double ivl_sim_surface_closing(const ivl_sim_surface_t *surface, ivl_d3_t v_W_mps)
{
    return ivl_d3_along(surface->normal_W, v_W_mps) - ivl_sim_surface_speed(surface);
}

/// Velocity of a point along the surface, as seen from there.
IVL_SIM_INLINE ivl_d3_t ivl_sim_surface_tangential(const ivl_sim_surface_t *surface, ivl_d3_t v_W_mps)
{
    const double closing = ivl_sim_surface_closing(surface, v_W_mps);
    return ivl_d3_sub(ivl_d3_sub(v_W_mps, surface->velocity_W_mps), ivl_d3_scale(closing, surface->normal_W));
}

#endif  // IVL_PHYS_SURFACE_H
