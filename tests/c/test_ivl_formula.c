/// @file test_ivl_formula.c
/// The paper's formula where it is exact, its guards, and what the low-passes in front of it do.
#include "ivl_formula.h"

#include "test_ivl_support.h"

static ivl_cfg_t cfg;

void setUp(void);
void tearDown(void);

void setUp(void)
{
    ivl_cfg_defaults(&cfg);
}

void tearDown(void)
{
}

// z'' constant: RREV' = z''/d + RREV^2 exactly, at every instant
static void test_the_formula_is_exact_for_any_motion_with_acceleration(void)
{
    rng_t rng = {5};
    for (int i = 0; i < 5000; i++)
    {
        const double d = (double)rng_float(&rng, 0.05f, 4.0f), v = (double)rng_float(&rng, -3.0f, 5.0f);
        const double a = (double)rng_float(&rng, 0.6f, 12.0f) * ((rng_below(&rng, 2) == 0u) ? 1.0 : -1.0);
        const double rrev = v / d, rate = a / d + rrev * rrev;
        if (fabs(a / d) < 0.6 || fabs(a / d) < 1.0e-2 * rrev * rrev)
        {
            continue;  // a difference of large numbers: the guard's business
        }
        const ivl_formula_distance_t found = ivl_formula_compute(&cfg, (float)rrev, (float)rate, (float)a, 0.0f, 0.0f, 0.0f);
        TEST_ASSERT_TRUE(found.valid);
        TEST_ASSERT_FLOAT_WITHIN((float)(1.0e-4 * d), (float)d, found.d_m);
        TEST_ASSERT_TRUE(found.sigma_m >= 0.0f);
    }
}

static void test_sigma_is_that_of_the_propagated_errors(void)
{
    // d = 2 / (6.25 - 1.5^2) = 0.5; dd/da = 1/4, dd/drate = -d/4, dd/drrev = d 2 rrev / 4
    const ivl_formula_distance_t found = ivl_formula_compute(&cfg, 1.5f, 6.25f, 2.0f, 0.01f, 0.04f, 0.09f);
    const float                  expected = sqrtf(0.09f / 16.0f + 0.25f * 0.04f / 16.0f + 0.25f * 9.0f * 0.01f / 16.0f);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, found.d_m);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, expected, found.sigma_m);
}

static void test_guards(void)
{
    // constant speed: 0/0
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 5.0f, 25.0f, 0.0f, 0.0f, 0.0f, 0.0f).valid);
    // too little acceleration, too small a denominator, a ceiling behind, numbers that are none
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, 3.0f, 0.49f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, 1.4f, 4.0f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, 0.0f, 4.0f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, NAN, 9.0f, 4.0f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, NAN, 4.0f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, 9.0f, NAN, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_TRUE(ivl_formula_compute(&cfg, 1.0f, 9.0f, 4.0f, 0.0f, 0.0f, 0.0f).valid);
    // without a limit of the acceleration there is no distance without acceleration all the same
    cfg.accel_mps2_min = 0.0f;
    TEST_ASSERT_FALSE(ivl_formula_compute(&cfg, 1.0f, 9.0f, 0.0f, 0.0f, 0.0f, 0.0f).valid);
    TEST_ASSERT_TRUE(ivl_formula_compute(&cfg, 1.0f, 9.0f, 0.1f, 0.0f, 0.0f, 0.0f).valid);
}

// RREV of a motion with constant acceleration, sampled: what the low-passes show is the distance of some time ago
static float followed(float period_s, float tau_s, float a_mps2, double *d_then)
{
    ivl_formula_t formula;
    cfg.rrev_tau_s = tau_s;
    ivl_formula_start(&formula);
    double t = 0.0;
    for (int i = 0; i * (double)period_s < 0.6; i++)
    {
        t = (double)period_s * i;
        ivl_formula_push(&cfg, &formula, (float)((double)a_mps2 * t / (2.0 - 0.5 * (double)a_mps2 * t * t)), period_s, a_mps2);
    }
    t -= 0.5 * (double)period_s + (double)tau_s;
    *d_then = 2.0 - 0.5 * (double)a_mps2 * t * t;
    const ivl_formula_distance_t found = ivl_formula_distance(&cfg, &formula);
    TEST_ASSERT_TRUE(found.valid);
    return found.d_m;
}

static void test_sampled_rrev_gives_the_distance_of_a_stated_time_ago(void)
{
    double      d_then;
    const float fast_m = followed(0.001f, 0.0f, 4.0f, &d_then);
    TEST_ASSERT_FLOAT_WITHIN(0.01f * (float)d_then, (float)d_then, fast_m);
    const float slow_m = followed(0.02f, 0.04f, 4.0f, &d_then);
    TEST_ASSERT_FLOAT_WITHIN(0.06f * (float)d_then, (float)d_then, slow_m);
}

static void test_nothing_is_told_before_the_low_passes_have_settled(void)
{
    ivl_formula_t formula;
    ivl_formula_start(&formula);
    // n readings span n - 1 periods; 3 tau are 6 of them
    for (int i = 0; i < 16; i++)
    {
        if (i != 7)
        {
            TEST_ASSERT_EQUAL_INT(i > 7, ivl_formula_distance(&cfg, &formula).valid);
        }
        ivl_formula_push(&cfg, &formula, 0.1f * (float)i, 0.02f, 4.0f);
    }
}

static void test_two_readings_are_too_few_however_far_apart_they_are(void)
{
    ivl_formula_t formula;
    ivl_formula_start(&formula);
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_EQUAL_INT(i > 2, ivl_formula_distance(&cfg, &formula).valid);
        ivl_formula_push(&cfg, &formula, 0.3f * (float)i, 0.3f, 4.0f);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_formula_is_exact_for_any_motion_with_acceleration);
    RUN_TEST(test_sigma_is_that_of_the_propagated_errors);
    RUN_TEST(test_guards);
    RUN_TEST(test_sampled_rrev_gives_the_distance_of_a_stated_time_ago);
    RUN_TEST(test_nothing_is_told_before_the_low_passes_have_settled);
    RUN_TEST(test_two_readings_are_too_few_however_far_apart_they_are);
    return UNITY_END();
}
