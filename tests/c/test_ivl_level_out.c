/// @file test_ivl_level_out.c
/// Go / no-go: when it is decided, once; and that a level-out keeps off the ceiling, against a projectile with fading thrust.
#include "ivl_level_out.h"

#include "test_ivl_support.h"

static fix_t fix;

static float rise_m(float v_close_mps, float thrust_mps2)
{
    ivl_surface_t surface;
    ivl_surface_init(&fix.cfg, &surface);
    return ivl_level_out_rise_m(&fix.cfg, &surface, v_close_mps, thrust_mps2);
}

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
            const float  rise = rise_m(v, 9.81f);
            // a slow vehicle turns before its thrust has faded: there the formula is off by less than the margin
            TEST_ASSERT_TRUE(fabs((double)rise - expected) < ((v > 3.0f * 9.81f * lags_s[i]) ? 0.002 : 0.025));
        }
    }
}

static void test_a_thrust_below_the_least_lift_adds_nothing(void)
{
    ivl_cfg_defaults(&fix.cfg);
    fix.cfg.motor_lag_s = 0.03f;
    const float kept_mps2 = IVL_LIFT_NORM_MIN * fix.cfg.gravity_mps2;
    const float expected_m = 4.0f / (2.0f * (fix.cfg.gravity_mps2 - kept_mps2));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, expected_m, rise_m(2.0f, kept_mps2));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, expected_m, rise_m(2.0f, 0.0f));
    TEST_ASSERT_TRUE(rise_m(2.0f, 1.1f * kept_mps2) > expected_m);
}

static void test_no_rise_without_closing_speed(void)
{
    ivl_cfg_defaults(&fix.cfg);
    const float none[] = {0.0f, -0.0f, -3.0f, NAN};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++)
    {
        TEST_ASSERT_EQUAL_FLOAT(0.0f, rise_m(none[i], 9.81f));
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
    fix_to_phase(&fix, IVL_PHASE_READY);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix.cfg, &fix.state, &policy));
    fix_request(&fix, IVL_REQUEST_APPROACH);
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

static void test_the_speed_along_the_ceiling_is_braked_in_its_own_direction(void)
{
    approach(0.5f, -3.0f, 20.0f);
    climb(2.0f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    fix.in.v_WB_mps = ivl_vec3(0.9f, -0.6f, 0.0f);
    fix_tick(&fix);
    const float left = 1.0f - fix.cfg.approach_accel_mps2 / fix.cfg.tick_hz / sqrtf(0.9f * 0.9f + 0.6f * 0.6f);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.9f * left, fix.state.level.along_mps);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -0.6f * left, fix.state.level.vy_mps);
}

static float room_needed_m(float v_mps)
{
    return rise_m(v_mps, fix.cfg.gravity_mps2) + v_mps / fix.cfg.tick_hz + fix.cfg.d_touch_m + fix.cfg.level_margin_m +
           2.0f * fix.cfg.height_sigma_m;
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
    while ((fix.out.phase == IVL_PHASE_APPROACH) && (fix.in.p_WB_m.z < fix.cfg.h_ceil_m))
    {
        fix.in.p_WB_m.z += 3.5f / fix.cfg.tick_hz;
        fix_tick(&fix);
    }
    assert_phase(IVL_PHASE_FLIP, &fix);
}

/// A source that estimates has no distance before its first measurement.
static void test_nothing_is_decided_before_the_first_valid_cue(void)
{
    approach(0.5f, -3.0f, 2.0f);
    fix_request(&fix, IVL_REQUEST_IDLE);
    fix.cfg.d_source = (uint8_t)IVL_SOURCE_RANGE;
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 3.0f);
    fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.005f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    TEST_ASSERT_FALSE(fix.state.decision.made);
}

// ---- without a cue

/// The distance is no longer certain enough for a cue.
static void lose_the_cue(void)
{
    fix.cfg.height_sigma_m = 1.0f;
}

