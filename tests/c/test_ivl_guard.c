/// @file test_ivl_guard.c
/// One test for each safety rule: what it does in the phases of its row, and that it does nothing in the others.
#include "ivl_cfg_name.h"
#include "test_ivl_support.h"

static const ivl_phase_t ALL[] = {IVL_PHASE_IDLE,     IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_FLIP,     IVL_PHASE_COAST,
                                  IVL_PHASE_ATTACHED, IVL_PHASE_DONE,  IVL_PHASE_ABORTED,  IVL_PHASE_LEVEL_OUT};
static fix_t             fix;
static bool              is_tested[IVL_RULE_COUNT];

typedef void (*spoiler_t)(ivl_in_t *in);

static bool is_before_trigger(ivl_phase_t phase)
{
    return (phase == IVL_PHASE_IDLE) || (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_LEVEL_OUT);
}

/// In a phase, with vitals that are given and good.
static void bring_to(ivl_phase_t phase)
{
    fix_to_phase(&fix, phase);
    fix.in.vitals = good_vitals();
    fix_tick(&fix);
    assert_phase(phase, &fix);
}

static void assert_rule(ivl_rule_t expected, uint8_t found)
{
    TEST_ASSERT_EQUAL_INT(expected, found);
}

/// A rule whose condition is a matter of one input: before the trigger it refuses to arm and aborts, later it changes nothing at all.
static void check_rule_before_trigger(ivl_rule_t rule, spoiler_t spoiler)
{
    is_tested[rule] = true;
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        bring_to(ALL[i]);
        spoiler(&fix.in);
        const bool is_on = fix.out.motors_on;
        TEST_ASSERT_EQUAL_INT(is_before_trigger(ALL[i]), ivl_guard_applies(rule, ALL[i]));
        if (ALL[i] == IVL_PHASE_IDLE)
        {
            fix_request(&fix, IVL_REQUEST_HOVER);
            assert_phase(IVL_PHASE_IDLE, &fix);
            assert_rule(rule, fix.state.guard.rule);
        }
        else if (is_before_trigger(ALL[i]))
        {
            fix_tick(&fix);
            assert_phase(IVL_PHASE_ABORTED, &fix);
            assert_rule(rule, fix.state.guard.cause);
        }
        else
        {
            fix_tick(&fix);
            assert_phase(ALL[i], &fix);
            TEST_ASSERT_EQUAL_INT(is_on, fix.out.motors_on);
        }
        assert_output_sane(&fix);
    }
}

/// A rule about arming alone.
static void check_rule_of_arming(ivl_rule_t rule, spoiler_t spoiler)
{
    is_tested[rule] = true;
    for (size_t i = 0; i < IVL_PHASE_COUNT; i++)
    {
        bring_to(ALL[i]);
        spoiler(&fix.in);
        TEST_ASSERT_EQUAL_INT(ALL[i] == IVL_PHASE_IDLE, ivl_guard_applies(rule, ALL[i]));
        fix_tick(&fix);
        assert_phase(ALL[i], &fix);
    }
    bring_to(IVL_PHASE_IDLE);
    const ivl_in_t good = fix.in;
    spoiler(&fix.in);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE, &fix);
    assert_rule(rule, fix.state.guard.rule);
    fix.in.vitals = good.vitals;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
}

// ---- the table as such

#ifndef IVL_NO_TEXT
static void test_rules_have_names(void)
{
    TEST_ASSERT_EQUAL_STRING("none", ivl_guard_name(IVL_RULE_NONE));
    TEST_ASSERT_EQUAL_STRING("battery", ivl_guard_name(IVL_RULE_BATTERY));
    TEST_ASSERT_EQUAL_STRING("no_go", ivl_guard_name(IVL_RULE_NO_GO));
    TEST_ASSERT_EQUAL_STRING("level_out_time", ivl_guard_name(IVL_RULE_LEVEL_OUT_TIME));
    TEST_ASSERT_EQUAL_STRING("?", ivl_guard_name(IVL_RULE_COUNT));
    for (int i = 1; i < (int)IVL_RULE_COUNT; i++)
    {
        TEST_ASSERT_TRUE(strlen(ivl_guard_name((ivl_rule_t)i)) > 2u);
    }
}
#endif

