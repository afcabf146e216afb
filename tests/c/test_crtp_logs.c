/// @file test_crtp_logs.c
/// Log blocks over the wire.
#include <math.h>

#include "crtp_fixture.h"

void setUp(void)
{
    open_server();
}

void tearDown(void)
{
    ivl_crtp_close(&server);
}

static void steps(int n)
{
    forget();
    for (int i = 0; i < n; i++)
    {
        ivl_crtp_step(&server);
    }
}

static void test_table(void)
{
    char           expected[40];
    const uint32_t crc = server.logs.toc.crc;
    (void)snprintf(expected, sizeof expected, "5c03%02x00%02x%02x%02x%02x1080", server.logs.toc.n, crc & 0xff, (crc >> 8) & 0xff,
                   (crc >> 16) & 0xff, crc >> 24);
    expect_answer("5c03", expected);
    expect_answer("5c020500", "5c020500076c0066333200");
    expect_answer("5cff", "");
    TEST_ASSERT_NOT_EQUAL(server.params.toc.crc, crc);
}

// block 1 = {l.i8, l.f32, l.t_ms}
static void test_block_is_sent_every_10_ms_with_the_vehicles_time(void)
{
    expect_answer("5d0601 040200 070500 030600", "5d060100");
    steps(20);
    TEST_ASSERT_EQUAL_STRING("", sent);
    expect_answer("5d030101", "5d030100");
    steps(9);
    TEST_ASSERT_EQUAL_STRING("", sent);
    steps(1);
    TEST_ASSERT_EQUAL_STRING("5e011e0000f9000020c01e000000", sent);
    steps(100);
    TEST_ASSERT_EQUAL_UINT(10, n_sent);
    expect_answer("5d0401", "5d040100");
    steps(100);
    TEST_ASSERT_EQUAL_UINT(0, n_sent);
    // and on again
    expect_answer("5d030102", "5d030100");
    steps(100);
    TEST_ASSERT_EQUAL_UINT(5, n_sent);
    expect_answer("5d0201", "5d020100");
    steps(100);
    TEST_ASSERT_EQUAL_UINT(0, n_sent);
    TEST_ASSERT_EQUAL_UINT16(0, server.logs.n_variables);
}

static void test_block_in_milliseconds(void)
{
    hear("5d0601030600");
    expect_answer("5d08010100", "5d080100");
    steps(50);
    TEST_ASSERT_EQUAL_UINT(50, n_sent);
    expect_answer("5d08012c01", "5d080100");
    steps(900);
    TEST_ASSERT_EQUAL_UINT(3, n_sent);
}

static void test_time_stamp_has_24_bits(void)
{
    fake.time_us = (uint64_t)0x1fffffe * 1000u;
    hear("5d0601040200");
    hear("5d08010100");
    steps(2);
    TEST_ASSERT_EQUAL_STRING("5e01fffffff9 5e01000000f9", sent);
}

static void test_period_0_is_once(void)
{
    hear("5d0601040200");
    expect_answer("5d030100", "5e01000000f9 5d030100");
    steps(50);
    TEST_ASSERT_EQUAL_UINT(0, n_sent);
}

static void test_every_type_in_every_form(void)
{
    const struct
    {
        const char *fetch_id, *value;
    } CASES[] = {
        {"040200", "f9"},       {"010200", "f9"},       {"020200", "f9ff"}, {"050200", "f9ff"},     {"060200", "f9ffffff"},
        {"070200", "0000e0c0"}, {"080200", "00c7"},     {"020300", "ffff"}, {"030300", "ffff0000"}, {"070300", "00ff7f47"},
        {"080300", "007c"},     {"060400", "6079feff"}, {"050400", "6079"}, {"070500", "000020c0"}, {"060500", "feffffff"},
        {"040500", "fe"},       {"080500", "00c1"},     {"010500", "fe"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++)
    {
        char request[24], expected[32];
        (void)snprintf(request, sizeof request, "5d0609%s", CASES[i].fetch_id);
        (void)snprintf(expected, sizeof expected, "5e09000000%s 5d030900", CASES[i].value);
        hear(request);
        expect_answer("5d030900", expected);
        hear("5d0209");
    }
}

static void test_floats_beyond_an_integers_range_have_its_end(void)
{
    const struct
    {
        float       value;
        const char *sent;
    } CASES[] = {{NAN, "00000000"}, {INFINITY, "ffffff7f"}, {-INFINITY, "00000080"}, {3e9f, "ffffff7f"}, {-2147483648.0f, "00000080"}};
    hear("5d0609060500");
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++)
    {
        char expected[32];
        fake_values.l_f32 = CASES[i].value;
        (void)snprintf(expected, sizeof expected, "5e09000000%s 5d030900", CASES[i].sent);
        expect_answer("5d030900", expected);
    }
}

