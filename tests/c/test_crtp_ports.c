/// @file test_crtp_ports.c
/// Each packet that moves the vehicle or asks about it: the bytes of the documentation, and every length that is not theirs.
#include "crtp/crtp_power.h"
#include "crtp_fixture.h"
#include "test_ivl_support.h"

void setUp(void)
{
    open_server();
}

void tearDown(void)
{
    ivl_crtp_close(&server);
}

// every proper beginning, and the packet with a byte too many, must be refused and reach nobody
static void expect_no_other_length(const char *request)
{
    char hex[80];
    TEST_ASSERT_TRUE(strlen(request) + 3u < sizeof hex);
    for (size_t n = 2; n < strlen(request); n += 2)
    {
        (void)snprintf(hex, sizeof hex, "%.*s", (int)n, request);
        expect_bad(hex);
    }
    (void)snprintf(hex, sizeof hex, "%s00", request);
    expect_bad(hex);
}

static void check_setpoint(const char *request, const char *said)
{
    expect_said(request, said);
    TEST_ASSERT_EQUAL_STRING("", sent);
    expect_no_other_length(request);
}

// 1.0 = 0000803f, 2.0 = 00000040, 3.0 = 00004040, 0.5 = 0000003f

static void test_rpyt(void)
{
    check_setpoint("3c0000803f00000040000040401027", "rpyt 1 2 3 10000");
    expect_bad("3d0000803f00000040000040401027");
}

