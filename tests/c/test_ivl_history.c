/// @file test_ivl_history.c
#include "ivl_history.h"

#include <string.h>

#include "ivl_vars.h"

#include "test_ivl_support.h"

#define DT_S 0.002f

static const float TICK_HZ_MAX = 1000.0f;

// of the members that are a delay of a reading, the largest value that is allowed
#define MAX_OF_DELAYS(ctype, group, name, field, unit, min, max, dflt, doc) MAX_IF_DELAY(name, max)
#define MAX_IF_DELAY(name, max) (strcmp(name, "rrev_delay") == 0 || strcmp(name, "range_delay") == 0) ? (float)(max) : 0.0f,

static void test_integrals_of_a_constant_acceleration_are_exact_at_any_instant(void)
{
    ivl_history_t h;
    ivl_history_start(&h);
    for (int n = 1; n <= 200; n++)
    {
        ivl_history_push(&h, 3.0f, DT_S);
        for (int back = -10; back < 61; back++)
        {
            const float  ago_s = 0.0005f * (float)back;
            const float  t = DT_S * (float)n - ago_s;
            ivl_motion_t m = {-1.0f, -1.0f};
            if (ivl_history_at(&h, ago_s, ago_s / DT_S, &m))
            {
                TEST_ASSERT_FLOAT_WITHIN(2.0e-5f, 3.0f * t, m.v_mps);
                TEST_ASSERT_FLOAT_WITHIN(2.0e-5f, 1.5f * t * t, m.p_m);
            }
            else
            {
                TEST_ASSERT_TRUE((t < DT_S + 1.0e-6f) || (ago_s / DT_S >= (float)IVL_HISTORY_TICKS - 1.001f));
            }
        }
    }
}

static void test_what_is_forgotten_or_was_never_is_not_told(void)
{
    ivl_history_t      h;
    ivl_motion_t       m = {7.0f, 8.0f};
    const ivl_motion_t untouched = m;
    ivl_history_start(&h);
    TEST_ASSERT_FALSE(ivl_history_at(&h, 0.001f, 0.5f, &m));
    for (int n = 0; n < 5; n++)
    {
        ivl_history_push(&h, 1.0f, DT_S);
    }
    TEST_ASSERT_FALSE(ivl_history_at(&h, 0.01f, 5.0f, &m));
    for (uint32_t n = 0; n < 3u * IVL_HISTORY_TICKS; n++)
    {
        ivl_history_push(&h, 1.0f, DT_S);
    }
    TEST_ASSERT_FALSE(ivl_history_at(&h, (float)IVL_HISTORY_TICKS * DT_S, (float)IVL_HISTORY_TICKS, &m));
    TEST_ASSERT_FALSE(ivl_history_at(&h, 1.0e9f, 1.0e12f, &m));
    TEST_ASSERT_FALSE(ivl_history_at(&h, NAN, NAN, &m));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &m, sizeof m);
    TEST_ASSERT_TRUE(ivl_history_at(&h, 0.06f, 30.0f, &m));
}

/// A delay that the configuration allows, and the tick that a reading waits, at the fastest rate.
static void test_no_delay_that_is_allowed_is_forgotten(void)
{
    const float longest_s[] = {IVL_PARAMS(MAX_OF_DELAYS) 0.0f};
    for (size_t i = 0; i < sizeof longest_s / sizeof longest_s[0]; i++)
    {
        TEST_ASSERT_TRUE((longest_s[i] + 2.0f / TICK_HZ_MAX) * TICK_HZ_MAX < (float)(IVL_HISTORY_TICKS - 1u));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_integrals_of_a_constant_acceleration_are_exact_at_any_instant);
    RUN_TEST(test_what_is_forgotten_or_was_never_is_not_told);
    RUN_TEST(test_no_delay_that_is_allowed_is_forgotten);
    return UNITY_END();
}
