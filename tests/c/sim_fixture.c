#include "sim_fixture.h"

#include "world_step_size.h"

uint64_t draw_u64(draws_t *draws)
{
    draws->state += 0x9e3779b97f4a7c15u;
    uint64_t z = draws->state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double draw(draws_t *draws, double lo, double hi)
{
    return lo + (hi - lo) * (double)(draw_u64(draws) >> 11) * (1.0 / 9007199254740992.0);
}

ivl_d3_t draw_d3(draws_t *draws, double limit)
{
    const double x = draw(draws, -limit, limit);
    const double y = draw(draws, -limit, limit);
    return ivl_d3(x, y, draw(draws, -limit, limit));
}

void draw_quat(draws_t *draws, double q[4])
{
    double square = 0.0;
    while (!(square > 0.01 && square < 1.0))
    {
        square = 0.0;
        for (int i = 0; i < 4; i++)
        {
            q[i] = draw(draws, -1.0, 1.0);
            square += q[i] * q[i];
        }
    }
    for (int i = 0; i < 4; i++)
    {
        q[i] /= sqrt(square);
    }
}

ivl_sim_params_t fixture_params(void)
{
#define DEFAULT(group, name, suffix, unit, lo, hi, dflt, doc) .group##_##name##_##suffix = (dflt),
    ivl_sim_params_t p = {IVL_SIM_PARAMS(DEFAULT)};
#undef DEFAULT
    p.body_mass_kg = 0.03584;
    p.body_inertia_xx_kgm2 = 4.935e-5;
    p.body_inertia_yy_kgm2 = 4.935e-5;
    p.body_inertia_zz_kgm2 = 2.926e-5;
    p.rotor_x_m = 0.033;
    p.rotor_y_m = 0.033;
    p.rotor_z_m = 0.014;
    p.rotor_thrust_max_N = 0.1615;
    p.rotor_thrust_constant_Ns2 = 2.21e-8;
    p.rotor_torque_constant_m = 0.00612;
    p.rotor_tau_up_s = 0.01;
    p.rotor_tau_down_s = 1.0e-4;
    p.prop_plate_size_x_m = 0.11;
    p.prop_plate_size_y_m = 0.11;
    p.prop_plate_size_z_m = 0.005;
    p.prop_plate_center_z_m = 0.011;
    p.base_plate_size_x_m = 0.075;
    p.base_plate_size_y_m = 0.075;
    p.base_plate_size_z_m = 0.005;
    p.base_plate_center_z_m = -0.005;
    p.leg_length_m = 0.05;
    p.leg_angle_deg = 50.0;
    p.leg_mass_kg = 4.4e-4;
    p.leg_stiffness_Nmprad = 0.08;
    p.leg_damping_Nmsprad = 6.788e-5;
    p.leg_hip_xy_m = 0.017;
    p.leg_hip_z_m = -0.005;
    p.leg_foot_radius_m = 0.002;
    p.leg_foot_mass_kg = 1.0e-5;
    return p;
}

ivl_sim_model_t fixture_model(const ivl_sim_params_t *params)
{
    ivl_sim_model_t model;
    ivl_cfg_t       cfg;
    char            error[256] = "";
    ivl_cfg_defaults(&cfg);
    TEST_ASSERT_TRUE_MESSAGE(ivl_sim_model_init(&model, params, &cfg, error, sizeof error), error);
    return model;
}

/// Unit vector between a and b: a bent towards b.
static ivl_d3_t bent(ivl_d3_t a, ivl_d3_t b, double by)
{
    const ivl_d3_t c = ivl_d3_add(a, ivl_d3_scale(by, b));
    return ivl_d3_scale(1.0 / sqrt(ivl_d3_dot(c, c)), c);
}

ivl_sim_kin_t draw_kin(const ivl_sim_model_t *model, draws_t *draws, double bend)
{
    ivl_sim_kin_t kin = {.p_WB_m = {draw(draws, -1.0, 1.0), draw(draws, -1.0, 1.0), draw(draws, 1.0, 2.0)}};
    draw_quat(draws, kin.q_WB);
    ivl_d3_store(kin.v_WB_mps, draw_d3(draws, 3.0));
    ivl_d3_store(kin.w_B_radps, draw_d3(draws, 20.0));
    const ivl_rot_t R = ivl_rot_from_quat(kin.q_WB);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = model->leg.hip_B_m[i];
        const ivl_d3_t n = bent(model->leg.rest_B[i], draw_d3(draws, 1.0), bend);
        const ivl_d3_t rod = ivl_d3_scale(model->raw.leg_length_m, n);
        // the rod turns with the body, and by itself
        const ivl_d3_t w = ivl_d3_add(ivl_d3_load(kin.w_B_radps), draw_d3(draws, 30.0));
        const ivl_d3_t v_foot = ivl_d3_add(ivl_d3_cross(ivl_d3_load(kin.w_B_radps), hip), ivl_d3_cross(w, rod));
        ivl_d3_store(kin.p_foot_W_m[i], ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_rot_apply(&R, ivl_d3_add(hip, rod))));
        ivl_d3_store(kin.v_foot_W_mps[i], ivl_d3_add(ivl_d3_load(kin.v_WB_mps), ivl_rot_apply(&R, v_foot)));
    }
    return kin;
}

