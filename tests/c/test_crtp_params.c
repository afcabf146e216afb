/// @file test_crtp_params.c
/// Parameters over the wire: table, values, names, defaults, persistence, and the server's own.
#include "crtp/crtp_control.h"
#include "crtp_fixture.h"

static bool own_was_changed;

static void note_own(void *context)
{
    (void)context;
    own_was_changed = true;
}

void setUp(void)
{
    open_server();
    server.host.own_changed = note_own;
    own_was_changed = false;
}

void tearDown(void)
{
    ivl_crtp_close(&server);
}

static uint16_t id_of(const char *group, const char *name)
{
    uint16_t id = 0;
    TEST_ASSERT_TRUE(ivl_crtp_toc_find(&server.params.toc, group, name, &id));
    return id;
}

// ---- table

static void test_table_information_and_items(void)
{
    char expected[40];
    (void)snprintf(expected, sizeof expected, "2c03%02x00%02x%02x%02x%02x", server.params.toc.n, server.params.toc.crc & 0xff,
                   (server.params.toc.crc >> 8) & 0xff, (server.params.toc.crc >> 16) & 0xff, server.params.toc.crc >> 24);
    expect_answer("2c03", expected);
    expect_answer("2c020000", "2c020000086100753800");
    expect_answer("2c020300", "2c0203002662620066333200");    // core
    expect_answer("2c020400", "2c02040046626200726f00");      // read-only
    expect_answer("2c020500", "2c020500166262006b65707400");  // extended
    expect_answer("2c02ff00", "2c02");
    expect_bad("2c");
    expect_bad("2c01");
    expect_bad("2c0300");
    expect_bad("2c0200");
}

static void test_crc_depends_on_every_name_type_and_order(void)
{
    ivl_crtp_toc_t            toc;
    char                      error[200];
    const ivl_crtp_toc_item_t a[] = {{"g", "x", 1}, {"g", "y", 2}};
    const ivl_crtp_toc_item_t others[][2] = {
        {{"g", "y", 2}, {"g", "x", 1}}, {{"g", "x", 1}, {"g", "y", 3}}, {{"g", "x", 1}, {"h", "y", 2}}, {{"gx", "x", 1}, {"g", "y", 2}}};
    TEST_ASSERT_TRUE(ivl_crtp_toc_init(&toc, 2, a, 2, error, sizeof error));
    const uint32_t crc = toc.crc;
    TEST_ASSERT_TRUE(ivl_crtp_toc_init(&toc, 2, a, 2, error, sizeof error));
    TEST_ASSERT_EQUAL_HEX32(crc, toc.crc);
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
    {
        TEST_ASSERT_TRUE(ivl_crtp_toc_init(&toc, 2, others[i], 2, error, sizeof error));
        TEST_ASSERT_NOT_EQUAL(crc, toc.crc);
    }
    // clients keep the tables of both ports in one place, by this number alone
    TEST_ASSERT_TRUE(ivl_crtp_toc_init(&toc, 5, a, 2, error, sizeof error));
    TEST_ASSERT_NOT_EQUAL(crc, toc.crc);
    TEST_ASSERT_TRUE(ivl_crtp_toc_init(&toc, 2, a, 1, error, sizeof error));
    TEST_ASSERT_NOT_EQUAL(crc, toc.crc);
}

static void test_tables_with_bad_names_are_refused_by_name(void)
{
    ivl_crtp_toc_t            toc;
    char                      error[200];
    const ivl_crtp_toc_item_t twice[] = {{"g", "x", 1}, {"h", "x", 1}, {"g", "x", 2}};
    const ivl_crtp_toc_item_t longer[] = {{"thirteenchars", "of25in_total", 1}};
    const ivl_crtp_toc_item_t empty[] = {{"g", "", 1}};
    TEST_ASSERT_FALSE(ivl_crtp_toc_init(&toc, 2, twice, 3, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "g.x"));
    TEST_ASSERT_FALSE(ivl_crtp_toc_init(&toc, 2, longer, 1, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "25"));
    TEST_ASSERT_FALSE(ivl_crtp_toc_init(&toc, 2, empty, 1, error, sizeof error));
}

static void test_longest_name_fills_a_packet(void)
{
    forget();
    hear("2c020600");
    TEST_ASSERT_EQUAL_UINT64(62, strlen(sent));
}

