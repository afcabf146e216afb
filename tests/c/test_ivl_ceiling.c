/// @file test_ivl_ceiling.c
#include "test_ivl_support.h"

static ivl_ceiling_t ceiling_at(float z_m, bool fresh)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    ivl_sense_t sense;
    ivl_sense_reset(&sense);
    sense.pose_fresh = fresh;
    sense.age_s = 0.012f;
    sense.sample.p_WB_m = ivl_vec3(3.0f, -2.0f, z_m);
    sense.sample.v_WB_mps = ivl_vec3(1.0f, 0.5f, 2.5f);
    see(&cfg, &sense);
    return ivl_ceiling_compute(&cfg, &sense);
}

static void test_distance_is_height_minus_altitude(void)
{
    const ivl_ceiling_t ceiling = ceiling_at(1.6f, true);
    TEST_ASSERT_TRUE(ceiling.valid);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, ceiling.d_ceil_m);
    TEST_ASSERT_EQUAL_FLOAT(2.5f, ceiling.v_close_mps);
    TEST_ASSERT_EQUAL_FLOAT(0.012f, ceiling.age_s);
}

static void test_distance_is_invalid_when_outside_its_range(void)
{
    // range of the defaults: 0.01 .. 5 m below 2.1 m
    TEST_ASSERT_TRUE(ceiling_at(2.0899f, true).valid);
    TEST_ASSERT_FALSE(ceiling_at(2.0901f, true).valid);
    TEST_ASSERT_FALSE(ceiling_at(2.2f, true).valid);
    TEST_ASSERT_TRUE(ceiling_at(-2.8999f, true).valid);
    TEST_ASSERT_FALSE(ceiling_at(-2.9001f, true).valid);
}

static void test_distance_is_invalid_and_zero_when_there_is_no_fresh_sample(void)
{
    const ivl_ceiling_t ceiling = ceiling_at(1.6f, false);
    TEST_ASSERT_FALSE(ceiling.valid);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, ceiling.d_ceil_m);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, ceiling.v_close_mps);
}

static void test_distance_is_invalid_when_altitude_is_no_number(void)
{
    TEST_ASSERT_FALSE(ceiling_at(NAN, true).valid);
    TEST_ASSERT_FALSE(ceiling_at(INFINITY, true).valid);
    TEST_ASSERT_FALSE(ceiling_at(-INFINITY, true).valid);
}

static void test_a_held_sample_is_carried_to_the_present_tick_if_asked(void)
{
    ivl_cfg_t   cfg;
    ivl_sense_t sense;
    ivl_cfg_defaults(&cfg);
    cfg.d_predict = 1u;
    ivl_sense_reset(&sense);
    sense.pose_fresh = true;
    sense.age_s = 0.012f;
    sense.sample.p_WB_m.z = 1.6f;
    sense.sample.v_WB_mps.z = 2.5f;
    see(&cfg, &sense);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.47f, ivl_ceiling_compute(&cfg, &sense).d_ceil_m);
    sense.sample.v_WB_mps.z = -2.5f;
    see(&cfg, &sense);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.53f, ivl_ceiling_compute(&cfg, &sense).d_ceil_m);
}

static void test_a_height_that_is_hardly_known_gives_no_distance(void)
{
    ivl_cfg_t   cfg;
    ivl_sense_t sense;
    ivl_cfg_defaults(&cfg);
    ivl_sense_reset(&sense);
    sense.pose_fresh = true;
    sense.sample.p_WB_m.z = 1.6f;
    cfg.height_sigma_m = 0.12f;
    see(&cfg, &sense);
    TEST_ASSERT_EQUAL_FLOAT(0.12f, ivl_ceiling_compute(&cfg, &sense).d_sigma_m);
    cfg.height_sigma_m = 0.13f;
    TEST_ASSERT_FALSE(ivl_ceiling_compute(&cfg, &sense).valid);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_distance_is_height_minus_altitude);
    RUN_TEST(test_distance_is_invalid_when_outside_its_range);
    RUN_TEST(test_distance_is_invalid_and_zero_when_there_is_no_fresh_sample);
    RUN_TEST(test_distance_is_invalid_when_altitude_is_no_number);
    RUN_TEST(test_a_held_sample_is_carried_to_the_present_tick_if_asked);
    RUN_TEST(test_a_height_that_is_hardly_known_gives_no_distance);
    return UNITY_END();
}