/// An approach at rest whose reference has its speed.
static void at_speed(float p_min, float log_odds, float threshold_per_s)
{
    approach(p_min, log_odds, threshold_per_s);
    fix.in.p_WB_m.z = 0.1f;
    fix_ticks(&fix, 1.0f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
}

static float distance_m(void)
{
    return fix.cfg.h_ceil_m - fix.in.p_WB_m.z;
}

static void rise_at(float v_mps)
{
    fix.in.v_WB_mps.z = v_mps;
    fix.in.p_WB_m.z += v_mps / fix.cfg.tick_hz;
    fix_tick(&fix);
    assert_output_sane(&fix);
}

/// Whatever the policy thinks of it: what cannot see cannot flip.
static void test_a_vehicle_that_loses_the_cue_levels_out_at_its_last_moment_all_the_same(void)
{
    for (float v = 0.3f; v < 4.5f; v += 0.3f)
    {
        for (float lost_m = 1.9f; lost_m > 0.5f; lost_m -= 0.2f)
        {
            at_speed(0.0f, 100.0f, 20.0f);
            const float needed_m = room_needed_m(v);
            while ((fix.out.phase == IVL_PHASE_APPROACH) && (distance_m() > 0.0f))
            {
                if (distance_m() < lost_m)
                {
                    lose_the_cue();
                }
                rise_at(v);
            }
            assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
            TEST_ASSERT_EQUAL_INT(IVL_RULE_NO_GO, fix.state.guard.cause);
            // lost only past it: then at once
            const float expected_m = (lost_m < needed_m) ? lost_m : needed_m;
            TEST_ASSERT_FLOAT_WITHIN(2.5f * v / fix.cfg.tick_hz, expected_m, distance_m());
            TEST_ASSERT_FALSE(fix.state.decision.go);
        }
    }
}

static void test_speed_that_grows_without_a_cue_is_reckoned_with(void)
{
    // straight up, as the reference: 4.3 m/s^2 up to 3.5 m/s
    approach(0.0f, 100.0f, 20.0f);
    fix_request(&fix, IVL_REQUEST_IDLE);
    fix.in.cmd.speed_mps = 3.5f;
    fix.in.cmd.angle_rad = IVL_HALF_PI;
    fix.in.p_WB_m.z = 0.0f;
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    float needed_m = 0.0f;
    while ((fix.out.phase == IVL_PHASE_APPROACH) && (distance_m() > 0.0f))
    {
        if (distance_m() < 1.8f)
        {
            lose_the_cue();
        }
        needed_m = rise_m(fix.state.approach.speed_mps, fix.cfg.gravity_mps2 + 4.3f);
        rise_at(fix.state.approach.speed_mps);
    }
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    const float room_m = distance_m() - fix.cfg.d_touch_m - fix.cfg.level_margin_m;
    TEST_ASSERT_TRUE((room_m > needed_m - 0.02f) && (room_m < needed_m + 0.03f));
}

static void test_a_go_is_worth_nothing_once_the_cue_is_lost(void)
{
    at_speed(0.5f, 3.0f, 12.0f);
    fix.in.p_WB_m.z = fix.cfg.h_ceil_m - 0.7f;
    rise_at(3.5f);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    TEST_ASSERT_TRUE(fix.state.decision.made && fix.state.decision.go);
    const float p_land = fix.state.decision.p_land, d_m = fix.state.decision.d_ceil_m;
    lose_the_cue();
    rise_at(3.5f);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    TEST_ASSERT_FALSE(fix.state.decision.go);
    // what the policy thought of it stays to be read
    TEST_ASSERT_EQUAL_FLOAT(p_land, fix.state.decision.p_land);
    TEST_ASSERT_EQUAL_FLOAT(d_m, fix.state.decision.d_ceil_m);
}

static void test_a_cue_that_comes_back_before_the_last_moment_is_taken(void)
{
    at_speed(0.0f, 100.0f, 3.0f);
    const float sigma_m = fix.cfg.height_sigma_m;
    lose_the_cue();
    while (distance_m() > 1.0f)
    {
        rise_at(2.0f);
    }
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.cfg.height_sigma_m = sigma_m;
    while ((fix.out.phase == IVL_PHASE_APPROACH) && (distance_m() > 0.0f))
    {
        rise_at(2.0f);
    }
    assert_phase(IVL_PHASE_FLIP, &fix);
}

// ---- a go that is asked again

/// While the distance may be shorter than it seems, a go is not the last word: the vehicle gets faster, and sees better.
static void test_a_go_is_asked_again_until_there_is_no_way_back(void)
{
    const float v = 2.0f;
    for (int late = 0; late < 2; late++)
    {
        at_speed(0.5f, 3.0f, 20.0f);
        fix.cfg.height_sigma_m = 0.08f;
        fix.cfg.d_sigma_norm_max = 10.0f;
        const float seems_m = room_needed_m(v) - 2.0f * fix.cfg.height_sigma_m;
        fix.in.p_WB_m.z = fix.cfg.h_ceil_m - (seems_m + 0.15f);
        rise_at(v);
        TEST_ASSERT_TRUE(fix.state.decision.made && fix.state.decision.go);
        const float d_first_m = fix.state.decision.d_ceil_m;
        while ((late == 1) && (distance_m() > seems_m - 0.01f))
        {
            rise_at(v);
        }
        rise_at(v);
        assert_phase(IVL_PHASE_APPROACH, &fix);
        TEST_ASSERT_TRUE(fix.state.decision.d_ceil_m < d_first_m);
        // from now on it thinks otherwise
        fix.state.policy.theta[10] = -3.0f;
        rise_at(v);
        assert_phase((late == 0) ? IVL_PHASE_LEVEL_OUT : IVL_PHASE_APPROACH, &fix);
    }
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
    TEST_ASSERT_EQUAL_FLOAT(z_begin_m, fix.state.level.h_m);
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
    fix_ticks(&fix, 2.0f);
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

static void test_hover_is_obeyed_only_when_the_level_out_rests(void)
{
    fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
    fix.in.v_WB_mps.x = 1.0f;
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    fix.in.v_WB_mps.z = 0.0f;
    while (!ivl_level_out_rests(&fix.state))
    {
        fix_tick(&fix);
        assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    }
    fix_tick(&fix);
    assert_phase(IVL_PHASE_READY, &fix);
}

/// Between a level hover far below, and the fence: as far from both as there is room for.
static void test_it_comes_to_rest_above_the_fence(void)
{
    const float fences_m[] = {-100.0f, 0.9f, 1.2f, 1.5f, 1.58f};
    for (size_t i = 0; i < sizeof fences_m / sizeof fences_m[0]; i++)
    {
        fix_to_phase(&fix, IVL_PHASE_LEVEL_OUT);
        fix.cfg.fence_z_m_min = fences_m[i];
        const float top_m = fix.in.p_WB_m.z, begin_m = fix.state.level.h_m, middle_m = 0.5f * (top_m + fences_m[i]);
        fix.in.v_WB_mps.z = 0.0f;
        fix_tick(&fix);
        assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
        const float z_m = fix.state.level.h_m;
        TEST_ASSERT_TRUE(z_m >= fminf(fences_m[i] + 0.2499f, middle_m - 1.0e-5f));
        TEST_ASSERT_TRUE(z_m <= fmaxf(top_m - 0.2499f, middle_m + 1.0e-5f));
        // where it began, if that is far enough from both
        TEST_ASSERT_TRUE((begin_m < fences_m[i] + 0.25f) || (fabsf(z_m - begin_m) < 1.0e-6f));
    }
}

/// Neither an abort that is asked for nor one by a rule steers a vehicle that rises: it levels out, and then lands.
static void test_an_abort_on_the_way_up_levels_out_before_it_lands(void)
{
    const ivl_phase_t from[] = {IVL_PHASE_APPROACH, IVL_PHASE_LEVEL_OUT};
    for (int i = 0; i < 4; i++)
    {
        fix_to_phase(&fix, from[i % 2]);
        fix.in.v_WB_mps = ivl_vec3(2.0f, 0.5f, 1.5f);
        fix.cfg.fence_x_m_max = (i < 2) ? 100.0f : -1.0f;
        fix_request(&fix, (i < 2) ? IVL_REQUEST_ABORT : IVL_REQUEST_APPROACH);
        for (int k = 0; k < 20; k++)
        {
            rise_at(1.5f);
            assert_phase(IVL_PHASE_ABORTED, &fix);
            // upright with the least lift, and no moment
            TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 0.2f * 9.81f * fix.cfg.mass_kg, fix.out.thrust_total_N);
            TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, fix.out.thrust_N[0], fix.out.thrust_N[2]);
        }
        fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 0.0f);
        fix_tick(&fix);
        TEST_ASSERT_FALSE(fix.state.level.rises);
        fix_ticks(&fix, 6.0f);
        assert_phase(IVL_PHASE_ABORTED, &fix);
        TEST_ASSERT_TRUE(ivl_level_out_rests(&fix.state));
        TEST_ASSERT_TRUE(fix.state.p_hold_W_m.z < fix.state.level.h_m);
    }
}

