/// @file test_ivl_mixer.c
#include "test_ivl_support.h"

static ivl_cfg_t cfg;

void setUp(void);
void setUp(void)
{
    ivl_cfg_defaults(&cfg);
}

static ivl_wrench_t wrench_of(float thrust_N, float mx_Nm, float my_Nm, float mz_Nm)
{
    return (ivl_wrench_t){.thrust_N = thrust_N, .moment_B_Nm = {mx_Nm, my_Nm, mz_Nm}};
}

static ivl_wrench_t mixed_back(ivl_wrench_t asked, float f[4])
{
    ivl_mixer_thrusts(&cfg, &asked, f);
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_TRUE((f[i] >= 0.0f) && (f[i] <= cfg.motor_thrust_N_max));
    }
    return ivl_mixer_wrench(&cfg, f);
}

static void test_each_axis_drives_the_motors_of_the_layout(void)
{
    float f[4];
    // 3.3 N mm of roll: 25 mN per motor on the left side (M3, M4), less on the right
    mixed_back(wrench_of(0.4f, 0.0033f, 0.0f, 0.0f), f);
    const float roll[4] = {0.075f, 0.075f, 0.125f, 0.125f};
    // nose down: the rear pair (M2, M3) pushes
    float p[4];
    mixed_back(wrench_of(0.4f, 0.0f, 0.0033f, 0.0f), p);
    const float pitch[4] = {0.075f, 0.125f, 0.125f, 0.075f};
    // yaw: M2 and M4
    float y[4];
    mixed_back(wrench_of(0.4f, 0.0f, 0.0f, 0.000612f), y);
    const float yaw[4] = {0.075f, 0.125f, 0.075f, 0.125f};
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, roll[i], f[i]);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, pitch[i], p[i]);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, yaw[i], y[i]);
    }
}

static void test_mixing_back_gives_the_wrench_when_nothing_saturates(void)
{
    rng_t rng = {7};
    for (int i = 0; i < 10000; i++)
    {
        // each share of a motor stays below a third of the room around half thrust
        const ivl_wrench_t asked = wrench_of(rng_float(&rng, 0.28f, 0.36f), rng_float(&rng, -0.003f, 0.003f),
                                             rng_float(&rng, -0.003f, 0.003f), rng_float(&rng, -0.0005f, 0.0005f));
        float              f[4];
        const ivl_wrench_t made = mixed_back(asked, f);
        TEST_ASSERT_FLOAT_WITHIN(2.0e-7f, asked.thrust_N, made.thrust_N);
        TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, asked.moment_B_Nm.x, made.moment_B_Nm.x);
        TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, asked.moment_B_Nm.y, made.moment_B_Nm.y);
        TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, asked.moment_B_Nm.z, made.moment_B_Nm.z);
    }
}

static void test_yaw_is_given_up_first(void)
{
    float              f[4];
    const ivl_wrench_t asked = wrench_of(0.3f, 0.004f, -0.003f, 0.01f);
    const ivl_wrench_t made = mixed_back(asked, f);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-7f, asked.thrust_N, made.thrust_N);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, asked.moment_B_Nm.x, made.moment_B_Nm.x);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, asked.moment_B_Nm.y, made.moment_B_Nm.y);
    TEST_ASSERT_TRUE((made.moment_B_Nm.z > 0.0f) && (made.moment_B_Nm.z < asked.moment_B_Nm.z));
    // as much yaw as fits: one motor is at a limit
    bool at_limit = false;
    for (int i = 0; i < 4; i++)
    {
        at_limit = at_limit || (f[i] < 1.0e-7f) || (f[i] > cfg.motor_thrust_N_max - 1.0e-7f);
    }
    TEST_ASSERT_TRUE(at_limit);
}

static void test_collective_falls_when_motors_are_full_and_roll_and_pitch_are_kept(void)
{
    float              f[4];
    const ivl_wrench_t made = mixed_back(wrench_of(1.0f, 0.002f, 0.001f, 0.0f), f);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, 0.002f, made.moment_B_Nm.x);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, 0.001f, made.moment_B_Nm.y);
    // per motor 0.1615 - (0.002 + 0.001) / (4 * 0.033)
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 4.0f * (0.1615f - 0.003f / 0.132f), made.thrust_N);
}

