/// @file test_ivl_record.c
/// The flight recorder: what it holds after a flip, when it can be read, and what it makes of values that do not fit.
#include "ivl_record.h"
#include "test_ivl_support.h"

#define HEADER_SIZE 36u
#define ROW_SIZE    44u

static fix_t          fix;
static ivl_recorder_t recorder;
static uint8_t        image[HEADER_SIZE + ROW_SIZE * IVL_RECORD_ROWS];

static void tick(void)
{
    fix_tick(&fix);
    ivl_record_step(&recorder, &fix.cfg, &fix.state, &fix.out);
}

static void ticks(int n)
{
    for (int i = 0; i < n; i++)
    {
        tick();
    }
}

static void request(ivl_request_t what)
{
    fix.in.cmd.request = what;
    tick();
}

static void start_approach_with(const ivl_policy_t *policy, int n_ready)
{
    fix_init(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix.cfg, &fix.state, policy));
    tick();
    request(IVL_REQUEST_HOVER);
    ticks(n_ready);
    request(IVL_REQUEST_APPROACH);
}

static void start_approach(int n_ready)
{
    const ivl_policy_t policy = constant_policy(7, 4.0f, 0.008f);
    start_approach_with(&policy, n_ready);
}

static void trigger(void)
{
    fix.in.p_WB_m.z = 1.6f;
    fix.in.v_WB_mps.z = 2.5f;
    tick();
    assert_phase(IVL_PHASE_FLIP, &fix);
}

static uint32_t number_at(uint32_t address, uint32_t size)
{
    uint32_t value = 0;
    for (uint32_t i = 0; i < size; i++)
    {
        value |= (uint32_t)image[address + i] << (8u * i);
    }
    return value;
}

static uint32_t row_at(uint32_t row, uint32_t offset, uint32_t size)
{
    return number_at(HEADER_SIZE + row * ROW_SIZE + offset, size);
}

static void read_all(void)
{
    TEST_ASSERT_EQUAL_UINT32(sizeof image, ivl_record_size());
    TEST_ASSERT_TRUE(ivl_record_read(&recorder, 0, (uint32_t)sizeof image, image));
}

static void test_header_can_be_read_before_anything_is_recorded(void)
{
    ivl_record_init(&recorder);
    TEST_ASSERT_TRUE(ivl_record_read(&recorder, 0, HEADER_SIZE, image));
    TEST_ASSERT_EQUAL_MEMORY("IVLR", image, 4);
    TEST_ASSERT_EQUAL_UINT32(ROW_SIZE, number_at(5, 1));
    TEST_ASSERT_EQUAL_UINT32(0, number_at(6, 2));
    TEST_ASSERT_EQUAL_UINT32(IVL_RECORD_NONE, number_at(8, 2));
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, 0, HEADER_SIZE + 1u, image));
}

static void test_flip_is_recorded_with_what_was_before_it(void)
{
    ivl_record_init(&recorder);
    start_approach(1000);
    trigger();
    const uint32_t t_trigger_us = (uint32_t)fix.in.t_us;
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, HEADER_SIZE, ROW_SIZE, image));
    ticks(1000);
    read_all();
    TEST_ASSERT_EQUAL_UINT32(IVL_RECORD_ROWS, number_at(6, 2));
    TEST_ASSERT_EQUAL_UINT32(IVL_RECORD_ROWS - IVL_RECORD_ROWS_POST - 1u, number_at(8, 2));
    TEST_ASSERT_EQUAL_UINT32(1, number_at(10, 1));
    TEST_ASSERT_EQUAL_UINT32(1, number_at(12, 4));
    TEST_ASSERT_EQUAL_UINT32(7, number_at(16, 4));
    TEST_ASSERT_EQUAL_HEX32(constant_policy(7, 4.0f, 0.008f).id.crc, number_at(20, 4));
    TEST_ASSERT_EQUAL_UINT32(0, number_at(11, 1));
    TEST_ASSERT_EQUAL_UINT32(t_trigger_us, number_at(32, 4));
    // the row of the trigger, and order of time throughout
    const uint32_t row = number_at(8, 2);
    TEST_ASSERT_EQUAL_UINT32(t_trigger_us, row_at(row, 0, 4));
    TEST_ASSERT_EQUAL_UINT32(IVL_PHASE_FLIP, row_at(row, 42, 1));
    TEST_ASSERT_EQUAL_UINT32(IVL_PHASE_APPROACH, row_at(row - 1u, 42, 1));
    for (uint32_t i = 1; i < IVL_RECORD_ROWS; i++)
    {
        TEST_ASSERT_EQUAL_UINT32(2000u, row_at(i, 0, 4) - row_at(i - 1u, 0, 4));
    }
}