static void test_a_block_has_26_bytes(void)
{
    // 6 x 4 + 2 = 26, one more is too many, and then none of its packet is added
    expect_answer("5d0601 070500 070500 070500 070500 070500 070500 020300", "5d060100");
    expect_answer("5d0701 010700", "5d070107");
    expect_answer("5d0602 070500 070500 070500 070500 070500 070500 070500", "5d060207");
    expect_answer("5d0302 01", "5d030202");
    hear("5d030101");
    steps(10);
    TEST_ASSERT_EQUAL_UINT64(62, strlen(sent));
}

static void test_append(void)
{
    expect_answer("5d0601 010700", "5d060100");
    expect_answer("5d0701 010700 040200", "5d070100");
    expect_answer("5d0702 010700", "5d070202");
    expect_answer("5d0701 01ff00", "5d070102");
    expect_answer("5d0701 0f0700", "5d070102");
    expect_answer("5d0701 010700 01ff00", "5d070102");
    expect_answer("5d030100", "5e010000000202f9 5d030100");
}

static void test_nine_variables_and_a_stray_byte(void)
{
    expect_answer("5d0601 010700 010700 010700 010700 010700 010700 010700 010700 010700 01", "5d060100");
    TEST_ASSERT_EQUAL_UINT8(9, server.logs.block[0].n);
}

static void test_errors_of_blocks(void)
{
    expect_answer("5d0601 010700", "5d060100");
    expect_answer("5d0601 010700", "5d060111");
    expect_answer("5d0602 01ffff", "5d060202");
    expect_answer("5d030201", "5d030202");
    expect_answer("5d0402", "5d040202");
    expect_answer("5d0202", "5d020202");
    expect_answer("5d0901", "5d090108");
    expect_answer("5d0001", "5d000108");
    expect_answer("5d03", "5d030016");
    expect_answer("5d0301", "5d030116");
    expect_answer("5d08010a", "5d080116");
    expect_answer("5d030101ff", "5d030116");
    expect_answer("5d020100", "5d020116");
    expect_bad("5d");
    expect_bad("5e");
    expect_bad("5f00");
}

static void test_16_blocks_and_128_variables(void)
{
    char request[80];
    for (int i = 0; i < 16; i++)
    {
        (void)snprintf(request, sizeof request, "5d06%02x 010700 010700 010700 010700 010700 010700 010700 010700", i);
        forget();
        hear(request);
        TEST_ASSERT_EQUAL_STRING("00", sent + strlen(sent) - 2);
    }
    expect_answer("5d0620 010700", "5d06200c");
    expect_answer("5d0700 010700", "5d07000c");
    expect_answer("5d0200", "5d020000");
    expect_answer("5d0620 010700", "5d062000");
    TEST_ASSERT_EQUAL_UINT16(121, server.logs.n_variables);
}

static void test_all_blocks_go_with_a_reset_and_with_the_link(void)
{
    hear("5d0601 010700");
    hear("5d030101");
    expect_answer("5d05", "5d050000");
    steps(30);
    TEST_ASSERT_EQUAL_UINT(0, n_sent);
    hear("5d0601 010700");
    hear("5d030101");
    forget();
    ivl_crtp_link(&server, false);
    TEST_ASSERT_EQUAL_STRING("link 0", fake_said);
    steps(30);
    TEST_ASSERT_EQUAL_UINT(0, n_sent);
    expect_answer("5d0601 010700", "5d060100");
}

static void test_values_are_refreshed_only_when_they_are_sampled(void)
{
    hear("5d0601 010700");
    hear("5d030101");
    fake.n_refreshed = 0;
    steps(100);
    TEST_ASSERT_EQUAL_UINT32(10, fake.n_refreshed);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table);
    RUN_TEST(test_block_is_sent_every_10_ms_with_the_vehicles_time);
    RUN_TEST(test_block_in_milliseconds);
    RUN_TEST(test_time_stamp_has_24_bits);
    RUN_TEST(test_period_0_is_once);
    RUN_TEST(test_every_type_in_every_form);
    RUN_TEST(test_floats_beyond_an_integers_range_have_its_end);
    RUN_TEST(test_a_block_has_26_bytes);
    RUN_TEST(test_append);
    RUN_TEST(test_nine_variables_and_a_stray_byte);
    RUN_TEST(test_errors_of_blocks);
    RUN_TEST(test_16_blocks_and_128_variables);
    RUN_TEST(test_all_blocks_go_with_a_reset_and_with_the_link);
    RUN_TEST(test_values_are_refreshed_only_when_they_are_sampled);
    return UNITY_END();
}
