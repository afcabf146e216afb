#include "phys_surface.h"

#include "phys_math.h"

ivl_sim_surface_t ivl_sim_surface_level(double height_m)
{
    return (ivl_sim_surface_t){.point_W_m = {0.0, 0.0, height_m}, .normal_W = {0.0, 0.0, 1.0}, .velocity_W_mps = {0.0, 0.0, 0.0}};
}

ivl_sim_surface_t ivl_sim_surface_tilted(double height_m, double tilt_rad, double along_mps, double away_mps)
{
    double s, c;
    ivl_sim_sincos(tilt_rad, &s, &c);
    return (ivl_sim_surface_t){.point_W_m = {0.0, 0.0, height_m},
                               .normal_W = {s, 0.0, c},
                               .velocity_W_mps = {along_mps * c + away_mps * s, 0.0, away_mps * c - along_mps * s}};
}

/// Normals nearer to straight down than this (a floor) are no turn of z up that has a shortest way.
static const double DOWN = -1.0 + 1.0e-9;

ivl_d3_t ivl_sim_surface_forward(const ivl_sim_surface_t *surface)
{
    const ivl_d3_t n = surface->normal_W, x = ivl_d3(1.0, 0.0, 0.0);
    if (!(n.z > DOWN))
    {
        // about y, as of any other plane that is tilted towards x; along the surface, and of unit length to 1e-9
        return ivl_d3_sub(ivl_d3_scale(n.x, n), x);
    }
    return ivl_d3_sub(x, ivl_d3_scale(n.x / (1.0 + n.z), ivl_d3(n.x, n.y, n.z + 1.0)));
}
