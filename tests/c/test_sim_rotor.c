/// @file test_sim_rotor.c
/// Rotor lag, mean thrust, saturation, scatter and ceiling effect against closed forms.
#include "sim_rotor.h"

#include "sim_fixture.h"

static const double LEVEL[4] = {0.0, 0.0, 0.0, 1.0};

/// A model whose time constants up and down differ and are both resolved by the tests.
static ivl_sim_params_t slow_params(void)
{
    ivl_sim_params_t p = fixture_params();
    p.rotor_tau_up_s = 0.05;
    p.rotor_tau_down_s = 0.15;
    return p;
}

static ivl_sim_rotor_t rotor_at(const ivl_sim_model_t *model, double speed_radps, float thrust_N)
{
    const float     command[4] = {thrust_N, thrust_N, thrust_N, thrust_N};
    ivl_sim_rotor_t rotor;
    ivl_sim_rotor_init(model, &rotor);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        rotor.speed_radps[i] = speed_radps;
    }
    ivl_sim_rotor_command(model, &rotor, command);
    return rotor;
}

/// speed(t) = command + (start - command) exp(-t / tau): a first-order lag on the rotor speed, not on the thrust.
static void check_step(double start_radps, float thrust_N, double tau_s)
{
    const ivl_sim_params_t params = slow_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const double           command = sqrt((double)thrust_N / params.rotor_thrust_constant_Ns2);
    ivl_sim_rotor_t        rotor = rotor_at(&model, start_radps, thrust_N);
    draws_t                draws = {3};
    double                 t = 0.0;
    while (t < 0.5)
    {
        const double dt = draw(&draws, 1.0e-5, 0.004);
        ivl_sim_rotor_step(&model, &rotor, 0.0, LEVEL, dt);
        t += dt;
        const double expected = command + (start_radps - command) * exp(-t / tau_s);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9 * (start_radps + command), expected, rotor.speed_radps[2]);
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
        const double    T = 0.08, tau = k ? params.rotor_tau_down_s : params.rotor_tau_up_s, e = exp(-T / tau);
        const double    command = sqrt((double)0.06f / params.rotor_thrust_constant_Ns2), gap = starts[k] - command;
        const double    integral = command * command * T + 2.0 * command * gap * tau * (1.0 - e) + 0.5 * gap * gap * tau * (1.0 - e * e);
        const double    expected = 4.0 * params.rotor_thrust_constant_Ns2 * integral / T;
        ivl_sim_rotor_t whole = rotor_at(&model, starts[k], 0.06f), parts = whole;
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, expected, ivl_sim_rotor_step(&model, &whole, 0.0, LEVEL, T).thrust_N);
        double sum = 0.0;
        for (int i = 0; i < 64; i++)
        {
            const double dt = T * (2.0 * i + 1.0) / 4096.0;
            sum += dt * ivl_sim_rotor_step(&model, &parts, 0.0, LEVEL, dt).thrust_N;
        }
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, expected, sum / T);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, whole.speed_radps[0], parts.speed_radps[0]);
    }
}

static void test_thrust_is_that_of_the_instant_when_the_step_has_no_length(void)
{
    const ivl_sim_params_t params = slow_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_rotor_t        rotor = rotor_at(&model, 1500.0, 0.15f);
    const double           expected = 4.0 * params.rotor_thrust_constant_Ns2 * 1500.0 * 1500.0;
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-7, expected, ivl_sim_rotor_step(&model, &rotor, 0.0, LEVEL, 0.0).thrust_N);
}

static void test_commands_saturate_and_what_is_no_number_stops_the_motor(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const float            command[4] = {10.0f, -1.0f, NAN, 0.16f};
    ivl_sim_rotor_t        rotor;
    ivl_sim_rotor_init(&model, &rotor);
    ivl_sim_rotor_command(&model, &rotor, command);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, model.rotor_speed_max_radps, rotor.command_radps[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, rotor.command_radps[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, rotor.command_radps[2]);
    TEST_ASSERT_TRUE(rotor.command_radps[3] < model.rotor_speed_max_radps);
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
        ivl_sim_rotor_t rotor = rotor_at(&model, 0.0, 0.0f);
        ivl_sim_rotor_command(&model, &rotor, command);
        ivl_sim_rotor_step(&model, &rotor, 0.0, LEVEL, 5.0);
        const ivl_sim_thrust_t load = ivl_sim_rotor_step(&model, &rotor, 0.0, LEVEL, 0.001);
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
    ivl_sim_rotor_t        rotor;
    ivl_sim_rotor_init(&model, &rotor);
    rotor.scatter[0] = 1.1;
    rotor.scatter[3] = 0.9;
    const double           each = 0.25 * model.mass_total_kg * params.world_gravity_mps2;
    const ivl_sim_thrust_t load = ivl_sim_rotor_step(&model, &rotor, 0.0, LEVEL, 0.002);
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
            const double error = group.world[0].rotor.scatter[k] - 1.0;
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
        ivl_sim_rotor_t rotor;
        ivl_sim_rotor_init(&model, &rotor);
        const double height = params.world_ceiling_height_m - params.rotor_z_m - gaps[i];
        const double ratio = radius / fmax(gaps[i], 0.5 * radius);  // the formula ends at half a radius
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, weight * (1.0 + 0.0625 * ratio * ratio),
                                  ivl_sim_rotor_step(&model, &rotor, height, LEVEL, 0.001).thrust_N);
    }
}

static void test_ceiling_effect_vanishes_when_the_vehicle_is_inverted(void)
{
    ivl_sim_params_t params = fixture_params();
    params.aero_ceiling_gain_norm = 0.0625;
    const ivl_sim_model_t model = fixture_model(&params);
    const double          inverted[4] = {0.0, 1.0, 0.0, 0.0};
    ivl_sim_rotor_t       rotor;
    ivl_sim_rotor_init(&model, &rotor);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, model.mass_total_kg * params.world_gravity_mps2,
                              ivl_sim_rotor_step(&model, &rotor, params.world_ceiling_height_m - 0.05, inverted, 0.001).thrust_N);
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
    return UNITY_END();
}
