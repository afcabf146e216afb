#include "phys_impulse.h"

#include "phys_evaluate.h"

/// A held foot moves with the surface exactly, not up to rounding.
static void settle(const ivl_sim_surface_t *surface, ivl_sim_foot_t foot, double v_W_mps[3])
{
    if (foot == IVL_SIM_FOOT_STUCK)
    {
        ivl_d3_store(v_W_mps, surface->velocity_W_mps);
    }
    else if (foot == IVL_SIM_FOOT_SLIDING)
    {
        const ivl_d3_t v = ivl_d3_load(v_W_mps);
        ivl_d3_store(v_W_mps, ivl_d3_sub(v, ivl_d3_scale(ivl_sim_surface_closing(surface, v), surface->normal_W)));
    }
}

void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_foot_t foot[IVL_SIM_LEGS], ivl_sim_kin_t *kin)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    ivl_sim_contact_t          contact;
    ivl_sim_state_t            s;
    phys_posture_t             k;
    ivl_wide_t                 b[IVL_SIM_TWIST] = {{0.0}}, r[IVL_SIM_LEGS], u[IVL_SIM_TWIST], axial[IVL_SIM_LEGS];
    ivl_w3_t                   jump[IVL_SIM_LEGS], v_foot[IVL_SIM_LEGS];
    phys_row_t                 rows[IVL_SIM_LEGS];
    ivl_sim_contact_spread(model, &contact, foot);
    ivl_sim_lane_spread(&s, kin);
    phys_posture(model, &s, &k);
    const ivl_w3_t v_surface = ivl_wrot_apply_inverse_d3(&k.R_WB, model->surface.velocity_W_mps);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // the jump of a held foot is known: all of its velocity over the surface, or the part along the normal if it slides
        const double stuck = (foot[i] == IVL_SIM_FOOT_STUCK) ? 1.0 : 0.0;
        v_foot[i] = ivl_wrot_apply_inverse(&k.R_WB, s.v_foot_W_mps[i]);
        const ivl_w3_t over = ivl_w3_sub(v_foot[i], v_surface);
        jump[i] = ivl_w3_plus(ivl_w3_scale(ivl_wide(-stuck), over), -contact.sliding[i] * ivl_w3_dot(k.normal, over), k.normal);
        const ivl_w3_t at_hip = ivl_w3_scale(ivl_wide(leg->mass_cross_kg), jump[i]);
        phys_subtract_wrench(b, at_hip, ivl_w3_cross_from_d3(leg->hip_B_m[i], at_hip));
        rows[i] = phys_constraint_row(model, &contact, &k, i);
        r[i] = ivl_w3_dot(k.n[i], ivl_w3_add(k.v_rod[i], jump[i]));
    }
    ivl_sim_mass_while_sliding(model, &contact, &k.normal, contact.inverse_mass6);
    phys_solve_constrained(contact.inverse_mass6, (const phys_row_t *)rows, b, r, u, axial);
    const ivl_w3_t dv = {u[0], u[1], u[2]}, dw = {u[3], u[4], u[5]};
    s.v_WB_mps = ivl_w3_add(s.v_WB_mps, ivl_wrot_apply(&k.R_WB, dv));
    s.w_B_radps = ivl_w3_add(s.w_B_radps, dw);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t dv_hip = ivl_w3_add(dv, ivl_w3_cross_d3(dw, leg->hip_B_m[i]));
        const ivl_w3_t push = ivl_w3_plus(ivl_w3_scale(axial[i], k.n[i]), ivl_wide(leg->mass_cross_kg), dv_hip);
        const ivl_w3_t yield = ivl_w3_scale(-contact.inverse_mass[i], phys_along_surface(contact.sliding[i], k.normal, push));
        s.v_foot_W_mps[i] = ivl_wrot_apply(&k.R_WB, ivl_w3_add(v_foot[i], ivl_w3_add(jump[i], yield)));
    }
    ivl_sim_lane_get(&s, 0, kin);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        settle(&model->surface, foot[i], kin->v_foot_W_mps[i]);
    }
}
