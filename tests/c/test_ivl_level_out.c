/// @file test_ivl_level_out.c
/// Go / no-go: when it is decided, once; and that a level-out keeps off the ceiling, against a projectile with fading thrust.
#include "ivl_level_out.h"

#include "test_ivl_support.h"

static fix_t fix;

// ---- the rise

/// Highest point of a mass whose thrust fades exponentially to the least lift, integrated in small steps.
static double integrated_rise_m(double v_mps, double thrust_mps2, double lag_s)
{
    const double g = 9.81, kept = (double)IVL_LIFT_NORM_MIN * g, dt = 1.0e-5;
    double       z = 0.0, more = thrust_mps2 - kept;
    while (v_mps > 0.0)
    {
        v_mps += (kept + more - g) * dt;
        more -= (lag_s > 0.0) ? more * dt / lag_s : more;
        z += v_mps * dt;
    }
    return z;
}

static void test_rise_is_that_of_a_mass_whose_thrust_fades(void)
{
    ivl_cfg_defaults(&fix.cfg);
    const float lags_s[] = {0.0f, 0.01f, 0.03f, 0.06f};
    for (size_t i = 0; i < sizeof lags_s / sizeof lags_s[0]; i++)
    {
        fix.cfg.motor_lag_s = lags_s[i];
        for (float v = 0.05f; v < 5.0f; v += 0.05f)
        {
            const double expected = integrated_rise_m((double)v, 9.81, (double)lags_s[i]);
            const float  rise = ivl_level_out_rise_m(&fix.cfg, v, 9.81f);
            // a slow vehicle turns before its thrust has faded: there the formula is off by less than the margin
            TEST_ASSERT_TRUE(fabs((double)rise - expected) < ((v > 3.0f * 9.81f * lags_s[i]) ? 0.002 : 0.025));
        }
    }
}

static void test_no_rise_without_closing_speed(void)
{
    ivl_cfg_defaults(&fix.cfg);
    const float none[] = {0.0f, -0.0f, -3.0f, NAN};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++)
    {
        TEST_ASSERT_EQUAL_FLOAT(0.0f, ivl_level_out_rise_m(&fix.cfg, none[i], 9.81f));
    }
}

// ---- when it is decided

static void approach(float p_min, float log_odds, float threshold_per_s)
{
    ivl_policy_t policy = no_go_policy(9);
    policy.theta[0] = threshold_per_s;
    policy.theta[9] = p_min;
    policy.theta[10] = log_odds;
    policy.id.crc = ivl_policy_crc(&policy);
    fix_to_phase(&fix, IVL_PHASE_APPROACH);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix.cfg, &fix.state, &policy));
}

/// Straight up at a speed, tick by tick, until the phase is another one or the ceiling is reached.
static void climb(float v_mps)
{
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, v_mps);
    fix.in.p_WB_m.z = 0.3f;
    while ((fix.out.phase == IVL_PHASE_APPROACH) && (fix.in.p_WB_m.z < fix.cfg.h_ceil_m))
    {
        fix.in.p_WB_m.z += v_mps / fix.cfg.tick_hz;
        fix_tick(&fix);
        assert_output_sane(&fix);
    }
}

static float room_needed_m(float v_mps)
{
    return ivl_level_out_rise_m(&fix.cfg, v_mps, fix.cfg.gravity_mps2) + v_mps / fix.cfg.tick_hz + fix.cfg.d_touch_m +
           fix.cfg.level_margin_m + 2.0f * fix.cfg.height_sigma_m;
}

/// A threshold that is never reached before: the last moment decides, at the distance that the rise needs.
static void test_no_go_is_decided_at_the_last_moment(void)
{
    for (float v = 0.3f; v < 4.5f; v += 0.3f)
    {
        approach(0.5f, -3.0f, 20.0f);
        climb(v);
        assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
        TEST_ASSERT_EQUAL_INT(IVL_RULE_NO_GO, fix.state.guard.cause);
        TEST_ASSERT_TRUE(fix.state.decision.made && !fix.state.decision.go);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 1.0f / (1.0f + 20.0855369f), fix.state.decision.p_land);
        const float d_m = fix.state.decision.d_ceil_m;
        TEST_ASSERT_TRUE(d_m <= room_needed_m(v));
        TEST_ASSERT_TRUE(d_m >= room_needed_m(v) - 2.0f * v / fix.cfg.tick_hz);
        TEST_ASSERT_EQUAL_UINT32(0u, fix.state.diag.n_trigger);
        TEST_ASSERT_EQUAL_UINT32(1u, fix.state.diag.n_no_go);
    }
}

