/// @file test_ivl_parts.c
/// Policies that arrive in parts, in any order, twice, mixed with others, or not at all: for every form that is compiled in.
#include "ivl_parts.h"
#include "test_ivl_support.h"

static ivl_parts_t parts;

static ivl_policy_t random_policy(rng_t *rng, uint32_t number, uint32_t seq)
{
    const ivl_form_t *form = ivl_form(number);
    ivl_policy_t      policy = {.id = {.seq = seq, .form = (uint8_t)number}, .n = form->n_params};
    for (uint32_t i = 0; i < policy.n; i++)
    {
        policy.theta[i] = rng_float(rng, ivl_form_group_of(form, i)->lo, ivl_form_group_of(form, i)->hi);
    }
    policy.id.crc = ivl_policy_crc(&policy);
    return policy;
}

static ivl_wire_status_t take(const ivl_policy_t *policy, uint32_t part)
{
    const ivl_wire_policy_t packet = packet_of(policy, (uint8_t)part);
    return ivl_parts_take(&parts, &packet);
}

/// A random order of 0 .. n-1.
static void shuffle(rng_t *rng, uint32_t n, uint32_t order[])
{
    for (uint32_t i = 0; i < n; i++)
    {
        const uint32_t k = rng_below(rng, i + 1u);
        order[i] = order[k];
        order[k] = i;
    }
}

static void test_parts_in_any_order_and_twice_make_the_policy(void)
{
    rng_t rng = {1};
    for (int trial = 0; trial < 200; trial++)
    {
        for (uint32_t number = 0; ivl_form(number) != NULL; number++)
        {
            const ivl_policy_t policy = random_policy(&rng, number, (uint32_t)trial);
            const uint32_t     n = ivl_parts_count(policy.n);
            uint32_t           order[16];
            shuffle(&rng, n, order);
            for (uint32_t i = 0; i + 1u < n; i++)
            {
                TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_INCOMPLETE, take(&policy, order[i]));
                TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_INCOMPLETE, take(&policy, order[rng_below(&rng, i + 1u)]));
                TEST_ASSERT_TRUE(((uint32_t)parts.missing >> order[n - 1u]) & 1u);
            }
            TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, take(&policy, order[n - 1u]));
            TEST_ASSERT_EQUAL_MEMORY(&policy, &parts.policy, sizeof policy);
            // a repeated part brings the same policy again
            TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, take(&policy, 0));
        }
    }
}

static void test_what_is_missing_is_told(void)
{
    rng_t rng = {2};
    for (uint32_t number = 0; ivl_form(number) != NULL; number++)
    {
        const ivl_policy_t policy = random_policy(&rng, number, 1);
        const uint32_t     n = ivl_parts_count(policy.n);
        for (uint32_t lost = 0; lost < n && n > 1u; lost++)
        {
            memset(&parts, 0, sizeof parts);
            for (uint32_t i = 0; i < n; i++)
            {
                const ivl_wire_policy_t packet = packet_of(&policy, (uint8_t)i);
                TEST_ASSERT_EQUAL_INT(i + 1u == n, ivl_parts_is_last(&packet));
                TEST_ASSERT_TRUE((i == lost) || (ivl_parts_take(&parts, &packet) == IVL_WIRE_ERR_INCOMPLETE));
            }
            TEST_ASSERT_EQUAL_HEX16(1u << lost, parts.missing);
            TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, take(&policy, lost));
        }
    }
}

static void test_parts_of_two_policies_never_make_one(void)
{
    rng_t rng = {3};
    for (uint32_t number = 0; ivl_form(number) != NULL; number++)
    {
        // the same number given twice by a host that was restarted: the checksum tells them apart
        const ivl_policy_t one = random_policy(&rng, number, 1), other = random_policy(&rng, number, 1);
        const uint32_t     n = ivl_parts_count(one.n);
        for (int k = 0; k < 500; k++)
        {
            const ivl_policy_t     *which = (rng_below(&rng, 2) == 0u) ? &one : &other;
            const ivl_wire_status_t status = take(which, rng_below(&rng, n));
            TEST_ASSERT_TRUE((status == IVL_WIRE_OK) || (status == IVL_WIRE_ERR_INCOMPLETE));
            if (status == IVL_WIRE_OK)
            {
                TEST_ASSERT_EQUAL_MEMORY(which, &parts.policy, sizeof *which);
            }
        }
    }
}

static void test_a_number_that_changed_on_the_way_is_refused_and_all_is_forgotten(void)
{
    rng_t rng = {4};
    for (uint32_t number = 0; ivl_form(number) != NULL; number++)
    {
        const ivl_policy_t policy = random_policy(&rng, number, 5);
        const uint32_t     n = ivl_parts_count(policy.n);
        for (uint32_t i = 0; i < policy.n; i++)
        {
            ivl_policy_t spoiled = policy;
            memset(&parts, 0, sizeof parts);
            spoiled.theta[i] = nextafterf(spoiled.theta[i], 1.0e9f);
            for (uint32_t k = 0; k + 1u < n; k++)
            {
                TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_INCOMPLETE, take(&spoiled, k));
            }
            TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_CRC, take(&spoiled, n - 1u));
            for (uint32_t k = 0; k + 1u < n; k++)
            {
                TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_INCOMPLETE, take(&policy, k));
            }
            TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, take(&policy, n - 1u));
        }
    }
}

static void test_noise_is_never_a_policy_but_by_its_checksum(void)
{
    rng_t rng = {6};
    for (int k = 0; k < 200000; k++)
    {
        uint8_t           bytes[IVL_WIRE_SIZE_MAX];
        ivl_wire_policy_t packet;
        for (size_t i = 0; i < sizeof bytes; i++)
        {
            bytes[i] = (uint8_t)rng_u64(&rng);
        }
        bytes[0] = (uint8_t)IVL_WIRE_TYPE_POLICY;
        bytes[1] = (uint8_t)IVL_WIRE_VERSION;
        bytes[10] %= 4u;
        bytes[11] = (uint8_t)((ivl_form(bytes[10]) != NULL && rng_below(&rng, 2) == 0u) ? ivl_form(bytes[10])->n_params : bytes[11]);
        bytes[12] %= 20u;
        TEST_ASSERT_TRUE(ivl_wire_get_policy(bytes, 29, &packet));
        const ivl_wire_status_t status = ivl_parts_take(&parts, &packet);
        TEST_ASSERT_TRUE((status != IVL_WIRE_OK) || (ivl_policy_crc(&parts.policy) == packet.crc));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parts_in_any_order_and_twice_make_the_policy);
    RUN_TEST(test_what_is_missing_is_told);
    RUN_TEST(test_parts_of_two_policies_never_make_one);
    RUN_TEST(test_a_number_that_changed_on_the_way_is_refused_and_all_is_forgotten);
    RUN_TEST(test_noise_is_never_a_policy_but_by_its_checksum);
    return UNITY_END();
}
