/// @file test_ivl_math.c
/// Accuracy of the own functions against libm in double precision, and rotation matrices against their definition.
#include "test_ivl_support.h"

// a slow machine takes fewer points of the sweeps
#ifndef SWEEP_STRIDE
#define SWEEP_STRIDE 1
#endif

static void test_sincos_is_within_its_stated_error_when_the_argument_is_in_range(void)
{
    double worst = 0.0;
    for (int i = -1000000; i <= 1000000; i += SWEEP_STRIDE)
    {
        const float        x = (float)i * 1.0e-4f;
        const ivl_sincos_t got = ivl_sincos(x);
        worst = fmax(worst, fabs((double)got.sin - sin((double)x)));
        worst = fmax(worst, fabs((double)got.cos - cos((double)x)));
    }
    TEST_ASSERT_TRUE_MESSAGE(worst < 1.5e-7, "sincos error");
}

static void test_sincos_gives_the_known_answers_of_vertical_and_horizontal(void)
{
    const ivl_sincos_t zero = ivl_sincos(0.0f);
    const ivl_sincos_t up = ivl_sincos(IVL_HALF_PI);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, zero.sin);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 1.0f, zero.cos);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 1.0f, up.sin);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 0.0f, up.cos);
}

static void test_sincos_gives_angle_zero_when_the_argument_is_no_usable_number(void)
{
    const float bad[] = {NAN, INFINITY, -INFINITY, FLT_MAX, 100.1f};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
    {
        const ivl_sincos_t got = ivl_sincos(bad[i]);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, got.sin);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, 1.0f, got.cos);
    }
}

static void test_tan_is_within_its_stated_error_when_the_argument_is_in_range(void)
{
    double worst = 0.0;
    for (int i = -1500000; i <= 1500000; i += SWEEP_STRIDE)
    {
        const float x = (float)i * 1.0e-6f;
        if (fabsf(x) <= 1.5f && i != 0)
        {
            const double truth = tan((double)x);
            worst = fmax(worst, fabs(((double)ivl_tan(x) - truth) / truth));
        }
    }
    TEST_ASSERT_TRUE_MESSAGE(worst < 4.0e-7, "tan error");
}

static void test_tan_is_limited_and_finite_when_the_argument_is_out_of_range(void)
{
    TEST_ASSERT_EQUAL_FLOAT(ivl_tan(1.5f), ivl_tan(3.0f));
    TEST_ASSERT_EQUAL_FLOAT(ivl_tan(-1.5f), ivl_tan(-INFINITY));
    TEST_ASSERT_EQUAL_FLOAT(ivl_tan(-1.5f), ivl_tan(NAN));
    TEST_ASSERT_EQUAL_FLOAT(-ivl_tan(1.2f), ivl_tan(-1.2f));
}

static void test_clamp_gives_the_lower_end_when_the_value_is_nan(void)
{
    TEST_ASSERT_EQUAL_FLOAT(2.0f, ivl_clamp(NAN, 2.0f, 3.0f));
    TEST_ASSERT_EQUAL_FLOAT(2.0f, ivl_clamp(-INFINITY, 2.0f, 3.0f));
    TEST_ASSERT_EQUAL_FLOAT(3.0f, ivl_clamp(INFINITY, 2.0f, 3.0f));
    TEST_ASSERT_EQUAL_FLOAT(2.5f, ivl_clamp(2.5f, 2.0f, 3.0f));
}

static void test_within_is_false_when_the_value_is_no_number(void)
{
    TEST_ASSERT_TRUE(ivl_within(-2.0f, 2.0f));
    TEST_ASSERT_FALSE(ivl_within(2.1f, 2.0f));
    TEST_ASSERT_FALSE(ivl_within(NAN, FLT_MAX));
    TEST_ASSERT_FALSE(ivl_within(INFINITY, FLT_MAX));
    TEST_ASSERT_FALSE(ivl_vec3_within(ivl_vec3(0.0f, NAN, 0.0f), 1.0f));
    TEST_ASSERT_FALSE(ivl_vec3_within(ivl_vec3(0.0f, 0.0f, -1.5f), 1.0f));
    TEST_ASSERT_TRUE(ivl_vec3_within(ivl_vec3(1.0f, -1.0f, 0.0f), 1.0f));
}

static void test_axes_are_right_when_the_body_is_nose_up(void)
{
    // a nose-up quarter turn is a rotation by -90 degrees about y: x points up, z points back
    const float      h = 0.70710678f;
    const ivl_axes_t r = ivl_axes_of((ivl_quat_t){0.0f, -h, 0.0f, h});
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, r.x.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, r.y.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -1.0f, r.z.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, r.z.z);
}

static void assert_vec3_near(ivl_vec3_t expected, ivl_vec3_t got)
{
    TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, expected.x, got.x);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, expected.y, got.y);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, expected.z, got.z);
}

static void test_axes_are_orthonormal_and_right_handed_for_random_attitudes(void)
{
    rng_t rng = {1};
    for (int i = 0; i < 10000; i++)
    {
        const ivl_axes_t r = ivl_axes_of(rng_quat(&rng));
        assert_vec3_near(r.z, ivl_cross(r.x, r.y));
        assert_vec3_near(r.x, ivl_cross(r.y, r.z));
        TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, 0.0f, ivl_dot(r.x, r.y));
        TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, 1.0f, ivl_dot(r.z, r.z));
    }
}

static void test_axes_turn_vectors_as_the_quaternion_product_does(void)
{
    rng_t rng = {2};
    for (int i = 0; i < 10000; i++)
    {
        const ivl_quat_t q = rng_quat(&rng);
        const ivl_vec3_t a = rng_vec3(&rng, 1.0f);
        const ivl_vec3_t u = {q.x, q.y, q.z};
        // v' = v + 2 u x (u x v + w v)
        const ivl_vec3_t turned = ivl_add(a, ivl_scale(ivl_cross(u, ivl_add(ivl_cross(u, a), ivl_scale(a, q.w))), 2.0f));
        const ivl_axes_t r = ivl_axes_of(q);
        assert_vec3_near(turned, ivl_add(ivl_scale(r.x, a.x), ivl_add(ivl_scale(r.y, a.y), ivl_scale(r.z, a.z))));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sincos_is_within_its_stated_error_when_the_argument_is_in_range);
    RUN_TEST(test_sincos_gives_the_known_answers_of_vertical_and_horizontal);
    RUN_TEST(test_sincos_gives_angle_zero_when_the_argument_is_no_usable_number);
    RUN_TEST(test_tan_is_within_its_stated_error_when_the_argument_is_in_range);
    RUN_TEST(test_tan_is_limited_and_finite_when_the_argument_is_out_of_range);
    RUN_TEST(test_clamp_gives_the_lower_end_when_the_value_is_nan);
    RUN_TEST(test_within_is_false_when_the_value_is_no_number);
    RUN_TEST(test_axes_are_right_when_the_body_is_nose_up);
    RUN_TEST(test_axes_are_orthonormal_and_right_handed_for_random_attitudes);
    RUN_TEST(test_axes_turn_vectors_as_the_quaternion_product_does);
    return UNITY_END();
}
