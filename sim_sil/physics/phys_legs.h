/// @file phys_legs.h
/// Legs: rods with springs and dampers at the hips, and the length constraint of each.  Parts of one evaluation, all inlined.
/// [MODEL sec. 3, 4]
#ifndef IVL_PHYS_LEGS_H
#define IVL_PHYS_LEGS_H

#include "phys_mass.h"
#include "phys_state.h"

/// Near +-90 degrees sideways the first hinge's axis falls into the rod (gimbal lock of the universal joint): its lever arm
/// cos(beta) is kept above this value.
#define IVL_SIM_COS_SIDEWAYS_MIN 0.05

/// Compliance of a rod, m/(N s^2) in the units of the constraint's matrix.  Four parallel legs hold the body redundantly;
/// this makes their forces unique.  With the rate of stabilisation it equals an axial stiffness of 2e7 N/m.
#define IVL_SIM_ROD_COMPLIANCE_PER_KG 1.0e-3

_Static_assert(2 * IVL_SIM_LEGS <= IVL_SIM_ANGLES_MAX, "two hinges a leg");

/// Positions and velocities in body axes.
typedef struct
{
    ivl_wrot_t R_WB;
    ivl_w3_t   up;                   ///< against gravity
    ivl_w3_t   normal;               ///< of the surface
    ivl_w3_t   v, w;                 ///< of the body
    ivl_w3_t   rod[IVL_SIM_LEGS];    ///< hip to foot
    ivl_w3_t   n[IVL_SIM_LEGS];      ///< rod / length
    ivl_w3_t   v_rod[IVL_SIM_LEGS];  ///< velocity of the foot minus that of the hip
} phys_posture_t;

IVL_SIM_INLINE void phys_posture(const ivl_sim_model_t *model, const ivl_sim_state_t *s, phys_posture_t *k)
{
    const ivl_wide_t inv_length = ivl_wide(1.0 / model->raw.leg_length_m);
    k->R_WB = ivl_wrot_from_quat(s->q_WB);
    k->up = ivl_wrot_direction(&k->R_WB, model->up_W);
    k->normal = ivl_wrot_direction(&k->R_WB, model->surface.normal_W);
    k->w = s->w_B_radps;
    k->v = ivl_wrot_apply_inverse(&k->R_WB, s->v_WB_mps);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = model->leg.hip_B_m[i];
        const ivl_w3_t foot = ivl_wrot_apply_inverse(&k->R_WB, ivl_w3_sub(s->p_foot_W_m[i], s->p_WB_m));
        const ivl_w3_t v_foot = ivl_wrot_apply_inverse(&k->R_WB, s->v_foot_W_mps[i]);
        k->rod[i] = (ivl_w3_t){foot.x - hip.x, foot.y - hip.y, foot.z - hip.z};
        k->n[i] = ivl_w3_scale(inv_length, k->rod[i]);
        k->v_rod[i] = ivl_w3_sub(v_foot, ivl_w3_add(k->v, ivl_w3_cross_d3(k->w, hip)));
    }
}

/// A hip's two hinges: angles still to be unfolded, and the directions in which they move the rod.       [MODEL eq. 3.2]
typedef struct
{
    ivl_w3_t   e_alpha, e_beta;
    ivl_wide_t inv_cos_beta;
} phys_hinge_t;

/// @param[out] angle, t  of the deflections in the leg's plane and sideways, for ivl_wide_unfold
IVL_SIM_INLINE phys_hinge_t phys_hinge(const ivl_sim_leg_model_t *leg, int i, ivl_w3_t n, ivl_angle_t angle[2], ivl_wide_t t_angle[2])
{
    const ivl_d3_t   e1 = leg->rest_B[i], e2 = leg->inplane_B[i], e3 = leg->sideways_B[i];
    const ivl_wide_t c = ivl_w3_dot_d3(n, e1), s = ivl_w3_dot_d3(n, e2), t = ivl_w3_dot_d3(n, e3);
    const ivl_wide_t root = ivl_wide_sqrt(c * c + s * s);
    const ivl_wide_t least = ivl_wide(IVL_SIM_COS_SIDEWAYS_MIN);
    const ivl_wide_t lever = ivl_wide_select(root > least, root, least);
    // three quotients from one division: divisions are what an evaluation spends most of its time on
    const ivl_angle_t a = ivl_wide_fold(s, c), b = ivl_wide_fold(t, root);
    const ivl_wide_t  both = a.den * b.den;
    const ivl_wide_t  reciprocal = 1.0 / (both * lever);
    const ivl_wide_t  inv = both * reciprocal;
    const ivl_wide_t  ca = c * inv, sa = s * inv;
    phys_hinge_t      h;
    angle[0] = a;
    angle[1] = b;
    t_angle[0] = a.num * b.den * lever * reciprocal;
    t_angle[1] = b.num * a.den * lever * reciprocal;
    h.inv_cos_beta = inv;
    h.e_alpha = (ivl_w3_t){ca * e2.x - sa * e1.x, ca * e2.y - sa * e1.y, ca * e2.z - sa * e1.z};
    h.e_beta = (ivl_w3_t){root * e3.x - t * (ca * e1.x + sa * e2.x), root * e3.y - t * (ca * e1.y + sa * e2.y),
                          root * e3.z - t * (ca * e1.z + sa * e2.z)};
    return h;
}

