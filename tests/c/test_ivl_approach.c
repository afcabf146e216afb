/// @file test_ivl_approach.c
#include "test_ivl_support.h"

static const float DT_S = 0.002f;

static ivl_cfg_t defaults(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    return cfg;
}

static void test_reference_begins_at_the_present_position_and_speed(void)
{
    const ivl_cfg_t  cfg = defaults();
    const ivl_vec3_t p = {0.3f, -0.2f, 0.9f};
    ivl_approach_t   approach;
    // velocity component along 60 degrees: 0.5 cos 60 + 1.0 sin 60 = 1.1160
    ivl_approach_begin(&cfg, &approach, p, ivl_vec3(0.5f, 0.7f, 1.0f), 2.5f, 1.04719755f);
    const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
    TEST_ASSERT_EQUAL_MEMORY(&p, &ref.p_W_m, sizeof p);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 1.1160254f * 0.5f, ref.v_W_mps.x);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, ref.v_W_mps.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 1.1160254f * 0.8660254f, ref.v_W_mps.z);
    // and accelerates along the path
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 4.3f * 0.5f, ref.a_W_mps2.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 4.3f * 0.8660254f, ref.a_W_mps2.z);
}

static void test_path_from_rest_follows_constant_acceleration_then_constant_speed(void)
{
    const ivl_cfg_t cfg = defaults();
    ivl_approach_t  approach;
    ivl_approach_begin(&cfg, &approach, ivl_vec3(0.0f, 0.0f, 0.0f), ivl_vec3(0.0f, 0.0f, 0.0f), 2.5f, IVL_HALF_PI);
    const float t_ramp_s = 2.5f / 4.3f;
    const float s_ramp_m = 0.5f * 2.5f * t_ramp_s;
    for (int i = 0; i < 1000; i++)
    {
        const float           t_s = (float)i * DT_S;
        const bool            is_ramp = t_s < t_ramp_s;
        const float           s_m = is_ramp ? 0.5f * 4.3f * t_s * t_s : s_ramp_m + 2.5f * (t_s - t_ramp_s);
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, s_m, ref.p_W_m.z);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, is_ramp ? 4.3f * t_s : 2.5f, ref.v_W_mps.z);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, ref.p_W_m.x);
    }
}

static void test_speed_is_exactly_the_target_after_the_ramp(void)
{
    const ivl_cfg_t cfg = defaults();
    const float     starts[] = {0.0f, 2.5f, 4.0f, -1.0f};
    for (int k = 0; k < 4; k++)
    {
        ivl_approach_t approach;
        ivl_approach_begin(&cfg, &approach, ivl_vec3(0.0f, 0.0f, 0.0f), ivl_vec3(starts[k], 0.0f, 0.0f), 2.5f, 0.0f);
        for (int i = 0; i < 500; i++)
        {
            (void)ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        }
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        TEST_ASSERT_FLOAT_WITHIN(3.0e-7f, 2.5f, ref.v_W_mps.x);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 0.0f, ref.a_W_mps2.x);
    }
}

static void test_vehicle_already_at_speed_just_holds_it(void)
{
    const ivl_cfg_t cfg = defaults();
    ivl_approach_t  approach;
    ivl_approach_begin(&cfg, &approach, ivl_vec3(0.0f, 0.0f, 0.0f), ivl_vec3(0.0f, 0.0f, 2.5f), 2.5f, IVL_HALF_PI);
    for (int i = 0; i < 100; i++)
    {
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 0.0f, ref.a_W_mps2.z);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 2.5f, ref.v_W_mps.z);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 2.5f * DT_S * (float)i, ref.p_W_m.z);
    }
}