static void test_rules_have_an_act(void)
{
    TEST_ASSERT_EQUAL_INT(IVL_ACT_NONE, ivl_guard_act(IVL_RULE_NONE));
    const int no_rules[] = {(int)IVL_RULE_COUNT, (int)IVL_RULE_COUNT + 1, 255, 256, 65535, 1 << 24, 2147483647};
    for (size_t i = 0; i < sizeof no_rules / sizeof no_rules[0]; i++)
    {
        TEST_ASSERT_EQUAL_INT(IVL_ACT_NONE, ivl_guard_act((ivl_rule_t)no_rules[i]));
        TEST_ASSERT_FALSE(ivl_guard_discards((ivl_rule_t)no_rules[i]));
#ifndef IVL_NO_TEXT
        TEST_ASSERT_EQUAL_STRING("?", ivl_guard_name((ivl_rule_t)no_rules[i]));
#endif
        for (int phase = 0; phase < (int)IVL_PHASE_COUNT; phase++)
        {
            TEST_ASSERT_FALSE(ivl_guard_applies((ivl_rule_t)no_rules[i], (ivl_phase_t)phase));
        }
    }
    TEST_ASSERT_EQUAL_INT(IVL_ACT_NONE, ivl_guard_act(IVL_RULE_COUNT));
    for (int phase = 0; phase < (int)IVL_PHASE_COUNT; phase++)
    {
        TEST_ASSERT_FALSE(ivl_guard_applies(IVL_RULE_COUNT, (ivl_phase_t)phase));
        TEST_ASSERT_FALSE(ivl_guard_applies(IVL_RULE_NONE, (ivl_phase_t)phase));
    }
    TEST_ASSERT_FALSE(ivl_guard_applies(IVL_RULE_STATE, IVL_PHASE_COUNT));
    for (int i = 1; i < (int)IVL_RULE_COUNT; i++)
    {
        TEST_ASSERT_TRUE(ivl_guard_act((ivl_rule_t)i) != IVL_ACT_NONE);
    }
}

static void test_no_rule_aborts_a_flip_or_what_follows_it(void)
{
    const ivl_phase_t after[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST, IVL_PHASE_ATTACHED, IVL_PHASE_DONE};
    for (int i = 0; i < (int)IVL_RULE_COUNT; i++)
    {
        for (size_t k = 0; k < sizeof after / sizeof after[0]; k++)
        {
            const bool is_abort = ivl_guard_act((ivl_rule_t)i) == IVL_ACT_ABORT;
            TEST_ASSERT_FALSE(is_abort && ivl_guard_applies((ivl_rule_t)i, after[k]));
        }
    }
}

static void test_vitals_that_are_not_given_satisfy_every_rule(void)
{
    const ivl_vitals_t none = {
        .vbat_V = NAN, .link_age_s = 1.0e9f, .setpoint_age_s = NAN, .host_age_s = NAN, .p_sigma_m = INFINITY, .bypassed = true};
    const ivl_phase_t from[] = {IVL_PHASE_IDLE, IVL_PHASE_READY, IVL_PHASE_APPROACH};
    for (int i = 0; i < 3; i++)
    {
        fix_to_phase(&fix, from[i]);
        fix.in.vitals = none;
        fix_request(&fix, (from[i] == IVL_PHASE_APPROACH) ? IVL_REQUEST_APPROACH : IVL_REQUEST_HOVER);
        fix_ticks(&fix, 0.1f);
        assert_phase((from[i] == IVL_PHASE_APPROACH) ? IVL_PHASE_APPROACH : IVL_PHASE_READY, &fix);
        assert_rule(IVL_RULE_NONE, fix.state.guard.cause);
    }
}

// ---- to arm

static void spoil_config(ivl_in_t *in)
{
    in->vitals.configured = false;
}

static void test_rule_config_refuses_to_arm_before_a_configuration_is_in_force(void)
{
    check_rule_of_arming(IVL_RULE_CONFIG, spoil_config);
}

static void spoil_bypass(ivl_in_t *in)
{
    in->vitals.bypassed = true;
}

static void test_rule_bypass_refuses_to_arm_while_motors_are_driven_past_the_core(void)
{
    check_rule_of_arming(IVL_RULE_BYPASS, spoil_bypass);
}

/// One vital with its limit: beyond is larger, or for the battery smaller.
typedef struct
{
    float     *value;
    float      limit, beyond;
    ivl_rule_t rule;
} vital_t;

static void assert_vital(const vital_t *vital, float value, ivl_rule_t expected)
{
    fix_to_phase(&fix, IVL_PHASE_READY);
    fix.in.vitals = good_vitals();
    *vital->value = value;
    fix_tick(&fix);
    assert_rule(expected, fix.state.guard.rule | fix.state.guard.cause);
    assert_phase((expected == IVL_RULE_NONE) ? IVL_PHASE_READY : IVL_PHASE_ABORTED, &fix);
}

static void test_each_vital_is_good_at_its_limit_and_bad_one_step_beyond_it(void)
{
    fix_init(&fix);
    const ivl_cfg_t cfg = fix.cfg;
    ivl_vitals_t   *in = &fix.in.vitals;
    const vital_t   vitals[] = {
        {&in->link_age_s, cfg.link_s_max, INFINITY, IVL_RULE_LINK}, {&in->setpoint_age_s, cfg.setpoint_s_max, INFINITY, IVL_RULE_SETPOINT},
        {&in->host_age_s, cfg.host_s_max, INFINITY, IVL_RULE_HOST}, {&in->p_sigma_m, cfg.p_sigma_m_max, INFINITY, IVL_RULE_UNCERTAIN},
        {&in->vbat_V, cfg.vbat_V_min, -INFINITY, IVL_RULE_BATTERY},
    };
    for (size_t i = 0; i < sizeof vitals / sizeof vitals[0]; i++)
    {
        const vital_t *vital = &vitals[i];
        assert_vital(vital, vital->limit, IVL_RULE_NONE);
        assert_vital(vital, nextafterf(vital->limit, -vital->beyond), IVL_RULE_NONE);
        assert_vital(vital, nextafterf(vital->limit, vital->beyond), vital->rule);
        assert_vital(vital, vital->beyond, vital->rule);
        assert_vital(vital, NAN, vital->rule);
    }
}