static void test_a_row_holds_each_component_of_what_was_sensed(void)
{
    ivl_record_init(&recorder);
    start_approach(10);
    fix.in.p_WB_m = ivl_vec3(0.11f, -0.22f, 1.6f);
    fix.in.v_WB_mps = ivl_vec3(0.33f, -0.44f, 2.5f);
    fix.in.q_WB = (ivl_quat_t){0.1f, -0.2f, 0.3f, 0.92736185f};
    fix.in.w_B_radps = ivl_vec3(1.0f, -2.0f, 3.0f);
    fix.in.f_B_mps2 = ivl_vec3(0.5f, -0.6f, 9.0f);
    tick();
    assert_phase(IVL_PHASE_FLIP, &fix);
    ticks(1000);
    read_all();
    const int16_t expected[16] = {110, -220, 1600, 330, -440, 2500, 3277, -6553, 9830, 30387, 32, -64, 96, 50, -60, 900};
    for (uint32_t i = 0; i < 16; i++)
    {
        TEST_ASSERT_INT16_WITHIN(1, expected[i], (int16_t)row_at(number_at(8, 2), 4u + 2u * i, 2));
    }
}

/// Minutes of hover after a no-go must not push the decision out of the ring.
static void test_a_no_go_is_recorded_with_its_decision_and_its_highest_point(void)
{
    ivl_record_init(&recorder);
    const ivl_policy_t policy = no_go_policy(8);
    start_approach_with(&policy, 1000);
    fix.in.p_WB_m.z = 1.6f;
    fix.in.v_WB_mps.z = 2.5f;
    tick();
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    const uint32_t t_decided_us = (uint32_t)fix.in.t_us;
    for (int i = 0; i < 150; i++)
    {
        fix.in.p_WB_m.z += fix.in.v_WB_mps.z / fix.cfg.tick_hz;
        fix.in.v_WB_mps.z -= 2.5f / 150.0f;
        tick();
    }
    fix.in.v_WB_mps.z = 0.0f;
    ticks(3000);
    read_all();
    const uint32_t row = number_at(8, 2);
    TEST_ASSERT_EQUAL_UINT32(IVL_RECORD_ROWS - IVL_RECORD_ROWS_POST - 1u, row);
    TEST_ASSERT_EQUAL_UINT32(8, number_at(16, 4));
    TEST_ASSERT_EQUAL_HEX32(policy.id.crc, number_at(20, 4));
    TEST_ASSERT_EQUAL_UINT32(policy.id.form, number_at(11, 1));
    TEST_ASSERT_EQUAL_UINT32(t_decided_us, number_at(32, 4));
    TEST_ASSERT_EQUAL_UINT32(t_decided_us, row_at(row, 0, 4));
    TEST_ASSERT_EQUAL_UINT32(IVL_RULE_NO_GO, row_at(row, 43, 1));
    TEST_ASSERT_EQUAL_UINT32(IVL_PHASE_APPROACH, row_at(row - 1u, 42, 1));
    TEST_ASSERT_INT_WITHIN(1, (int)(1000.0f * fix.in.p_WB_m.z), (int)row_at(row + 150u, 8, 2));
}

static void test_the_next_approach_of_the_same_cycle_is_a_recording_of_its_own(void)
{
    ivl_record_init(&recorder);
    const ivl_policy_t no_go = no_go_policy(8), go = constant_policy(9, 4.0f, 0.008f);
    start_approach_with(&no_go, 10);
    fix.in.p_WB_m.z = 1.6f;
    fix.in.v_WB_mps.z = 2.5f;
    tick();
    fix.in.v_WB_mps.z = 0.0f;
    ticks(1000);
    fix.in.p_WB_m.z = 1.0f;
    request(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
    // still the first one
    read_all();
    TEST_ASSERT_EQUAL_UINT32(1, number_at(12, 4));
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix.cfg, &fix.state, &go));
    request(IVL_REQUEST_APPROACH);
    trigger();
    ticks(1000);
    read_all();
    TEST_ASSERT_EQUAL_UINT32(2, number_at(12, 4));
    TEST_ASSERT_EQUAL_UINT32(9, number_at(16, 4));
    TEST_ASSERT_EQUAL_UINT32(IVL_PHASE_FLIP, row_at(number_at(8, 2), 42, 1));
}

static void test_row_holds_the_values_in_their_units(void)
{
    ivl_record_init(&recorder);
    start_approach(0);
    fix.in.p_WB_m = ivl_vec3(-1.5f, 0.25f, 1.6f);
    fix.in.v_WB_mps = ivl_vec3(0.5f, -0.125f, 2.5f);
    fix.in.w_B_radps = ivl_vec3(1.0f, -2.0f, 0.5f);
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, 12.5f);
    tick();
    assert_phase(IVL_PHASE_FLIP, &fix);
    request(IVL_REQUEST_IDLE);
    read_all();
    const uint32_t row = number_at(8, 2);
    const int16_t  expected[17] = {-1500, 250, 1600, 500, -125, 2500, 0, 0, 0, 32767, 32, -64, 16, 0, 0, 1250, 500};
    for (uint32_t i = 0; i < 17u; i++)
    {
        TEST_ASSERT_EQUAL_INT(expected[i], (int16_t)row_at(row, 4u + 2u * i, 2));
    }
    // front pair: M / (2 arm_x) = 0.1212 N of 0.1615 N
    TEST_ASSERT_EQUAL_UINT32(191, row_at(row, 38, 1));
    TEST_ASSERT_EQUAL_UINT32(0, row_at(row, 39, 1));
    TEST_ASSERT_EQUAL_UINT32(0, row_at(row, 40, 1));
    TEST_ASSERT_EQUAL_UINT32(191, row_at(row, 41, 1));
}

