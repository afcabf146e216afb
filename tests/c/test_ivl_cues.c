/// @file test_ivl_cues.c
#include "test_ivl_support.h"

static ivl_cues_t cues_of(float d_ceil_m, ivl_vec3_t v_WB_mps)
{
    const ivl_ceiling_t ceiling = {.d_ceil_m = d_ceil_m, .v_close_mps = v_WB_mps.z, .valid = true};
    return ivl_cues_compute(ceiling, v_WB_mps.x);
}

static void test_cues_have_the_known_values(void)
{
    // 2.5 m/s up and 1 m/s ahead, half a metre below the ceiling
    const ivl_cues_t cues = cues_of(0.5f, ivl_vec3(1.0f, 7.0f, 2.5f));
    TEST_ASSERT_TRUE(cues.valid);
    TEST_ASSERT_EQUAL_FLOAT(5.0f, cues.rrev_per_s);
    TEST_ASSERT_EQUAL_FLOAT(-2.0f, cues.of_y_radps);
}

static void test_rrev_is_negative_when_departing(void)
{
    TEST_ASSERT_EQUAL_FLOAT(-2.0f, cues_of(0.5f, ivl_vec3(0.0f, 0.0f, -1.0f)).rrev_per_s);
}

static void test_cues_are_invalid_and_zero_when_the_ceiling_is(void)
{
    const ivl_ceiling_t bad = {.d_ceil_m = 0.5f, .v_close_mps = 2.5f, .valid = false};
    const ivl_cues_t    cues = ivl_cues_compute(bad, 1.0f);
    TEST_ASSERT_FALSE(cues.valid);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, cues.rrev_per_s);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, cues.of_y_radps);
}

static void test_cues_are_invalid_when_the_distance_is_not_positive(void)
{
    const ivl_vec3_t v = {0.0f, 0.0f, 1.0f};
    TEST_ASSERT_FALSE(cues_of(0.0f, v).valid);
    TEST_ASSERT_FALSE(cues_of(-0.1f, v).valid);
    TEST_ASSERT_FALSE(cues_of(NAN, v).valid);
}

static float rrev_after(float d_m, float vz_mps, float az_mps2, float t_s)
{
    const float d_then_m = d_m - vz_mps * t_s - 0.5f * az_mps2 * t_s * t_s;
    return cues_of(d_then_m, ivl_vec3(0.0f, 0.0f, vz_mps + az_mps2 * t_s)).rrev_per_s;
}

// RREV' = z'' / d + RREV^2, the identity behind the distance from RREV and the accelerometer
static void test_rate_of_rrev_is_acceleration_over_distance_plus_rrev_squared(void)
{
    rng_t       rng = {3};
    const float h_s = 0.004f;
    for (int i = 0; i < 10000; i++)
    {
        const float d_m = rng_float(&rng, 0.5f, 3.0f);
        const float vz_mps = rng_float(&rng, 0.5f, 3.0f);
        const float az_mps2 = rng_float(&rng, -4.0f, 4.0f);
        const float rrev = vz_mps / d_m;
        const float slope = (rrev_after(d_m, vz_mps, az_mps2, h_s) - rrev_after(d_m, vz_mps, az_mps2, -h_s)) / (2.0f * h_s);
        const float expected = az_mps2 / d_m + rrev * rrev;
        // the central difference errs by h^2 / 6 times the third derivative, of order 6 RREV^4 here
        const float tolerance = 2.0f * h_s * h_s * (rrev * rrev + 16.0f) * (rrev * rrev + 16.0f) + 1.0e-3f;
        TEST_ASSERT_FLOAT_WITHIN(tolerance, expected, slope);
    }
}

static void test_flow_comes_from_its_sensor_only_if_asked_valid_and_young(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    ivl_in_t in = good_input();
    in.t_us = 5000000u;
    in.flow = (ivl_reading_t){4990000u, -3.5f, 1u};
    const ivl_cues_t cues = {.rrev_per_s = 4.0f, .of_y_radps = -2.0f, .valid = true};
    for (int i = 0; i < 6; i++)
    {
        ivl_in_t   spoiled = in;
        ivl_cues_t taken = cues;
        cfg.of_source = (uint8_t)(i != 1);
        spoiled.flow.valid = (uint8_t)(i != 2);
        spoiled.flow.t_us = (i == 3) ? 4700000u : spoiled.flow.t_us;
        spoiled.flow.value = (i == 4) ? NAN : spoiled.flow.value;
        taken.valid = i != 5;
        ivl_cues_take_flow(&cfg, &spoiled, &taken);
        TEST_ASSERT_EQUAL_FLOAT((i == 0) ? -3.5f : -2.0f, taken.of_y_radps);
        TEST_ASSERT_EQUAL_FLOAT(4.0f, taken.rrev_per_s);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_cues_have_the_known_values);
    RUN_TEST(test_rrev_is_negative_when_departing);
    RUN_TEST(test_cues_are_invalid_and_zero_when_the_ceiling_is);
    RUN_TEST(test_cues_are_invalid_when_the_distance_is_not_positive);
    RUN_TEST(test_rate_of_rrev_is_acceleration_over_distance_plus_rrev_squared);
    RUN_TEST(test_flow_comes_from_its_sensor_only_if_asked_valid_and_young);
    return UNITY_END();
}
