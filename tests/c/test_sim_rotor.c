/// @file test_sim_rotor.c
/// Rotor lag, decay, mean thrust, saturation, battery, scatter, ceiling effect and inflow against closed forms.
#include "phys_rotor.h"

#include "sim_fixture.h"

/// The air at one vehicle, and what its rotors make of it.
typedef struct
{
    double gap_m, v_W_mps[3], q_WB[4];
} flow_t;

typedef struct
{
    double thrust_N, torque_B_Nm[3];
} thrust_t;

/// A step of the same vehicle in all lanes, which must do the same.
static thrust_t step_in(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, const flow_t *flow, double dt_s)
{
    const ivl_w3_t          v = ivl_w3_of(ivl_d3_load(flow->v_W_mps));
    const ivl_wide_t        q[4] = {ivl_wide(flow->q_WB[0]), ivl_wide(flow->q_WB[1]), ivl_wide(flow->q_WB[2]), ivl_wide(flow->q_WB[3])};
    const ivl_wide_t        dt = ivl_wide(dt_s);
    const ivl_sim_airflow_t air = {ivl_wide(flow->gap_m), &v, q};
    ivl_sim_load_t          load;
    thrust_t                thrust;
    ivl_sim_rotor_step(model, rotors, &air, &dt, rotors, &load);
    thrust.thrust_N = load.thrust_N[0];
    ivl_d3_store(thrust.torque_B_Nm, ivl_w3_lane(&load.torque_B_Nm, 0));
    for (int lane = 1; lane < IVL_SIM_LANES; lane++)
    {
        TEST_ASSERT_EQUAL_DOUBLE(load.thrust_N[0], load.thrust_N[lane]);
        TEST_ASSERT_EQUAL_DOUBLE(load.torque_B_Nm.z[0], load.torque_B_Nm.z[lane]);
    }
    return thrust;
}

/// Level and at rest, at a height.
static thrust_t step(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, double height_m, double dt_s)
{
    const flow_t flow = {.gap_m = 3.0 - height_m, .q_WB = {0.0, 0.0, 0.0, 1.0}};
    return step_in(model, rotors, &flow, dt_s);
}

static void command_all(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, const float thrust_N[4])
{
    const ivl_mask_t all = ivl_mask(true);
    const ivl_wide_t thrust[4] = {ivl_wide((double)thrust_N[0]), ivl_wide((double)thrust_N[1]), ivl_wide((double)thrust_N[2]),
                                  ivl_wide((double)thrust_N[3])};
    ivl_sim_rotor_command(model, rotors, &all, thrust);
}

static ivl_sim_rotors_t hovering(const ivl_sim_model_t *model)
{
    ivl_sim_rotors_t rotors;
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_rotor_init(model, &rotors, lane);
    }
    return rotors;
}

/// A model whose time constants up and down differ and are both resolved by the tests.
static ivl_sim_params_t slow_params(void)
{
    ivl_sim_params_t p = fixture_params();
    p.rotor_tau_up_s = 0.05;
    p.rotor_tau_down_s = 0.15;
    return p;
}

static ivl_sim_rotors_t rotor_at(const ivl_sim_model_t *model, double speed_radps, float thrust_N)
{
    const float      command[4] = {thrust_N, thrust_N, thrust_N, thrust_N};
    ivl_sim_rotors_t rotor = hovering(model);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        rotor.speed_radps[i] = ivl_wide(speed_radps);
    }
    command_all(model, &rotor, command);
    return rotor;
}

/// speed(t) = command + (start - command) exp(-t / tau): a first-order lag on the rotor speed, not on the thrust.
static void check_step(double start_radps, float thrust_N, double tau_s)
{
    const ivl_sim_params_t params = slow_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const double           command = sqrt((double)thrust_N / params.rotor_thrust_constant_Ns2);
    ivl_sim_rotors_t       rotor = rotor_at(&model, start_radps, thrust_N);
    draws_t                draws = {3};
    double                 t = 0.0;
    while (t < 0.5)
    {
        const double dt = draw(&draws, 1.0e-5, 0.004);
        step(&model, &rotor, 0.0, dt);
        t += dt;
        const double expected = command + (start_radps - command) * exp(-t / tau_s);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9 * (start_radps + command), expected, rotor.speed_radps[2][0]);
    }
}

static void test_speed_follows_the_exponential_when_it_rises(void)
{
    check_step(500.0, 0.12f, 0.05);
}

static void test_speed_follows_the_exponential_when_it_falls(void)
{
    check_step(2500.0, 0.02f, 0.15);
    check_step(2500.0, 0.0f, 0.15);
}

