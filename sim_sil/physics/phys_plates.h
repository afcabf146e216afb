/// @file phys_plates.h
/// Plates that strike the surface: rotors' disc and underside as boxes whose corners press and rub.  [MODEL sec. 5]
#ifndef IVL_PHYS_PLATES_H
#define IVL_PHYS_PLATES_H

#include "phys_legs.h"

/// Height of the highest point of a plate above the body origin; heights are along the surface's normal.
IVL_SIM_INLINE ivl_wide_t phys_plate_top(const ivl_sim_plate_t *plate, ivl_w3_t normal)
{
    return ivl_wide_abs(normal.x) * plate->half_m[0] + ivl_wide_abs(normal.y) * plate->half_m[1] +
           ivl_wide_abs(normal.z) * plate->half_m[2] + normal.z * plate->center_z_m;
}

/// Adds the wrench of one corner that presses on the surface: Hunt-Crossley normal force, regularised Coulomb friction.
/// [MODEL eq. 5.1, 5.2]
/// @param[in] above      height of the body origin
/// @param[in] surface    that of the surface
/// @param[in] v_surface  velocity of the surface, body axes
IVL_SIM_INLINE void phys_corner_force(const ivl_sim_params_t *raw, const phys_posture_t *k, ivl_wide_t above, ivl_wide_t surface,
                                      ivl_w3_t v_surface, ivl_d3_t x, ivl_wide_t b[IVL_SIM_TWIST])
{
    const ivl_wide_t zero = ivl_wide(0.0);
    const ivl_wide_t depth = above + ivl_w3_dot_d3(k->normal, x) - surface;
    const ivl_w3_t   v = ivl_w3_sub(ivl_w3_add(k->v, ivl_w3_cross_d3(k->w, x)), v_surface);
    const ivl_wide_t depth_rate = ivl_w3_dot(k->normal, v);
    const ivl_wide_t force = raw->plate_stiffness_Npm * depth * (1.0 + raw->plate_damping_spm * depth_rate);
    const ivl_wide_t press = ivl_wide_select((depth > zero) & (force > zero), force, zero);
    const ivl_w3_t   slip = ivl_w3_plus(v, -depth_rate, k->normal);
    const double     slow = raw->plate_slip_speed_mps;
    const ivl_wide_t drag = raw->plate_friction_norm * press / ivl_wide_sqrt(ivl_w3_dot(slip, slip) + slow * slow);
    const ivl_w3_t   f = ivl_w3_sub(ivl_w3_scale(-press, k->normal), ivl_w3_scale(drag, slip));
    const ivl_w3_t   m = ivl_w3_cross_from_d3(x, f);
    const ivl_wide_t wrench[IVL_SIM_TWIST] = {f.x, f.y, f.z, m.x, m.y, m.z};
    for (int i = 0; i < IVL_SIM_TWIST; i++)
    {
        b[i] += wrench[i];
    }
}

/// Adds what the surface does to the plates.
/// @param[out] overlap  highest point of each plate above the surface
IVL_SIM_INLINE void phys_plates_wrench(const ivl_sim_model_t *model, const phys_posture_t *k, ivl_wide_t above, ivl_wide_t surface,
                                       ivl_wide_t b[IVL_SIM_TWIST], ivl_wide_t overlap[IVL_SIM_PLATES])
{
    for (int p = 0; p < IVL_SIM_PLATES; p++)
    {
        overlap[p] = above + phys_plate_top(&model->plate[p], k->normal) - surface;
        if (ivl_mask_any(overlap[p] > 0.0))
        {
            const ivl_w3_t v_surface = ivl_wrot_apply_inverse_d3(&k->R_WB, model->surface.velocity_W_mps);
            for (int i = 0; i < IVL_SIM_CORNERS; i++)
            {
                phys_corner_force(&model->raw, k, above, surface, v_surface, model->plate[p].corner_B_m[i], b);
            }
        }
    }
}

/// Height of the highest point of a plate above the body origin, of one vehicle.
/// @param[in] normal_B  the surface's normal in body axes
double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t normal_B);

/// Elastic energy of the corners of a plate that press on the surface, of one vehicle.
/// @param[in] height_m  of the body origin
double ivl_sim_plate_energy(const ivl_sim_model_t *model, const ivl_sim_plate_t *plate, ivl_d3_t normal_B, double height_m,
                            double surface_height_m);

#endif  // IVL_PHYS_PLATES_H
