/// @file test_ivl_filter.c
/// Kalman filter: against textbook matrices in double precision, on motions that it should know exactly, and on anything at all.
#include "ivl_filter.h"

#include "test_ivl_support.h"

// ---- textbook filter in double precision, P as a full matrix

typedef struct
{
    double x[3], P[3][3];
} book_t;

static book_t book_of(const ivl_filter_t *f)
{
    const double U[3][3] = {{1.0, (double)f->u12, (double)f->u13}, {0.0, 1.0, (double)f->u23}, {0.0, 0.0, 1.0}};
    const double D[3] = {(double)f->d1, (double)f->d2, (double)f->d3};
    book_t       b = {.x = {(double)f->d_m, (double)f->v_mps, (double)f->b_mps2}};
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            for (int k = 0; k < 3; k++)
            {
                b.P[i][j] += U[i][k] * D[k] * U[j][k];
            }
        }
    }
    return b;
}

static void book_predict(book_t *b, double t, double dv, double dp, double q)
{
    const double F[3][3] = {{1.0, -t, 0.5 * t * t}, {0.0, 1.0, -t}, {0.0, 0.0, 1.0}}, c = q * fabs(t), g[3] = {-0.5 * t, 1.0, 0.0};
    const double x[3] = {b->x[0], b->x[1], b->x[2]};
    double       FP[3][3] = {{0.0}};
    b->x[0] = x[0] - x[1] * t - dp + 0.5 * x[2] * t * t;
    b->x[1] = x[1] + dv - x[2] * t;
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            FP[i][j] = F[i][0] * b->P[0][j] + F[i][1] * b->P[1][j] + F[i][2] * b->P[2][j];
        }
    }
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            b->P[i][j] = FP[i][0] * F[j][0] + FP[i][1] * F[j][1] + FP[i][2] * F[j][2] + c * g[i] * g[j];
        }
    }
}

static void book_correct(book_t *b, double h1, double h2, double y, double r)
{
    double k[3], s = r;
    for (int i = 0; i < 3; i++)
    {
        k[i] = b->P[i][0] * h1 + b->P[i][1] * h2;
    }
    s += h1 * k[0] + h2 * k[1];
    for (int i = 0; i < 3; i++)
    {
        b->x[i] += k[i] * y / s;
        for (int j = 0; j < 3; j++)
        {
            b->P[i][j] -= k[i] * k[j] / s;
        }
    }
}

static void assert_like(const book_t *expected, const ivl_filter_t *f)
{
    const book_t found = book_of(f);
    for (int i = 0; i < 3; i++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(2.0e-5 * (1.0 + fabs(expected->x[i])), expected->x[i], found.x[i]);
        for (int j = 0; j < 3; j++)
        {
            const double scale = sqrt(expected->P[i][i] * expected->P[j][j]);
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-4 * scale + 1.0e-11, expected->P[i][j], found.P[i][j]);
        }
    }
}

static void test_predictions_and_corrections_are_those_of_the_textbook(void)
{
    rng_t rng = {3};
    for (int run = 0; run < 300; run++)
    {
        ivl_filter_t f;
        ivl_filter_start(&f, rng_float(&rng, 0.5f, 3.0f), rng_float(&rng, -1.0f, 3.0f), rng_float(&rng, 0.1f, 1.0f),
                         rng_float(&rng, 0.02f, 0.5f), rng_float(&rng, 0.05f, 0.5f));
        book_t book = book_of(&f);
        for (int i = 0; i < 20; i++)
        {
            const float t = rng_float(&rng, -0.01f, 0.1f), dv = rng_float(&rng, -0.4f, 0.4f), dp = rng_float(&rng, -0.02f, 0.02f);
            const float q = rng_float(&rng, 1.0e-5f, 1.0e-2f);
            ivl_filter_predict(&f, t, dv, dp, q);
            book_predict(&book, (double)t, (double)dv, (double)dp, (double)q);
            const double later = 0.03;
            book_t       ahead = book;
            book_predict(&ahead, later, 0.0, 0.0, 0.0);
            TEST_ASSERT_FLOAT_WITHIN(2.0e-4f * (float)ahead.P[0][0], (float)ahead.P[0][0], ivl_filter_d_variance(&f, (float)later, 0.0f));
            const ivl_innovation_t in = {rng_float(&rng, -5.0f, 5.0f), (float)rng_below(&rng, 2), rng_float(&rng, -0.05f, 0.05f),
                                         rng_float(&rng, 1.0e-3f, 1.0e-1f)};
            TEST_ASSERT_TRUE(ivl_filter_correct(&f, &in, 100.0f));
            book_correct(&book, (double)in.h1, (double)in.h2, (double)in.y, (double)in.r);
            assert_like(&book, &f);
        }
    }
}