/// How much faster than at rest the fastest leg swings.  One that is bent sideways has less inertia about its first hinge; one
/// whose foot is stuck has the body's.                                                             [MODEL eq. 7.8]
IVL_SIM_INLINE ivl_wide_t phys_fastest_swing(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact,
                                             const phys_hinge_t h[IVL_SIM_LEGS])
{
    ivl_wide_t fastest = ivl_wide(0.0);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_wide_t share = ivl_wide_select(contact->inverse_mass[i] > 0.0, ivl_wide(1.0), ivl_wide(model->step.stuck_norm));
        const ivl_wide_t swing = share * h[i].inv_cos_beta * h[i].inv_cos_beta;
        fastest = ivl_wide_larger(swing, fastest);
    }
    return fastest;
}

/// Forces of the hips' springs and dampers on the feet; a rod's hip end gets the opposite, the body the opposite couple.
/// [MODEL eq. 3.4]
IVL_SIM_INLINE void phys_hip_couples(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const phys_posture_t *k,
                                     ivl_w3_t couple[IVL_SIM_LEGS], ivl_wide_t *swing)
{
    const double stiffness = model->raw.leg_stiffness_Nmprad, damping = model->raw.leg_damping_Nmsprad;
    const double inv_length = 1.0 / model->raw.leg_length_m;
    phys_hinge_t h[IVL_SIM_LEGS];
    ivl_angle_t  folded[2 * IVL_SIM_LEGS];
    ivl_wide_t   t[2 * IVL_SIM_LEGS], deflection[2 * IVL_SIM_LEGS];
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        h[i] = phys_hinge(&model->leg, i, k->n[i], &folded[2 * i], &t[2 * i]);
    }
    ivl_wide_unfold(folded, t, deflection, 2 * IVL_SIM_LEGS);
    *swing = phys_fastest_swing(model, contact, h);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t   turning = ivl_w3_sub(k->v_rod[i], ivl_w3_cross(k->w, k->rod[i]));
        const ivl_wide_t alpha_rate = inv_length * ivl_w3_dot(turning, h[i].e_alpha) * h[i].inv_cos_beta;
        const ivl_wide_t beta_rate = inv_length * ivl_w3_dot(turning, h[i].e_beta);
        const ivl_wide_t torque_alpha = -(stiffness * deflection[2 * i] + damping * alpha_rate) * inv_length;
        const ivl_wide_t torque_beta = -(stiffness * deflection[2 * i + 1] + damping * beta_rate) * inv_length;
        couple[i] = ivl_w3_plus(ivl_w3_scale(torque_alpha * h[i].inv_cos_beta, h[i].e_alpha), torque_beta, h[i].e_beta);
    }
}

/// Without the part along the surface's normal, for a foot that slides.
IVL_SIM_INLINE ivl_w3_t phys_along_surface(ivl_wide_t sliding, ivl_w3_t normal, ivl_w3_t a)
{
    return ivl_w3_plus(a, -sliding * ivl_w3_dot(normal, a), normal);
}

/// A leg's row of the constraint: multiplier direction g at the hip, its moment, its own compliance.  [MODEL eq. 4.9]
typedef struct
{
    ivl_w3_t   g, hip_x_g;
    ivl_wide_t compliance;
} phys_row_t;

IVL_SIM_INLINE phys_row_t phys_constraint_row(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const phys_posture_t *k,
                                              int i)
{
    const ivl_w3_t pn = phys_along_surface(contact->sliding[i], k->normal, k->n[i]);
    phys_row_t     r;
    r.g = ivl_w3_plus(k->n[i], model->leg.mass_cross_kg * contact->inverse_mass[i], pn);
    r.hip_x_g = ivl_w3_cross_from_d3(model->leg.hip_B_m[i], r.g);
    r.compliance = contact->inverse_mass[i] * ivl_w3_dot(k->n[i], pn) + IVL_SIM_ROD_COMPLIANCE_PER_KG;
    return r;
}

#endif  // IVL_PHYS_LEGS_H