/// A flip that would come earlier than the last moment decides, too.
static void test_no_go_is_decided_at_the_trigger_if_that_comes_first(void)
{
    approach(0.5f, -3.0f, 2.0f);
    climb(1.5f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    TEST_ASSERT_TRUE(fix.state.decision.d_ceil_m > 1.2f * room_needed_m(1.5f));
}

static void test_a_go_at_the_last_moment_is_not_taken_back(void)
{
    approach(0.5f, 3.0f, 12.0f);
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 3.5f);
    // past the last moment, long before the threshold
    fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.6f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    TEST_ASSERT_TRUE(fix.state.decision.made && fix.state.decision.go);
    // no other policy takes the place of the one that was asked
    const ivl_policy_t other = no_go_policy(10);
    TEST_ASSERT_EQUAL_INT(IVL_ERR_PHASE, ivl_policy_commit(&fix.cfg, &fix.state, &other));
    // and this one is not asked again
    fix.state.policy.theta[10] = -3.0f;
    climb(3.5f);
    assert_phase(IVL_PHASE_FLIP, &fix);
}

static void test_no_go_without_a_valid_cue_is_not_decided(void)
{
    approach(0.5f, -3.0f, 2.0f);
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 3.0f);
    fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.005f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    TEST_ASSERT_FALSE(fix.state.decision.made);
}

static void test_a_policy_that_always_goes_never_levels_out(void)
{
    for (float v = 0.3f; v < 4.5f; v += 0.3f)
    {
        approach(0.0f, -100.0f, 3.0f);
        climb(v);
        assert_phase(IVL_PHASE_FLIP, &fix);
        TEST_ASSERT_TRUE(fix.state.decision.made && fix.state.decision.go);
    }
}

/// A command that makes no sense says nothing about the ceiling.
static void test_a_bad_command_does_not_hold_up_a_no_go(void)
{
    approach(0.5f, -3.0f, 20.0f);
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 3.0f);
    fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.5f;
    fix.in.cmd.speed_mps = 2.0f * fix.cfg.speed_mps_max;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
}

static void test_a_level_out_comes_back_to_where_the_approach_began(void)
{
    // HOVER at another point, and APPROACH before the vehicle is there
    fix_to_phase(&fix, IVL_PHASE_READY);
    fix.in.cmd.p_hover_W_m.z = 0.1f;
    fix_tick(&fix);
    const ivl_policy_t policy = no_go_policy(9);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix.cfg, &fix.state, &policy));
    const float z_begin_m = fix.in.p_WB_m.z;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    climb(2.0f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    TEST_ASSERT_EQUAL_FLOAT(z_begin_m, fix.state.level.z_W_m);
}

static void test_nothing_is_decided_before_the_ceiling_comes_closer(void)
{
    // an approach that begins past the last moment, at rest
    const float p_min[] = {0.0f, 0.5f};
    for (int i = 0; i < 2; i++)
    {
        approach(p_min[i], -3.0f, 20.0f);
        fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 0.0f);
        fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.05f;
        fix_ticks(&fix, 0.05f);
        assert_phase(IVL_PHASE_APPROACH, &fix);
        TEST_ASSERT_FALSE(fix.state.decision.made);
        fix.in.v_WB_mps.z = 0.01f;
        fix_tick(&fix);
        assert_phase((i == 0) ? IVL_PHASE_APPROACH : IVL_PHASE_LEVEL_OUT, &fix);
        TEST_ASSERT_TRUE(fix.state.decision.made);
    }
}

static void test_the_next_approach_decides_anew(void)
{
    approach(0.5f, -3.0f, 4.0f);
    climb(2.0f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 0.0f);
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY, &fix);
    TEST_ASSERT_FALSE(fix.state.decision.made);
    fix.in.p_WB_m.z = 1.0f;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    climb(2.0f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    TEST_ASSERT_EQUAL_UINT32(2u, fix.state.diag.n_no_go);
}

// ---- the level-out itself

/// A point mass that does what the core asks for: thrust along the vertical at once, no rotation.
static void fly(float duration_s, float *z_max_m)
{
    const float dt_s = 1.0f / fix.cfg.tick_hz;
    for (int i = 0; i < (int)(duration_s * fix.cfg.tick_hz); i++)
    {
        const float a_mps2 = fix.out.thrust_total_N / fix.cfg.mass_kg - fix.cfg.gravity_mps2;
        fix.in.v_WB_mps.z += a_mps2 * dt_s;
        fix.in.p_WB_m.z += fix.in.v_WB_mps.z * dt_s;
        *z_max_m = (fix.in.p_WB_m.z > *z_max_m) ? fix.in.p_WB_m.z : *z_max_m;
        fix_tick(&fix);
        assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
        assert_output_sane(&fix);
    }
}