// ---- values

static void test_read(void)
{
    expect_answer("2d0000", "2d00000002");
    expect_answer("2d0100", "2d010000fdff");
    expect_answer("2d0200", "2d02000070110100");
    expect_answer("2d0300", "2d0300000000c03f");
    expect_answer("2d0700", "2d0700000000000000010000");
    expect_answer("2dff00", "2dff0002");
    expect_bad("2d00");
    expect_bad("2d000000");
}

static void test_write_is_echoed_and_the_vehicle_is_told(void)
{
    expect_said("2e000007", "u8 is 7");
    TEST_ASSERT_EQUAL_STRING("2e000007", sent);
    expect_answer("2e0100ff7f", "2e0100ff7f");
    TEST_ASSERT_EQUAL_INT16(32767, fake_values.i16);
    expect_answer("2e06009a9999999999b93f", "2e06009a9999999999b93f");
    TEST_ASSERT_EQUAL_DOUBLE(0.1, fake_values.f64);
    expect_answer("2eff0000", "2eff0002");
}

static void test_write_to_read_only_is_not_answered(void)
{
    expect_answer("2e04000000803f", "");
    TEST_ASSERT_EQUAL_FLOAT(9.0f, fake_values.read_only);
}

static void test_write_of_another_size_is_refused(void)
{
    expect_answer("2e0200010203", "2e020016");
    expect_answer("2e02000102030405", "2e020016");
    expect_answer("2e0200", "2e020016");
    TEST_ASSERT_EQUAL_UINT32(70000, fake_values.u32);
    expect_bad("2e02");
}

// a\0 u8\0 08 05
static void test_set_by_name(void)
{
    expect_said("2f006100753800 08 05", "u8 is 5");
    TEST_ASSERT_EQUAL_STRING("2f00610075380000", sent);
    expect_answer("2f006100753900 08 05", "2f00610075390002");  // no such
    expect_answer("2f006100753800 09 05", "2f00610075380016");  // another type
    expect_answer("2f006100753800 08 0500", "2f00610075380016");
    expect_answer("2f006100753800 08", "2f00610075380016");
    expect_answer("2f00626200726f00 06 00000000", "2f00626200726f000d");
    TEST_ASSERT_EQUAL_UINT8(5, fake_values.u8);
    expect_bad("2f0061007538");
    expect_bad("2f006100753800");
    expect_bad("2f00");
    // names longer than any table has
    expect_bad("2f00616161616161616161616161616100616161616161616161616161000801");
}

// ---- defaults and persistence

static void test_extended_type(void)
{
    expect_answer("2f070500", "2f0705000001");
    expect_answer("2f020500", "2f02050001");
    expect_answer("2f070000", "2f07000002");
    expect_answer("2f07ff00", "2f07ff0002");
    expect_bad("2f07ff");
    expect_bad("2f07ff0000");
    expect_bad("2f090000");
    expect_bad("2f");
}

static void test_default_is_the_value_at_the_start(void)
{
    hear("2e000007");
    expect_answer("2f080000", "2f0800000002");
    expect_answer("2f060000", "2f06000002");
    expect_answer("2f080400", "2f08040002");  // read-only: none
    expect_answer("2f080600", "2f08060000fca9f1d24d62503f");
}

static void test_persistent_value_is_stored_told_and_cleared(void)
{
    expect_answer("2f040500", "2f040500000000803e");
    expect_answer("2f050500", "2f05050002");
    hear("2e05000000003f");
    expect_answer("2f030500", "2f03050000");
    hear("2e05000000403f");
    expect_answer("2f040500", "2f040500010000803e0000003f");
    expect_answer("2f050500", "2f05050000");
    expect_answer("2f040500", "2f040500000000803e");
    // a parameter that is not persistent
    expect_answer("2f030000", "2f03000002");
    expect_answer("2f040000", "2f04000002");
}

static void test_a_change_by_the_vehicle_is_told(void)
{
    forget();
    fake_values.i16 = 258;
    for (int ms = 0; ms < 300; ms++)
    {
        ivl_crtp_step(&server);
    }
    TEST_ASSERT_EQUAL_STRING("2f0101000201", sent);
}

