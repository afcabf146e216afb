/// @file test_sim_model.c
/// Ranges of the raw parameters, and what is derived from them.
#include "sim_model.h"

#include <stdio.h>

#include "sim_fixture.h"

typedef struct
{
    const char *name;
    double      lo, hi, dflt;
} row_t;

#define ROW(group, name, suffix, unit, lo, hi, dflt, doc) {#group "." #name, lo, hi, dflt},
static const row_t ROWS[] = {IVL_SIM_PARAMS(ROW)};
#undef ROW

enum
{
    N_ROWS = sizeof ROWS / sizeof ROWS[0]
};

static bool accepted(const double values[N_ROWS], char *error, size_t size)
{
    ivl_sim_params_t params;
    ivl_sim_model_t  model;
    ivl_cfg_t        cfg;
    memcpy(&params, values, sizeof params);
    ivl_cfg_defaults(&cfg);
    return ivl_sim_model_init(&model, &params, &cfg, error, size);
}

static void test_the_table_and_the_struct_have_the_same_order(void)
{
    TEST_ASSERT_EQUAL_UINT(sizeof(ivl_sim_params_t), N_ROWS * sizeof(double));
    for (size_t i = 0; i < N_ROWS; i++)
    {
        TEST_ASSERT_TRUE(ROWS[i].lo < ROWS[i].hi);
        TEST_ASSERT_TRUE(isnan(ROWS[i].dflt) || (ROWS[i].dflt >= ROWS[i].lo && ROWS[i].dflt <= ROWS[i].hi));
    }
}

static void test_each_parameter_is_refused_by_name_when_it_is_no_number_or_out_of_range(void)
{
    const ivl_sim_params_t good = fixture_params();
    for (size_t i = 0; i < N_ROWS; i++)
    {
        const double bad[] = {(double)NAN, ROWS[i].lo - 1.0e-3 * (1.0 + fabs(ROWS[i].lo)), ROWS[i].hi + 1.0 + fabs(ROWS[i].hi),
                              -(double)INFINITY};
        for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        {
            if (bad[k] > 0.0 && isinf(ROWS[i].hi))
            {
                continue;  // nothing lies above infinity
            }
            double values[N_ROWS];
            char   error[256] = "";
            memcpy(values, &good, sizeof good);
            values[i] = bad[k];
            TEST_ASSERT_FALSE_MESSAGE(accepted(values, error, sizeof error), ROWS[i].name);
            TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE(ROWS[i].name, error, strlen(ROWS[i].name), error);
        }
    }
}

static void test_a_required_parameter_that_is_missing_is_refused(void)
{
    const ivl_sim_params_t good = fixture_params();
    int                    required = 0;
    for (size_t i = 0; i < N_ROWS; i++)
    {
        double values[N_ROWS];
        char   error[256] = "";
        memcpy(values, &good, sizeof good);
        values[i] = ROWS[i].dflt;
        required += isnan(ROWS[i].dflt) ? 1 : 0;
        TEST_ASSERT_EQUAL(!isnan(ROWS[i].dflt), accepted(values, error, sizeof error));
    }
    TEST_ASSERT_GREATER_THAN(20, required);
}

static void test_a_vehicle_that_the_flight_core_refuses_is_refused_by_its_name(void)
{
    ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t  model;
    ivl_cfg_t        cfg;
    char             error[256] = "";
    ivl_cfg_defaults(&cfg);
    params.rotor_x_m = 0.5;  // within the world's range, beyond the core's
    TEST_ASSERT_FALSE(ivl_sim_model_init(&model, &params, &cfg, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "firmware.arm_x"));
}

static void check_vector(double x, double y, double z, ivl_d3_t v)
{
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, x, v.x);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, y, v.y);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, z, v.z);
}

static void test_legs_stand_at_the_stated_azimuths_and_angle(void)
{
    ivl_sim_params_t params = fixture_params();
    const double     azimuth[4] = {-45.0, -135.0, 135.0, 45.0}, degree = IVL_SIM_PI / 180.0;
    for (double psi = 0.0; psi <= 90.0; psi += 15.0)
    {
        params.leg_angle_deg = psi;
        const ivl_sim_model_t model = fixture_model(&params);
        for (int i = 0; i < 4; i++)
        {
            const double c = cos(azimuth[i] * degree), s = sin(azimuth[i] * degree);
            check_vector(sin(psi * degree) * c, sin(psi * degree) * s, -cos(psi * degree), model.leg.rest_B[i]);
            check_vector(copysign(0.017, c), copysign(0.017, s), -0.005, model.leg.hip_B_m[i]);
            // the in-plane direction is that of growing psi; the third one is across both
            check_vector(cos(psi * degree) * c, cos(psi * degree) * s, sin(psi * degree), model.leg.inplane_B[i]);
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 0.0, ivl_d3_dot(model.leg.sideways_B[i], model.leg.rest_B[i]));
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 0.0, ivl_d3_dot(model.leg.sideways_B[i], model.leg.inplane_B[i]));
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 1.0, ivl_d3_dot(model.leg.sideways_B[i], model.leg.sideways_B[i]));
        }
    }
}