static void test_level_out_keeps_the_margin_and_hovers_where_the_approach_began(void)
{
    for (float v = 0.3f; v < 4.5f; v += 0.3f)
    {
        approach(0.5f, -3.0f, 20.0f);
        const float z_begin_m = fix.state.p_hold_W_m.z;
        climb(v);
        float z_max_m = 0.0f;
        fly(6.0f, &z_max_m);
        const float clearance_m = fix.cfg.h_ceil_m - fix.cfg.d_touch_m - z_max_m;
        TEST_ASSERT_TRUE(clearance_m > fix.cfg.level_margin_m - 0.005f);
        TEST_ASSERT_TRUE(clearance_m < fix.cfg.level_margin_m + 0.03f);
        TEST_ASSERT_TRUE(ivl_level_out_rests(&fix.state));
        TEST_ASSERT_FLOAT_WITHIN(0.05f, z_begin_m, fix.in.p_WB_m.z);
        TEST_ASSERT_FLOAT_WITHIN(0.05f, 0.0f, fix.in.v_WB_mps.z);
    }
}

static void test_hover_is_obeyed_only_when_it_no_longer_rises(void)
{
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    fix.in.v_WB_mps.z = 0.0f;
    fix_tick(&fix);
    fix_tick(&fix);
    assert_phase(IVL_PHASE_READY, &fix);
}

static void test_a_forgotten_level_out_lands(void)
{
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    fix.in.v_WB_mps.z = 0.0f;
    fix_ticks(&fix, fix.cfg.level_out_s_max + 0.01f);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    TEST_ASSERT_EQUAL_INT(IVL_RULE_LEVEL_OUT_TIME, fix.state.guard.cause);
}

static void test_brakes_along_the_ceiling_without_a_jump(void)
{
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    fix.in.v_WB_mps = ivl_vec3(1.8f, -0.6f, 0.0f);
    fix_tick(&fix);
    ivl_reference_t last = ivl_level_out_next(&fix.cfg, &fix.state);
    const float     dt_s = fix.state.derived.dt_s, dv_mps_max = fix.cfg.approach_accel_mps2 * dt_s * 1.01f;
    while (!ivl_level_out_rests(&fix.state))
    {
        fix.in.p_WB_m = last.p_W_m;
        fix_tick(&fix);
        const ivl_reference_t ref = ivl_level_out_next(&fix.cfg, &fix.state);
        const ivl_vec3_t      dv = ivl_sub(ref.v_W_mps, last.v_W_mps), dp = ivl_sub(ref.p_W_m, last.p_W_m);
        // the step above and this call advance it twice
        TEST_ASSERT_TRUE(sqrtf(dv.x * dv.x + dv.y * dv.y) <= 2.0f * dv_mps_max);
        TEST_ASSERT_TRUE(sqrtf(ivl_dot(dp, dp)) <= 2.1f * 2.2f * dt_s);
        last = ref;
    }
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, last.v_W_mps.x + last.v_W_mps.y);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rise_is_that_of_a_mass_whose_thrust_fades);
    RUN_TEST(test_no_rise_without_closing_speed);
    RUN_TEST(test_no_go_is_decided_at_the_last_moment);
    RUN_TEST(test_no_go_is_decided_at_the_trigger_if_that_comes_first);
    RUN_TEST(test_a_go_at_the_last_moment_is_not_taken_back);
    RUN_TEST(test_no_go_without_a_valid_cue_is_not_decided);
    RUN_TEST(test_a_policy_that_always_goes_never_levels_out);
    RUN_TEST(test_a_bad_command_does_not_hold_up_a_no_go);
    RUN_TEST(test_a_level_out_comes_back_to_where_the_approach_began);
    RUN_TEST(test_nothing_is_decided_before_the_ceiling_comes_closer);
    RUN_TEST(test_the_next_approach_decides_anew);
    RUN_TEST(test_level_out_keeps_the_margin_and_hovers_where_the_approach_began);
    RUN_TEST(test_hover_is_obeyed_only_when_it_no_longer_rises);
    RUN_TEST(test_a_forgotten_level_out_lands);
    RUN_TEST(test_brakes_along_the_ceiling_without_a_jump);
    return UNITY_END();
}