static void test_roll_and_pitch_are_scaled_together_when_they_cannot_fit(void)
{
    float              f[4];
    const ivl_wrench_t made = mixed_back(wrench_of(0.1f, 0.02f, -0.01f, 0.0f), f);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-7f, 0.1f, made.thrust_N);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -2.0f, made.moment_B_Nm.x / made.moment_B_Nm.y);
    // the whole collective goes into them: |roll| + |pitch| shares are a quarter of 0.1 N
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 0.025f, (made.moment_B_Nm.x - made.moment_B_Nm.y) / 0.132f);
}

static void test_motors_are_off_when_no_thrust_is_asked_for(void)
{
    float              f[4];
    const ivl_wrench_t made = mixed_back(wrench_of(0.0f, 0.01f, 0.01f, 0.01f), f);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, made.thrust_N);
    mixed_back(wrench_of(-1.0f, 0.01f, 0.01f, 0.01f), f);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, f[0] + f[1] + f[2] + f[3]);
}

static void test_priorities_hold_for_random_wrenches(void)
{
    rng_t rng = {8};
    for (int i = 0; i < 100000; i++)
    {
        const ivl_wrench_t asked = wrench_of(rng_float(&rng, -0.2f, 1.5f), rng_float(&rng, -0.02f, 0.02f), rng_float(&rng, -0.02f, 0.02f),
                                             rng_float(&rng, -0.02f, 0.02f));
        float              f[4];
        const ivl_wrench_t made = mixed_back(asked, f);
        const float        limit = (asked.thrust_N > 0.0f) ? asked.thrust_N : 0.0f;
        TEST_ASSERT_TRUE(made.thrust_N <= limit + 1.0e-6f);
        // moments keep their sign and never exceed what was asked for
        TEST_ASSERT_TRUE(made.moment_B_Nm.x * asked.moment_B_Nm.x >= -1.0e-9f);
        TEST_ASSERT_TRUE(made.moment_B_Nm.y * asked.moment_B_Nm.y >= -1.0e-9f);
        TEST_ASSERT_TRUE(made.moment_B_Nm.z * asked.moment_B_Nm.z >= -1.0e-9f);
        TEST_ASSERT_TRUE(fabsf(made.moment_B_Nm.x) <= fabsf(asked.moment_B_Nm.x) + 2.0e-8f);
        TEST_ASSERT_TRUE(fabsf(made.moment_B_Nm.y) <= fabsf(asked.moment_B_Nm.y) + 2.0e-8f);
        TEST_ASSERT_TRUE(fabsf(made.moment_B_Nm.z) <= fabsf(asked.moment_B_Nm.z) + 2.0e-8f);
        // roll and pitch in the proportion asked for
        const float cross = made.moment_B_Nm.x * asked.moment_B_Nm.y - made.moment_B_Nm.y * asked.moment_B_Nm.x;
        TEST_ASSERT_FLOAT_WITHIN(1.0e-9f, 0.0f, cross);
    }
}

static void test_thrusts_are_in_range_when_the_wrench_is_no_number(void)
{
    const float bad[] = {NAN, INFINITY, -INFINITY, FLT_MAX};
    for (int i = 0; i < 4; i++)
    {
        float f[4];
        mixed_back(wrench_of(bad[i], 0.0f, 0.0f, 0.0f), f);
        mixed_back(wrench_of(0.3f, bad[i], 0.0f, 0.0f), f);
        mixed_back(wrench_of(0.3f, 0.0f, bad[i], 0.0f), f);
        mixed_back(wrench_of(0.3f, 0.0f, 0.0f, bad[i]), f);
        mixed_back(wrench_of(bad[i], bad[i], bad[i], bad[i]), f);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_axis_drives_the_motors_of_the_layout);
    RUN_TEST(test_mixing_back_gives_the_wrench_when_nothing_saturates);
    RUN_TEST(test_yaw_is_given_up_first);
    RUN_TEST(test_collective_falls_when_motors_are_full_and_roll_and_pitch_are_kept);
    RUN_TEST(test_roll_and_pitch_are_scaled_together_when_they_cannot_fit);
    RUN_TEST(test_motors_are_off_when_no_thrust_is_asked_for);
    RUN_TEST(test_priorities_hold_for_random_wrenches);
    RUN_TEST(test_thrusts_are_in_range_when_the_wrench_is_no_number);
    return UNITY_END();
}