static void test_generic_setpoints(void)
{
    const char *four = "0000803f00000040000040400000003f";
    const struct
    {
        const char *type, *said;
    } CASES[] = {
        {"01", "velocity (1 2 3) -0.5"}, {"02", "zdistance 1 2 -3 0.5"}, {"05", "hover 1 2 -3 0.5"}, {"07", "position (1 2 3) 0.5"},
        {"08", "velocity (1 2 3) 0.5"},  {"09", "zdistance 1 2 3 0.5"},  {"0a", "hover 1 2 3 0.5"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++)
    {
        char request[80];
        (void)snprintf(request, sizeof request, "7c%s%s", CASES[i].type, four);
        expect_said(request, CASES[i].said);
        (void)snprintf(request, sizeof request, "7c%s%.30s", CASES[i].type, four);
        expect_bad(request);
    }
    expect_said("7c00", "stop");
    expect_bad("7c0000");
    expect_bad("7c");
}

static void test_manual_and_full_state(void)
{
    check_setpoint("7c0b0000803f0000004000004040102701", "manual 1 2 3 10000 1");
    // 1000 = e803, -1000 = 18fc, 500 = f401; quaternion: largest is w, all others 0
    check_setpoint("7c06e80318fc0000f40100000000e80300000000000000c0e80318fc0000",
                   "full (1 -1 0) (0.5 0 0) (1 0 0) (0.000 0.000 0.000 1.000) (1 -1 0)");
    // a quaternion that is none
    expect_bad("7c06e80318fc0000f40100000000e80300000000ffffffffe80318fc0000");
}

static void test_setpoints_that_nobody_models_are_counted(void)
{
    expect_bad("7c0c0000803f00000040000040400000003f");
    expect_bad("7cff");
    expect_bad("7e00");
}

static void test_older_setpoints_and_those_of_a_radio_control(void)
{
    check_setpoint("7c040000803f00000040000040400000003f", "althold 1 2 3 0.5");
    // 1000, 1500, 2000 and 1250 us; a first further channel below 1500 us switches levelling off
    check_setpoint("7c0300e803dc05d007e204", "cppm 1000 1500 2000 1250 1");
    expect_said("7c0301e803dc05d007e204db05", "cppm 1000 1500 2000 1250 0");
    expect_said("7c0302e803dc05d007e204dc050000", "cppm 1000 1500 2000 1250 1");
    expect_bad("7c0301e803dc05d007e204");
    expect_bad("7c0300e803dc05d007e204db05");
}

static void test_notify_stop(void)
{
    check_setpoint("7d0064000000", "notify_stop 100");
    expect_bad("7d0164000000");
}

static void test_a_setpoint_that_the_vehicle_refuses_is_counted(void)
{
    fake.refuse = true;
    const uint32_t n_bad = server.own.n_bad;
    expect_said("3c0000c07f00000040000040401027", "rpyt nan 2 3 10000");
    TEST_ASSERT_EQUAL_UINT32(n_bad + 1u, server.own.n_bad);
}

static void test_high_level_commands_are_answered_with_three_bytes_and_an_error(void)
{
    expect_said("8c07000000803f0000004001 00004040", "takeoff 1 2 1 3");
    TEST_ASSERT_EQUAL_STRING("8c07000000", sent);
    expect_said("8c08000000803f0000004000 00004040", "land 1 2 0 3");
    expect_said("8c01000000803f00004040", "takeoff 1 0 0 3");
    expect_said("8c02000000803f00004040", "land 1 0 0 3");
    expect_said("8c0300", "hl_stop");
    expect_said("8c040001 0000803f000000400000404000 00003f00004040", "go_to 1 0 (1 2 3) 0.5 3");
    expect_said("8c0c00 0100 0000803f00000040000040400000003f00004040", "go_to 1 0 (1 2 3) 0.5 3");
    expect_said("8c0c00 0001 0000803f00000040000040400000003f00004040", "go_to 0 1 (1 2 3) 0.5 3");
    TEST_ASSERT_EQUAL_STRING("8c0c000000", sent);
    expect_said("8c0900 0000803f 01 00000040 00 0000003f", "takeoff_at 1 1 2 0 0.5");
    expect_said("8c0a00 0000803f 00 00000040 01 0000003f", "land_at 1 0 2 1 0.5");
    expect_said("8c0b00 0100 0000803f00000040000040400000003f00004040", "spiral 1 0 1 2 3 0.5 3");
    expect_said("8c0500 0100 07 00000040", "start 7 1 0 0 2");
    expect_said("8c0500 0001 07 00000040", "start 7 0 0 1 2");
    expect_said("8c0d00 010001 07 00000040", "start 7 1 0 1 2");
    expect_said("8c0d00 000100 07 00000040", "start 7 0 1 0 2");
    // a definition names no groups
    expect_said("8c06 03 01 00 84000000 05", "define 3 1 0 132 5");
    TEST_ASSERT_EQUAL_STRING("8c06030100", sent);
}

static void test_high_level_errors(void)
{
    fake.refuse = true;
    expect_answer("8c0300", "8c03000010");
    fake.refuse = false;
    expect_answer("8c03", "8c03000016");
    expect_answer("8c030000", "8c03000016");
    expect_answer("8c07000000803f0000004001000040", "8c07000016");
    expect_answer("8c0b00", "8c0b000016");
    expect_answer("8c0603010084000000", "8c06030116");
    expect_answer("8c0e00", "8c0e000008");
    expect_answer("8cff00", "8cff000008");
    expect_bad("8c");
    expect_bad("8d0300");
}

static void test_high_level_commands_for_another_group_do_nothing_and_succeed(void)
{
    expect_answer("8c0002", "8c00020000");
    expect_said("8c0301", "");
    TEST_ASSERT_EQUAL_STRING("8c03010000", sent);
    expect_said("8c0303", "hl_stop");
    expect_said("8c0300", "hl_stop");
}

// ---- the set-point of zeros with which cflib closes

static const char ZERO[] = "3c0000000000000000000000000000";

static void test_zeros_act_at_once_unless_the_vehicle_flies_on_by_itself(void)
{
    expect_said(ZERO, "rpyt 0 0 0 0");
    fake.flies_high_level = true;
    expect_said(ZERO, "");
    // pings go on while cflib closes
    expect_said("fc00", "");
    expect_said("7c00", "rpyt 0 0 0 0; stop");
    expect_said(ZERO, "");
    expect_said(ZERO, "rpyt 0 0 0 0");
}

static void test_zeros_that_wait_are_dropped_with_their_client_and_act_if_he_stays(void)
{
    fake.flies_high_level = true;
    expect_said(ZERO, "");
    ivl_crtp_link(&server, false);
    for (int ms = 0; ms < 3000; ms++)
    {
        ivl_crtp_step(&server);
    }
    TEST_ASSERT_EQUAL_STRING("link 0", fake_said);
    expect_said(ZERO, "");
    for (int ms = 0; ms < 1499; ms++)
    {
        ivl_crtp_step(&server);
    }
    TEST_ASSERT_EQUAL_STRING("", fake_said);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("rpyt 0 0 0 0", fake_said);
}

static void test_zeros_that_nothing_follows_are_handed_back_before_they_are_old(void)
{
    expect_said(ZERO, "rpyt 0 0 0 0");
    for (int ms = 0; ms < 399; ms++)
    {
        ivl_crtp_step(&server);
    }
    hear("fc00");
    TEST_ASSERT_EQUAL_STRING("rpyt 0 0 0 0", fake_said);
    for (int ms = 0; ms < 2000; ms++)
    {
        ivl_crtp_step(&server);
    }
    TEST_ASSERT_EQUAL_STRING("rpyt 0 0 0 0; notify_stop 0", fake_said);
    // a stream of them is somebody's
    for (int i = 0; i < 10; i++)
    {
        hear(ZERO);
        forget();
        for (int ms = 0; ms < 390; ms++)
        {
            ivl_crtp_step(&server);
        }
        TEST_ASSERT_EQUAL_STRING("", fake_said);
    }
}

static void test_a_client_that_ends_with_zeros_hands_back(void)
{
    expect_said(ZERO, "rpyt 0 0 0 0");
    forget();
    ivl_crtp_link(&server, false);
    TEST_ASSERT_EQUAL_STRING("link 0; notify_stop 0", fake_said);
    expect_said("3c0000803f00000040000040401027", "rpyt 1 2 3 10000");
    forget();
    ivl_crtp_link(&server, false);
    TEST_ASSERT_EQUAL_STRING("link 0", fake_said);
}

// ---- the radio's processor

static void power(const char *request, const char *said, const char *answer)
{
    uint8_t           bytes[64], out[IVL_CRTP_BYTES_MAX];
    char              hex[80] = "";
    ivl_crtp_packet_t reply;
    const size_t      size = from_hex(request, bytes, sizeof bytes);
    fake_clear();
    TEST_ASSERT_TRUE_MESSAGE(ivl_crtp_is_power(bytes, size), request);
    ivl_crtp_power(&server, bytes, size, &reply);
    const size_t n = ivl_crtp_bytes(&reply, out);
    for (size_t i = 0; i < n; i++)
    {
        (void)snprintf(hex + 2u * i, 3, "%02x", out[i]);
    }
    TEST_ASSERT_EQUAL_STRING_MESSAGE(answer, hex, request);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(said, fake_said, request);
}

static void test_power_packets_switch_the_vehicle_and_are_always_acknowledged(void)
{
    const uint32_t n_bad = server.own.n_bad;
    power("fffe03", "", "ff");
    power("fffe02", "link 0; off", "ff");
    power("f3fe02", "", "ff");
    // nobody is at home
    expect_answer("fc00112233", "");
    fake.console = "unsaid";
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("", sent);
    fake.console = NULL;
    expect_said("7c00", "");
    TEST_ASSERT_EQUAL_STRING("", sent);
    power("fffe03", "on", "ff");
    expect_answer("fc00112233", "fc00112233");
    power("fffe01", "link 0; off", "ff");
    power("fffe03", "on", "ff");
    power("fffeff", "", "fffeffe7e7e7e7");
    TEST_ASSERT_EQUAL_UINT32(n_bad, server.own.n_bad);
    power("fffef001", "link 0; off; on", "ff");
    // there is no loader
    power("fffef000", "", "ff");
    power("fffef0", "", "ff");
    power("fffe77", "", "ff");
    TEST_ASSERT_EQUAL_UINT32(n_bad + 3u, server.own.n_bad);
    const uint8_t others[][3] = {{0xFF, 0xFF, 2}, {0xFD, 0xFE, 2}, {0xEF, 0xFE, 2}};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
    {
        TEST_ASSERT_FALSE(ivl_crtp_is_power(others[i], 3));
    }
    TEST_ASSERT_FALSE(ivl_crtp_is_power((const uint8_t[]){0xFF, 0xFE}, 2));
}

static void test_stored_values_are_in_force_after_power_on(void)
{
    // row 5 is persistent
    expect_answer("2e05000000803f", "2e05000000803f");
    hear("2f030500");
    expect_answer("2e050000000040", "2e050000000040");
    power("fffe02", "link 0; off", "ff");
    power("fffe03", "on", "ff");
    TEST_ASSERT_EQUAL_FLOAT(1.0f, fake_values.kept);
}

static void test_localization(void)
{
    check_setpoint("6c0000803f0000004000004040", "ext_position (1 2 3)");
    check_setpoint("6d080000803f00000040000040400000000000000000000000000000803f", "ext_pose (1 2 3) (0.000 0.000 0.000 1.000)");
    check_setpoint("6d03", "estop");
    check_setpoint("6d04", "watchdog");
    expect_bad("6d");
    expect_bad("6d02010203");
    expect_bad("6f00");
}

static void test_packed_localization_is_for_whom_it_names(void)
{
    // e7: this vehicle, e8: another
    expect_said("6ee7e80318fcf401", "ext_position (1 -1 0.5)");
    expect_said("6ee8e80318fcf401", "");
    expect_said("6ee8000000000000e7e80318fcf401e7f401f401f401", "ext_position (1 -1 0.5); ext_position (0.5 0.5 0.5)");
    expect_said("6d09e7e80318fcf401000000c0", "ext_pose (1 -1 0.5) (0.000 0.000 0.000 1.000)");
    expect_said("6d09e8e80318fcf401000000c0e7000000000000000000c0", "ext_pose (0 0 0) (0.000 0.000 0.000 1.000)");
    expect_bad("6d09e7e80318fcf401ffffffff");
    expect_bad("6ee7e80318fcf4");
    expect_bad("6ee7e80318fcf401e7");
    expect_bad("6e");
    expect_bad("6d09");
}

static void test_supervisor_tells_its_bits(void)
{
    fake.info = 0x0535;
    expect_answer("9c0c", "9c8c3505");
    for (unsigned bit = 0; bit < 11; bit++)
    {
        char request[8], reply[16];
        (void)snprintf(request, sizeof request, "9c%02x", bit + 1);
        (void)snprintf(reply, sizeof reply, "9c%02x%02x", 0x81 + bit, (0x535 >> bit) & 1);
        expect_answer(request, reply);
    }
    expect_bad("9c00");
    expect_bad("9c0d");
    expect_bad("9c");
    expect_bad("9c0c00");
    expect_bad("9e0c");
}

static void test_supervisor_arms_recovers_and_stops(void)
{
    expect_said("9d0101", "arm 1");
    TEST_ASSERT_EQUAL_STRING("9d810101", sent);
    expect_said("9d0100", "arm 0");
    TEST_ASSERT_EQUAL_STRING("9d810100", sent);
    fake.refuse = true;
    expect_answer("9d0101", "9d810001");
    expect_answer("9d02", "9d820001");
    fake.info = 0x80;
    expect_answer("9d02", "9d820000");
    fake.refuse = false;
    check_setpoint("9d03", "estop");
    check_setpoint("9d04", "watchdog");
    expect_bad("9d01");
    expect_bad("9d010100");
    expect_bad("9d0200");
    expect_bad("9d05");
}

static void test_platform(void)
{
    expect_answer("dd00", "dd000c000000");
    expect_answer("dc0101", "dc010101");
    expect_answer("dc02", "dc020101");
    expect_answer("dc0001", "dc0001");
    expect_answer("dc0301", "dc");
    forget();
    hear("dd01");
    TEST_ASSERT_EQUAL_STRING_LEN("dd01", sent, 4);
    TEST_ASSERT_TRUE(strlen(sent) > 10u);
    expect_bad("dd");
    expect_bad("dd03");
    expect_bad("dc01");
    expect_bad("dc");
    expect_bad("df00");
}

static void test_app_channel_carries_up_to_30_bytes_both_ways(void)
{
    expect_said("de010203", "app 3 bytes from 1");
    expect_said("de000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d", "app 30 bytes from 0");
    TEST_ASSERT_EQUAL_STRING("", sent);
    forget();
    for (unsigned i = 0; i < 30; i++)
    {
        fake.app[i] = (uint8_t)i;
    }
    fake.app_size = 30;
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("de000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d", sent);
}

static void test_link_service(void)
{
    expect_answer("fc00112233445566778899", "fc00112233445566778899");
    expect_answer("fc", "fc");
    expect_answer("fd00", "fd4269746372617a65204372617a79666c6965000000000000000000000000");
}

static void test_memory(void)
{
    expect_answer("4c01", "4c0102");
    expect_answer("4c0200", "4c020018280000000000000000000000");
    expect_answer("4c0201", "4c020101280000000102030405060708");
    expect_answer("4c0202", "4c0202");
    expect_answer("4d000100000003", "4d000100000000020304");
    // 40 bytes; a packet carries 24
    expect_answer("4d001000000018", "4d0010000000001112131415161718191a1b1c1d1e1f202122232425262728");
    expect_answer("4d001100000018", "4d001100000005");
    expect_answer("4d000000000019", "4d000000000005");
    expect_answer("4d00ffffffff01", "4d00ffffffff05");
    expect_answer("4d002800000000", "4d002800000000");
    expect_answer("4d020000000001", "4d020000000005");
    expect_bad("4d0000000000");
    expect_bad("4d00000000000100");
    expect_answer("4e0002000000aabb", "4e000200000000");
    TEST_ASSERT_EQUAL_HEX8(0xbb, fake.memory[3]);
    expect_answer("4e002700000001", "4e002700000000");
    expect_answer("4e00270000000102", "4e002700000005");
    expect_answer("4e010000000001", "4e010000000005");
    expect_bad("4e00000000");
    fake.refuse = true;
    expect_answer("4d000100000003", "4d000100000005");
    expect_bad("4c");
    expect_bad("4c03");
    expect_bad("4f00");
}

static void test_console_text_is_split_into_packets(void)
{
    fake.console = "0123456789012345678901234567890123";
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("0c303132333435363738393031323334353637383930313233343536373839 0c30313233", sent);
}

static void test_ports_that_do_not_exist(void)
{
    expect_bad("1c00");
    expect_bad("ac00");
    expect_bad("0c00");
    expect_bad("ff");
    ivl_crtp_receive(&server, (const uint8_t *)"", 0);
    TEST_ASSERT_EQUAL_UINT32(5, server.own.n_bad);
}

static void test_noise_is_counted_and_changes_no_table(void)
{
    rng_t    rng = {7};
    uint32_t crc = server.params.toc.crc;
    for (int i = 0; i < 200000; i++)
    {
        uint8_t      noise[40];
        const size_t size = rng_below(&rng, sizeof noise + 1u);
        for (size_t k = 0; k < size; k++)
        {
            noise[k] = (uint8_t)rng_u64(&rng);
        }
        // as if the port were known half of the time
        noise[0] = (uint8_t)((rng_u64(&rng) & 1u) ? noise[0] : (noise[0] & 0x03u) | 0x5cu);
        forget();
        ivl_crtp_receive(&server, noise, size);
        if ((i & 7) == 0)
        {
            ivl_crtp_step(&server);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(crc, server.params.toc.crc);
    TEST_ASSERT_TRUE(server.own.n_bad > 10000u);
    TEST_ASSERT_TRUE(server.logs.n_variables <= IVL_CRTP_LOG_VARIABLES);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rpyt);
    RUN_TEST(test_generic_setpoints);
    RUN_TEST(test_manual_and_full_state);
    RUN_TEST(test_setpoints_that_nobody_models_are_counted);
    RUN_TEST(test_older_setpoints_and_those_of_a_radio_control);
    RUN_TEST(test_zeros_act_at_once_unless_the_vehicle_flies_on_by_itself);
    RUN_TEST(test_zeros_that_wait_are_dropped_with_their_client_and_act_if_he_stays);
    RUN_TEST(test_zeros_that_nothing_follows_are_handed_back_before_they_are_old);
    RUN_TEST(test_a_client_that_ends_with_zeros_hands_back);
    RUN_TEST(test_power_packets_switch_the_vehicle_and_are_always_acknowledged);
    RUN_TEST(test_stored_values_are_in_force_after_power_on);
    RUN_TEST(test_notify_stop);
    RUN_TEST(test_a_setpoint_that_the_vehicle_refuses_is_counted);
    RUN_TEST(test_high_level_commands_are_answered_with_three_bytes_and_an_error);
    RUN_TEST(test_high_level_errors);
    RUN_TEST(test_high_level_commands_for_another_group_do_nothing_and_succeed);
    RUN_TEST(test_localization);
    RUN_TEST(test_packed_localization_is_for_whom_it_names);
    RUN_TEST(test_supervisor_tells_its_bits);
    RUN_TEST(test_supervisor_arms_recovers_and_stops);
    RUN_TEST(test_platform);
    RUN_TEST(test_app_channel_carries_up_to_30_bytes_both_ways);
    RUN_TEST(test_link_service);
    RUN_TEST(test_memory);
    RUN_TEST(test_console_text_is_split_into_packets);
    RUN_TEST(test_ports_that_do_not_exist);
    RUN_TEST(test_noise_is_counted_and_changes_no_table);
    return UNITY_END();
}