static void test_a_measurement_beyond_the_gate_changes_nothing(void)
{
    ivl_filter_t f;
    ivl_filter_start(&f, 1.0f, 0.0f, 0.3f, 0.05f, 0.15f);
    const ivl_filter_t before = f;
    // the standard deviation of y is sqrt(0.3^2 + 0.4^2) = 0.5
    const float values[] = {2.01f, -2.01f, NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 5; i++)
    {
        const ivl_innovation_t in = {1.0f, 0.0f, values[i], 0.16f};
        TEST_ASSERT_FALSE(ivl_filter_correct(&f, &in, 4.0f));
        TEST_ASSERT_EQUAL_MEMORY(&before, &f, sizeof f);
    }
    const ivl_innovation_t in = {1.0f, 0.0f, 1.99f, 0.16f};
    TEST_ASSERT_TRUE(ivl_filter_correct(&f, &in, 4.0f));
}

// perfect measurements of v / d over a known acceleration, from a wrong start: distance, speed and bias are found
static void test_scale_and_bias_are_learned_while_accelerating(void)
{
    const double a = 3.0, bias = 0.2, d0 = 2.0;
    ivl_filter_t f;
    ivl_filter_start(&f, 1.4f, 0.0f, 0.5f, 0.05f, 0.15f);
    for (int i = 1; i <= 80; i++)
    {
        const double t = 0.01 * i, d = d0 - 0.5 * a * t * t, v = a * t, told = a + bias;
        ivl_filter_predict(&f, 0.01f, (float)(told * 0.01), (float)(0.5 * told * 1.0e-4), 1.0e-6f);
        const float            h = f.v_mps / f.d_m, y = (float)(v / d) * f.d_m - f.v_mps;
        const ivl_innovation_t in = {-h, 1.0f, y, 2.5e-3f * f.d_m * f.d_m};
        (void)ivl_filter_correct(&f, &in, 6.0f);
    }
    const float sigma_m = sqrtf(ivl_filter_d_variance(&f, 0.0f, 0.0f));
    TEST_ASSERT_TRUE(sigma_m < 0.1f);
    TEST_ASSERT_FLOAT_WITHIN(2.0f * sigma_m, (float)(d0 - 0.5 * a * 0.64), f.d_m);
    TEST_ASSERT_FLOAT_WITHIN(0.2f, (float)(a * 0.8), f.v_mps);
    TEST_ASSERT_FLOAT_WITHIN(0.3f, (float)bias, f.b_mps2);
}

// anything at all: D stays positive and finite, so the covariance is symmetric and positive definite, and sigma real
static void test_the_covariance_stays_positive_whatever_comes(void)
{
    rng_t rng = {17};
    for (int run = 0; run < 2000; run++)
    {
        ivl_filter_t f;
        ivl_filter_start(&f, rng_float(&rng, 0.0f, 10.0f), rng_float(&rng, -10.0f, 10.0f), rng_float(&rng, 0.001f, 10.0f),
                         rng_float(&rng, 0.001f, 10.0f), rng_float(&rng, 0.001f, 10.0f));
        const float r_min = (rng_below(&rng, 2) == 0u) ? 1.0e-10f : 1.0e-2f;
        for (int i = 0; i < 60; i++)
        {
            const float t = rng_float(&rng, -0.1f, 0.3f);
            ivl_filter_predict(&f, t, rng_float(&rng, -60.0f, 60.0f), rng_float(&rng, -10.0f, 10.0f), rng_float(&rng, 1.0e-6f, 1.0f));
            const ivl_innovation_t in = {rng_float(&rng, -100.0f, 100.0f), (float)rng_below(&rng, 2), rng_float(&rng, -30.0f, 30.0f),
                                         r_min * rng_float(&rng, 1.0f, 100.0f)};
            (void)ivl_filter_correct(&f, &in, 4.0f);
            TEST_ASSERT_TRUE((f.d1 > 0.0f) && (f.d2 > 0.0f) && (f.d3 > 0.0f));
            TEST_ASSERT_TRUE(isfinite(f.d1) && isfinite(f.d2) && isfinite(f.d3));
            TEST_ASSERT_TRUE(isfinite(f.u12) && isfinite(f.u13) && isfinite(f.u23));
            TEST_ASSERT_TRUE(ivl_filter_d_variance(&f, t, 1.0e-4f) > 0.0f);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_predictions_and_corrections_are_those_of_the_textbook);
    RUN_TEST(test_a_measurement_beyond_the_gate_changes_nothing);
    RUN_TEST(test_scale_and_bias_are_learned_while_accelerating);
    RUN_TEST(test_the_covariance_stays_positive_whatever_comes);
    return UNITY_END();
}
