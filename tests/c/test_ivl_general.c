/// @file test_ivl_general.c
/// The forms for every approach: against the same formulas in double precision, and what must hold whatever the numbers.
#include "ivl_general.h"

#include "ivl_math.h"
#include "test_ivl_support.h"

static const ivl_form_t *const GENERAL[] = {&ivl_form_polynomial2, &ivl_form_polynomial3, &ivl_form_bilinear};
static const int               N_THRESHOLD[] = {6, 10, 30};
#define N_GENERAL (sizeof GENERAL / sizeof GENERAL[0])

static ivl_seen_t seen_at(float vx, float vz, float d)
{
    return (ivl_seen_t){.ceiling = {.valid = true, .d_ceil_m = d}, .cues = {.valid = true, .rrev_per_s = vz / d, .of_y_radps = -vx / d}};
}

static void random_theta(const ivl_form_t *form, rng_t *rng, float theta[])
{
    for (uint32_t i = 0; i < form->n_params; i++)
    {
        const ivl_form_group_t *group = ivl_form_group_of(form, i);
        theta[i] = rng_float(rng, group->lo, group->hi);
    }
}

// ---- the same in double precision, term by term

static double power(double x, int n)
{
    double product = 1.0;
    for (int i = 0; i < n; i++)
    {
        product *= x;
    }
    return product;
}

static double polynomial(const float c[], int n, double x, double z)
{
    static const int EXPONENTS[10][2] = {{0, 0}, {1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}, {3, 0}, {2, 1}, {1, 2}, {0, 3}};
    double           sum = 0.0;
    for (int i = 0; i < n; i++)
    {
        sum += (double)c[i] * power(x, EXPONENTS[i][0]) * power(z, EXPONENTS[i][1]);
    }
    return sum;
}

static double limited(double x, double lo, double hi)
{
    return (x < lo) ? lo : ((x > hi) ? hi : x);
}

/// Weights of the four nodes around a place: a tent of width one step at each node.
static double table(const float nodes[], double vx, double vz)
{
    const double sx = limited(vx, 0.0, 4.0), sz = limited(vz * 1.25, 0.0, 5.0);
    double       sum = 0.0;
    for (int i = 0; i < 5; i++)
    {
        for (int j = 0; j < 6; j++)
        {
            const double wx = 1.0 - fabs(sx - i), wz = 1.0 - fabs(sz - j);
            sum += (wx > 0.0 && wz > 0.0) ? wx * wz * (double)nodes[6 * i + j] : 0.0;
        }
    }
    return sum;
}

static double threshold(size_t which, const float theta[], double vx, double vz)
{
    const double x = (vx - 1.4) / 2.0, z = (vz - 1.6) / 2.0;
    return limited((N_THRESHOLD[which] == 30) ? table(theta, vx, vz) : polynomial(theta, N_THRESHOLD[which], x, z), 0.5, 20.0);
}

static void test_actions_are_those_of_the_formulas(void)
{
    rng_t rng = {5};
    float theta[IVL_FORM_PARAMS_MAX];
    for (int trial = 0; trial < 30000; trial++)
    {
        const size_t      which = (size_t)trial % N_GENERAL;
        const ivl_form_t *form = GENERAL[which];
        random_theta(form, &rng, theta);
        const float *rest = theta + N_THRESHOLD[which];
        for (int i = 4; i < 14; i++)
        {
            theta[N_THRESHOLD[which] + i] *= 0.02f;  // log-odds that are neither sure
        }
        const float        vx = rng_float(&rng, -1.0f, 6.0f), vz = rng_float(&rng, 0.01f, 6.0f), d = rng_float(&rng, 0.02f, 3.0f);
        const ivl_seen_t   seen = seen_at(vx, vz, d);
        const double       ux = limited((double)vx, 0.0, 5.0), uz = limited((double)vz, 0.0, 5.0);
        const double       x = (ux - 1.4) / 2.0, z = (uz - 1.6) / 2.0;
        const ivl_action_t action = form->decide(theta, &seen);
        const double       r_star = threshold(which, theta, ux, uz), margin = (double)seen.cues.rrev_per_s - r_star;
        // single precision may decide otherwise within its rounding
        TEST_ASSERT_TRUE(fabs(margin) < 2.0e-3 || action.flip == (margin > 0.0));
        const double m = (double)rest[0] + (double)rest[1] * x + (double)rest[2] * z;
        TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, (float)((m > 0.0) ? m : 0.0), action.moment_Nm);
        const double p = 1.0 / (1.0 + exp(-polynomial(rest + 4, 10, x, z)));
        TEST_ASSERT_FLOAT_WITHIN(2.0e-5f, (float)p, action.p_land);
        TEST_ASSERT_TRUE(fabs(p - (double)rest[3]) < 3.0e-5 || action.go == (p > (double)rest[3]));
    }
}