void turn_kin(const ivl_sim_model_t *model, const double q[4], ivl_sim_kin_t *kin)
{
    memcpy(kin->q_WB, q, sizeof kin->q_WB);
    const ivl_rot_t R = ivl_rot_from_quat(q);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t foot = ivl_d3_add(model->leg.hip_B_m[i], ivl_d3_scale(model->raw.leg_length_m, model->leg.rest_B[i]));
        ivl_d3_store(kin->p_foot_W_m[i], ivl_d3_add(ivl_d3_load(kin->p_WB_m), ivl_rot_apply(&R, foot)));
    }
}

ivl_sim_kin_t resting_kin(const ivl_sim_model_t *model, double x, double y, double z)
{
    const double  level[4] = {0.0, 0.0, 0.0, 1.0};
    ivl_sim_kin_t kin = {.p_WB_m = {x, y, z}};
    turn_kin(model, level, &kin);
    return kin;
}

void nose_up(double angle, double q[4])
{
    q[0] = 0.0;
    q[1] = -sin(0.5 * angle);
    q[2] = 0.0;
    q[3] = cos(0.5 * angle);
}

void stop_rotors(ivl_sim_group_t *group, int lane)
{
    const double still[IVL_SIM_MOTORS] = {0.0, 0.0, 0.0, 0.0};
    ivl_sim_rotor_set(&group->rotor, lane, still);
}

void command_rotors(ivl_sim_group_t *group, const float thrust_N[IVL_SIM_MOTORS])
{
    ivl_mask_t which = {0};
    ivl_wide_t thrust[IVL_SIM_MOTORS] = {{0.0}};
    which[0] = -1;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        thrust[i][0] = (double)thrust_N[i];
    }
    ivl_sim_rotor_command(group->model, &group->rotor, &which, thrust);
}

void place_alone(const ivl_sim_model_t *model, ivl_sim_group_t *group, const ivl_sim_kin_t *kin, const ivl_sim_foot_t held[IVL_SIM_LEGS])
{
    const ivl_sim_rng_t rng = {1, 2};
    ivl_sim_group_init(model, group);
    ivl_sim_world_start(group, 0, &rng, kin->p_WB_m, kin->v_WB_mps);
    ivl_sim_world_t *world = &group->world[0];
    memcpy(world->foot, held, sizeof world->foot);
    ivl_sim_contact_set(model, &group->contact, 0, held);
    ivl_sim_world_place(group, 0, kin);
    stop_rotors(group, 0);
}

static bool all_ready(const ivl_sim_group_t *group)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (group->active[lane] && !ivl_sim_world_ready(group, lane))
        {
            return false;
        }
    }
    return true;
}

void advance(ivl_sim_group_t *group, double dt_s)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        if (group->active[lane])
        {
            group->progress.left_s[lane] = dt_s;
            group->progress.evaluations_left[lane] = ivl_sim_step_evaluations(&group->model->step, dt_s);
        }
    }
    while (!all_ready(group))
    {
        ivl_sim_group_step(group);
    }
}

ivl_sim_rate_t evaluate(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_sim_foot_t foot[IVL_SIM_LEGS], double thrust_N,
                        ivl_d3_t torque_B_Nm)
{
    ivl_sim_state_t   state, next;
    ivl_sim_contact_t contact;
    ivl_sim_rate_t    last, rate;
    ivl_wide_t        dt = ivl_wide(0.0);
    memset(&last, 0, sizeof last);
    memset(&contact, 0, sizeof contact);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_lane_set(&state, lane, kin);
        ivl_sim_contact_set(model, &contact, lane, foot);
    }
    const ivl_sim_load_t load = {.thrust_N = ivl_wide(thrust_N),
                                 .torque_B_Nm = ivl_w3_of(torque_B_Nm),
                                 .surface_height_m = ivl_wide(ivl_sim_surface_height(&model->surface, 0.0))};
    ivl_sim_leapfrog(model, &contact, &load, &dt, &state, &last, &next, &rate);
    return rate;
}

double rod_error(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    double          worst = 0.0;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = ivl_d3_add(ivl_d3_load(kin->p_WB_m), ivl_rot_apply(&R, model->leg.hip_B_m[i]));
        const ivl_d3_t rod = ivl_d3_sub(ivl_d3_load(kin->p_foot_W_m[i]), hip);
        const double   error = fabs(sqrt(ivl_d3_dot(rod, rod)) - model->raw.leg_length_m);
        worst = (error > worst) ? error : worst;
    }
    return worst;
}

double energy_at_rest(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    return ivl_sim_energy(model, kin, ivl_sim_surface_height(&model->surface, 0.0));
}

double total_energy(const ivl_sim_group_t *group)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(group, 0);
    return ivl_sim_energy(group->model, &kin, ivl_sim_world_surface_m(group, 0));
}
