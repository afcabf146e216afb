/// @file test_ivl_phase.c
/// Every exit of the phase table, every phase that must ignore a request, and faults injected in each phase.
#include "test_ivl_support.h"

static const ivl_phase_t ALL[] = {IVL_PHASE_IDLE,     IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_FLIP,     IVL_PHASE_COAST,
                                  IVL_PHASE_ATTACHED, IVL_PHASE_DONE,  IVL_PHASE_ABORTED,  IVL_PHASE_LEVEL_OUT};
static fix_t             fix;

static void tick_to(ivl_phase_t expected)
{
    fix_tick(&fix);
    assert_phase(expected, &fix);
    assert_output_sane(&fix);
}

#ifndef IVL_NO_TEXT
static void test_phases_have_names(void)
{
    const char *const names[] = {"idle", "ready", "approach", "flip", "coast", "attached", "done", "aborted", "level_out"};
    for (int i = 0; i < (int)IVL_PHASE_COUNT; i++)
    {
        TEST_ASSERT_EQUAL_STRING(names[i], ivl_phase_name((ivl_phase_t)i));
    }
    TEST_ASSERT_EQUAL_STRING("?", ivl_phase_name(IVL_PHASE_COUNT));
    TEST_ASSERT_EQUAL_STRING("?", ivl_phase_name((ivl_phase_t)1000));
}
#endif

static void test_each_phase_can_be_reached_and_stays_when_nothing_changes(void)
{
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        fix_to_phase(&fix, ALL[i]);
        assert_phase(ALL[i], &fix);
        tick_to(ALL[i]);
        tick_to(ALL[i]);
    }
}

static void test_motors_run_in_four_phases_only(void)
{
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        const ivl_phase_t p = ALL[i];
        fix_to_phase(&fix, p);
        fix_tick(&fix);
        const bool expected = (p == IVL_PHASE_READY) || (p == IVL_PHASE_APPROACH) || (p == IVL_PHASE_FLIP) || (p == IVL_PHASE_ABORTED) ||
                              (p == IVL_PHASE_LEVEL_OUT);
        TEST_ASSERT_EQUAL_INT(expected, fix.out.motors_on);
        TEST_ASSERT_EQUAL_INT(expected, fix.out.thrust_total_N > 0.0f);
        TEST_ASSERT_EQUAL_INT(!expected && (p != IVL_PHASE_IDLE), ivl_motors_latched_off(&fix.state));
    }
}

static void test_request_idle_leads_to_idle_from_every_phase_at_once(void)
{
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        fix_to_phase(&fix, ALL[i]);
        fix_request(&fix, IVL_REQUEST_IDLE);
        assert_phase(IVL_PHASE_IDLE, &fix);
        assert_motors_off(&fix);
    }
}

static void test_request_abort_hovers_before_the_trigger_and_does_nothing_after_it(void)
{
    const ivl_phase_t expected[] = {IVL_PHASE_IDLE,     IVL_PHASE_ABORTED, IVL_PHASE_ABORTED, IVL_PHASE_FLIP,   IVL_PHASE_COAST,
                                    IVL_PHASE_ATTACHED, IVL_PHASE_DONE,    IVL_PHASE_ABORTED, IVL_PHASE_ABORTED};
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        fix_to_phase(&fix, ALL[i]);
        fix_request(&fix, IVL_REQUEST_ABORT);
        assert_phase(expected[i], &fix);
        const bool is_on = (expected[i] == IVL_PHASE_ABORTED) || (expected[i] == IVL_PHASE_FLIP);
        TEST_ASSERT_EQUAL_INT(is_on, fix.out.motors_on);
    }
}

static void test_approach_passes_through_ready_in_the_same_tick(void)
{
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_APPROACH, &fix);
}

static void test_approach_triggers_in_the_first_tick_when_the_threshold_is_zero(void)
{
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    fix_policy(&fix, 0.0f, 0.008f);
    fix.in.v_WB_mps.z = 2.0f;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_FLIP, &fix);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.1f, fix.state.snapshot.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, -0.008f, fix.out.pitch_moment_Nm);
}

static void test_approach_waits_in_ready_for_the_policy_and_the_minimum_stay(void)
{
    fix_init(&fix);
    fix.cfg.ready_s_min = 0.1f;
    ivl_init(&fix.cfg, &fix.state);
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_READY, &fix);
    fix_ticks(&fix, 0.2f);
    assert_phase(IVL_PHASE_READY, &fix);
    fix_policy(&fix, 4.0f, 0.008f);
    tick_to(IVL_PHASE_APPROACH);
    // with a policy, only the stay counts: entered at tick 0, 50 ticks of 2 ms
    fix_request(&fix, IVL_REQUEST_IDLE);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    fix_ticks(&fix, 0.096f);
    assert_phase(IVL_PHASE_READY, &fix);
    fix_ticks(&fix, 0.006f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
}