static void test_mean_thrust_is_exact_for_any_step_and_any_division_of_it(void)
{
    const ivl_sim_params_t params = slow_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const double           starts[] = {0.0, 2600.0};
    for (int k = 0; k < 2; k++)
    {
        // integral of speed^2 over [0, T], by hand: command^2 T + 2 command gap tau (1 - e) + gap^2 tau (1 - e^2) / 2
        const double     T = 0.08, tau = k ? params.rotor_tau_down_s : params.rotor_tau_up_s, e = exp(-T / tau);
        const double     command = sqrt((double)0.06f / params.rotor_thrust_constant_Ns2), gap = starts[k] - command;
        const double     integral = command * command * T + 2.0 * command * gap * tau * (1.0 - e) + 0.5 * gap * gap * tau * (1.0 - e * e);
        const double     expected = 4.0 * params.rotor_thrust_constant_Ns2 * integral / T;
        ivl_sim_rotors_t whole = rotor_at(&model, starts[k], 0.06f), parts = whole;
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, expected, step(&model, &whole, 0.0, T).thrust_N);
        double sum = 0.0;
        for (int i = 0; i < 64; i++)
        {
            const double dt = T * (2.0 * i + 1.0) / 4096.0;
            sum += dt * step(&model, &parts, 0.0, dt).thrust_N;
        }
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, expected, sum / T);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, whole.speed_radps[0][0], parts.speed_radps[0][0]);
    }
}

static void test_thrust_is_that_of_the_instant_when_the_step_has_no_length(void)
{
    const ivl_sim_params_t params = slow_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotors_t       rotor = rotor_at(&model, 1500.0, 0.15f);
    const double           expected = 4.0 * params.rotor_thrust_constant_Ns2 * 1500.0 * 1500.0;
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-7, expected, step(&model, &rotor, 0.0, 0.0).thrust_N);
}

static void test_commands_saturate_and_what_is_no_number_stops_the_motor(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const float            command[4] = {10.0f, -1.0f, NAN, 0.16f};
    ivl_sim_rotors_t       rotor = hovering(&model);
    command_all(&model, &rotor, command);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, model.rotor_speed_max_radps, rotor.command_radps[0][0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, rotor.command_radps[1][0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, rotor.command_radps[2][0]);
    TEST_ASSERT_TRUE(rotor.command_radps[3][0] < model.rotor_speed_max_radps);
}

static void test_each_motor_makes_the_moment_of_its_place_and_its_sense_of_rotation(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    // M1 front right, M2 rear right, M3 rear left, M4 front left: F along z at (x, y) makes (y F, -x F); 1 and 3 turn the
    // body clockwise seen from above
    const double sign_x[4] = {1.0, -1.0, -1.0, 1.0}, sign_y[4] = {-1.0, -1.0, 1.0, 1.0}, sign_yaw[4] = {-1.0, 1.0, -1.0, 1.0};
    for (int i = 0; i < 4; i++)
    {
        float command[4] = {0.0f, 0.0f, 0.0f, 0.0f};
        command[i] = 0.1f;
        ivl_sim_rotors_t rotor = rotor_at(&model, 0.0, 0.0f);
        command_all(&model, &rotor, command);
        step(&model, &rotor, 0.0, 5.0);
        const thrust_t load = step(&model, &rotor, 0.0, 0.001);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-8, 0.1, load.thrust_N);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, sign_y[i] * 0.033 * 0.1, load.torque_B_Nm[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, -sign_x[i] * 0.033 * 0.1, load.torque_B_Nm[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, sign_yaw[i] * 0.00612 * 0.1, load.torque_B_Nm[2]);
    }
}

static void test_scatter_multiplies_each_thrust_when_it_is_set(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotors_t       rotor = hovering(&model);
    rotor.scatter[0] = ivl_wide(1.1);
    rotor.scatter[3] = ivl_wide(0.9);
    const double   each = 0.25 * model.mass_total_kg * params.world_gravity_mps2;
    const thrust_t load = step(&model, &rotor, 0.0, 0.002);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 4.0 * each, load.thrust_N);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, (-1.1 + 0.9) * each * params.rotor_y_m, load.torque_B_Nm[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, load.torque_B_Nm[1]);
}

