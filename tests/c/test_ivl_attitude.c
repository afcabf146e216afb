/// @file test_ivl_attitude.c
#include "ivl_attitude.h"
#include "test_ivl_support.h"

static const ivl_quat_t LEVEL = {0.0f, 0.0f, 0.0f, 1.0f};
static ivl_attitude_t   attitude;

static float up_z(ivl_quat_t q)
{
    return 1.0f - 2.0f * (q.x * q.x + q.y * q.y);
}

static void test_estimate_is_taken_over_when_it_changes_and_kept_turning_when_it_does_not(void)
{
    const ivl_quat_t rolled = {0.1f, 0.0f, 0.0f, 0.99498744f};
    attitude = (ivl_attitude_t){LEVEL, LEVEL};
    ivl_attitude_update(&attitude, rolled, true, ivl_vec3(0.0f, 10.0f, 0.0f), 0.001f);
    TEST_ASSERT_EQUAL_MEMORY(&rolled, &attitude.q_WB, sizeof rolled);
    for (int i = 0; i < 9; i++)
    {
        ivl_attitude_update(&attitude, rolled, true, ivl_vec3(0.0f, 10.0f, 0.0f), 0.001f);
    }
    // 0.09 rad about b_y on top of the roll
    const float half = 0.045f;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, rolled.w * sinf(half), attitude.q_WB.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, rolled.x * cosf(half), attitude.q_WB.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, rolled.x * sinf(half), attitude.q_WB.z);
}

static void test_half_turn_at_any_rate_that_a_gyro_gives_ends_upside_down(void)
{
    const float rates[] = {1.0f, 10.0f, 34.9f};
    for (int k = 0; k < 3; k++)
    {
        attitude = (ivl_attitude_t){LEVEL, LEVEL};
        const int n = (int)(IVL_PI / (rates[k] * 0.001f) + 0.5f);
        for (int i = 0; i < n; i++)
        {
            // an estimator that jumps about is not followed
            const ivl_quat_t estimate = {0.0f, 0.0f, (float)(i & 1), (float)(1 - (i & 1))};
            ivl_attitude_update(&attitude, estimate, false, ivl_vec3(0.0f, -rates[k], 0.0f), 0.001f);
        }
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, -1.0f, up_z(attitude.q_WB));
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, attitude.q_WB.y * attitude.q_WB.y + attitude.q_WB.w * attitude.q_WB.w);
    }
}

static void test_estimate_that_is_no_number_is_passed_on(void)
{
    attitude = (ivl_attitude_t){LEVEL, LEVEL};
    const ivl_quat_t bad = {NAN, 0.0f, 0.0f, 1.0f};
    for (int i = 0; i < 3; i++)
    {
        ivl_attitude_update(&attitude, bad, true, ivl_vec3(0.0f, 0.0f, 0.0f), 0.001f);
        TEST_ASSERT_TRUE(isnan(attitude.q_WB.x));
    }
    ivl_attitude_update(&attitude, LEVEL, true, ivl_vec3(0.0f, 0.0f, 0.0f), 0.001f);
    TEST_ASSERT_EQUAL_MEMORY(&LEVEL, &attitude.q_WB, sizeof LEVEL);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_estimate_is_taken_over_when_it_changes_and_kept_turning_when_it_does_not);
    RUN_TEST(test_half_turn_at_any_rate_that_a_gyro_gives_ends_upside_down);
    RUN_TEST(test_estimate_that_is_no_number_is_passed_on);
    return UNITY_END();
}