static void test_ready_hovers_where_it_began_when_no_hover_point_was_given(void)
{
    fix_init(&fix);
    fix.in.cmd.p_hover_W_m = ivl_vec3(NAN, NAN, NAN);
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_READY, &fix);
    TEST_ASSERT_EQUAL_MEMORY(&fix.in.p_WB_m, &fix.state.p_hold_W_m, sizeof(ivl_vec3_t));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, fix.cfg.mass_kg * fix.cfg.gravity_mps2, fix.out.thrust_total_N);
}

static void test_hover_request_calls_an_approach_back(void)
{
    fix_to_phase(&fix, IVL_PHASE_APPROACH);
    fix_request(&fix, IVL_REQUEST_HOVER);
    // which is no no-go, but goes the same way
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    TEST_ASSERT_EQUAL_UINT32(0u, fix.state.diag.n_no_go);
    fix_ticks(&fix, 1.0f);
    assert_phase(IVL_PHASE_READY, &fix);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_APPROACH, &fix);
}

static void test_vehicle_that_is_tipped_over_is_not_armed_and_aborts(void)
{
    const ivl_quat_t over = {0.0f, 0.70710678f, 0.0f, 0.70710678f};  // 90 degrees
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    fix.in.q_WB = over;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE, &fix);
    const ivl_phase_t flying[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH};
    for (int i = 0; i < 2; i++)
    {
        fix_to_phase(&fix, flying[i]);
        fix.in.q_WB = over;
        tick_to(IVL_PHASE_ABORTED);
        assert_motors_off(&fix);
    }
}

static void test_approach_aborts_when_it_takes_too_long(void)
{
    fix_to_phase(&fix, IVL_PHASE_APPROACH);
    fix_ticks(&fix, fix.cfg.approach_s_max - 0.01f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix_ticks(&fix, 0.02f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    TEST_ASSERT_TRUE(fix.out.motors_on);
}

static void test_trigger_is_live_in_approach_only(void)
{
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        fix_to_phase(&fix, ALL[i]);
        const uint32_t before = fix.state.diag.n_trigger;
        fix.in.q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
        fix.in.p_WB_m.z = 1.9f;
        fix.in.v_WB_mps.z = 3.0f;
        fix_ticks(&fix, 0.02f);
        TEST_ASSERT_EQUAL_UINT32(before + (ALL[i] == IVL_PHASE_APPROACH ? 1u : 0u), fix.state.diag.n_trigger);
    }
}

// intrusive: the table never leads back to approach after a trigger, and the trigger itself refuses as well
static void test_trigger_does_not_fire_twice_when_the_phase_is_forced_back(void)
{
    fix_to_phase(&fix, IVL_PHASE_FLIP);
    fix.state.phase = IVL_PHASE_APPROACH;
    tick_to(IVL_PHASE_APPROACH);
    TEST_ASSERT_EQUAL_UINT32(1, fix.state.diag.n_trigger);
}

static void test_flip_is_cut_when_the_body_passes_the_horizontal(void)
{
    fix_to_phase(&fix, IVL_PHASE_FLIP);
    // 89.9 degrees nose up, then 90.1
    fix.in.q_WB = (ivl_quat_t){0.0f, -sinf(0.78452f), 0.0f, cosf(0.78452f)};
    tick_to(IVL_PHASE_FLIP);
    fix.in.q_WB = (ivl_quat_t){0.0f, -sinf(0.78627f), 0.0f, cosf(0.78627f)};
    tick_to(IVL_PHASE_COAST);
    // latched: level again, and still off
    fix.in.q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
    tick_to(IVL_PHASE_COAST);
    assert_motors_off(&fix);
}

static void test_flip_goes_on_inverted_when_the_option_is_off_until_its_time_is_over(void)
{
    fix_to_phase(&fix, IVL_PHASE_FLIP);
    fix.cfg.cut_at_inverted = 0;
    fix.in.q_WB = (ivl_quat_t){0.0f, 1.0f, 0.0f, 0.0f};
    fix_ticks(&fix, fix.cfg.flip_s_max - 0.01f);
    assert_phase(IVL_PHASE_FLIP, &fix);
    fix_ticks(&fix, 0.02f);
    assert_phase(IVL_PHASE_COAST, &fix);
}

static void test_contact_cuts_in_flip_and_coast_when_the_option_is_on(void)
{
    const ivl_phase_t from[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST};
    for (int i = 0; i < 2; i++)
    {
        for (uint8_t on = 0; on < 2u; on++)
        {
            fix_to_phase(&fix, from[i]);
            fix.cfg.cut_on_contact = on;
            fix.in.f_B_mps2 = ivl_vec3(-40.0f, 0.0f, 0.0f);
            tick_to((on != 0u) ? IVL_PHASE_ATTACHED : from[i]);
        }
    }
}

static void test_contact_means_nothing_before_the_trigger(void)
{
    const ivl_phase_t from[] = {IVL_PHASE_IDLE, IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_ABORTED, IVL_PHASE_LEVEL_OUT};
    for (int i = 0; i < 5; i++)
    {
        fix_to_phase(&fix, from[i]);
        fix.in.f_B_mps2 = ivl_vec3(-40.0f, 0.0f, 0.0f);
        tick_to(from[i]);
    }
}

static void test_hanging_ends_the_coast_without_a_contact(void)
{
    fix_to_phase(&fix, IVL_PHASE_COAST);
    fix.cfg.cut_on_contact = 0;
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, -9.81f);
    fix_ticks(&fix, 0.18f);
    assert_phase(IVL_PHASE_COAST, &fix);
    fix_ticks(&fix, 0.04f);
    assert_phase(IVL_PHASE_ATTACHED, &fix);
}