static void test_derived_numbers_are_those_of_the_paper_s_simulator(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_foot_mass_kg = 0.0;
    ivl_sim_model_t model = fixture_model(&params);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 0.03584 + 4.0 * 4.4e-4, model.mass_total_kg);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-18, 4.4e-4 * 0.05 * 0.05 / 3.0, model.leg.moment_pivot_kgm2);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 467.1, model.leg_frequency_radps);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, sqrt(0.1615 / 2.21e-8), model.rotor_speed_max_radps);
    params.leg_length_m = 0.075;
    params.leg_mass_kg = 6.6e-4;
    model = fixture_model(&params);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 254.3, model.leg_frequency_radps);
}

/// The lumped matrix of a rod, [[1/3, 1/6], [1/6, 1/3]] of its mass: exact for the kinetic energy of any rigid motion.
static void test_rod_element_has_the_kinetic_energy_of_a_uniform_rod(void)
{
    const ivl_sim_params_t     params = fixture_params();
    const ivl_sim_model_t      model = fixture_model(&params);
    const ivl_sim_leg_model_t *leg = &model.leg;
    draws_t                    draws = {1};
    for (int i = 0; i < 100; i++)
    {
        const ivl_d3_t a = draw_d3(&draws, 3.0), b = draw_d3(&draws, 3.0);
        double         slices = 0.0;
        const int      n = 2000;
        for (int k = 0; k < n; k++)
        {
            const double   s = (k + 0.5) / n;
            const ivl_d3_t v = ivl_d3_add(ivl_d3_scale(1.0 - s, a), ivl_d3_scale(s, b));
            slices += 0.5 * params.leg_mass_kg / n * ivl_d3_dot(v, v);
        }
        slices += 0.5 * params.leg_foot_mass_kg * ivl_d3_dot(b, b);
        const double lumped =
            0.5 * leg->mass_hip_kg * ivl_d3_dot(a, a) + leg->mass_cross_kg * ivl_d3_dot(a, b) + 0.5 * leg->mass_foot_kg * ivl_d3_dot(b, b);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6 * slices, slices, lumped);  // midpoint slices err by 1/n^2
    }
}

static void test_reach_bounds_every_point_of_the_vehicle(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {2};
    for (int i = 0; i < 10000; i++)
    {
        ivl_d3_t n = draw_d3(&draws, 1.0);  // legs may point anywhere
        n = ivl_d3_scale((params.leg_length_m + params.leg_foot_radius_m) / sqrt(ivl_d3_dot(n, n)), n);
        const ivl_d3_t foot = ivl_d3_add(model.leg.hip_B_m[i % 4], n);
        TEST_ASSERT_TRUE(sqrt(ivl_d3_dot(foot, foot)) <= model.reach_m);
    }
    const double corner = sqrt(0.055 * 0.055 * 2.0 + 0.0135 * 0.0135);
    TEST_ASSERT_TRUE(corner <= model.reach_m && model.reach_m < 0.09);
}

static void test_the_flight_core_is_told_the_world_s_numbers(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_sensed_gap_offset_m = 0.045;
    const ivl_sim_model_t model = fixture_model(&params);
    TEST_ASSERT_EQUAL_FLOAT((float)model.mass_total_kg, model.firmware.mass_kg);
    TEST_ASSERT_EQUAL_FLOAT(3.045f, model.firmware.h_ceil_m);
    TEST_ASSERT_EQUAL_FLOAT(0.1615f, model.firmware.motor_thrust_N_max);
    TEST_ASSERT_EQUAL_FLOAT(49.35e-6f, model.firmware.jyy_kgm2);
    TEST_ASSERT_EQUAL_FLOAT(0.033f, model.firmware.arm_x_m);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 0.002, model.tick_s);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_table_and_the_struct_have_the_same_order);
    RUN_TEST(test_each_parameter_is_refused_by_name_when_it_is_no_number_or_out_of_range);
    RUN_TEST(test_a_required_parameter_that_is_missing_is_refused);
    RUN_TEST(test_a_vehicle_that_the_flight_core_refuses_is_refused_by_its_name);
    RUN_TEST(test_legs_stand_at_the_stated_azimuths_and_angle);
    RUN_TEST(test_derived_numbers_are_those_of_the_paper_s_simulator);
    RUN_TEST(test_rod_element_has_the_kinetic_energy_of_a_uniform_rod);
    RUN_TEST(test_reach_bounds_every_point_of_the_vehicle);
    RUN_TEST(test_the_flight_core_is_told_the_world_s_numbers);
    return UNITY_END();
}
