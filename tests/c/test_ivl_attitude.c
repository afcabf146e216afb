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

/// Third column of the attitude's matrix and first one, in double: enough to tell any two attitudes apart.
static void axes_of(const double q[4], double axes[6])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double of[6] = {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w),
                          2.0 * (x * z + y * w),       2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)};
    memcpy(axes, of, sizeof of);
}

/// Vector u turned by an angle about a unit vector k: Rodrigues' formula.
static void turn_about(const double k[3], double angle, double u[3])
{
    const double c = cos(angle), s = sin(angle), along = (1.0 - c) * (k[0] * u[0] + k[1] * u[1] + k[2] * u[2]);
    const double turned[3] = {c * u[0] + s * (k[1] * u[2] - k[2] * u[1]) + along * k[0],
                              c * u[1] + s * (k[2] * u[0] - k[0] * u[2]) + along * k[1],
                              c * u[2] + s * (k[0] * u[1] - k[1] * u[0]) + along * k[2]};
    memcpy(u, turned, sizeof turned);
}

static void test_any_attitude_turns_about_any_axis_of_the_body_as_a_rigid_body_does(void)
{
    rng_t rng = {31};
    for (int i = 0; i < 500; i++)
    {
        const ivl_quat_t q0 = rng_quat(&rng);
        const ivl_vec3_t w = rng_vec3(&rng, 30.0f);
        attitude = (ivl_attitude_t){q0, q0};
        for (int n = 0; n < 20; n++)
        {
            ivl_attitude_update(&attitude, q0, true, w, 0.001f);
        }
        // the axis is one of the body, so in W it is turned as the body is; both axes of the body turn about it
        const double q[4] = {(double)q0.x, (double)q0.y, (double)q0.z, (double)q0.w};
        const double rate = sqrt((double)ivl_dot(w, w));
        double       before[6], after[6], y[3], k[3];
        axes_of(q, before);
        y[0] = before[4] * before[2] - before[5] * before[1];
        y[1] = before[5] * before[0] - before[3] * before[2];
        y[2] = before[3] * before[1] - before[4] * before[0];
        for (int c = 0; c < 3; c++)
        {
            k[c] = ((double)w.x * before[c] + (double)w.y * y[c] + (double)w.z * before[3 + c]) / rate;
        }
        turn_about(k, 0.02 * rate, before);
        turn_about(k, 0.02 * rate, before + 3);
        const double now[4] = {(double)attitude.q_WB.x, (double)attitude.q_WB.y, (double)attitude.q_WB.z, (double)attitude.q_WB.w};
        axes_of(now, after);
        for (int c = 0; c < 6; c++)
        {
            TEST_ASSERT_FLOAT_WITHIN(5.0e-4f, (float)before[c], (float)after[c]);
        }
    }
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
    RUN_TEST(test_any_attitude_turns_about_any_axis_of_the_body_as_a_rigid_body_does);
    RUN_TEST(test_half_turn_at_any_rate_that_a_gyro_gives_ends_upside_down);
    RUN_TEST(test_estimate_that_is_no_number_is_passed_on);
    return UNITY_END();
}
