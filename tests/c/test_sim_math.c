/// @file test_sim_math.c
/// The simulator's functions against libm, which is good to about 1 ulp and is used in tests only.
#include "sim_fixture.h"

enum
{
    N_DRAWS = 200000
};

static double ulps(double a, double b)
{
    const double size = fmax(fabs(b), 2.2250738585072014e-308);
    return fabs(a - b) / (size * 2.220446049250313e-16);
}

static void test_atan2_agrees_with_libm_when_points_are_anywhere(void)
{
    draws_t draws = {1};
    for (int i = 0; i < N_DRAWS; i++)
    {
        // directions of all octants, magnitudes over many decades
        const double scale = pow(10.0, draw(&draws, -12.0, 12.0));
        const double s = scale * draw(&draws, -1.0, 1.0), c = scale * draw(&draws, -1.0, 1.0);
        TEST_ASSERT_LESS_THAN_DOUBLE(4.0, ulps(ivl_sim_atan2(s, c), atan2(s, c)));
    }
}

static void test_atan2_is_exact_when_the_point_lies_on_an_axis_or_at_the_origin(void)
{
    TEST_ASSERT_EQUAL_DOUBLE(0.0, ivl_sim_atan2(0.0, 1.0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, ivl_sim_atan2(0.0, 0.0));
    TEST_ASSERT_EQUAL_DOUBLE(0.5 * IVL_SIM_PI, ivl_sim_atan2(2.0, 0.0));
    TEST_ASSERT_EQUAL_DOUBLE(-0.5 * IVL_SIM_PI, ivl_sim_atan2(-2.0, 0.0));
    TEST_ASSERT_EQUAL_DOUBLE(IVL_SIM_PI, ivl_sim_atan2(0.0, -3.0));
    TEST_ASSERT_EQUAL_DOUBLE(0.25 * IVL_SIM_PI, ivl_sim_atan2(5.0, 5.0));
    TEST_ASSERT_EQUAL_DOUBLE(-0.75 * IVL_SIM_PI, ivl_sim_atan2(-5.0, -5.0));
}

static void test_sincos_agrees_with_libm_when_the_angle_is_within_the_stated_range(void)
{
    draws_t draws = {2};
    for (int i = 0; i < N_DRAWS; i++)
    {
        const double limit = (i % 2) ? 7.0 : 1.0e5;
        const double x = draw(&draws, -limit, limit);
        // absolute: near a multiple of pi the reduction in two parts of pi/2 leaves |n| 2e-21, 1.3e-16 at 1e5
        double s, c;
        ivl_sim_sincos(x, &s, &c);
        TEST_ASSERT_DOUBLE_WITHIN(5.0e-16, sin(x), s);
        TEST_ASSERT_DOUBLE_WITHIN(5.0e-16, cos(x), c);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, 1.0, s * s + c * c);
    }
}

static void test_sincos_is_exact_at_zero(void)
{
    double s, c;
    ivl_sim_sincos(0.0, &s, &c);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, s);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, c);
}

