/// @file phys_plates.h
/// Plates that strike the surface: rotors' disc and underside as boxes whose corners press and rub.  [MODEL sec. 5]
#ifndef IVL_PHYS_PLATES_H
#define IVL_PHYS_PLATES_H

#include "phys_legs.h"

/// Height of the highest point of a plate above the body origin.
IVL_SIM_INLINE ivl_wide_t phys_plate_top(const ivl_sim_plate_t *plate, ivl_w3_t up)
{
    return ivl_wide_abs(up.x) * plate->half_m[0] + ivl_wide_abs(up.y) * plate->half_m[1] + ivl_wide_abs(up.z) * plate->half_m[2] +
           up.z * plate->center_z_m;
}

/// Adds the wrench of one corner that presses on the ceiling: Hunt-Crossley normal force, regularised Coulomb friction.
/// [MODEL eq. 5.1, 5.2]
IVL_SIM_INLINE void phys_corner_force(const ivl_sim_params_t *raw, const phys_posture_t *k, ivl_wide_t height, ivl_d3_t x,
                                      ivl_wide_t b[IVL_SIM_TWIST])
{
    const ivl_wide_t zero = ivl_wide(0.0);
    const ivl_wide_t depth = height + ivl_w3_dot_d3(k->up, x) - raw->world_ceiling_height_m;
    const ivl_w3_t   v = ivl_w3_add(k->v, ivl_w3_cross_d3(k->w, x));
    const ivl_wide_t depth_rate = ivl_w3_dot(k->up, v);
    const ivl_wide_t force = raw->plate_stiffness_Npm * depth * (1.0 + raw->plate_damping_spm * depth_rate);
    const ivl_wide_t press = ivl_wide_select((depth > zero) & (force > zero), force, zero);
    const ivl_w3_t   slip = ivl_w3_plus(v, -depth_rate, k->up);
    const double     slow = raw->plate_slip_speed_mps;
    const ivl_wide_t drag = raw->plate_friction_norm * press / ivl_wide_sqrt(ivl_w3_dot(slip, slip) + slow * slow);
    const ivl_w3_t   f = ivl_w3_sub(ivl_w3_scale(-press, k->up), ivl_w3_scale(drag, slip));
    const ivl_w3_t   m = ivl_w3_cross_from_d3(x, f);
    const ivl_wide_t wrench[IVL_SIM_TWIST] = {f.x, f.y, f.z, m.x, m.y, m.z};
    for (int i = 0; i < IVL_SIM_TWIST; i++)
    {
        b[i] += wrench[i];
    }
}

/// Height of the highest point of a plate above the body origin, of one vehicle.
/// @param[in] up  the world's z axis in body axes
double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t up);

/// Elastic energy of the corners of a plate that press on the ceiling, of one vehicle.
/// @param[in] height_m  of the body origin
double ivl_sim_plate_energy(const ivl_sim_model_t *model, const ivl_sim_plate_t *plate, ivl_d3_t up, double height_m);

#endif  // IVL_PHYS_PLATES_H