// ---- the server's own

static void write_own(const char *name, float value)
{
    const uint16_t id = id_of("fault", name);
    uint8_t        bytes[7] = {0x2e, (uint8_t)id, (uint8_t)(id >> 8)};
    memcpy(bytes + 3, &value, 4);
    ivl_crtp_receive(&server, bytes, sizeof bytes);
}

static void test_a_value_that_a_write_does_not_leave_is_told_at_once(void)
{
    // what was written is what it is: nobody is told
    const unsigned before = n_sent;
    write_own("loss", 0.5f);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_UINT(1, n_sent - before);
    write_own("loss", 7.0f);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_UINT(3, n_sent - before);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_UINT(3, n_sent - before);
}

static void test_fault_parameters_are_brought_into_range(void)
{
    write_own("loss", 0.25f);
    TEST_ASSERT_EQUAL_FLOAT(0.25f, server.own.fault.loss);
    TEST_ASSERT_TRUE(own_was_changed);
    write_own("loss", 7.0f);
    TEST_ASSERT_EQUAL_FLOAT(1.0f, server.own.fault.loss);
    write_own("delay_ms", -1.0f);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, server.own.fault.delay_ms);
    write_own("jitter_ms", NAN);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, server.own.fault.jitter_ms);
}

static void start_lockstep(void)
{
    char reply[IVL_CRTP_CONTROL_BYTES];
    ivl_crtp_control(&server, "sil.lockstep=1", 14, reply);
    TEST_ASSERT_EQUAL_STRING("sil.lockstep=1", reply);
}

static const char *run_to(uint32_t t_ms)
{
    static char    request[20];
    const uint16_t id = id_of("sil", "run_to_ms");
    (void)snprintf(request, sizeof request, "2e%02x%02x%02x%02x%02x%02x", id & 0xff, id >> 8, t_ms & 0xff, (t_ms >> 8) & 0xff,
                   (t_ms >> 16) & 0xff, t_ms >> 24);
    return request;
}

static void test_lockstep_run_is_answered_when_it_is_there(void)
{
    start_lockstep();
    expect_answer(run_to(3), "");
    ivl_crtp_step(&server);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("", sent);
    TEST_ASSERT_TRUE(server.own.time.running);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING(run_to(3), sent);
    TEST_ASSERT_FALSE(server.own.time.running);
    // again, and the past: nothing to do
    expect_answer(run_to(3), run_to(3));
    expect_answer(run_to(2), run_to(2));
    TEST_ASSERT_FALSE(server.own.time.running);
}

static void test_lockstep_run_by_name_is_answered_when_it_is_there_too(void)
{
    start_lockstep();
    expect_answer("2f0073696c0072756e5f746f5f6d73000a02000000", "");
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("", sent);
    ivl_crtp_step(&server);
    TEST_ASSERT_EQUAL_STRING("2f0073696c0072756e5f746f5f6d730000", sent);
}

static void test_lockstep_repetition_has_one_answer_and_a_new_request_ends_the_wait(void)
{
    start_lockstep();
    expect_answer(run_to(2), "");
    expect_answer(run_to(2), "");
    char first[20];
    (void)snprintf(first, sizeof first, "%s", run_to(2));
    expect_answer(run_to(4), first);
    forget();
    for (int i = 0; i < 4; i++)
    {
        ivl_crtp_step(&server);
    }
    TEST_ASSERT_EQUAL_STRING(run_to(4), sent);
}

static void test_lockstep_run_ends_early_where_the_client_wants(void)
{
    char reply[IVL_CRTP_CONTROL_BYTES];
    start_lockstep();
    ivl_crtp_control(&server, "sil.run_until=0x108", 19, reply);
    TEST_ASSERT_EQUAL_STRING("sil.run_until=264", reply);
    expect_answer(run_to(100), "");
    ivl_crtp_step(&server);
    fake_values.phase = 2;
    ivl_crtp_step(&server);
    TEST_ASSERT_TRUE(server.own.time.running);
    fake_values.phase = 3;
    ivl_crtp_step(&server);
    TEST_ASSERT_FALSE(server.own.time.running);
    TEST_ASSERT_EQUAL_STRING(run_to(100), sent);
    TEST_ASSERT_EQUAL_UINT32(3, server.own.time.run_to_ms);
    // a repetition does not run on; in the same phase a new run does
    expect_answer(run_to(100), run_to(100));
    expect_answer(run_to(101), "");
    ivl_crtp_step(&server);
    TEST_ASSERT_TRUE(server.own.time.running);
    fake_values.ended = 1;
    ivl_crtp_step(&server);
    TEST_ASSERT_FALSE(server.own.time.running);
}