static void test_rule_rearm_wants_hover_after_a_landing(void)
{
    is_tested[IVL_RULE_REARM] = true;
    bring_to(IVL_PHASE_DONE);
    fix_request(&fix, IVL_REQUEST_IDLE);
    fix.in = good_input();
    fix.in.vitals = good_vitals();
    fix.in.t_us = fix.in.t_pose_us = 100000000u;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_IDLE, &fix);
    assert_rule(IVL_RULE_REARM, fix.state.guard.rule);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
}

static void spoil_battery_rest(ivl_in_t *in)
{
    in->vitals.vbat_V = 3.1f;
}

static void test_rule_battery_rest_refuses_to_arm_on_a_weak_battery(void)
{
    check_rule_of_arming(IVL_RULE_BATTERY_REST, spoil_battery_rest);
}

// ---- before the trigger

static void test_rule_state_aborts_when_the_estimate_is_too_old(void)
{
    is_tested[IVL_RULE_STATE] = true;
    const ivl_phase_t from[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH};
    for (int i = 0; i < 2; i++)
    {
        bring_to(from[i]);
        fix.in.p_WB_m.x = NAN;
        fix_ticks(&fix, 0.09f);
        assert_phase(from[i], &fix);
        fix_ticks(&fix, 0.02f);
        assert_phase(IVL_PHASE_ABORTED, &fix);
        assert_rule(IVL_RULE_STATE, fix.state.guard.cause);
        assert_motors_off(&fix);
    }
    // and nothing arms on a state that never came
    fix_init(&fix);
    fix.in.p_WB_m.x = NAN;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE, &fix);
    assert_rule(IVL_RULE_STATE, fix.state.guard.rule);
}

static void test_rule_tilt_aborts_and_refuses_beyond_tilt_abort(void)
{
    is_tested[IVL_RULE_TILT] = true;
    const ivl_phase_t from[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH};
    const ivl_quat_t  over = {0.0f, 0.70710678f, 0.0f, 0.70710678f};
    for (int i = 0; i < 2; i++)
    {
        bring_to(from[i]);
        fix.in.q_WB = over;
        fix_tick(&fix);
        assert_phase(IVL_PHASE_ABORTED, &fix);
        assert_rule(IVL_RULE_TILT, fix.state.guard.cause);
        assert_motors_off(&fix);
    }
    bring_to(IVL_PHASE_IDLE);
    fix.in.q_WB = over;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE, &fix);
    assert_rule(IVL_RULE_TILT, fix.state.guard.rule);
}