static void test_scatter_of_a_world_has_the_stated_deviation(void)
{
    ivl_sim_params_t params = fixture_params();
    params.rotor_thrust_scatter_norm = 0.02;
    const ivl_sim_model_t  model = fixture_model(&params);
    static ivl_sim_group_t group;
    const double           p[3] = {0.0, 0.0, 1.0}, v[3] = {0.0, 0.0, 0.0};
    double                 sum = 0.0, square = 0.0;
    const int              n = 4000;
    ivl_sim_group_init(&model, &group);
    for (int i = 0; i < n; i++)
    {
        const ivl_sim_rng_t rng = {9, (uint64_t)i};
        ivl_sim_world_start(&group, 0, &rng, p, v);
        for (int k = 0; k < 4; k++)
        {
            const double error = group.rotor.scatter[k][0] - 1.0;
            sum += error;
            square += error * error;
        }
    }
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 0.02 / sqrt(4.0 * n), 0.0, sum / (4.0 * n));
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 0.02 / sqrt(8.0 * n), 0.02, sqrt(square / (4.0 * n)));
}

static void test_thrust_grows_as_stated_when_the_rotor_nears_the_ceiling(void)
{
    ivl_sim_params_t params = fixture_params();
    params.aero_ceiling_gain_norm = 0.0625;
    const ivl_sim_model_t model = fixture_model(&params);
    const double          weight = model.mass_total_kg * params.world_gravity_mps2, radius = params.aero_rotor_radius_m;
    const double          gaps[] = {1.0, 0.1, 0.04, 0.5 * radius, 0.1 * radius};
    for (int i = 0; i < 5; i++)
    {
        ivl_sim_rotors_t rotor = hovering(&model);
        const double     height = params.world_ceiling_height_m - params.rotor_z_m - gaps[i];
        const double     ratio = radius / fmax(gaps[i], 0.5 * radius);  // the formula ends at half a radius
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, weight * (1.0 + 0.0625 * ratio * ratio), step(&model, &rotor, height, 0.001).thrust_N);
    }
}

static void test_ceiling_effect_vanishes_when_the_vehicle_is_inverted(void)
{
    ivl_sim_params_t params = fixture_params();
    params.aero_ceiling_gain_norm = 0.0625;
    const ivl_sim_model_t model = fixture_model(&params);
    const flow_t          body = {.gap_m = 0.05, .q_WB = {0.0, 1.0, 0.0, 0.0}};
    ivl_sim_rotors_t      rotor = hovering(&model);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, model.mass_total_kg * params.world_gravity_mps2, step_in(&model, &rotor, &body, 0.001).thrust_N);
}

// ---- decay with a share of drag that grows with the square of the speed -------------------------------------------------

static ivl_sim_params_t drag_params(double share)
{
    ivl_sim_params_t p = slow_params();
    p.rotor_tau_down_s = 0.19;
    p.rotor_drag_share_norm = share;
    return p;
}

/// dg/dt = -(g / tau) [(1 - share) + share (g + 2 c) / full], by a fine Runge-Kutta of fourth order.
static double integrated(const ivl_sim_model_t *model, double g, double command, double time_s)
{
    const double share = model->raw.rotor_drag_share_norm, tau = model->raw.rotor_tau_down_s, full = model->rotor_speed_max_radps;
    const int    n = 20000;
    const double h = time_s / n;
    for (int i = 0; i < n; i++)
    {
        double k[4], at = g;
        for (int j = 0; j < 4; j++)
        {
            k[j] = -at / tau * (1.0 - share + share * (at + 2.0 * command) / full);
            at = g + h * ((j < 2) ? 0.5 : 1.0) * k[j];
        }
        g += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]);
    }
    return command + g;
}

static void test_decay_follows_its_law_for_any_division_of_the_time(void)
{
    const double shares[] = {0.1, 0.5, 0.9, 0.95};
    draws_t      draws = {5};
    for (int k = 0; k < 4; k++)
    {
        const ivl_sim_params_t params = drag_params(shares[k]);
        const ivl_sim_model_t  model = fixture_model(&params);
        for (int stop = 0; stop < 2; stop++)
        {
            const double     start = 2500.0, command = stop ? 0.0 : sqrt((double)0.03f / params.rotor_thrust_constant_Ns2);
            ivl_sim_rotors_t rotor = rotor_at(&model, start, stop ? 0.0f : 0.03f);
            double           t = 0.0;
            while (t < 0.4)
            {
                const double dt = draw(&draws, 1.0e-5, 0.002);
                step(&model, &rotor, 0.0, dt);
                t += dt;
            }
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-6 * start, integrated(&model, start - command, command, t), rotor.speed_radps[1][0]);
        }
    }
}