static void test_values_beyond_the_type_are_limited(void)
{
    ivl_record_init(&recorder);
    start_approach(0);
    trigger();
    fix.in.p_WB_m = ivl_vec3(199.0f, -199.0f, 1.0f);
    fix.in.f_B_mps2 = ivl_vec3(1.0e6f, -1.0e6f, 0.0f);
    tick();
    request(IVL_REQUEST_IDLE);
    read_all();
    const uint32_t row = number_at(8, 2) + 1u;
    TEST_ASSERT_EQUAL_INT(32767, (int16_t)row_at(row, 4, 2));
    TEST_ASSERT_EQUAL_INT(-32767, (int16_t)row_at(row, 6, 2));
    TEST_ASSERT_EQUAL_INT(32767, (int16_t)row_at(row, 30, 2));
    TEST_ASSERT_EQUAL_INT(-32767, (int16_t)row_at(row, 32, 2));
}

static void test_cycle_without_trigger_freezes_when_it_ends(void)
{
    ivl_record_init(&recorder);
    start_approach(10);
    request(IVL_REQUEST_IDLE);
    read_all();
    TEST_ASSERT_EQUAL_UINT32(12, number_at(6, 2));
    TEST_ASSERT_EQUAL_UINT32(IVL_RECORD_NONE, number_at(8, 2));
    // rows beyond the last one are 0
    for (uint32_t i = 0; i < ROW_SIZE; i++)
    {
        TEST_ASSERT_EQUAL_UINT32(0, row_at(12, i, 1));
    }
}

static void test_recording_stays_until_the_next_arm_cycle_and_its_number_changes(void)
{
    ivl_record_init(&recorder);
    start_approach(10);
    trigger();
    ticks(500);
    read_all();
    static uint8_t before[sizeof image];
    memcpy(before, image, sizeof image);
    request(IVL_REQUEST_IDLE);
    ticks(2000);
    read_all();
    TEST_ASSERT_EQUAL_MEMORY(before, image, sizeof image);
    fix.in.p_WB_m.z = 1.0f;
    fix.in.v_WB_mps.z = 0.0f;
    request(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, 0, HEADER_SIZE + 1u, image));
    TEST_ASSERT_TRUE(ivl_record_read(&recorder, 0, HEADER_SIZE, image));
    TEST_ASSERT_EQUAL_UINT32(0, number_at(10, 1));
    TEST_ASSERT_EQUAL_UINT32(2, number_at(12, 4));
}

static void test_reads_outside_are_refused_and_pieces_make_the_whole(void)
{
    ivl_record_init(&recorder);
    start_approach(600);
    request(IVL_REQUEST_IDLE);
    read_all();
    const uint32_t size = (uint32_t)sizeof image;
    uint8_t        piece[24];
    for (uint32_t at = 0; at < size; at += sizeof piece)
    {
        const uint32_t n = (size - at < sizeof piece) ? size - at : (uint32_t)sizeof piece;
        TEST_ASSERT_TRUE(ivl_record_read(&recorder, at, n, piece));
        TEST_ASSERT_EQUAL_MEMORY(image + at, piece, n);
    }
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, size, 1, piece));
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, size - 1u, 2, piece));
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, UINT32_MAX, 24, piece));
    TEST_ASSERT_FALSE(ivl_record_read(&recorder, 8, UINT32_MAX, piece));
    TEST_ASSERT_TRUE(ivl_record_read(&recorder, size, 0, piece));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_header_can_be_read_before_anything_is_recorded);
    RUN_TEST(test_flip_is_recorded_with_what_was_before_it);
    RUN_TEST(test_a_row_holds_each_component_of_what_was_sensed);
    RUN_TEST(test_a_no_go_is_recorded_with_its_decision_and_its_highest_point);
    RUN_TEST(test_the_next_approach_of_the_same_cycle_is_a_recording_of_its_own);
    RUN_TEST(test_row_holds_the_values_in_their_units);
    RUN_TEST(test_values_beyond_the_type_are_limited);
    RUN_TEST(test_cycle_without_trigger_freezes_when_it_ends);
    RUN_TEST(test_recording_stays_until_the_next_arm_cycle_and_its_number_changes);
    RUN_TEST(test_reads_outside_are_refused_and_pieces_make_the_whole);
    return UNITY_END();
}
