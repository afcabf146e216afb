/// @file test_ivl_policy.c
#include "test_ivl_support.h"

static ivl_status_t commit(fix_t *fix, uint32_t seq, float rrev_c_per_s, float moment_y_Nm)
{
    const ivl_policy_t policy = {.seq = seq, .rrev_c_per_s = rrev_c_per_s, .moment_y_Nm = moment_y_Nm};
    return ivl_policy_commit(&fix->cfg, &fix->state, &policy);
}

static void test_policy_is_in_force_as_a_whole_when_good(void)
{
    fix_t fix;
    fix_init(&fix);
    TEST_ASSERT_FALSE(fix.state.has_policy);
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 3, 4.5f, 0.008f));
    TEST_ASSERT_TRUE(fix.state.has_policy);
    TEST_ASSERT_EQUAL_UINT32(3, fix.state.policy.seq);
    TEST_ASSERT_EQUAL_FLOAT(4.5f, fix.state.policy.rrev_c_per_s);
    TEST_ASSERT_EQUAL_FLOAT(0.008f, fix.state.policy.moment_y_Nm);
    TEST_ASSERT_EQUAL_UINT32(0, fix.state.diag.n_policy_refused);
}

static void test_policy_is_refused_as_a_whole_and_counted_when_bad(void)
{
    const float  bad[][2] = {{-0.1f, 0.008f}, {20.1f, 0.008f}, {NAN, 0.008f},    {INFINITY, 0.008f}, {4.5f, -0.001f},
                             {4.5f, 0.0201f}, {4.5f, NAN},     {4.5f, INFINITY}, {NAN, NAN}};
    const size_t n_bad = sizeof bad / sizeof bad[0];
    fix_t        fix;
    fix_init(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 3, 4.5f, 0.008f));
    const ivl_policy_t before = fix.state.policy;
    for (size_t i = 0; i < n_bad; i++)
    {
        TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, commit(&fix, 4, bad[i][0], bad[i][1]));
        TEST_ASSERT_EQUAL_MEMORY(&before, &fix.state.policy, sizeof before);
    }
    TEST_ASSERT_EQUAL_UINT32(n_bad, fix.state.diag.n_policy_refused);
}

static void test_ends_of_the_ranges_are_accepted(void)
{
    fix_t fix;
    fix_init(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 1, 0.0f, 0.0f));
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 2, 20.0f, 0.02f));
}

static void test_policy_can_change_until_the_trigger_and_again_in_idle(void)
{
    const ivl_phase_t open[] = {IVL_PHASE_IDLE, IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_ABORTED};
    const ivl_phase_t shut[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST, IVL_PHASE_ATTACHED, IVL_PHASE_DONE};
    for (int i = 0; i < 4; i++)
    {
        fix_t fix;
        fix_to_phase(&fix, open[i]);
        TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 9, 5.0f, 0.007f));
        fix_to_phase(&fix, shut[i]);
        TEST_ASSERT_EQUAL_INT(IVL_ERR_PHASE, commit(&fix, 9, 5.0f, 0.007f));
        TEST_ASSERT_EQUAL_UINT32(7, fix.state.policy.seq);
        TEST_ASSERT_EQUAL_UINT32(1, fix.state.diag.n_policy_refused);
        fix_request(&fix, IVL_REQUEST_IDLE);
        TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 9, 5.0f, 0.007f));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_policy_is_in_force_as_a_whole_when_good);
    RUN_TEST(test_policy_is_refused_as_a_whole_and_counted_when_bad);
    RUN_TEST(test_ends_of_the_ranges_are_accepted);
    RUN_TEST(test_policy_can_change_until_the_trigger_and_again_in_idle);
    return UNITY_END();
}