static void test_leaving_lockstep_answers_who_waits(void)
{
    char reply[IVL_CRTP_CONTROL_BYTES];
    start_lockstep();
    expect_answer(run_to(50), "");
    ivl_crtp_control(&server, "sil.lockstep=0", 14, reply);
    TEST_ASSERT_EQUAL_STRING(run_to(50), sent);
    TEST_ASSERT_FALSE(server.own.time.running);
}

// ---- control channel

static void check_control(const char *request, const char *expected)
{
    char reply[IVL_CRTP_CONTROL_BYTES];
    ivl_crtp_control(&server, request, strlen(request), reply);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(expected, reply, request);
}

static void test_control_reads_and_writes_every_type(void)
{
    check_control("a.u8", "a.u8=2");
    check_control("a.u8=255\n", "a.u8=255");
    check_control("a.i16=-32768", "a.i16=-32768");
    check_control("a.u32=0xffffffff", "a.u32=4294967295");
    check_control("bb.f32=-1.5e3", "bb.f32=-1500");
    check_control("twelve_chars.of_24_in_all=0.1", "twelve_chars.of_24_in_all=0.10000000000000001");
    check_control("c.u64=18446744073709551615", "c.u64=18446744073709551615");
    check_control("l.i32", "l.i32=-100000");
    check_control("l.f32", "l.f32=-2.5");
}

static void test_control_refuses_what_does_not_fit(void)
{
    check_control("a.u8=256", "error: a.u8: 256 is no value of its type");
    check_control("a.u8=-1", "error: a.u8: -1 is no value of its type");
    check_control("a.i16=32768", "error: a.i16: 32768 is no value of its type");
    check_control("a.u8=", "error: a.u8:  is no value of its type");
    check_control("a.u8=3x", "error: a.u8: 3x is no value of its type");
    check_control("bb.f32=", "error: bb.f32:  is no value of its type");
    check_control("bb.ro=1", "error: bb.ro is read-only");
    check_control("l.i32=1", "error: no parameter l.i32");
    check_control("no.thing", "error: no variable no.thing");
    check_control("nonsense", "error: expected group.name or group.name=value");
    check_control("", "error: expected group.name or group.name=value");
    TEST_ASSERT_EQUAL_UINT8(2, fake_values.u8);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table_information_and_items);
    RUN_TEST(test_crc_depends_on_every_name_type_and_order);
    RUN_TEST(test_tables_with_bad_names_are_refused_by_name);
    RUN_TEST(test_longest_name_fills_a_packet);
    RUN_TEST(test_read);
    RUN_TEST(test_write_is_echoed_and_the_vehicle_is_told);
    RUN_TEST(test_write_to_read_only_is_not_answered);
    RUN_TEST(test_write_of_another_size_is_refused);
    RUN_TEST(test_set_by_name);
    RUN_TEST(test_extended_type);
    RUN_TEST(test_default_is_the_value_at_the_start);
    RUN_TEST(test_persistent_value_is_stored_told_and_cleared);
    RUN_TEST(test_a_change_by_the_vehicle_is_told);
    RUN_TEST(test_a_value_that_a_write_does_not_leave_is_told_at_once);
    RUN_TEST(test_fault_parameters_are_brought_into_range);
    RUN_TEST(test_lockstep_run_is_answered_when_it_is_there);
    RUN_TEST(test_lockstep_run_by_name_is_answered_when_it_is_there_too);
    RUN_TEST(test_lockstep_repetition_has_one_answer_and_a_new_request_ends_the_wait);
    RUN_TEST(test_lockstep_run_ends_early_where_the_client_wants);
    RUN_TEST(test_leaving_lockstep_answers_who_waits);
    RUN_TEST(test_control_reads_and_writes_every_type);
    RUN_TEST(test_control_refuses_what_does_not_fit);
    return UNITY_END();
}