static void test_mean_thrust_of_a_decay_is_that_of_a_fine_division(void)
{
    const ivl_sim_params_t params = drag_params(0.9);
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotors_t       whole = rotor_at(&model, 2500.0, 0.01f), parts = whole;
    const double           mean = step(&model, &whole, 0.0, 0.002).thrust_N;
    double                 sum = 0.0;
    for (int i = 0; i < 200; i++)
    {
        sum += step(&model, &parts, 0.0, 1.0e-5).thrust_N / 200.0;
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, sum, mean);
}

static void test_a_rotor_never_falls_below_its_command_and_ends_still(void)
{
    const ivl_sim_params_t params = drag_params(0.9);
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotors_t       rotor = rotor_at(&model, 2500.0, 0.02f), stopped = rotor_at(&model, 2500.0, 0.0f);
    double                 last = 2500.0;
    for (int i = 0; i < 3000; i++)
    {
        step(&model, &rotor, 0.0, 0.002);
        step(&model, &stopped, 0.0, 0.002);
        TEST_ASSERT_TRUE(rotor.speed_radps[0][0] <= last && rotor.speed_radps[0][0] >= rotor.command_radps[0][0]);
        last = rotor.speed_radps[0][0];
    }
    while (ivl_mask_any(ivl_sim_rotor_turn(&stopped)))
    {
        step(&model, &stopped, 0.0, 0.002);
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.0, stopped.speed_radps[3][0]);
}

static void test_drag_that_grows_is_refused_with_rotors_that_stop_at_once(void)
{
    ivl_sim_params_t params = drag_params(0.5);
    params.rotor_tau_down_s = 0.005;
    ivl_sim_model_t model;
    ivl_cfg_t       firmware;
    char            error[200] = "";
    ivl_cfg_defaults(&firmware);
    TEST_ASSERT_FALSE(ivl_sim_model_init(&model, &params, &firmware, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "rotor.drag_share"));
}

// ---- battery ------------------------------------------------------------------------------------------------------------

static ivl_sim_params_t battery_params(double compensated)
{
    ivl_sim_params_t p = slow_params();
    p.battery_voltage_V = 3.9;
    p.battery_sag_VpN = 1.4;
    p.battery_rated_voltage_V = 3.5;
    p.battery_speed_slope_norm = 0.8;
    p.battery_compensated_norm = compensated;
    return p;
}

static void test_voltage_falls_with_the_thrust_of_all_rotors(void)
{
    const ivl_sim_params_t params = battery_params(0.0);
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotors_t       rotor = rotor_at(&model, 2000.0, 0.1f);
    rotor.speed_radps[2][0] = 1000.0;
    const double square = 3.0 * 2000.0 * 2000.0 + 1000.0 * 1000.0;
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 3.9 - 1.4 * params.rotor_thrust_constant_Ns2 * square, ivl_sim_rotor_voltage(&model, &rotor, 0));
}

static void test_command_is_scaled_by_the_voltage_unless_it_is_compensated(void)
{
    for (int compensated = 0; compensated < 2; compensated++)
    {
        const ivl_sim_params_t params = battery_params(compensated);
        const ivl_sim_model_t  model = fixture_model(&params);
        const double           wanted = sqrt((double)0.08f / params.rotor_thrust_constant_Ns2);
        ivl_sim_rotors_t       rotor = rotor_at(&model, 2200.0, 0.08f);
        const double           scale = 1.0 + 0.8 * (ivl_sim_rotor_voltage(&model, &rotor, 0) / 3.5 - 1.0);
        TEST_ASSERT_TRUE(scale < 0.999);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, compensated ? wanted : scale * wanted, rotor.command_radps[0][0]);
        // at full duty the voltage limits the speed either way
        const float all[4] = {1.0f, 1.0f, 1.0f, 1.0f};
        command_all(&model, &rotor, all);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, scale * model.rotor_speed_max_radps, rotor.command_radps[0][0]);
    }
}

static void test_thrust_gain_scales_what_is_delivered_below_saturation(void)
{
    ivl_sim_params_t params = slow_params();
    params.rotor_thrust_gain_norm = 0.9;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_rotors_t      rotor = rotor_at(&model, 0.0, 0.1f);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, sqrt(0.9 * (double)0.1f / params.rotor_thrust_constant_Ns2), rotor.command_radps[0][0]);
    const float all[4] = {1.0f, 1.0f, 1.0f, 1.0f};
    command_all(&model, &rotor, all);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, model.rotor_speed_max_radps, rotor.command_radps[0][0]);
}