static void test_rule_command_aborts_when_commands_make_no_sense_for_too_long(void)
{
    is_tested[IVL_RULE_COMMAND] = true;
    bring_to(IVL_PHASE_APPROACH);
    fix.in.cmd.speed_mps = NAN;
    fix_ticks(&fix, 0.09f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix_ticks(&fix, 0.02f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_rule(IVL_RULE_COMMAND, fix.state.guard.cause);
    TEST_ASSERT_TRUE(fix.out.motors_on);
}

static void spoil_supervisor(ivl_in_t *in)
{
    in->vitals.can_fly = false;
}

static void test_rule_supervisor_aborts_when_the_autopilot_stops_the_motors(void)
{
    check_rule_before_trigger(IVL_RULE_SUPERVISOR, spoil_supervisor);
}

static void spoil_link(ivl_in_t *in)
{
    in->vitals.link_age_s = 0.51f;
}

static void test_rule_link_aborts_when_the_link_is_down(void)
{
    check_rule_before_trigger(IVL_RULE_LINK, spoil_link);
}

static void spoil_setpoint(ivl_in_t *in)
{
    in->vitals.setpoint_age_s = 0.41f;
}

static void test_rule_setpoint_aborts_before_the_autopilot_acts_on_its_age(void)
{
    check_rule_before_trigger(IVL_RULE_SETPOINT, spoil_setpoint);
    // the autopilot levels out at 0.5 s whatever the parameter
    fix.cfg.setpoint_s_max = 0.5f;
    TEST_ASSERT_EQUAL_STRING("setpoint_s_max", ivl_cfg_bad_name(&fix.cfg));
}

static void spoil_host(ivl_in_t *in)
{
    in->vitals.host_age_s = 0.51f;
}

static void test_rule_host_aborts_when_the_heartbeat_is_lost(void)
{
    check_rule_before_trigger(IVL_RULE_HOST, spoil_host);
}

static void spoil_battery(ivl_in_t *in)
{
    in->vitals.vbat_V = 2.65f;
}

static void spoil_battery_nan(ivl_in_t *in)
{
    in->vitals.vbat_V = NAN;
}

static void test_rule_battery_aborts_below_the_gate(void)
{
    fix_init(&fix);
    is_tested[IVL_RULE_BATTERY] = true;
    const spoiler_t   spoilers[] = {spoil_battery, spoil_battery_nan};
    const ivl_phase_t from[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_FLIP, IVL_PHASE_COAST};
    for (int k = 0; k < 2; k++)
    {
        for (int i = 0; i < 4; i++)
        {
            bring_to(from[i]);
            spoilers[k](&fix.in);
            fix_tick(&fix);
            assert_phase(is_before_trigger(from[i]) ? IVL_PHASE_ABORTED : from[i], &fix);
            assert_rule(is_before_trigger(from[i]) ? IVL_RULE_BATTERY : IVL_RULE_NONE, fix.state.guard.cause);
        }
    }
}

static void test_rule_fence_aborts_outside_each_face_of_the_box(void)
{
    is_tested[IVL_RULE_FENCE] = true;
    const ivl_vec3_t outside[] = {{-1.1f, 0.0f, 1.0f}, {1.1f, 0.0f, 1.0f}, {0.0f, -1.1f, 1.0f},
                                  {0.0f, 1.1f, 1.0f},  {0.0f, 0.0f, 0.1f}, {0.0f, 0.0f, 1.9f}};
    for (int i = 0; i < 6; i++)
    {
        for (int k = 0; k < 3; k++)
        {
            fix_init(&fix);
            fix.cfg.fence_x_m_min = fix.cfg.fence_y_m_min = -1.0f;
            fix.cfg.fence_x_m_max = fix.cfg.fence_y_m_max = 1.0f;
            fix.cfg.fence_z_m_min = 0.2f;
            fix.cfg.fence_z_m_max = 1.8f;
            ivl_init(&fix.cfg, &fix.state);
            fix_policy(&fix, 4.0f, 0.008f);
            const ivl_request_t requests[] = {IVL_REQUEST_IDLE, IVL_REQUEST_HOVER, IVL_REQUEST_APPROACH};
            fix_request(&fix, requests[k]);
            assert_phase((ivl_phase_t)k, &fix);
            fix.in.p_WB_m = outside[i];
            fix_request(&fix, (k == 0) ? IVL_REQUEST_HOVER : requests[k]);
            assert_phase((k == 0) ? IVL_PHASE_IDLE : IVL_PHASE_ABORTED, &fix);
            assert_rule(IVL_RULE_FENCE, (k == 0) ? fix.state.guard.rule : fix.state.guard.cause);
        }
    }
    fix.cfg.fence_z_m_max = 0.2f;
    TEST_ASSERT_EQUAL_STRING("fence_z_min", ivl_cfg_bad_name(&fix.cfg));
    fix.cfg.fence_y_m_max = -2.0f;
    TEST_ASSERT_EQUAL_STRING("fence_y_min", ivl_cfg_bad_name(&fix.cfg));
    fix.cfg.fence_x_m_max = -2.0f;
    TEST_ASSERT_EQUAL_STRING("fence_x_min", ivl_cfg_bad_name(&fix.cfg));
}

static void spoil_speed(ivl_in_t *in)
{
    // away from the ceiling, so that nothing triggers
    in->v_WB_mps = ivl_vec3(-7.0f, 0.0f, -7.0f);
}

static void test_rule_speed_aborts_above_speed_abort(void)
{
    check_rule_before_trigger(IVL_RULE_SPEED, spoil_speed);
}

static void spoil_uncertain(ivl_in_t *in)
{
    in->vitals.p_sigma_m = 0.11f;
}

static void test_rule_uncertain_aborts_when_the_position_is_not_known_well(void)
{
    check_rule_before_trigger(IVL_RULE_UNCERTAIN, spoil_uncertain);
}

static void test_rule_too_close_aborts_an_approach_that_has_not_triggered(void)
{
    is_tested[IVL_RULE_TOO_CLOSE] = true;
    fix_init(&fix);
    fix.cfg.d_abort_m = 0.2f;
    ivl_init(&fix.cfg, &fix.state);
    fix_policy(&fix, 20.0f, 0.008f);
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    fix.in.p_WB_m.z = 2.1f - 0.21f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.in.p_WB_m.z = 2.1f - 0.19f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_rule(IVL_RULE_TOO_CLOSE, fix.state.guard.cause);
}

static void test_rule_approach_time_aborts_an_approach_without_trigger(void)
{
    is_tested[IVL_RULE_APPROACH_TIME] = true;
    fix_to_phase(&fix, IVL_PHASE_APPROACH);
    fix_ticks(&fix, fix.cfg.approach_s_max - 0.1f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix_ticks(&fix, 0.2f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_rule(IVL_RULE_APPROACH_TIME, fix.state.guard.cause);
}

static void test_rule_level_out_time_lands_a_vehicle_that_nobody_asks_for_anything(void)
{
    is_tested[IVL_RULE_LEVEL_OUT_TIME] = true;
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    fix.in.v_WB_mps.z = 0.0f;
    fix_ticks(&fix, fix.cfg.level_out_s_max - 0.1f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    fix_ticks(&fix, 0.2f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_rule(IVL_RULE_LEVEL_OUT_TIME, fix.state.guard.cause);
}

static void test_rule_no_go_calls_off_what_would_not_land(void)
{
    is_tested[IVL_RULE_NO_GO] = true;
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    assert_rule(IVL_RULE_NO_GO, fix.state.guard.cause);
    TEST_ASSERT_TRUE(fix.out.motors_on);
    TEST_ASSERT_FALSE(fix.state.triggered);
}

// ---- after the trigger

static void test_rule_contact_switches_the_motors_off_at_touch_down(void)
{
    is_tested[IVL_RULE_CONTACT] = true;
    const ivl_phase_t from[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST};
    for (int i = 0; i < 2; i++)
    {
        bring_to(from[i]);
        fix.in.f_B_mps2.y = 26.0f;
        fix_tick(&fix);
        assert_phase(IVL_PHASE_ATTACHED, &fix);
        assert_rule(IVL_RULE_CONTACT, fix.state.guard.cause);
        assert_motors_off(&fix);
    }
}

static void test_rule_hang_switches_the_motors_off_when_the_specific_force_is_reversed(void)
{
    is_tested[IVL_RULE_HANG] = true;
    const ivl_phase_t from[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST};
    for (int i = 0; i < 2; i++)
    {
        bring_to(from[i]);
        fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, -9.81f);
        fix_ticks(&fix, fix.cfg.hang_s + 0.01f);
        assert_phase(IVL_PHASE_ATTACHED, &fix);
        assert_rule(IVL_RULE_HANG, fix.state.guard.cause);
        assert_motors_off(&fix);
    }
}

static void test_rule_blind_cuts_a_flip_without_senses_as_if_its_time_were_over(void)
{
    is_tested[IVL_RULE_BLIND] = true;
    bring_to(IVL_PHASE_FLIP);
    fix.in.q_WB.x = NAN;
    fix_ticks(&fix, 0.09f);
    assert_phase(IVL_PHASE_FLIP, &fix);
    TEST_ASSERT_TRUE(fix.out.motors_on);
    fix_ticks(&fix, 0.02f);
    assert_phase(IVL_PHASE_COAST, &fix);
    assert_rule(IVL_RULE_BLIND, fix.state.guard.cause);
    assert_motors_off(&fix);
}

static void test_rule_flip_time_cuts_the_motors(void)
{
    is_tested[IVL_RULE_FLIP_TIME] = true;
    bring_to(IVL_PHASE_FLIP);
    fix_ticks(&fix, fix.cfg.flip_s_max - 0.02f);
    assert_phase(IVL_PHASE_FLIP, &fix);
    fix_ticks(&fix, 0.04f);
    assert_phase(IVL_PHASE_COAST, &fix);
    assert_rule(IVL_RULE_FLIP_TIME, fix.state.guard.cause);
    assert_motors_off(&fix);
}

static void test_rule_coast_time_ends_a_coast_without_contact(void)
{
    is_tested[IVL_RULE_COAST_TIME] = true;
    bring_to(IVL_PHASE_COAST);
    fix_ticks(&fix, fix.cfg.coast_s_max + 0.02f);
    assert_phase(IVL_PHASE_DONE, &fix);
    assert_rule(IVL_RULE_COAST_TIME, fix.state.guard.cause);
}

static void test_flip_ignores_every_fault_that_is_not_its_own(void)
{
    bring_to(IVL_PHASE_FLIP);
    fix.in.vitals = (ivl_vitals_t){.given = true, .vbat_V = 0.0f, .link_age_s = 99.0f, .setpoint_age_s = 99.0f, .host_age_s = 99.0f};
    fix.in.vitals.p_sigma_m = NAN;
    fix.in.p_WB_m = ivl_vec3(150.0f, 0.0f, 1.9f);
    fix.in.v_WB_mps = ivl_vec3(20.0f, 0.0f, 0.0f);
    fix.in.cmd.request = IVL_REQUEST_ABORT;
    fix_ticks(&fix, 0.2f);
    assert_phase(IVL_PHASE_FLIP, &fix);
    TEST_ASSERT_TRUE(fix.out.motors_on);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, -0.008f, fix.out.pitch_moment_Nm);
}

// ---- after an abort

static void test_rule_lost_cuts_the_motors_of_an_aborted_vehicle_that_cannot_hover(void)
{
    is_tested[IVL_RULE_LOST] = true;
    bring_to(IVL_PHASE_ABORTED);
    fix.in.v_WB_mps.y = INFINITY;
    fix_ticks(&fix, 0.12f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    assert_rule(IVL_RULE_LOST, fix.state.guard.rule);
    assert_motors_off(&fix);
    TEST_ASSERT_TRUE(ivl_motors_latched_off(&fix.state));
}

static void test_rule_landed_follows_hover_and_descent(void)
{
    is_tested[IVL_RULE_LANDED] = true;
    bring_to(IVL_PHASE_ABORTED);
    // hover: the reference stays
    fix_ticks(&fix, fix.cfg.abort_hover_s - 0.02f);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, fix.state.p_hold_W_m.z);
    // descent: it falls at the stated speed, here with the vehicle on it
    for (int i = 0; i < 500; i++)
    {
        fix.in.p_WB_m.z = fix.state.p_hold_W_m.z;
        fix_tick(&fix);
    }
    TEST_ASSERT_FLOAT_WITHIN(0.02f, 1.0f - 0.3f, fix.state.p_hold_W_m.z);
    TEST_ASSERT_TRUE(fix.out.motors_on);
    // touch-down: off, and off it stays
    for (int i = 0; i < 1200; i++)
    {
        fix.in.p_WB_m.z = fix.state.p_hold_W_m.z;
        fix_tick(&fix);
    }
    assert_motors_off(&fix);
    assert_rule(IVL_RULE_LANDED, fix.state.guard.rule);
    TEST_ASSERT_TRUE(ivl_motors_latched_off(&fix.state));
    fix.in.p_WB_m.z = 1.0f;
    fix_ticks(&fix, 1.0f);
    assert_motors_off(&fix);
}

static void test_a_vehicle_that_is_low_has_not_landed_before_its_descent_has_ended(void)
{
    fix_to_phase(&fix, IVL_PHASE_ABORTED);
    fix.in.p_WB_m.z = 0.5f * fix.cfg.land_height_m;
    fix_tick(&fix);
    TEST_ASSERT_NOT_EQUAL_INT(IVL_RULE_LANDED, fix.state.guard.rule);
    TEST_ASSERT_TRUE(fix.out.motors_on);
}

static void test_landing_ends_on_a_table_that_stands_higher_than_land_height(void)
{
    bring_to(IVL_PHASE_ABORTED);
    fix.in.p_WB_m.z = 0.5f;
    fix_ticks(&fix, 2.0f + 0.95f / 0.3f + 1.9f);
    TEST_ASSERT_TRUE(fix.out.motors_on);
    fix_ticks(&fix, 0.3f);
    assert_motors_off(&fix);
    assert_rule(IVL_RULE_LANDED, fix.state.guard.rule);
}

// ---- the trigger

/// In APPROACH, with a state that triggers in the next tick.
static void about_to_trigger(void)
{
    bring_to(IVL_PHASE_APPROACH);
    fix.in.p_WB_m.z = 1.6f;
    fix.in.v_WB_mps.z = 2.5f;
}

static void assert_held(ivl_rule_t rule)
{
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    assert_rule(rule, fix.state.guard.rule);
}

static void test_rule_no_policy_holds_the_trigger(void)
{
    is_tested[IVL_RULE_NO_POLICY] = true;
    about_to_trigger();
    fix.state.has_policy = false;
    assert_held(IVL_RULE_NO_POLICY);
    fix.state.has_policy = true;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_FLIP, &fix);
}

static void test_rule_one_shot_holds_a_second_trigger(void)
{
    is_tested[IVL_RULE_ONE_SHOT] = true;
    about_to_trigger();
    fix.state.triggered = true;
    assert_held(IVL_RULE_ONE_SHOT);
    TEST_ASSERT_EQUAL_UINT32(0, fix.state.diag.n_trigger);
}

static void test_rule_not_fresh_holds_the_trigger_on_yesterdays_sample(void)
{
    is_tested[IVL_RULE_NOT_FRESH] = true;
    about_to_trigger();
    fix.in.p_WB_m.y = NAN;
    assert_held(IVL_RULE_NOT_FRESH);
}

static void test_rule_cue_holds_the_trigger_outside_the_range_of_distance(void)
{
    is_tested[IVL_RULE_CUE] = true;
    const float z_m[] = {2.1f - 0.009f, 2.11f, 2.1f - 5.01f};
    for (int i = 0; i < 3; i++)
    {
        about_to_trigger();
        fix.in.p_WB_m.z = z_m[i];
        fix.in.v_WB_mps.z = 8.0f;
        assert_held(IVL_RULE_CUE);
    }
}

static void test_every_rule_was_tested(void)
{
    for (int i = 1; i < (int)IVL_RULE_COUNT; i++)
    {
        TEST_ASSERT_EQUAL_INT_MESSAGE(i, is_tested[i] ? i : 0, "a rule that no test has tried");
    }
}

// ---- lock-out

static void land_and_go_idle(void)
{
    bring_to(IVL_PHASE_DONE);
    fix_request(&fix, IVL_REQUEST_IDLE);
}

static void test_lock_out_lasts_until_the_vehicle_rests_upright_and_nobody_asks_for_thrust(void)
{
    bring_to(IVL_PHASE_IDLE);
    TEST_ASSERT_TRUE(fix.out.stock_allowed);
    // hanging: for as long as it likes
    land_and_go_idle();
    assert_phase(IVL_PHASE_IDLE, &fix);
    fix_ticks(&fix, 5.0f);
    TEST_ASSERT_FALSE(fix.out.stock_allowed);
    // upright at rest, but the autopilot wants to go
    const uint64_t now_us = fix.in.t_us;
    fix.in = good_input();
    fix.in.t_us = fix.in.t_pose_us = now_us;
    fix.in.vitals = good_vitals();
    fix.in.vitals.stock_idle = false;
    fix_ticks(&fix, 5.0f);
    TEST_ASSERT_FALSE(fix.out.stock_allowed);
    // moved about
    fix.in.vitals.stock_idle = true;
    for (int i = 0; i < 10; i++)
    {
        fix.in.w_B_radps.x = 1.0f;
        fix_tick(&fix);
        fix.in.w_B_radps.x = 0.0f;
        fix_ticks(&fix, fix.cfg.rearm_s - 0.1f);
        TEST_ASSERT_FALSE(fix.out.stock_allowed);
    }
    // left alone
    fix_ticks(&fix, 0.2f);
    TEST_ASSERT_TRUE(fix.out.stock_allowed);
}

/// After a landing: taken down and put somewhere in some state; `n` says which.
static ivl_in_t put_down(int n, bool is_mild)
{
    ivl_in_t    in = good_input();
    const float half_rad = is_mild ? 0.13f : 0.26f, rate = is_mild ? 0.29f : 0.31f, force = is_mild ? 1.9f : 2.1f;
    const float s = sinf(half_rad), c = cosf(half_rad);
    in.vitals = good_vitals();
    switch (n)
    {
    case 0:
        in.q_WB = (ivl_quat_t){s, 0.0f, 0.0f, c};
        break;
    case 1:
        in.q_WB = (ivl_quat_t){0.0f, -s, 0.0f, c};
        break;
    case 2:
        in.w_B_radps.x = -rate;
        break;
    case 3:
        in.w_B_radps.y = rate;
        break;
    case 4:
        in.w_B_radps.z = -rate;
        break;
    case 5:
        in.f_B_mps2.z += force;
        break;
    case 6:
        in.f_B_mps2.z -= force;
        break;
    case 7:
        in.vitals.given = is_mild;
        break;
    case 8:
        in.vitals.stock_idle = is_mild;
        break;
    default:
        in.p_WB_m.y = is_mild ? 0.5f : NAN;
        break;
    }
    return in;
}

/// Each condition of rest is spoiled alone, by a little more than it allows, and then by a little less.
static void test_each_condition_of_rest_alone_keeps_the_lock_out(void)
{
    for (int n = 0; n < 10; n++)
    {
        bring_to(IVL_PHASE_IDLE);
        land_and_go_idle();
        for (int mild = 0; mild < 2; mild++)
        {
            const uint64_t now_us = fix.in.t_us;
            fix.in = put_down(n, mild == 1);
            fix.in.t_us = fix.in.t_pose_us = now_us;
            fix_ticks(&fix, (mild == 1) ? fix.cfg.rearm_s - 0.05f : 3.0f);
            TEST_ASSERT_FALSE_MESSAGE(fix.out.stock_allowed, "locked out");
        }
        fix_ticks(&fix, 0.1f);
        TEST_ASSERT_TRUE_MESSAGE(fix.out.stock_allowed, "rested");
    }
}

static void test_lock_out_begins_with_the_trigger_and_survives_the_kill_switch(void)
{
    const ivl_phase_t from[] = {IVL_PHASE_FLIP, IVL_PHASE_COAST, IVL_PHASE_ATTACHED, IVL_PHASE_DONE};
    for (int i = 0; i < 4; i++)
    {
        bring_to(from[i]);
        fix_request(&fix, IVL_REQUEST_IDLE);
        assert_phase(IVL_PHASE_IDLE, &fix);
        TEST_ASSERT_FALSE(fix.out.stock_allowed);
    }
    const ivl_phase_t free_of_it[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH};
    for (int i = 0; i < 2; i++)
    {
        bring_to(free_of_it[i]);
        TEST_ASSERT_FALSE(fix.out.stock_allowed);
        fix_request(&fix, IVL_REQUEST_IDLE);
        TEST_ASSERT_TRUE(fix.out.stock_allowed);
    }
}

static void test_the_lock_out_lasts_longer_than_rearm_s(void)
{
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    // sums that are exact
    fix.cfg.tick_hz = 512.0f;
    fix.cfg.rearm_s = 0.25f;
    ivl_init(&fix.cfg, &fix.state);
    fix.state.guard.locked_out = true;
    fix.in.vitals = good_vitals();
    fix.in.cmd.request = IVL_REQUEST_IDLE;
    for (int i = 0; i < 128; i++)
    {
        fix_tick(&fix);
    }
    TEST_ASSERT_EQUAL_FLOAT(0.25f, fix.state.guard.rest_s);
    TEST_ASSERT_TRUE(fix.state.guard.locked_out);
    fix_tick(&fix);
    TEST_ASSERT_FALSE(fix.state.guard.locked_out);
}

static void test_a_cycle_that_begins_with_its_approach_ends_the_lock_out_as_well(void)
{
    fix_to_phase(&fix, IVL_PHASE_IDLE);
    fix.state.guard.locked_out = true;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    TEST_ASSERT_FALSE(fix.state.guard.locked_out);
}

static void test_lock_out_follows_an_abort_that_has_cut_the_motors_and_a_new_cycle_ends_it(void)
{
    bring_to(IVL_PHASE_ABORTED);
    fix.in.p_WB_m.x = NAN;
    fix_ticks(&fix, 0.2f);
    fix_request(&fix, IVL_REQUEST_IDLE);
    TEST_ASSERT_FALSE(fix.out.stock_allowed);
    fix.in.p_WB_m.x = 0.0f;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
    fix_request(&fix, IVL_REQUEST_IDLE);
    TEST_ASSERT_TRUE(fix.out.stock_allowed);
}

int main(void)
{
    UNITY_BEGIN();
#ifndef IVL_NO_TEXT
    RUN_TEST(test_rules_have_names);
#endif
    RUN_TEST(test_rules_have_an_act);
    RUN_TEST(test_no_rule_aborts_a_flip_or_what_follows_it);
    RUN_TEST(test_vitals_that_are_not_given_satisfy_every_rule);
    RUN_TEST(test_rule_config_refuses_to_arm_before_a_configuration_is_in_force);
    RUN_TEST(test_rule_bypass_refuses_to_arm_while_motors_are_driven_past_the_core);
    RUN_TEST(test_each_vital_is_good_at_its_limit_and_bad_one_step_beyond_it);
    RUN_TEST(test_rule_rearm_wants_hover_after_a_landing);
    RUN_TEST(test_rule_battery_rest_refuses_to_arm_on_a_weak_battery);
    RUN_TEST(test_rule_state_aborts_when_the_estimate_is_too_old);
    RUN_TEST(test_rule_tilt_aborts_and_refuses_beyond_tilt_abort);
    RUN_TEST(test_rule_command_aborts_when_commands_make_no_sense_for_too_long);
    RUN_TEST(test_rule_supervisor_aborts_when_the_autopilot_stops_the_motors);
    RUN_TEST(test_rule_link_aborts_when_the_link_is_down);
    RUN_TEST(test_rule_setpoint_aborts_before_the_autopilot_acts_on_its_age);
    RUN_TEST(test_rule_host_aborts_when_the_heartbeat_is_lost);
    RUN_TEST(test_rule_battery_aborts_below_the_gate);
    RUN_TEST(test_rule_fence_aborts_outside_each_face_of_the_box);
    RUN_TEST(test_rule_speed_aborts_above_speed_abort);
    RUN_TEST(test_rule_uncertain_aborts_when_the_position_is_not_known_well);
    RUN_TEST(test_rule_too_close_aborts_an_approach_that_has_not_triggered);
    RUN_TEST(test_rule_approach_time_aborts_an_approach_without_trigger);
    RUN_TEST(test_rule_level_out_time_lands_a_vehicle_that_nobody_asks_for_anything);
    RUN_TEST(test_rule_no_go_calls_off_what_would_not_land);
    RUN_TEST(test_rule_contact_switches_the_motors_off_at_touch_down);
    RUN_TEST(test_rule_hang_switches_the_motors_off_when_the_specific_force_is_reversed);
    RUN_TEST(test_rule_blind_cuts_a_flip_without_senses_as_if_its_time_were_over);
    RUN_TEST(test_rule_flip_time_cuts_the_motors);
    RUN_TEST(test_rule_coast_time_ends_a_coast_without_contact);
    RUN_TEST(test_flip_ignores_every_fault_that_is_not_its_own);
    RUN_TEST(test_rule_lost_cuts_the_motors_of_an_aborted_vehicle_that_cannot_hover);
    RUN_TEST(test_rule_landed_follows_hover_and_descent);
    RUN_TEST(test_a_vehicle_that_is_low_has_not_landed_before_its_descent_has_ended);
    RUN_TEST(test_landing_ends_on_a_table_that_stands_higher_than_land_height);
    RUN_TEST(test_rule_no_policy_holds_the_trigger);
    RUN_TEST(test_rule_one_shot_holds_a_second_trigger);
    RUN_TEST(test_rule_not_fresh_holds_the_trigger_on_yesterdays_sample);
    RUN_TEST(test_rule_cue_holds_the_trigger_outside_the_range_of_distance);
    RUN_TEST(test_every_rule_was_tested);
    RUN_TEST(test_lock_out_lasts_until_the_vehicle_rests_upright_and_nobody_asks_for_thrust);
    RUN_TEST(test_each_condition_of_rest_alone_keeps_the_lock_out);
    RUN_TEST(test_lock_out_begins_with_the_trigger_and_survives_the_kill_switch);
    RUN_TEST(test_the_lock_out_lasts_longer_than_rearm_s);
    RUN_TEST(test_a_cycle_that_begins_with_its_approach_ends_the_lock_out_as_well);
    RUN_TEST(test_lock_out_follows_an_abort_that_has_cut_the_motors_and_a_new_cycle_ends_it);
    return UNITY_END();
}
