#include "world_scene.h"

/// Nearer than this a sensor sees nothing but the surface's paint, and 1/d need not be finite.
static const double D_MIN_M = 1.0e-3;

double ivl_sim_scene_distance_m(const ivl_sim_scene_t *scene, double age_s)
{
    const ivl_sim_surface_t *surface = &scene->model->surface;
    const double             past = scene->surface_height_m - age_s * ivl_sim_surface_speed(surface);
    const double             plane = past + scene->model->raw.world_sensed_gap_offset_m;
    const double             height = ivl_sim_surface_height_of(surface, ivl_d3_load(scene->kin->p_WB_m));
    const double             rising = ivl_d3_along(surface->normal_W, ivl_d3_load(scene->kin->v_WB_mps));
    const double             faster = ivl_d3_along(surface->normal_W, ivl_d3_load(scene->a_W_mps2));
    const double             z = height - age_s * (rising - 0.5 * age_s * faster);
    return (plane - z > D_MIN_M) ? plane - z : D_MIN_M;
}

/// Velocity of the body origin `age_s` ago.
static ivl_d3_t velocity(const ivl_sim_scene_t *scene, double age_s)
{
    return ivl_d3_sub(ivl_d3_load(scene->kin->v_WB_mps), ivl_d3_scale(age_s, ivl_d3_load(scene->a_W_mps2)));
}

double ivl_sim_scene_closing_mps(const ivl_sim_scene_t *scene, double age_s)
{
    return ivl_sim_surface_closing(&scene->model->surface, velocity(scene, age_s));
}

double ivl_sim_scene_forward_mps(const ivl_sim_scene_t *scene, double age_s)
{
    const ivl_sim_surface_t *surface = &scene->model->surface;
    return ivl_d3_dot(ivl_sim_surface_forward(surface), ivl_sim_surface_tangential(surface, velocity(scene, age_s)));
}

double ivl_sim_scene_facing(const ivl_sim_scene_t *scene)
{
    const double  *q = scene->kin->q_WB;
    const double   x = q[0], y = q[1], z = q[2], w = q[3];
    const ivl_d3_t b_z = ivl_d3(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
    return ivl_d3_along(scene->model->surface.normal_W, b_z);
}
