/// @file test_ivl_trigger.c
#include "test_ivl_support.h"

static bool due(float rrev_c_per_s, float rrev_per_s, bool valid)
{
    const ivl_policy_t policy = constant_policy(1, rrev_c_per_s, 0.008f);
    const ivl_seen_t   seen = {.cues = {.rrev_per_s = rrev_per_s, .of_y_radps = 1.0f, .valid = valid}};
    return ivl_policy_decide(&policy, &seen).flip;
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

static void test_trigger_of_a_policy_that_flips_at_once_needs_a_closing_ceiling_alone(void)
{
    ivl_policy_t policy = constant_policy(1, 4.5f, 0.008f);
    policy.at_once = true;
    const ivl_seen_t closing = {.cues = {.rrev_per_s = 0.1f, .valid = true}}, opening = {.cues = {.rrev_per_s = -0.1f, .valid = true}},
                     blind = {.cues = {.rrev_per_s = 0.1f, .valid = false}};
    TEST_ASSERT_TRUE(ivl_policy_decide(&policy, &closing).flip);
    TEST_ASSERT_EQUAL_FLOAT(0.008f, ivl_policy_decide(&policy, &closing).moment_Nm);
    TEST_ASSERT_FALSE(ivl_policy_decide(&policy, &opening).flip);
    TEST_ASSERT_FALSE(ivl_policy_decide(&policy, &blind).flip);
}

static void test_latch_copies_everything_of_the_tick(void)
{
    // Given a tick with distinct values everywhere
    const ivl_sample_t    sample = {.t_us = 11,
                                    .t_pose_us = 9,
                                    .p_WB_m = {1.0f, 2.0f, 3.0f},
                                    .v_WB_mps = {4.0f, 5.0f, 6.0f},
                                    .q_WB = {0.1f, 0.2f, 0.3f, 0.9f},
                                    .w_B_radps = {7.0f, 8.0f, 9.0f},
                                    .f_B_mps2 = {10.0f, 11.0f, 12.0f}};
    const ivl_ceiling_t   ceiling = {.d_ceil_m = 0.5f, .v_close_mps = 6.0f, .age_s = 0.001f, .valid = true};
    const ivl_cues_t      cues = {.rrev_per_s = 12.0f, .of_y_radps = -8.0f, .valid = true};
    const ivl_policy_id_t policy = {.seq = 42, .crc = 77, .form = 3};
    const ivl_action_t    action = {.flip = true, .go = true, .moment_Nm = 0.007f};

    // When it is latched
    const ivl_seen_t seen = {ceiling, cues};
    ivl_snapshot_t   s;
    ivl_trigger_snapshot(&s, &sample, &seen, &policy, &action);

    // Then the snapshot has all of them
    TEST_ASSERT_EQUAL_UINT64(11, s.sample.t_us);
    TEST_ASSERT_EQUAL_UINT64(9, s.sample.t_pose_us);
    TEST_ASSERT_EQUAL_MEMORY(&sample.p_WB_m, &s.sample.p_WB_m, sizeof sample - offsetof(ivl_sample_t, p_WB_m));
    TEST_ASSERT_EQUAL_FLOAT(0.5f, s.d_ceil_m);
    TEST_ASSERT_EQUAL_FLOAT(12.0f, s.rrev_per_s);
    TEST_ASSERT_EQUAL_FLOAT(-8.0f, s.of_y_radps);
    TEST_ASSERT_EQUAL_UINT32(42, s.policy.seq);
    TEST_ASSERT_EQUAL_UINT32(77, s.policy.crc);
    TEST_ASSERT_EQUAL_UINT8(3, s.policy.form);
    TEST_ASSERT_TRUE(s.action.flip && s.action.go);
    TEST_ASSERT_EQUAL_FLOAT(0.007f, s.action.moment_Nm);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_trigger_is_due_from_the_threshold_on);
    RUN_TEST(test_trigger_is_due_at_once_when_the_threshold_is_zero_and_the_ceiling_closes_in);
    RUN_TEST(test_trigger_is_not_due_when_a_value_is_bad);
    RUN_TEST(test_trigger_of_a_policy_that_flips_at_once_needs_a_closing_ceiling_alone);
    RUN_TEST(test_latch_copies_everything_of_the_tick);
    return UNITY_END();
}
