/// @file phys_evaluate.h
/// One evaluation: accelerations of a vehicle from its state, in all lanes.  Inlined into the step.   [MODEL sec. 4]
#ifndef IVL_PHYS_EVALUATE_H
#define IVL_PHYS_EVALUATE_H

#include "phys_plates.h"
#include "phys_solve.h"

/// Stabilisation of the length constraints: their error decays at this rate.  It only removes what truncation and rounding
/// leave; the motion does not depend on it.                                                        [MODEL eq. 4.7]
#define IVL_SIM_STABILISATION_PER_S 150.0

/// What acts on the body except the legs: weight, rotors, drag, plates, gyroscopic moment.
IVL_SIM_INLINE void phys_body_wrench(const ivl_sim_model_t *model, const ivl_sim_load_t *load, const phys_posture_t *k,
                                     const ivl_sim_state_t *s, ivl_wide_t b[IVL_SIM_TWIST], ivl_wide_t overlap[IVL_SIM_PLATES])
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            weight = raw->body_mass_kg * raw->world_gravity_mps2;
    const double            ixx = raw->body_inertia_xx_kgm2, iyy = raw->body_inertia_yy_kgm2, izz = raw->body_inertia_zz_kgm2;
    b[0] = -weight * k->up.x - raw->aero_drag_xy_Nspm * k->v.x;
    b[1] = -weight * k->up.y - raw->aero_drag_xy_Nspm * k->v.y;
    b[2] = -weight * k->up.z - raw->aero_drag_z_Nspm * k->v.z + load->thrust_N;
    b[3] = load->torque_B_Nm.x - (izz - iyy) * k->w.y * k->w.z;
    b[4] = load->torque_B_Nm.y - (ixx - izz) * k->w.z * k->w.x;
    b[5] = load->torque_B_Nm.z - (iyy - ixx) * k->w.x * k->w.y;
    phys_plates_wrench(model, k, ivl_sim_surface_heights_of(&model->surface, s->p_WB_m), load->surface_height_m, b, overlap);
}

IVL_SIM_INLINE void phys_subtract_wrench(ivl_wide_t b[IVL_SIM_TWIST], ivl_w3_t force, ivl_w3_t moment)
{
    b[0] -= force.x;
    b[1] -= force.y;
    b[2] -= force.z;
    b[3] -= moment.x;
    b[4] -= moment.y;
    b[5] -= moment.z;
}

