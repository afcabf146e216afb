/// @file test_ivl_maneuver.c
#include "ivl_maneuver.h"

#include "test_ivl_support.h"

static void thrusts_of(float moment_Nm, float thrust_N[4])
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    ivl_maneuver_thrusts(&cfg, moment_Nm, thrust_N);
}

static void test_front_pair_shares_the_moment_and_the_rear_pair_is_off(void)
{
    float f[4];
    thrusts_of(0.0066f, f);
    // 6.6 N mm over two arms of 33 mm
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 0.1f, f[0]);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, f[1]);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, f[2]);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 0.1f, f[3]);
}

static void test_moment_made_is_nose_up_and_of_the_size_asked_for(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    rng_t rng = {4};
    for (int i = 0; i < 10000; i++)
    {
        const float moment_Nm = rng_float(&rng, 0.0f, 0.0106f);
        float       f[4];
        ivl_maneuver_thrusts(&cfg, moment_Nm, f);
        const ivl_wrench_t made = ivl_mixer_wrench(&cfg, f);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, -moment_Nm, made.moment_B_Nm.y);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-9f, 0.0f, made.moment_B_Nm.x);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-9f, 0.0f, made.moment_B_Nm.z);
    }
}

static void test_thrust_is_limited_when_the_moment_is_too_large_or_no_number(void)
{
    float f[4];
    thrusts_of(0.02f, f);
    TEST_ASSERT_EQUAL_FLOAT(0.1615f, f[0]);
    TEST_ASSERT_EQUAL_FLOAT(0.1615f, f[3]);
    const float bad[] = {-0.001f, NAN, -INFINITY};
    for (int i = 0; i < 3; i++)
    {
        thrusts_of(bad[i], f);
        for (int k = 0; k < 4; k++)
        {
            TEST_ASSERT_EQUAL_FLOAT(0.0f, f[k]);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_front_pair_shares_the_moment_and_the_rear_pair_is_off);
    RUN_TEST(test_moment_made_is_nose_up_and_of_the_size_asked_for);
    RUN_TEST(test_thrust_is_limited_when_the_moment_is_too_large_or_no_number);
    return UNITY_END();
}
