/// @file test_ivl_wire.c
/// Packets of the app channel: bytes as documented, there and back, and whatever else may arrive.
#include "ivl_wire.h"
#include "test_ivl_support.h"

static uint8_t bytes[IVL_WIRE_SIZE_MAX];

static void test_policy_has_the_documented_bytes(void)
{
    const ivl_wire_policy_t packet = {
        .seq = 0x04030201u, .crc = 0x08070605u, .form = 9u, .n = 3u, .part = 0u, .theta0 = 1.0f, .theta1 = -2.0f, .theta2 = 0.5f};
    const uint8_t expected[] = {0x01, 0x02, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x03, 0x00, 0x00, 0x00,
                                0x80, 0x3f, 0x00, 0x00, 0x00, 0xc0, 0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x00, 0x00};
    TEST_ASSERT_EQUAL_UINT64(sizeof expected, ivl_wire_put_policy(bytes, &packet));
    TEST_ASSERT_EQUAL_MEMORY(expected, bytes, sizeof expected);
}

static void test_command_has_the_documented_bytes(void)
{
    const ivl_wire_command_t packet = {.seq = 0x1234u, .request = 2u, .hover_x_m = 1.0f, .hover_z_m = -2.0f, .angle_rad = 1.0f};
    TEST_ASSERT_EQUAL_UINT64(25, ivl_wire_put_command(bytes, &packet));
    const uint8_t head[] = {0x02, 0x02, 0x34, 0x12, 0x02, 0x00, 0x00, 0x80, 0x3f};
    TEST_ASSERT_EQUAL_MEMORY(head, bytes, sizeof head);
}

static void test_reading_has_the_documented_bytes(void)
{
    const ivl_wire_reading_t packet = {.valid = 3u, .age_s = 0.5f, .rrev_per_s = 1.0f, .of_y_radps = -2.0f};
    const uint8_t            expected[] = {0x03, 0x02, 0x03, 0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x80, 0x3f, 0x00, 0x00, 0x00, 0xc0};
    TEST_ASSERT_EQUAL_UINT64(sizeof expected, ivl_wire_put_reading(bytes, &packet));
    TEST_ASSERT_EQUAL_MEMORY(expected, bytes, sizeof expected);
}

