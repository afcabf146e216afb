/// @file test_ivl_pwm.c
#include "test_ivl_support.h"

static ivl_cfg_t cfg;

void setUp(void);
void setUp(void)
{
    ivl_cfg_defaults(&cfg);
}

static uint16_t pwm_of(float thrust_N)
{
    const float f[4] = {0.0f, thrust_N, 0.0f, 0.0f};
    uint16_t    pwm[4];
    ivl_pwm_of_thrust(&cfg, f, pwm);
    TEST_ASSERT_EQUAL_UINT16(0, pwm[0]);
    TEST_ASSERT_EQUAL_UINT16(0, pwm[2]);
    TEST_ASSERT_EQUAL_UINT16(0, pwm[3]);
    return pwm[1];
}

static void test_pwm_is_that_of_the_curve_in_double_precision(void)
{
    for (int i = 1; i <= 1615; i++)
    {
        const double thrust_N = (double)i * 1.0e-4;
        const double f_gf = thrust_N / 9.80665 * 1000.0;
        double       pwm = 3.31e4 * tan((f_gf - 8.72) / 11.2) + 3.26e4;
        pwm = fmin(fmax(pwm, 0.0), 60000.0);
        TEST_ASSERT_DOUBLE_WITHIN(1.02, pwm, (double)pwm_of((float)thrust_N));
    }
}

static void test_pwm_has_the_known_value_in_the_middle_of_the_curve(void)
{
    // 8.72 gf = 0.0855140 N: the tangent is zero
    TEST_ASSERT_UINT16_WITHIN(1, 32600, pwm_of(0.0855140f));
}

static void test_pwm_rises_with_thrust(void)
{
    uint16_t last = 0;
    for (int i = 1; i <= 1615; i++)
    {
        const uint16_t now = pwm_of((float)i * 1.0e-4f);
        TEST_ASSERT_TRUE(now >= last);
        last = now;
    }
    TEST_ASSERT_TRUE(last > 59000u);
}

static void test_pwm_is_zero_when_thrust_is_zero_or_no_number(void)
{
    cfg.pwm_d = 40000.0f;  // a curve that does not pass through the origin
    TEST_ASSERT_TRUE(pwm_of(1.0e-6f) > 7000u);
    TEST_ASSERT_EQUAL_UINT16(0, pwm_of(0.0f));
    TEST_ASSERT_EQUAL_UINT16(0, pwm_of(-0.1f));
    TEST_ASSERT_EQUAL_UINT16(0, pwm_of(NAN));
    TEST_ASSERT_EQUAL_UINT16(0, pwm_of(-INFINITY));
}

static void test_pwm_is_limited_when_thrust_is_too_large(void)
{
    TEST_ASSERT_EQUAL_UINT16(60000, pwm_of(10.0f));
    TEST_ASSERT_EQUAL_UINT16(60000, pwm_of(INFINITY));
    cfg.pwm_max = 65535.0f;
    TEST_ASSERT_EQUAL_UINT16(65535, pwm_of(INFINITY));
}

static void test_curve_is_refused_near_the_pole(void)
{
    TEST_ASSERT_TRUE(ivl_pwm_curve_good(&cfg));
    cfg.pwm_b_gf = -8.72f;
    TEST_ASSERT_FALSE(ivl_pwm_curve_good(&cfg));
    cfg.pwm_b_gf = NAN;
    TEST_ASSERT_FALSE(ivl_pwm_curve_good(&cfg));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pwm_is_that_of_the_curve_in_double_precision);
    RUN_TEST(test_pwm_has_the_known_value_in_the_middle_of_the_curve);
    RUN_TEST(test_pwm_rises_with_thrust);
    RUN_TEST(test_pwm_is_zero_when_thrust_is_zero_or_no_number);
    RUN_TEST(test_pwm_is_limited_when_thrust_is_too_large);
    RUN_TEST(test_curve_is_refused_near_the_pole);
    return UNITY_END();
}