static void test_an_abort_in_ready_hovers_where_it_is(void)
{
    fix_to_phase(&fix, IVL_PHASE_READY);
    fix.in.p_WB_m = ivl_vec3(0.3f, -0.2f, 1.1f);
    fix.in.v_WB_mps.z = 0.2f;
    fix_request(&fix, IVL_REQUEST_ABORT);
    TEST_ASSERT_EQUAL_MEMORY(&fix.in.p_WB_m, &fix.state.p_hold_W_m, sizeof fix.in.p_WB_m);
    fix_tick(&fix);
    TEST_ASSERT_EQUAL_MEMORY(&fix.in.p_WB_m, &fix.state.p_hold_W_m, sizeof fix.in.p_WB_m);
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
    RUN_TEST(test_a_thrust_below_the_least_lift_adds_nothing);
    RUN_TEST(test_no_rise_without_closing_speed);
    RUN_TEST(test_the_speed_along_the_ceiling_is_braked_in_its_own_direction);
    RUN_TEST(test_no_go_is_decided_at_the_last_moment);
    RUN_TEST(test_no_go_is_decided_at_the_trigger_if_that_comes_first);
    RUN_TEST(test_a_go_at_the_last_moment_is_not_taken_back);
    RUN_TEST(test_nothing_is_decided_before_the_first_valid_cue);
    RUN_TEST(test_a_vehicle_that_loses_the_cue_levels_out_at_its_last_moment_all_the_same);
    RUN_TEST(test_speed_that_grows_without_a_cue_is_reckoned_with);
    RUN_TEST(test_a_go_is_worth_nothing_once_the_cue_is_lost);
    RUN_TEST(test_a_cue_that_comes_back_before_the_last_moment_is_taken);
    RUN_TEST(test_a_go_is_asked_again_until_there_is_no_way_back);
    RUN_TEST(test_a_policy_that_always_goes_never_levels_out);
    RUN_TEST(test_a_bad_command_does_not_hold_up_a_no_go);
    RUN_TEST(test_a_level_out_comes_back_to_where_the_approach_began);
    RUN_TEST(test_nothing_is_decided_before_the_ceiling_comes_closer);
    RUN_TEST(test_the_next_approach_decides_anew);
    RUN_TEST(test_level_out_keeps_the_margin_and_hovers_where_the_approach_began);
    RUN_TEST(test_hover_is_obeyed_only_when_the_level_out_rests);
    RUN_TEST(test_it_comes_to_rest_above_the_fence);
    RUN_TEST(test_an_abort_on_the_way_up_levels_out_before_it_lands);
    RUN_TEST(test_an_abort_in_ready_hovers_where_it_is);
    RUN_TEST(test_a_forgotten_level_out_lands);
    RUN_TEST(test_brakes_along_the_ceiling_without_a_jump);
    return UNITY_END();
}
