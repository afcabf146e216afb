/// @file world_scene.h
/// What a sensor looks at: the vehicle and the surface at the present instant, and the truth a little while ago.
#ifndef IVL_WORLD_SCENE_H
#define IVL_WORLD_SCENE_H

#include "phys_state.h"

typedef struct
{
    const ivl_sim_model_t *model;
    const ivl_sim_kin_t   *kin;
    double                 surface_height_m;  ///< along the surface's normal
    double                 a_W_mps2[3];       ///< of the body origin: the past is exact for constant acceleration
} ivl_sim_scene_t;

/// Distance of the body origin from the plane of the cues; never less than a millimetre.
double ivl_sim_scene_distance_m(const ivl_sim_scene_t *scene, double age_s);

/// Speed at which that distance shrinks.
double ivl_sim_scene_closing_mps(const ivl_sim_scene_t *scene, double age_s);

/// Speed forward along the surface, as seen from there.
double ivl_sim_scene_forward_mps(const ivl_sim_scene_t *scene, double age_s);

/// Cosine of the angle between body z and the surface's normal, at present.
double ivl_sim_scene_facing(const ivl_sim_scene_t *scene);

#endif  // IVL_WORLD_SCENE_H
