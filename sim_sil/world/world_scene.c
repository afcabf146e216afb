#include "world_scene.h"

/// Nearer than this a sensor sees nothing but the ceiling's paint, and 1/d need not be finite.
static const double D_MIN_M = 1.0e-3;

double ivl_sim_scene_distance_m(const ivl_sim_scene_t *scene, double age_s)
{
    const ivl_sim_params_t *raw = &scene->model->raw;
    const double            plane = raw->world_ceiling_height_m + raw->world_sensed_gap_offset_m;
    const double            z = scene->kin->p_WB_m[2] - age_s * (scene->kin->v_WB_mps[2] - 0.5 * age_s * scene->a_W_mps2[2]);
    return (plane - z > D_MIN_M) ? plane - z : D_MIN_M;
}

double ivl_sim_scene_closing_mps(const ivl_sim_scene_t *scene, double age_s)
{
    return scene->kin->v_WB_mps[2] - age_s * scene->a_W_mps2[2];
}

double ivl_sim_scene_forward_mps(const ivl_sim_scene_t *scene, double age_s)
{
    return scene->kin->v_WB_mps[0] - age_s * scene->a_W_mps2[0];
}

double ivl_sim_scene_facing(const ivl_sim_scene_t *scene)
{
    const double *q = scene->kin->q_WB;
    return 1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]);
}
