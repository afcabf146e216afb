/// @file test_sim_rng.c
/// Philox4x32-10 against its published known answers; uniform and normal numbers against their moments.
#include "sim_rng.h"

#include "sim_fixture.h"

enum
{
    N_DRAWS = 100000
};

static void test_philox_gives_the_published_answers(void)
{
    static const struct
    {
        uint32_t counter[4], key[2], out[4];
    } known[] = {
        {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u}},
        {{0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu},
         {0xffffffffu, 0xffffffffu},
         {0x408f276du, 0x41c83b0eu, 0xa20bc7c6u, 0x6d5451fdu}},
        {{0x243f6a88u, 0x85a308d3u, 0x13198a2eu, 0x03707344u},
         {0xa4093822u, 0x299f31d0u},
         {0xd16cfe09u, 0x94fdccebu, 0x5001e420u, 0x24126ea1u}},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
    {
        uint32_t out[4];
        ivl_sim_philox(known[i].counter, known[i].key, out);
        TEST_ASSERT_EQUAL_HEX32_ARRAY(known[i].out, out, 4);
    }
}

static void test_uniform_has_the_moments_of_the_uniform_distribution(void)
{
    const ivl_sim_rng_t rng = {7, 8};
    double              sum = 0.0, square = 0.0;
    for (uint32_t i = 0; i < N_DRAWS; i++)
    {
        const double u = ivl_sim_uniform(&rng, IVL_SIM_DRAW_SENSOR_PHASE, i);
        TEST_ASSERT_TRUE(u > 0.0 && u < 1.0);
        sum += u;
        square += u * u;
    }
    // five standard errors: sqrt(1/12/n), sqrt(4/45/n)
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(1.0 / 12.0 / N_DRAWS), 0.5, sum / N_DRAWS);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(4.0 / 45.0 / N_DRAWS), 1.0 / 3.0, square / N_DRAWS);
}

/// Standard error of the mean of the k-th power of a normal number: sqrt((E x^2k - (E x^k)^2) / n).
static void test_normal_has_the_moments_of_the_normal_distribution(void)
{
    const ivl_sim_rng_t rng = {123456789012345u, 3};
    const double        expected[4] = {0.0, 1.0, 0.0, 3.0}, variance[4] = {1.0, 2.0, 15.0, 96.0};
    double              sum[4] = {0.0}, beyond = 0.0;
    for (uint32_t i = 0; i < N_DRAWS / 4; i++)
    {
        double x[4];
        ivl_sim_normal4(&rng, IVL_SIM_DRAW_POSITION, i, x);
        for (int k = 0; k < 4; k++)
        {
            beyond += (fabs(x[k]) > 1.959963985) ? 1.0 : 0.0;
            for (int power = 0; power < 4; power++)
            {
                sum[power] += pow(x[k], power + 1);
            }
        }
    }
    for (int power = 0; power < 4; power++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(variance[power] / N_DRAWS), expected[power], sum[power] / N_DRAWS);
    }
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(0.05 * 0.95 / N_DRAWS), 0.05, beyond / N_DRAWS);
}

/// Correlation of two sequences of normal numbers, and within one draw of four.
static double correlation(const ivl_sim_rng_t *a, ivl_sim_draw_t purpose_a, int k_a, const ivl_sim_rng_t *b, ivl_sim_draw_t purpose_b,
                          int k_b, uint32_t shift)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < N_DRAWS / 10; i++)
    {
        double x[4], y[4];
        ivl_sim_normal4(a, purpose_a, i, x);
        ivl_sim_normal4(b, purpose_b, i + shift, y);
        sum += x[k_a] * y[k_b];
    }
    return sum / (N_DRAWS / 10);
}

static void test_draws_are_independent_across_purposes_streams_seeds_and_time(void)
{
    const ivl_sim_rng_t rng = {11, 0}, next_stream = {11, 1}, far_stream = {11, (uint64_t)1 << 32}, next_seed = {12, 0},
                        far_seed = {11 + ((uint64_t)1 << 32), 0}, swapped = {0, 11};
    const double        bound = 5.0 / sqrt(N_DRAWS / 10);
    TEST_ASSERT_DOUBLE_WITHIN(bound, 1.0, correlation(&rng, IVL_SIM_DRAW_GYRO, 0, &rng, IVL_SIM_DRAW_GYRO, 0, 0));
    for (int k = 0; k < 4; k++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, 0, &rng, IVL_SIM_DRAW_GYRO, k, 1));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &rng, IVL_SIM_DRAW_ACCEL, k, 0));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &next_stream, IVL_SIM_DRAW_GYRO, k, 0));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &far_stream, IVL_SIM_DRAW_GYRO, k, 0));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &next_seed, IVL_SIM_DRAW_GYRO, k, 0));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &far_seed, IVL_SIM_DRAW_GYRO, k, 0));
        TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_GYRO, k, &swapped, IVL_SIM_DRAW_GYRO, k, 0));
        for (int other = 0; other < k; other++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(bound, 0.0, correlation(&rng, IVL_SIM_DRAW_THRUST, k, &rng, IVL_SIM_DRAW_THRUST, other, 0));
        }
    }
}

static void test_a_draw_depends_on_its_arguments_alone(void)
{
    const ivl_sim_rng_t rng = {5, 6};
    double              first[4], again[4];
    ivl_sim_normal4(&rng, IVL_SIM_DRAW_VELOCITY, 42, first);
    (void)ivl_sim_uniform(&rng, IVL_SIM_DRAW_VELOCITY, 41);
    ivl_sim_normal4(&rng, IVL_SIM_DRAW_VELOCITY, 42, again);
    TEST_ASSERT_EQUAL_MEMORY(first, again, sizeof first);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_philox_gives_the_published_answers);
    RUN_TEST(test_uniform_has_the_moments_of_the_uniform_distribution);
    RUN_TEST(test_normal_has_the_moments_of_the_normal_distribution);
    RUN_TEST(test_draws_are_independent_across_purposes_streams_seeds_and_time);
    RUN_TEST(test_a_draw_depends_on_its_arguments_alone);
    return UNITY_END();
}