static void test_coast_and_attached_end_in_done_after_their_time(void)
{
    fix_to_phase(&fix, IVL_PHASE_COAST);
    fix_ticks(&fix, fix.cfg.coast_s_max - 0.02f);
    assert_phase(IVL_PHASE_COAST, &fix);
    fix_ticks(&fix, 0.04f);
    assert_phase(IVL_PHASE_DONE, &fix);
    fix_to_phase(&fix, IVL_PHASE_ATTACHED);
    fix_ticks(&fix, fix.cfg.attached_s - 0.02f);
    assert_phase(IVL_PHASE_ATTACHED, &fix);
    fix_ticks(&fix, 0.04f);
    assert_phase(IVL_PHASE_DONE, &fix);
}

static void test_only_idle_then_hover_starts_the_next_cycle(void)
{
    fix_to_phase(&fix, IVL_PHASE_DONE);
    fix.in.q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, 9.81f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_DONE, &fix);
    fix_request(&fix, IVL_REQUEST_ABORT);
    assert_phase(IVL_PHASE_DONE, &fix);
    fix_request(&fix, IVL_REQUEST_IDLE);
    assert_phase(IVL_PHASE_IDLE, &fix);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_IDLE, &fix);
    TEST_ASSERT_TRUE(fix.state.snapshot.sample.t_us > 0u);  // still there to be read
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
    TEST_ASSERT_EQUAL_UINT64(0, fix.state.snapshot.sample.t_us);
    // and the whole cycle works again
    fix.in.p_WB_m.z = 1.0f;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    fix.in.p_WB_m.z = 1.6f;
    tick_to(IVL_PHASE_FLIP);
    TEST_ASSERT_EQUAL_UINT32(2, fix.state.diag.n_trigger);
}

