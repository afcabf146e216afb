/// @file test_ivl_handover.c
#include "ivl_handover.h"
#include "test_ivl_support.h"

static ivl_handover_t handover;

static void test_sum_starts_at_the_old_thrust_and_ends_at_the_new_one_without_a_step(void)
{
    const float pairs[][2] = {{0.6f, 0.5f}, {0.3f, 0.8f}};
    for (int k = 0; k < 2; k++)
    {
        const float from = pairs[k][0], to = pairs[k][1];
        ivl_handover_begin(&handover, from, to, 0.3f, 0.001f);
        float last = to + ivl_handover_next(&handover);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, from, last);
        for (int i = 0; i < 299; i++)
        {
            const float now = to + ivl_handover_next(&handover);
            TEST_ASSERT_TRUE(fabsf(now - last) <= 1.01f * fabsf(from - to) / 300.0f);
            TEST_ASSERT_TRUE(fabsf(now - to) < fabsf(last - to));
            last = now;
        }
        (void)ivl_handover_next(&handover);
        for (int i = 0; i < 10; i++)
        {
            TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, ivl_handover_next(&handover));
        }
    }
}

static void test_nothing_fades_when_a_side_has_its_motors_off_or_is_no_number(void)
{
    const float bad[][2] = {{0.0f, 0.5f}, {0.5f, 0.0f}, {NAN, 0.5f}, {0.5f, NAN}, {INFINITY, 0.5f}, {0.5f, 1.5f}, {-0.1f, 0.5f}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
    {
        ivl_handover_begin(&handover, bad[k][0], bad[k][1], 0.3f, 0.001f);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, ivl_handover_next(&handover));
    }
    ivl_handover_begin(&handover, 0.4f, 0.5f, 0.0f, 0.001f);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, ivl_handover_next(&handover));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sum_starts_at_the_old_thrust_and_ends_at_the_new_one_without_a_step);
    RUN_TEST(test_nothing_fades_when_a_side_has_its_motors_off_or_is_no_number);
    return UNITY_END();
}