IVL_SIM_INLINE void phys_accelerate(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                                    const ivl_sim_state_t *s, ivl_sim_rate_t *rate)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    const double               length = model->raw.leg_length_m, gravity = model->raw.world_gravity_mps2;
    const double               joint = model->raw.leg_foot_damping_Nmsprad / (length * length);
    const double               sigma = IVL_SIM_STABILISATION_PER_S;
    phys_posture_t             k;
    phys_posture(model, s, &k);
    ivl_wide_t b[IVL_SIM_TWIST], r[IVL_SIM_LEGS], u[IVL_SIM_TWIST], axial[IVL_SIM_LEGS], fastest2 = ivl_wide(0.0), longest = ivl_wide(0.0);
    ivl_w3_t   f_foot[IVL_SIM_LEGS], centripetal[IVL_SIM_LEGS], couple[IVL_SIM_LEGS];
    phys_row_t rows[IVL_SIM_LEGS];
    phys_body_wrench(model, load, &k, s, b, rate->overlap_m);
    phys_hip_couples(model, contact, &k, couple, &rate->swing_norm);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t   hip = leg->hip_B_m[i];
        const ivl_wide_t inv_mass = contact->inverse_mass[i], sliding = contact->sliding[i];

        // forces on the rod's ends: hip springs, friction of a stuck foot's joint, weight
        const ivl_wide_t held = ivl_wide_select(inv_mass > 0.0, ivl_wide(0.0), ivl_wide(joint));
        const ivl_w3_t   pair = ivl_w3_plus(couple[i], -held, k.v_rod[i]);
        f_foot[i] = ivl_w3_plus(pair, ivl_wide(-leg->weight_foot_kg * gravity), k.up);

        // what the hip takes from the body if neither the body nor the constraint accelerated it
        centripetal[i] = ivl_w3_cross(k.w, ivl_w3_cross_d3(k.w, hip));
        const ivl_w3_t at_foot = ivl_w3_plus(f_foot[i], ivl_wide(-leg->mass_cross_kg), centripetal[i]);
        const ivl_w3_t yield = ivl_w3_scale(leg->mass_cross_kg * inv_mass, phys_along_surface(sliding, k.normal, at_foot));
        const ivl_w3_t weight = ivl_w3_plus(pair, ivl_wide(leg->weight_hip_kg * gravity), k.up);
        const ivl_w3_t at_hip = ivl_w3_plus(ivl_w3_add(weight, yield), ivl_wide(leg->mass_hip_kg), centripetal[i]);
        phys_subtract_wrench(b, at_hip, ivl_w3_add(ivl_w3_cross_from_d3(hip, at_hip), ivl_w3_cross(k.rod[i], couple[i])));

        // length constraint: n.(a_foot - a_hip) = -|v_rod|^2 / L - stabilisation
        rows[i] = phys_constraint_row(model, contact, &k, i);
        const ivl_wide_t speed2 = ivl_w3_dot(k.v_rod[i], k.v_rod[i]);
        const ivl_wide_t excess = ivl_w3_dot(k.rod[i], k.rod[i]) - length * length;
        fastest2 = ivl_wide_larger(speed2, fastest2);
        longest = ivl_wide_larger(ivl_wide_abs(excess), longest);
        const ivl_wide_t curvature =
            speed2 * (1.0 / length) + 2.0 * sigma * ivl_w3_dot(k.n[i], k.v_rod[i]) + (0.5 * sigma * sigma / length) * excess;
        r[i] = curvature + inv_mass * ivl_w3_dot(k.n[i], phys_along_surface(sliding, k.normal, f_foot[i])) -
               ivl_w3_dot(rows[i].g, centripetal[i]);
    }
    rate->turn2_per_s2 = fastest2 * (1.0 / (length * length));
    rate->stretch_norm = longest * (0.5 / (length * length));
    const ivl_wide_t *inverse6 = contact->inverse_mass6;
    ivl_wide_t        rebuilt[IVL_SIM_PACKED];
    if (contact->any_sliding)
    {
        memcpy(rebuilt, contact->inverse_mass6, sizeof rebuilt);
        ivl_sim_mass_while_sliding(model, contact, &k.normal, rebuilt);
        inverse6 = rebuilt;
    }
    phys_solve_constrained(inverse6, (const phys_row_t *)rows, b, r, u, axial);

    // back to the feet, and to world axes
    const ivl_w3_t a = {u[0], u[1], u[2]}, alpha = {u[3], u[4], u[5]};
    rate->a_WB_mps2 = ivl_wrot_apply(&k.R_WB, a);
    rate->alpha_B_radps2 = alpha;
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t a_hip = ivl_w3_add(ivl_w3_add(a, centripetal[i]), ivl_w3_cross_d3(alpha, leg->hip_B_m[i]));
        const ivl_w3_t net = ivl_w3_plus(ivl_w3_plus(f_foot[i], -axial[i], k.n[i]), ivl_wide(-leg->mass_cross_kg), a_hip);
        const ivl_w3_t a_foot = ivl_w3_scale(contact->inverse_mass[i], phys_along_surface(contact->sliding[i], k.normal, net));
        rate->a_foot_W_mps2[i] = ivl_wrot_apply(&k.R_WB, a_foot);
        rate->pull_N[i] = -ivl_w3_dot(k.normal, net);
    }
}

#endif  // IVL_PHYS_EVALUATE_H