/// Whatever is seen, bad numbers included, a good policy keeps its announced moment, and flips nowhere below the least threshold.
static void test_whatever_is_seen_the_action_is_within_its_bounds(void)
{
    static const float ODD[] = {0.0f, -0.0f, 1.0e-30f, -1.0e30f, 1.0e30f, INFINITY, -INFINITY, NAN};
    rng_t              rng = {6};
    float              theta[IVL_FORM_PARAMS_MAX];
    for (int trial = 0; trial < 30000; trial++)
    {
        const ivl_form_t *form = GENERAL[(size_t)trial % N_GENERAL];
        random_theta(form, &rng, theta);
        ivl_seen_t seen = seen_at(rng_float(&rng, -9.0f, 9.0f), rng_float(&rng, -9.0f, 9.0f), rng_float(&rng, 0.01f, 5.0f));
        float     *fields[] = {&seen.ceiling.d_ceil_m, &seen.cues.rrev_per_s, &seen.cues.of_y_radps};
        *fields[trial % 3] = ODD[rng_below(&rng, 8u)];
        const ivl_action_t action = form->decide(theta, &seen);
        TEST_ASSERT_TRUE(action.moment_Nm >= 0.0f && action.moment_Nm <= form->moment_most_Nm(theta) * 1.000001f);
        TEST_ASSERT_TRUE(action.p_land >= 0.0f && action.p_land <= 1.0f);
        TEST_ASSERT_FALSE(action.flip && !(seen.cues.rrev_per_s >= 0.5f));
    }
}

static void test_a_table_is_continuous_and_exact_at_its_nodes(void)
{
    rng_t rng = {7};
    float theta[IVL_FORM_PARAMS_MAX];
    random_theta(&ivl_form_bilinear, &rng, theta);
    for (int i = 0; i < 5; i++)
    {
        for (int j = 1; j < 6; j++)
        {
            // at a node the threshold is the node: a little less RREV does not flip, a little more does
            const float vx = (float)i, vz = 0.8f * (float)j, node = theta[6 * i + j];
            for (int side = -1; side <= 1; side += 2)
            {
                const float      rrev = node * (1.0f + 1.0e-4f * (float)side);
                const ivl_seen_t seen = seen_at(vx, vz, vz / rrev);
                TEST_ASSERT_EQUAL_INT(side > 0, ivl_form_bilinear.decide(theta, &seen).flip);
            }
        }
    }
}

static void test_logistic_is_that_of_double_precision(void)
{
    for (int i = -400000; i <= 400000; i++)
    {
        const float x = (float)i * 1.0e-4f;
        TEST_ASSERT_FLOAT_WITHIN(2.0e-7f, (float)(1.0 / (1.0 + exp(-(double)x))), ivl_logistic(x));
    }
    TEST_ASSERT_EQUAL_FLOAT(0.5f, ivl_logistic(0.0f));
    TEST_ASSERT_TRUE(ivl_logistic(INFINITY) > 0.999999f && ivl_logistic(INFINITY) <= 1.0f);
    TEST_ASSERT_TRUE(ivl_logistic(-INFINITY) < 1.0e-6f && ivl_logistic(NAN) < 1.0e-6f);
}

static void test_every_parameter_has_a_group_and_no_more(void)
{
    for (uint32_t number = 0; ivl_form(number) != NULL; number++)
    {
        const ivl_form_t *form = ivl_form(number);
        uint32_t          n = 0;
        for (uint32_t g = 0; g < form->n_groups; g++)
        {
            n += form->groups[g].n;
        }
        TEST_ASSERT_EQUAL_UINT32(form->n_params, n);
        TEST_ASSERT_NOT_NULL(ivl_form_group_of(form, n - 1u));
        TEST_ASSERT_NULL(ivl_form_group_of(form, n));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_actions_are_those_of_the_formulas);
    RUN_TEST(test_whatever_is_seen_the_action_is_within_its_bounds);
    RUN_TEST(test_a_table_is_continuous_and_exact_at_its_nodes);
    RUN_TEST(test_logistic_is_that_of_double_precision);
    RUN_TEST(test_every_parameter_has_a_group_and_no_more);
    return UNITY_END();
}
