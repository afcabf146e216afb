#include "phys_energy.h"

#include "phys_plates.h"

double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double surface_height_m)
{
    const ivl_sim_params_t    *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    ivl_sim_state_t            s;
    phys_posture_t             k;
    ivl_sim_lane_spread(&s, kin);
    phys_posture(model, &s, &k);
    const ivl_d3_t v = ivl_w3_lane(&k.v, 0), w = ivl_w3_lane(&k.w, 0), up = ivl_w3_lane(&k.up, 0), normal = ivl_w3_lane(&k.normal, 0);
    const double   level_m = ivl_d3_dot(model->up_W, ivl_d3_load(kin->p_WB_m));
    const double   height_m = ivl_sim_surface_height_of(&model->surface, ivl_d3_load(kin->p_WB_m));
    double         energy =
        0.5 * raw->body_mass_kg * ivl_d3_dot(v, v) +
        0.5 * (raw->body_inertia_xx_kgm2 * w.x * w.x + raw->body_inertia_yy_kgm2 * w.y * w.y + raw->body_inertia_zz_kgm2 * w.z * w.z) +
        raw->body_mass_kg * raw->world_gravity_mps2 * level_m;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        ivl_angle_t folded[2];
        ivl_wide_t  t[2], deflection[2];
        (void)phys_hinge(leg, i, k.n[i], folded, t);
        ivl_wide_unfold(folded, t, deflection, 2);
        const ivl_d3_t v_hip = ivl_d3_add(v, ivl_d3_cross(w, leg->hip_B_m[i]));
        const ivl_d3_t v_foot = ivl_d3_add(v_hip, ivl_w3_lane(&k.v_rod[i], 0));
        const double   hip_level = level_m + ivl_d3_dot(leg->hip_B_m[i], up);
        const double   foot_level = ivl_d3_dot(model->up_W, ivl_d3_load(kin->p_foot_W_m[i]));
        energy += 0.5 * leg->mass_hip_kg * ivl_d3_dot(v_hip, v_hip) + leg->mass_cross_kg * ivl_d3_dot(v_hip, v_foot) +
                  0.5 * leg->mass_foot_kg * ivl_d3_dot(v_foot, v_foot) +
                  0.5 * raw->leg_stiffness_Nmprad * (deflection[0][0] * deflection[0][0] + deflection[1][0] * deflection[1][0]) +
                  raw->world_gravity_mps2 * (leg->weight_hip_kg * hip_level + leg->weight_foot_kg * foot_level);
    }
    return energy + ivl_sim_plate_energy(model, &model->plate[IVL_SIM_PROP_PLATE], normal, height_m, surface_height_m) +
           ivl_sim_plate_energy(model, &model->plate[IVL_SIM_BASE_PLATE], normal, height_m, surface_height_m);
}

void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double linear[3], double angular[3])
{
    const ivl_sim_params_t    *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    const ivl_rot_t            R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t             p = ivl_d3_load(kin->p_WB_m), v = ivl_d3_load(kin->v_WB_mps), w = ivl_d3_load(kin->w_B_radps);
    const ivl_d3_t spin = ivl_d3(raw->body_inertia_xx_kgm2 * w.x, raw->body_inertia_yy_kgm2 * w.y, raw->body_inertia_zz_kgm2 * w.z);
    ivl_d3_t       l = ivl_d3_scale(raw->body_mass_kg, v);
    ivl_d3_t       a = ivl_d3_add(ivl_rot_apply(&R, spin), ivl_d3_cross(p, l));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = leg->hip_B_m[i];
        const ivl_d3_t v_hip = ivl_d3_add(v, ivl_rot_apply(&R, ivl_d3_cross(w, hip)));
        const ivl_d3_t p_hip = ivl_d3_add(p, ivl_rot_apply(&R, hip));
        const ivl_d3_t v_foot = ivl_d3_load(kin->v_foot_W_mps[i]), p_foot = ivl_d3_load(kin->p_foot_W_m[i]);
        const ivl_d3_t l_hip = ivl_d3_add(ivl_d3_scale(leg->mass_hip_kg, v_hip), ivl_d3_scale(leg->mass_cross_kg, v_foot));
        const ivl_d3_t l_foot = ivl_d3_add(ivl_d3_scale(leg->mass_cross_kg, v_hip), ivl_d3_scale(leg->mass_foot_kg, v_foot));
        l = ivl_d3_add(l, ivl_d3_add(l_hip, l_foot));
        a = ivl_d3_add(a, ivl_d3_add(ivl_d3_cross(p_hip, l_hip), ivl_d3_cross(p_foot, l_foot)));
    }
    ivl_d3_store(linear, l);
    ivl_d3_store(angular, a);
}
