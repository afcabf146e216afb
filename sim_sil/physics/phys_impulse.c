#include "phys_impulse.h"

#include "phys_evaluate.h"

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
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // the jump of a held foot is known: all of its velocity, or the part along the normal if it slides
        const double stuck = (foot[i] == IVL_SIM_FOOT_STUCK) ? 1.0 : 0.0;
        v_foot[i] = ivl_wrot_apply_inverse(&k.R_WB, s.v_foot_W_mps[i]);
        jump[i] = ivl_w3_plus(ivl_w3_scale(ivl_wide(-stuck), v_foot[i]), -contact.sliding[i] * ivl_w3_dot(k.up, v_foot[i]), k.up);
        const ivl_w3_t at_hip = ivl_w3_scale(ivl_wide(leg->mass_cross_kg), jump[i]);
        phys_subtract_wrench(b, at_hip, ivl_w3_cross_from_d3(leg->hip_B_m[i], at_hip));
        rows[i] = phys_constraint_row(model, &contact, &k, i);
        r[i] = ivl_w3_dot(k.n[i], ivl_w3_add(k.v_rod[i], jump[i]));
    }
    ivl_sim_mass_while_sliding(model, &contact, &k.up, contact.inverse_mass6);
    phys_solve_constrained(contact.inverse_mass6, (const phys_row_t *)rows, b, r, u, axial);
    const ivl_w3_t dv = {u[0], u[1], u[2]}, dw = {u[3], u[4], u[5]};
    s.v_WB_mps = ivl_w3_add(s.v_WB_mps, ivl_wrot_apply(&k.R_WB, dv));
    s.w_B_radps = ivl_w3_add(s.w_B_radps, dw);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t dv_hip = ivl_w3_add(dv, ivl_w3_cross_d3(dw, leg->hip_B_m[i]));
        const ivl_w3_t push = ivl_w3_plus(ivl_w3_scale(axial[i], k.n[i]), ivl_wide(leg->mass_cross_kg), dv_hip);
        const ivl_w3_t yield = ivl_w3_scale(-contact.inverse_mass[i], phys_along_surface(contact.sliding[i], k.up, push));
        s.v_foot_W_mps[i] = ivl_wrot_apply(&k.R_WB, ivl_w3_add(v_foot[i], ivl_w3_add(jump[i], yield)));
    }
    ivl_sim_lane_get(&s, 0, kin);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // exactly at rest, not up to rounding
        kin->v_foot_W_mps[i][0] = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : kin->v_foot_W_mps[i][0];
        kin->v_foot_W_mps[i][1] = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : kin->v_foot_W_mps[i][1];
        kin->v_foot_W_mps[i][2] = (foot[i] != IVL_SIM_FOOT_FREE) ? 0.0 : kin->v_foot_W_mps[i][2];
    }
}