static void test_exp_agrees_with_libm_when_the_argument_is_negative(void)
{
    draws_t draws = {3};
    for (int i = 0; i < N_DRAWS; i++)
    {
        const double x = (i % 2) ? draw(&draws, -699.9, 0.0) : -pow(10.0, draw(&draws, -15.0, 0.0));
        TEST_ASSERT_LESS_THAN_DOUBLE(4.0, ulps(ivl_sim_exp(x), exp(x)));
    }
    TEST_ASSERT_EQUAL_DOUBLE(1.0, ivl_sim_exp(0.0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, ivl_sim_exp(-701.0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, ivl_sim_exp(-(double)INFINITY));
}

static void test_log_agrees_with_libm_when_the_argument_is_positive(void)
{
    draws_t draws = {4};
    for (int i = 0; i < N_DRAWS; i++)
    {
        const double x = (i % 2) ? draw(&draws, 0.5, 2.0) : pow(10.0, draw(&draws, -300.0, 300.0));
        // near 1 the exponent's share cancels when the mantissa lies above sqrt 2: an absolute ulp of ln 2 is left
        TEST_ASSERT_DOUBLE_WITHIN(2.3e-16 * (1.0 + 3.0 * fabs(log(x))), log(x), ivl_sim_log(x));
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.0, ivl_sim_log(1.0));
}

static ivl_wide_t any_function(int which, ivl_wide_t a, ivl_wide_t b)
{
    switch (which)
    {
    case 0:
        return ivl_wide_atan2(a, b);
    case 1:
        return ivl_wide_sqrt(ivl_wide_abs(a));
    case 2:
        return ivl_wide_select(a > b, a, b);
    default:
        return ivl_wide_abs(a) * b - a;
    }
}

static void test_a_lane_has_the_same_bits_when_its_neighbours_hold_anything(void)
{
    draws_t      draws = {5};
    const double odd[] = {0.0, -0.0, 1.0e308, 4.9e-324, (double)INFINITY, (double)NAN};
    for (int i = 0; i < 20000; i++)
    {
        const double a = draw(&draws, -2.0, 2.0), b = draw(&draws, -2.0, 2.0);
        const int    which = i % 4, lane = i / 4 % IVL_SIM_LANES;
        ivl_wide_t   wide_a, wide_b;
        for (int k = 0; k < IVL_SIM_LANES; k++)
        {
            wide_a[k] = odd[draw_u64(&draws) % 6];
            wide_b[k] = odd[draw_u64(&draws) % 6];
        }
        wide_a[lane] = a;
        wide_b[lane] = b;
        const double among = any_function(which, wide_a, wide_b)[lane];
        const double alone = any_function(which, ivl_wide(a), ivl_wide(b))[(lane + 3) % IVL_SIM_LANES];
        TEST_ASSERT_EQUAL_MEMORY(&alone, &among, sizeof alone);
    }
}

static void test_a_mask_is_noticed_in_any_lane(void)
{
    TEST_ASSERT_FALSE(ivl_mask_any(ivl_wide(0.0) > ivl_wide(0.0)));
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_wide_t a = ivl_wide(0.0);
        a[lane] = 1.0;
        TEST_ASSERT_TRUE(ivl_mask_any(a > ivl_wide(0.0)));
    }
}

static void test_rotation_of_a_quaternion_turns_vectors_as_the_product_does(void)
{
    draws_t draws = {6};
    for (int i = 0; i < 2000; i++)
    {
        // v' = v + 2 u x (u x v + w v) for a unit quaternion (u, w); any length must give the same rotation
        double q[4], longer[4];
        draw_quat(&draws, q);
        for (int k = 0; k < 4; k++)
        {
            longer[k] = 1.7 * q[k];
        }
        const ivl_d3_t  u = ivl_d3(q[0], q[1], q[2]), v = draw_d3(&draws, 5.0);
        const ivl_d3_t  inner = ivl_d3_add(ivl_d3_cross(u, v), ivl_d3_scale(q[3], v));
        const ivl_d3_t  expected = ivl_d3_add(v, ivl_d3_scale(2.0, ivl_d3_cross(u, inner)));
        const ivl_rot_t R = ivl_rot_from_quat(longer);
        const ivl_d3_t  found = ivl_rot_apply(&R, v), back = ivl_rot_apply_inverse(&R, found);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, expected.x, found.x);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, expected.y, found.y);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, expected.z, found.z);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, v.x, back.x);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, v.y, back.y);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-14, v.z, back.z);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_atan2_agrees_with_libm_when_points_are_anywhere);
    RUN_TEST(test_atan2_is_exact_when_the_point_lies_on_an_axis_or_at_the_origin);
    RUN_TEST(test_sincos_agrees_with_libm_when_the_angle_is_within_the_stated_range);
    RUN_TEST(test_sincos_is_exact_at_zero);
    RUN_TEST(test_exp_agrees_with_libm_when_the_argument_is_negative);
    RUN_TEST(test_log_agrees_with_libm_when_the_argument_is_positive);
    RUN_TEST(test_a_lane_has_the_same_bits_when_its_neighbours_hold_anything);
    RUN_TEST(test_a_mask_is_noticed_in_any_lane);
    RUN_TEST(test_rotation_of_a_quaternion_turns_vectors_as_the_product_does);
    return UNITY_END();
}
