/// @file test_ivl_policy.c
#include "test_ivl_support.h"

static ivl_status_t commit(fix_t *fix, uint32_t seq, float rrev_c_per_s, float moment_Nm)
{
    const ivl_policy_t policy = constant_policy(seq, rrev_c_per_s, moment_Nm);
    return ivl_policy_commit(&fix->cfg, &fix->state, &policy);
}

static void test_policy_is_in_force_as_a_whole_when_good(void)
{
    fix_t fix;
    fix_init(&fix);
    TEST_ASSERT_FALSE(fix.state.has_policy);
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 3, 4.5f, 0.008f));
    TEST_ASSERT_TRUE(fix.state.has_policy);
    const ivl_policy_t wanted = constant_policy(3, 4.5f, 0.008f);
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &fix.state.policy, sizeof wanted);
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

/// Who asks for an approach has seen the policy that flies it: nobody changes it on the way, nor while the vehicle comes back.
static void test_a_policy_is_taken_in_idle_and_ready_only(void)
{
    for (int phase = 0; phase < (int)IVL_PHASE_COUNT; phase++)
    {
        fix_t fix;
        fix_to_phase(&fix, (ivl_phase_t)phase);
        const ivl_policy_t before = fix.state.policy;
        const uint32_t     n_refused = fix.state.diag.n_policy_refused;
        const bool         is_open = (phase == (int)IVL_PHASE_IDLE) || (phase == (int)IVL_PHASE_READY);
        TEST_ASSERT_EQUAL_INT(is_open ? IVL_OK : IVL_ERR_PHASE, commit(&fix, 41, 0.5f, 0.004f));
        TEST_ASSERT_EQUAL_INT(is_open ? 41 : (int)before.id.seq, (int)fix.state.policy.id.seq);
        TEST_ASSERT_EQUAL_UINT32(n_refused + (is_open ? 0u : 1u), fix.state.diag.n_policy_refused);
        if (!is_open)
        {
            TEST_ASSERT_EQUAL_MEMORY(&before, &fix.state.policy, sizeof before);
        }
        fix_request(&fix, IVL_REQUEST_IDLE);
        TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 42, 5.0f, 0.007f));
    }
}

static void test_ends_of_the_ranges_are_accepted(void)
{
    fix_t fix;
    fix_init(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 1, 0.0f, 0.0f));
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 2, 20.0f, 0.02f));
}

static void test_a_form_that_does_not_exist_or_has_another_length_is_refused(void)
{
    fix_t fix;
    fix_init(&fix);
    for (uint32_t form = 0; form < 256u; form++)
    {
        for (uint32_t n = 0; n < 256u; n++)
        {
            ivl_policy_t policy = constant_policy(1, 4.5f, 0.008f);
            policy.id.form = (uint8_t)form;
            policy.n = (uint8_t)n;
            if ((ivl_form(form) == NULL) || (n != ivl_form(form)->n_params))
            {
                TEST_ASSERT_EQUAL_INT(IVL_ERR_FORM, ivl_policy_commit(&fix.cfg, &fix.state, &policy));
                TEST_ASSERT_EQUAL_UINT32(0, ivl_policy_crc(&policy));
            }
        }
    }
    TEST_ASSERT_FALSE(fix.state.has_policy);
}

static void test_a_moment_beyond_what_the_configuration_allows_is_refused(void)
{
    fix_t fix;
    fix_init(&fix);
    fix.cfg.flip_moment_Nm_max = 0.005f;
    ivl_init(&fix.cfg, &fix.state);
    TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, commit(&fix, 1, 4.5f, 0.0051f));
    TEST_ASSERT_EQUAL_INT(IVL_OK, commit(&fix, 1, 4.5f, 0.005f));
}

/// Whatever the numbers of a form are within its ranges, its moment is none that it did not announce.
static void test_a_form_asks_for_no_more_moment_than_it_says(void)
{
    rng_t rng = {5};
    for (uint32_t number = 0; ivl_form(number) != NULL; number++)
    {
        const ivl_form_t *form = ivl_form(number);
        TEST_ASSERT_TRUE((form->n_params > 0u) && (form->n_params <= IVL_FORM_PARAMS_MAX));
        for (int k = 0; k < 2000; k++)
        {
            ivl_policy_t policy = {.id = {.form = (uint8_t)number}, .n = form->n_params};
            for (uint32_t i = 0; i < policy.n; i++)
            {
                policy.theta[i] = rng_float(&rng, ivl_form_group_of(form, i)->lo, ivl_form_group_of(form, i)->hi);
            }
            const ivl_seen_t   seen = {.ceiling = {.d_ceil_m = rng_float(&rng, 0.01f, 3.0f), .valid = true},
                                       .cues = {rng_float(&rng, -5.0f, 25.0f), rng_float(&rng, -20.0f, 20.0f), true}};
            const ivl_action_t action = ivl_policy_decide(&policy, &seen);
            TEST_ASSERT_TRUE(action.moment_Nm >= 0.0f && action.moment_Nm <= form->moment_most_Nm(policy.theta));
            TEST_ASSERT_TRUE(action.p_land >= 0.0f && action.p_land <= 1.0f);
            TEST_ASSERT_FALSE(action.flip && !(seen.cues.rrev_per_s > 0.0f));
        }
    }
}

static void test_checksum_tells_policies_apart(void)
{
    const ivl_policy_t policy = constant_policy(1, 4.5f, 0.008f), same = constant_policy(2, 4.5f, 0.008f);
    TEST_ASSERT_EQUAL_HEX32(policy.id.crc, same.id.crc);
    // "constant", then 4.5 and 0.008 as little-endian floats: zlib.crc32 in Python says the same
    TEST_ASSERT_EQUAL_HEX32(0x43BB9AD1u, policy.id.crc);
    TEST_ASSERT_NOT_EQUAL(policy.id.crc, constant_policy(1, nextafterf(4.5f, 5.0f), 0.008f).id.crc);
    TEST_ASSERT_NOT_EQUAL(policy.id.crc, constant_policy(1, 4.5f, nextafterf(0.008f, 1.0f)).id.crc);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_policy_is_in_force_as_a_whole_when_good);
    RUN_TEST(test_policy_is_refused_as_a_whole_and_counted_when_bad);
    RUN_TEST(test_a_policy_is_taken_in_idle_and_ready_only);
    RUN_TEST(test_ends_of_the_ranges_are_accepted);
    RUN_TEST(test_a_form_that_does_not_exist_or_has_another_length_is_refused);
    RUN_TEST(test_a_moment_beyond_what_the_configuration_allows_is_refused);
    RUN_TEST(test_a_form_asks_for_no_more_moment_than_it_says);
    RUN_TEST(test_checksum_tells_policies_apart);
    return UNITY_END();
}