#define CHECK_ROUND_TRIP(lower, ...)                                                                                                       \
    do                                                                                                                                     \
    {                                                                                                                                      \
        const ivl_wire_##lower##_t sent = {__VA_ARGS__};                                                                                   \
        ivl_wire_##lower##_t       got;                                                                                                    \
        memset(&got, 0, sizeof got);                                                                                                       \
        const size_t size = ivl_wire_put_##lower(bytes, &sent);                                                                            \
        TEST_ASSERT_TRUE(size <= IVL_WIRE_SIZE_MAX);                                                                                       \
        TEST_ASSERT_TRUE(ivl_wire_get_##lower(bytes, size, &got));                                                                         \
        uint8_t again[IVL_WIRE_SIZE_MAX];                                                                                                  \
        TEST_ASSERT_EQUAL_UINT64(size, ivl_wire_put_##lower(again, &got));                                                                 \
        TEST_ASSERT_EQUAL_MEMORY(bytes, again, size);                                                                                      \
        /* a byte less, a byte more, another type, another version */                                                                      \
        TEST_ASSERT_FALSE(ivl_wire_get_##lower(bytes, size - 1u, &got));                                                                   \
        TEST_ASSERT_FALSE(ivl_wire_get_##lower(bytes, size + 1u, &got));                                                                   \
        bytes[0] ^= 0x40u;                                                                                                                 \
        TEST_ASSERT_FALSE(ivl_wire_get_##lower(bytes, size, &got));                                                                        \
        bytes[0] ^= 0x40u;                                                                                                                 \
        bytes[1]++;                                                                                                                        \
        TEST_ASSERT_FALSE(ivl_wire_get_##lower(bytes, size, &got));                                                                        \
    } while (0)

static void test_packets_survive_the_way_and_refuse_what_is_not_theirs(void)
{
    CHECK_ROUND_TRIP(policy, .seq = 7, .crc = 0x12345678u, .form = 1, .n = 6, .part = 1, .theta0 = 4.8f, .theta3 = 0.008f);
    CHECK_ROUND_TRIP(command, .seq = 9, .request = 1, .hover_x_m = -1.5f, .hover_y_m = 2.0f, .hover_z_m = 1.0f, .speed_mps = 2.5f);
    CHECK_ROUND_TRIP(reading, .valid = 1, .age_s = 0.02f, .rrev_per_s = 4.8f, .of_y_radps = -1.5f);
    CHECK_ROUND_TRIP(policy_echo, .seq = 7, .status = -2, .missing = 0x8001u, .seq_in_force = 6, .crc_in_force = 0xdeadbeefu,
                     .form_in_force = 2);
    CHECK_ROUND_TRIP(command_echo, .seq = 65535, .status = -1, .request = 3, .phase = 7, .rule = 11, .cause = 12);
    CHECK_ROUND_TRIP(config_echo, .seq = 1, .status = -3, .bad = 255, .crc = 0xdeadbeefu);
}

static void test_values_that_are_no_numbers_pass_through(void)
{
    const ivl_wire_policy_t sent = {.seq = 1, .theta0 = NAN, .theta3 = -INFINITY};
    ivl_wire_policy_t       got;
    TEST_ASSERT_TRUE(ivl_wire_get_policy(bytes, ivl_wire_put_policy(bytes, &sent), &got));
    TEST_ASSERT_TRUE(isnan(got.theta0) && isinf(got.theta3));
}

static void test_crc_has_the_value_that_zip_files_have(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, ivl_wire_crc(0, "123456789", 9));
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, ivl_wire_crc(ivl_wire_crc(0, "1234", 4), "56789", 5));
    TEST_ASSERT_EQUAL_HEX32(0u, ivl_wire_crc(0, "", 0));
}

// at most one kind accepts a packet, and only if its first bytes say so
static void test_random_bytes_are_accepted_only_with_type_version_and_size(void)
{
    rng_t    rng = {5};
    uint32_t n_accepted = 0;
    for (int i = 0; i < 400000; i++)
    {
        uint8_t      noise[IVL_WIRE_SIZE_MAX];
        const size_t size = rng_below(&rng, IVL_WIRE_SIZE_MAX + 1u);
        for (size_t k = 0; k < sizeof noise; k++)
        {
            noise[k] = (uint8_t)rng_u64(&rng);
        }
        noise[0] = (uint8_t)(noise[0] & 0x83u);
        noise[1] = ((noise[1] & 1u) != 0u) ? (uint8_t)IVL_WIRE_VERSION : (uint8_t)(noise[1] >> 5u);
        ivl_wire_policy_t       policy;
        ivl_wire_command_t      command;
        ivl_wire_reading_t      reading;
        ivl_wire_policy_echo_t  policy_echo;
        ivl_wire_command_echo_t command_echo;
        ivl_wire_config_echo_t  config_echo;
        const int n = ivl_wire_get_policy(noise, size, &policy) + ivl_wire_get_command(noise, size, &command) +
                      ivl_wire_get_reading(noise, size, &reading) + ivl_wire_get_policy_echo(noise, size, &policy_echo) +
                      ivl_wire_get_command_echo(noise, size, &command_echo) + ivl_wire_get_config_echo(noise, size, &config_echo);
        TEST_ASSERT_TRUE(n <= 1);
        TEST_ASSERT_TRUE((n == 0) || ((noise[1] == IVL_WIRE_VERSION) && (size >= 9u)));
        n_accepted += (uint32_t)n;
    }
    TEST_ASSERT_TRUE(n_accepted > 1000u);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_policy_has_the_documented_bytes);
    RUN_TEST(test_command_has_the_documented_bytes);
    RUN_TEST(test_reading_has_the_documented_bytes);
    RUN_TEST(test_packets_survive_the_way_and_refuse_what_is_not_theirs);
    RUN_TEST(test_values_that_are_no_numbers_pass_through);
    RUN_TEST(test_crc_has_the_value_that_zip_files_have);
    RUN_TEST(test_random_bytes_are_accepted_only_with_type_version_and_size);
    return UNITY_END();
}
