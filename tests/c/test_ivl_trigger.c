/// @file test_ivl_trigger.c
#include "test_ivl_support.h"

static bool due(float rrev_c_per_s, float rrev_per_s, bool valid)
{
    const ivl_policy_t policy = {.rrev_c_per_s = rrev_c_per_s, .moment_y_Nm = 0.008f};
    return ivl_trigger_due(&policy, (ivl_cues_t){.rrev_per_s = rrev_per_s, .of_y_radps = 1.0f, .valid = valid});
}

static void test_trigger_is_due_from_the_threshold_on(void)
{
    TEST_ASSERT_FALSE(due(4.5f, 4.4999f, true));
    TEST_ASSERT_TRUE(due(4.5f, 4.5f, true));
    TEST_ASSERT_TRUE(due(4.5f, 6.0f, true));
}

static void test_trigger_is_due_at_once_when_the_threshold_is_zero_and_the_ceiling_closes_in(void)
{
    TEST_ASSERT_TRUE(due(0.0f, 1.0e-3f, true));
    TEST_ASSERT_FALSE(due(0.0f, 0.0f, true));
    TEST_ASSERT_FALSE(due(0.0f, -1.0f, true));
}

static void test_trigger_is_not_due_when_a_value_is_bad(void)
{
    TEST_ASSERT_FALSE(due(4.5f, 6.0f, false));
    TEST_ASSERT_FALSE(due(4.5f, NAN, true));
    TEST_ASSERT_FALSE(due(NAN, 6.0f, true));
    TEST_ASSERT_FALSE(due(INFINITY, 6.0f, true));
}

static void test_latch_copies_everything_of_the_tick(void)
{
    // Given a tick with distinct values everywhere
    const ivl_sample_t  sample = {.t_us = 11,
                                  .t_pose_us = 9,
                                  .p_WB_m = {1.0f, 2.0f, 3.0f},
                                  .v_WB_mps = {4.0f, 5.0f, 6.0f},
                                  .q_WB = {0.1f, 0.2f, 0.3f, 0.9f},
                                  .w_B_radps = {7.0f, 8.0f, 9.0f},
                                  .f_B_mps2 = {10.0f, 11.0f, 12.0f}};
    const ivl_ceiling_t ceiling = {.d_ceil_m = 0.5f, .v_close_mps = 6.0f, .age_s = 0.001f, .valid = true};
    const ivl_cues_t    cues = {.rrev_per_s = 12.0f, .of_y_radps = -8.0f, .valid = true};
    const ivl_policy_t  policy = {.seq = 42, .rrev_c_per_s = 11.5f, .moment_y_Nm = 0.007f};

    // When it is latched
    ivl_snapshot_t s;
    memset(&s, 0xff, sizeof s);
    const ivl_seen_t seen = {ceiling, cues};
    ivl_trigger_latch(&s, &sample, &seen, &policy);

    // Then the snapshot has all of them
    TEST_ASSERT_EQUAL_UINT64(11, s.t_us);
    TEST_ASSERT_EQUAL_UINT64(9, s.t_pose_us);
    TEST_ASSERT_EQUAL_MEMORY(&sample.p_WB_m, &s.p_WB_m, sizeof s.p_WB_m);
    TEST_ASSERT_EQUAL_MEMORY(&sample.v_WB_mps, &s.v_WB_mps, sizeof s.v_WB_mps);
    TEST_ASSERT_EQUAL_MEMORY(&sample.q_WB, &s.q_WB, sizeof s.q_WB);
    TEST_ASSERT_EQUAL_MEMORY(&sample.w_B_radps, &s.w_B_radps, sizeof s.w_B_radps);
    TEST_ASSERT_EQUAL_MEMORY(&sample.f_B_mps2, &s.f_B_mps2, sizeof s.f_B_mps2);
    TEST_ASSERT_EQUAL_FLOAT(0.5f, s.d_ceil_m);
    TEST_ASSERT_EQUAL_FLOAT(12.0f, s.rrev_per_s);
    TEST_ASSERT_EQUAL_FLOAT(-8.0f, s.of_y_radps);
    TEST_ASSERT_EQUAL_UINT32(42, s.policy.seq);
    TEST_ASSERT_EQUAL_FLOAT(11.5f, s.policy.rrev_c_per_s);
    TEST_ASSERT_EQUAL_FLOAT(0.007f, s.policy.moment_y_Nm);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_trigger_is_due_from_the_threshold_on);
    RUN_TEST(test_trigger_is_due_at_once_when_the_threshold_is_zero_and_the_ceiling_closes_in);
    RUN_TEST(test_trigger_is_not_due_when_a_value_is_bad);
    RUN_TEST(test_latch_copies_everything_of_the_tick);
    return UNITY_END();
}