static void test_battery_of_a_world_is_drawn_once_a_rollout_with_the_stated_deviation(void)
{
    ivl_sim_params_t params = battery_params(0.0);
    params.battery_voltage_scatter_V = 0.08;
    const ivl_sim_model_t  model = fixture_model(&params);
    static ivl_sim_group_t group;
    const double           p[3] = {0.0, 0.0, 1.0}, v[3] = {0.0, 0.0, 0.0};
    double                 sum = 0.0, square = 0.0;
    const int              n = 4000;
    ivl_sim_group_init(&model, &group);
    for (int i = 0; i < n; i++)
    {
        const ivl_sim_rng_t rng = {9, (uint64_t)i};
        ivl_sim_world_start(&group, 0, &rng, p, v);
        const double error = group.rotor.open_circuit_V[0] - 3.9;
        sum += error;
        square += error * error;
    }
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 0.08 / sqrt(n), 0.0, sum / n);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * 0.08 / sqrt(2.0 * n), 0.08, sqrt(square / n));
    ivl_sim_start_state_t start = {.q_WB = {0.0, 0.0, 0.0, 1.0}, .battery_V = 3.7};
    const ivl_sim_rng_t   rng = {9, 0};
    ivl_sim_world_start_from(&group, 0, &rng, &start);
    TEST_ASSERT_EQUAL_DOUBLE(3.7, group.rotor.open_circuit_V[0]);
}

// ---- inflow -------------------------------------------------------------------------------------------------------------

static void test_thrust_is_lost_to_a_climb_along_the_axis_alone(void)
{
    ivl_sim_params_t params = slow_params();
    params.rotor_inflow_loss_spm = 0.03;
    const ivl_sim_model_t model = fixture_model(&params);
    const double          weight = model.mass_total_kg * params.world_gravity_mps2;
    const flow_t          climbs = {.v_W_mps = {1.0, -2.0, 2.5}, .q_WB = {0.0, 0.0, 0.0, 1.0}};
    const flow_t          sinks = {.v_W_mps = {1.0, -2.0, -2.5}, .q_WB = {0.0, 0.0, 0.0, 1.0}};
    // nose up by a quarter turn: the axis points along -x
    const flow_t        turned = {.v_W_mps = {-1.0, 0.5, 2.5}, .q_WB = {0.0, -sqrt(0.5), 0.0, sqrt(0.5)}};
    const flow_t *const flows[3] = {&climbs, &sinks, &turned};
    const double        expected[3] = {1.0 - 0.03 * 2.5, 1.0, 1.0 - 0.03 * 1.0};
    for (int i = 0; i < 3; i++)
    {
        ivl_sim_rotors_t rotor = hovering(&model);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, weight * expected[i], step_in(&model, &rotor, flows[i], 0.001).thrust_N);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speed_follows_the_exponential_when_it_rises);
    RUN_TEST(test_speed_follows_the_exponential_when_it_falls);
    RUN_TEST(test_mean_thrust_is_exact_for_any_step_and_any_division_of_it);
    RUN_TEST(test_thrust_is_that_of_the_instant_when_the_step_has_no_length);
    RUN_TEST(test_commands_saturate_and_what_is_no_number_stops_the_motor);
    RUN_TEST(test_each_motor_makes_the_moment_of_its_place_and_its_sense_of_rotation);
    RUN_TEST(test_scatter_multiplies_each_thrust_when_it_is_set);
    RUN_TEST(test_scatter_of_a_world_has_the_stated_deviation);
    RUN_TEST(test_thrust_grows_as_stated_when_the_rotor_nears_the_ceiling);
    RUN_TEST(test_ceiling_effect_vanishes_when_the_vehicle_is_inverted);
    RUN_TEST(test_decay_follows_its_law_for_any_division_of_the_time);
    RUN_TEST(test_mean_thrust_of_a_decay_is_that_of_a_fine_division);
    RUN_TEST(test_a_rotor_never_falls_below_its_command_and_ends_still);
    RUN_TEST(test_drag_that_grows_is_refused_with_rotors_that_stop_at_once);
    RUN_TEST(test_voltage_falls_with_the_thrust_of_all_rotors);
    RUN_TEST(test_command_is_scaled_by_the_voltage_unless_it_is_compensated);
    RUN_TEST(test_thrust_gain_scales_what_is_delivered_below_saturation);
    RUN_TEST(test_battery_of_a_world_is_drawn_once_a_rollout_with_the_stated_deviation);
    RUN_TEST(test_thrust_is_lost_to_a_climb_along_the_axis_alone);
    return UNITY_END();
}