static void test_aborted_stays_off_when_the_state_comes_back(void)
{
    fix_to_phase(&fix, IVL_PHASE_ABORTED);
    const ivl_in_t good = fix.in;
    fix.in.p_WB_m.z = NAN;
    fix_ticks(&fix, 0.2f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_motors_off(&fix);
    TEST_ASSERT_TRUE(ivl_motors_latched_off(&fix.state));
    fix.in.p_WB_m = good.p_WB_m;
    fix_ticks(&fix, 0.2f);
    assert_motors_off(&fix);
    // a new cycle clears it
    fix_request(&fix, IVL_REQUEST_IDLE);
    fix_request(&fix, IVL_REQUEST_HOVER);
    TEST_ASSERT_TRUE(fix.out.motors_on);
}

static void test_short_gap_in_the_inputs_is_flown_through(void)
{
    const ivl_phase_t from[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_FLIP, IVL_PHASE_ABORTED, IVL_PHASE_LEVEL_OUT};
    for (int i = 0; i < 5; i++)
    {
        fix_to_phase(&fix, from[i]);
        const ivl_in_t good = fix.in;
        fix.in.w_B_radps.y = NAN;
        fix_ticks(&fix, 0.09f);
        assert_phase(from[i], &fix);
        TEST_ASSERT_TRUE(fix.out.motors_on);
        fix.in.w_B_radps = good.w_B_radps;
        tick_to(from[i]);
    }
}

// every kind of bad input, for longer than a sample may be old, in every phase
static void test_spoiled_inputs_never_trigger_and_end_in_a_safe_phase_from_every_phase(void)
{
    const ivl_phase_t expected[] = {IVL_PHASE_IDLE,     IVL_PHASE_ABORTED, IVL_PHASE_ABORTED, IVL_PHASE_COAST,  IVL_PHASE_COAST,
                                    IVL_PHASE_ATTACHED, IVL_PHASE_DONE,    IVL_PHASE_ABORTED, IVL_PHASE_ABORTED};
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        for (uint32_t kind = 0; kind < SPOIL_COUNT; kind++)
        {
            fix_to_phase(&fix, ALL[i]);
            const uint32_t n_trigger = fix.state.diag.n_trigger;
            // a state that would trigger if only it were good
            fix.in.p_WB_m.z = 1.9f;
            fix.in.v_WB_mps.z = 3.0f;
            const ivl_in_t good = fix.in;
            for (int k = 0; k < 60; k++)
            {
                const uint64_t now_us = fix.in.t_us;
                fix.in = good;
                fix.in.t_us = now_us + 2000u;
                fix.in.t_pose_us = fix.in.t_us;
                spoil(&fix.in, kind);
                ivl_step(&fix.cfg, &fix.state, &fix.in, &fix.out);
                assert_output_sane(&fix);
            }
            assert_phase(expected[i], &fix);
            // only a command that makes no sense leaves a state that a hover can be flown on
            TEST_ASSERT_EQUAL_INT(spoils_command(kind) && (expected[i] == IVL_PHASE_ABORTED), fix.out.motors_on);
            TEST_ASSERT_EQUAL_UINT32(n_trigger, fix.state.diag.n_trigger);
        }
    }
}

/// Each half of what arming asks of a tick, spoiled alone: a good request that was taken before does not stand in for a bad one.
static void test_arming_needs_state_and_command_of_the_same_tick(void)
{
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    const ivl_in_t good = fix.in;
    fix.in.q_WB.w = NAN;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE, &fix);
    fix.in.q_WB = good.q_WB;
    fix.in.cmd.p_hover_W_m.x = NAN;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_IDLE, &fix);
    fix.in.cmd.p_hover_W_m = good.cmd.p_hover_W_m;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_READY, &fix);
}

int main(void)
{
    UNITY_BEGIN();
#ifndef IVL_NO_TEXT
    RUN_TEST(test_phases_have_names);
#endif
    RUN_TEST(test_each_phase_can_be_reached_and_stays_when_nothing_changes);
    RUN_TEST(test_motors_run_in_four_phases_only);
    RUN_TEST(test_request_idle_leads_to_idle_from_every_phase_at_once);
    RUN_TEST(test_request_abort_hovers_before_the_trigger_and_does_nothing_after_it);
    RUN_TEST(test_approach_passes_through_ready_in_the_same_tick);
    RUN_TEST(test_approach_triggers_in_the_first_tick_when_the_threshold_is_zero);
    RUN_TEST(test_approach_waits_in_ready_for_the_policy_and_the_minimum_stay);
    RUN_TEST(test_ready_hovers_where_it_began_when_no_hover_point_was_given);
    RUN_TEST(test_hover_request_calls_an_approach_back);
    RUN_TEST(test_vehicle_that_is_tipped_over_is_not_armed_and_aborts);
    RUN_TEST(test_approach_aborts_when_it_takes_too_long);
    RUN_TEST(test_trigger_is_live_in_approach_only);
    RUN_TEST(test_trigger_does_not_fire_twice_when_the_phase_is_forced_back);
    RUN_TEST(test_flip_is_cut_when_the_body_passes_the_horizontal);
    RUN_TEST(test_flip_goes_on_inverted_when_the_option_is_off_until_its_time_is_over);
    RUN_TEST(test_contact_cuts_in_flip_and_coast_when_the_option_is_on);
    RUN_TEST(test_contact_means_nothing_before_the_trigger);
    RUN_TEST(test_hanging_ends_the_coast_without_a_contact);
    RUN_TEST(test_coast_and_attached_end_in_done_after_their_time);
    RUN_TEST(test_only_idle_then_hover_starts_the_next_cycle);
    RUN_TEST(test_aborted_stays_off_when_the_state_comes_back);
    RUN_TEST(test_short_gap_in_the_inputs_is_flown_through);
    RUN_TEST(test_spoiled_inputs_never_trigger_and_end_in_a_safe_phase_from_every_phase);
    RUN_TEST(test_arming_needs_state_and_command_of_the_same_tick);
    return UNITY_END();
}