// position is the integral of speed, speed that of acceleration: so feed-forward and feedback never disagree
static void test_reference_is_consistent_with_its_derivatives_for_random_paths(void)
{
    const ivl_cfg_t cfg = defaults();
    rng_t           rng = {5};
    for (int i = 0; i < 1000; i++)
    {
        ivl_approach_t approach;
        ivl_approach_begin(&cfg, &approach, rng_vec3(&rng, 1.0f), rng_vec3(&rng, 3.0f), rng_float(&rng, 0.1f, 6.0f),
                           rng_float(&rng, 0.0f, IVL_HALF_PI));
        ivl_reference_t a = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        for (int k = 0; k < 100; k++)
        {
            const ivl_reference_t b = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
            const ivl_vec3_t      mean_v = ivl_scale(ivl_add(a.v_W_mps, b.v_W_mps), 0.5f);
            const ivl_vec3_t      p = ivl_add(a.p_W_m, ivl_scale(mean_v, DT_S));
            const ivl_vec3_t      v = ivl_add(a.v_W_mps, ivl_scale(a.a_W_mps2, DT_S));
            TEST_ASSERT_TRUE(ivl_vec3_within(ivl_sub(p, b.p_W_m), 2.0e-6f));
            TEST_ASSERT_TRUE(ivl_vec3_within(ivl_sub(v, b.v_W_mps), 2.0e-6f));
            TEST_ASSERT_TRUE(ivl_dot(a.a_W_mps2, a.a_W_mps2) <= 4.301f * 4.301f);
            a = b;
        }
    }
}

static void test_an_accelerating_approach_goes_on_beyond_the_commanded_speed_up_to_the_limit(void)
{
    ivl_cfg_t cfg = defaults();
    cfg.shape = (uint8_t)IVL_SHAPE_ACCELERATE;
    ivl_approach_t approach;
    ivl_approach_begin(&cfg, &approach, ivl_vec3(0.0f, 0.0f, 0.0f), ivl_vec3(0.0f, 0.0f, 0.0f), 2.5f, IVL_HALF_PI);
    for (int i = 0; i < 1000; i++)
    {
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        const float           expected = cfg.approach_accel_mps2 * DT_S * (float)i;
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, (expected < cfg.speed_mps_max) ? expected : cfg.speed_mps_max, ref.v_W_mps.z);
    }
}

// at speed from the start, the cue as the path itself gives it
static void test_holding_rrev_lets_the_speed_fall_with_the_distance_and_ends_at_the_stated_part(void)
{
    ivl_cfg_t cfg = defaults();
    cfg.shape = (uint8_t)IVL_SHAPE_RREV;
    const float    angle = 1.2f, d0_m = 2.0f;
    ivl_approach_t approach;
    ivl_approach_begin(&cfg, &approach, ivl_vec3(0.0f, 0.0f, -d0_m), ivl_vec3(2.5f * cosf(angle), 0.0f, 2.5f * sinf(angle)), 2.5f, angle);
    float rrev = 0.0f;
    bool  was_held = false;
    while (approach.p_W_m.z < -0.2f)
    {
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, rrev, DT_S);
        rrev = ref.v_W_mps.z / -ref.p_W_m.z;
        TEST_ASSERT_TRUE(approach.speed_mps > 0.6f * 2.5f - 1.0e-4f);
        if ((rrev > 3.06f) && (approach.speed_mps > 0.61f * 2.5f))
        {
            TEST_FAIL_MESSAGE("RREV is not held");
        }
        was_held = was_held || approach.closing;
    }
    TEST_ASSERT_TRUE(was_held);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 0.6f * 2.5f, approach.speed_mps);
    TEST_ASSERT_TRUE(rrev > 5.0f);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_reference_begins_at_the_present_position_and_speed);
    RUN_TEST(test_path_from_rest_follows_constant_acceleration_then_constant_speed);
    RUN_TEST(test_speed_is_exactly_the_target_after_the_ramp);
    RUN_TEST(test_vehicle_already_at_speed_just_holds_it);
    RUN_TEST(test_reference_is_consistent_with_its_derivatives_for_random_paths);
    RUN_TEST(test_an_accelerating_approach_goes_on_beyond_the_commanded_speed_up_to_the_limit);
    RUN_TEST(test_holding_rrev_lets_the_speed_fall_with_the_distance_and_ends_at_the_stated_part);
    return UNITY_END();
}
