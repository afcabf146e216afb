/// @file test_ivl_surface.c
/// A surface of any angle: what the vehicle sees of it, and that each rule of the core has its meaning there.
#include "ivl_surface.h"

#include "ivl_landing.h"
#include "ivl_level_out.h"
#include "test_ivl_support.h"

static fix_t fix;

static const float WALL = 1.57079633f, SLOPE = 2.35619449f, FLOOR = 3.14159265f;  // tilt of the normal from up

/// Nose-up by an angle.
static ivl_quat_t nose_up(float angle_rad)
{
    const ivl_sincos_t half = ivl_sincos(0.5f * angle_rad);
    return (ivl_quat_t){0.0f, -half.sin, 0.0f, half.cos};
}

/// A fresh core before a surface whose plane passes through x = 2, z = 1; the vehicle is at x = 1, z = 1 + above_m.
static void before(float tilt_rad, float above_m)
{
    fix_init(&fix);
    fix.cfg.surface_tilt_rad = tilt_rad;
    fix.cfg.h_ceil_m = 2.0f * ivl_sincos(tilt_rad).sin + ivl_sincos(tilt_rad).cos;
    ivl_init(&fix.cfg, &fix.state);
    TEST_ASSERT_TRUE(fix.state.derived.cfg_good);
    fix.in.p_WB_m = ivl_vec3(1.0f, 0.0f, 1.0f + above_m);
    fix.in.cmd.p_hover_W_m = fix.in.p_WB_m;
    fix_policy(&fix, 4.0f, 0.008f);
}

static void approach(float tilt_rad, float above_m, float angle_rad)
{
    before(tilt_rad, above_m);
    fix.in.cmd.angle_rad = angle_rad;
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    assert_phase(IVL_PHASE_APPROACH, &fix);
}

/// On a floor the motors are cut in the same tick: it needs no turn.
static void flip(float tilt_rad, float above_m)
{
    approach(tilt_rad, above_m, IVL_HALF_PI);
    // 5 m/s towards it from a metre, or less
    fix.in.v_WB_mps = ivl_surface_vec3(&fix.state.derived.surface, 0.0f, 0.0f, -5.0f);
    fix_tick(&fix);
    assert_phase((tilt_rad < FLOOR) ? IVL_PHASE_FLIP : IVL_PHASE_COAST, &fix);
}

static ivl_sample_t any_sample(rng_t *rng)
{
    return (ivl_sample_t){
        .p_WB_m = rng_vec3(rng, 5.0f), .v_WB_mps = rng_vec3(rng, 5.0f), .q_WB = rng_quat(rng), .f_B_mps2 = rng_vec3(rng, 20.0f)};
}

static void test_a_ceiling_is_seen_along_the_axes_of_the_world_to_the_last_bit(void)
{
    rng_t rng = {1};
    fix_init(&fix);
    ivl_surface_t ceiling;
    ivl_surface_init(&fix.cfg, &ceiling);
    for (int i = 0; i < 1000; i++)
    {
        const ivl_sample_t sample = any_sample(&rng);
        ivl_relative_t     rel;
        ivl_surface_see(&fix.cfg, &ceiling, &sample, &rel);
        TEST_ASSERT_EQUAL_FLOAT(sample.p_WB_m.z, rel.height_m);
        TEST_ASSERT_EQUAL_FLOAT(sample.v_WB_mps.z, rel.close_mps);
        TEST_ASSERT_EQUAL_FLOAT(sample.v_WB_mps.x, rel.along_mps);
        TEST_ASSERT_EQUAL_FLOAT(-sample.f_B_mps2.z, rel.hung_mps2);
        TEST_ASSERT_EQUAL_FLOAT(ivl_axes_of(sample.q_WB).z.z, rel.facing);
    }
    TEST_ASSERT_EQUAL_FLOAT(0.0f, ceiling.up_z_cut);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, ceiling.late_s);
}

// a sample that is turned along with the surface is seen as before; gravity alone does not turn
static void test_a_tilted_surface_is_the_ceiling_turned(void)
{
    rng_t rng = {2};
    fix_init(&fix);
    fix.cfg.gravity_mps2 = 1.0f;
    ivl_surface_t ceiling;
    ivl_surface_init(&fix.cfg, &ceiling);
    for (int i = 0; i < 1000; i++)
    {
        const ivl_sample_t here = any_sample(&rng);
        fix.cfg.surface_tilt_rad = rng_float(&rng, 0.0f, FLOOR);
        ivl_surface_t surface;
        ivl_surface_init(&fix.cfg, &surface);
        const ivl_sincos_t half = ivl_sincos(0.5f * fix.cfg.surface_tilt_rad);
        const ivl_quat_t   q = here.q_WB;
        ivl_sample_t       there = here;
        there.p_WB_m = ivl_surface_vec3(&surface, here.p_WB_m.x, here.p_WB_m.y, -here.p_WB_m.z);
        there.v_WB_mps = ivl_surface_vec3(&surface, here.v_WB_mps.x, here.v_WB_mps.y, -here.v_WB_mps.z);
        // about y by the tilt, then as before
        there.q_WB = (ivl_quat_t){half.cos * q.x + half.sin * q.z, half.cos * q.y + half.sin * q.w, half.cos * q.z - half.sin * q.x,
                                  half.cos * q.w - half.sin * q.y};
        ivl_relative_t a, b;
        ivl_surface_see(&fix.cfg, &ceiling, &here, &a);
        ivl_surface_see(&fix.cfg, &surface, &there, &b);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, a.height_m, b.height_m);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, a.close_mps, b.close_mps);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, a.along_mps, b.along_mps);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, a.facing, b.facing);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, a.accel_mps2 + 1.0f, b.accel_mps2 + surface.cos);
    }
}

static void test_distance_and_cues_are_those_of_the_wall(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.in.v_WB_mps = ivl_vec3(2.0f, 0.3f, -1.0f);
    fix_tick(&fix);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 1.0f, fix.out.ceiling.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 2.0f, fix.out.cues.rrev_per_s);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -1.0f, fix.out.cues.of_y_radps);  // down is forward
}

static void test_the_path_turns_along_with_the_surface(void)
{
    approach(WALL, 0.0f, 1.04719755f);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.8660254f, fix.state.approach.dir_x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -0.5f, fix.state.approach.dir_z);
    approach(WALL, 0.0f, 2.0943951f);  // climbing
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.8660254f, fix.state.approach.dir_x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, fix.state.approach.dir_z);
    approach(FLOOR, 1.0f, IVL_HALF_PI);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -1.0f, fix.state.approach.dir_z);
}

static void test_the_trigger_waits_until_the_wall_comes_closer(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.in.v_WB_mps = ivl_vec3(-5.0f, 0.0f, 5.0f);  // fast, and not towards it
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.in.v_WB_mps.x = 5.0f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_FLIP, &fix);
}

static void test_motors_are_cut_half_way_round(void)
{
    const float tilts[] = {0.0f, WALL, SLOPE};
    for (size_t i = 0; i < sizeof tilts / sizeof tilts[0]; i++)
    {
        const float needed = FLOOR - tilts[i];
        flip(tilts[i], (tilts[i] > WALL) ? 0.2f : -0.2f);
        fix.in.q_WB = nose_up(0.5f * needed - 0.02f);
        fix_tick(&fix);
        assert_phase(IVL_PHASE_FLIP, &fix);
        fix.in.q_WB = nose_up(0.5f * needed + 0.02f);
        fix_tick(&fix);
        assert_phase(IVL_PHASE_COAST, &fix);
    }
    // a floor needs no turn
    approach(FLOOR, 1.0f, IVL_HALF_PI);
    fix.in.v_WB_mps.z = -5.0f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_COAST, &fix);
    TEST_ASSERT_EQUAL_UINT32(1u, fix.state.diag.n_trigger);
}

static void test_a_vehicle_at_rest_on_the_wall_is_attached(void)
{
    flip(WALL, 0.0f);
    fix.in.q_WB = nose_up(WALL);
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, 0.0f);
    fix_ticks(&fix, 2.0f * fix.cfg.hang_s);
    assert_phase(IVL_PHASE_COAST, &fix);  // falling along it
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, -9.81f);
    fix_ticks(&fix, 2.0f * fix.cfg.hang_s);
    assert_phase(IVL_PHASE_COAST, &fix);  // what hangs on a ceiling does not hang here
    fix.in.f_B_mps2 = ivl_vec3(9.81f, 0.0f, 0.0f);
    fix_ticks(&fix, 2.0f * fix.cfg.hang_s);
    assert_phase(IVL_PHASE_ATTACHED, &fix);
}

static void test_contact_cuts_before_a_wall(void)
{
    flip(WALL, 0.0f);
    fix.in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, 60.0f);
    fix_tick(&fix);
    assert_phase(IVL_PHASE_ATTACHED, &fix);
}

static void test_too_close_is_the_distance_of_the_wall(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.cfg.d_abort_m = 0.5f;
    fix.in.p_WB_m.x = 1.4f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.in.p_WB_m.x = 1.6f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    TEST_ASSERT_EQUAL_INT(IVL_RULE_TOO_CLOSE, fix.state.guard.cause);
}

static void test_the_fence_is_the_same_box_before_a_wall(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.cfg.fence_x_m_max = 2.5f;  // behind the wall: that side stays open
    fix.in.p_WB_m.x = 1.99f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_APPROACH, &fix);
    fix.in.p_WB_m.x = 2.6f;
    fix_tick(&fix);
    assert_phase(IVL_PHASE_ABORTED, &fix);
    TEST_ASSERT_EQUAL_INT(IVL_RULE_FENCE, fix.state.guard.cause);
}

static void test_a_go_is_asked_where_a_level_out_still_keeps_off_the_wall(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.in.p_WB_m.x = -2.0f;
    const float v_mps = 1.0f;
    fix.in.v_WB_mps.x = v_mps;
    while (!fix.state.decision.made && fix.in.p_WB_m.x < 2.0f)
    {
        fix.in.p_WB_m.x += v_mps / fix.cfg.tick_hz;
        fix_tick(&fix);
    }
    // to tilt takes K_w / K_R, then it brakes like an approach accelerates
    const float tilts_s = fix.cfg.kd_rate_xy_Nmsprad / fix.cfg.kp_att_xy_Nmprad;
    const float needed_m =
        v_mps * tilts_s + 0.5f * v_mps * v_mps / fix.cfg.approach_accel_mps2 + fix.cfg.d_touch_m + fix.cfg.level_margin_m;
    TEST_ASSERT_FLOAT_WITHIN(0.02f, 2.0f - needed_m, fix.in.p_WB_m.x);
}

static void test_a_level_out_brakes_and_goes_back_from_the_wall(void)
{
    approach(WALL, 0.0f, IVL_HALF_PI);
    fix.in.v_WB_mps = ivl_vec3(1.0f, 0.0f, -0.5f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_LEVEL_OUT, &fix);
    const ivl_reference_t ref = ivl_level_out_next(&fix.cfg, &fix.state);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -fix.cfg.approach_accel_mps2, ref.a_W_mps2.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 0.0f, ref.a_W_mps2.z);
    fix.in.v_WB_mps.x = -0.01f;
    fix.in.p_WB_m.x = 1.7f;
    fix_tick(&fix);
    for (int i = 0; (i < 2000) && !ivl_level_out_rests(&fix.state); i++)
    {
        fix_tick(&fix);
    }
    TEST_ASSERT_TRUE(ivl_level_out_rests(&fix.state));
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 1.0f, fix.state.p_hold_W_m.x);  // where the approach began
    TEST_ASSERT_TRUE(fix.state.p_hold_W_m.z < 1.0f && fix.state.p_hold_W_m.z > 0.9f);
}

static void descend(float tilt_rad, float above_m, ivl_vec3_t *way)
{
    before(tilt_rad, above_m);
    fix_tick(&fix);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_ABORT);
    const ivl_vec3_t from = fix.state.p_hold_W_m;
    fix_ticks(&fix, fix.cfg.abort_hover_s + 1.0f);
    *way = ivl_sub(fix.state.p_hold_W_m, from);
}

static void test_a_landing_after_an_abort_does_not_come_down_on_a_slope(void)
{
    ivl_vec3_t way;
    descend(0.0f, -0.5f, &way);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, way.x);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, -fix.cfg.land_speed_mps, way.z);
    descend(WALL, 0.0f, &way);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 0.0f, way.x);
    descend(2.0f, 0.5f, &way);  // 65 degrees: along it
    TEST_ASSERT_TRUE(way.z < -0.2f);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 0.0f, fix.state.derived.surface.sin * way.x + fix.state.derived.surface.cos * way.z);
    descend(2.8f, 0.5f, &way);  // 20 degrees: on it
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, way.x);
}

/// True if the vehicle, turned nose up, is given back after a landing.
static bool is_given_back(float tilt_rad, float nose_up_rad)
{
    flip(tilt_rad, 0.2f);
    fix_request(&fix, IVL_REQUEST_IDLE);
    const ivl_sincos_t turned = ivl_sincos(nose_up_rad);
    fix.in.vitals = good_vitals();
    fix.in.vitals.stock_idle = 1u;
    fix.in.v_WB_mps = ivl_vec3(0.0f, 0.0f, 0.0f);
    fix.in.q_WB = nose_up(nose_up_rad);
    fix.in.f_B_mps2 = ivl_vec3(9.81f * turned.sin, 0.0f, 9.81f * turned.cos);
    TEST_ASSERT_TRUE(fix.state.guard.locked_out);
    fix_ticks(&fix, fix.cfg.rearm_s + 0.1f);
    return !fix.state.guard.locked_out;
}

static void test_no_other_controller_gets_the_motors_on_a_wall_or_slope(void)
{
    TEST_ASSERT_FALSE(is_given_back(WALL, WALL));
    TEST_ASSERT_FALSE(is_given_back(SLOPE, FLOOR - SLOPE));
    TEST_ASSERT_TRUE(is_given_back(FLOOR, 0.0f));  // upright on its feet
}

static void test_the_region_of_velocities_is_one_below_a_ceiling(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    cfg.shape = 3u;
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(&cfg));
    cfg.surface_tilt_rad = 0.1f;
    TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, ivl_cfg_check(&cfg));
    cfg.shape = 0u;
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(&cfg));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_ceiling_is_seen_along_the_axes_of_the_world_to_the_last_bit);
    RUN_TEST(test_a_tilted_surface_is_the_ceiling_turned);
    RUN_TEST(test_distance_and_cues_are_those_of_the_wall);
    RUN_TEST(test_the_path_turns_along_with_the_surface);
    RUN_TEST(test_the_trigger_waits_until_the_wall_comes_closer);
    RUN_TEST(test_motors_are_cut_half_way_round);
    RUN_TEST(test_a_vehicle_at_rest_on_the_wall_is_attached);
    RUN_TEST(test_contact_cuts_before_a_wall);
    RUN_TEST(test_too_close_is_the_distance_of_the_wall);
    RUN_TEST(test_the_fence_is_the_same_box_before_a_wall);
    RUN_TEST(test_a_go_is_asked_where_a_level_out_still_keeps_off_the_wall);
    RUN_TEST(test_a_level_out_brakes_and_goes_back_from_the_wall);
    RUN_TEST(test_a_landing_after_an_abort_does_not_come_down_on_a_slope);
    RUN_TEST(test_no_other_controller_gets_the_motors_on_a_wall_or_slope);
    RUN_TEST(test_the_region_of_velocities_is_one_below_a_ceiling);
    return UNITY_END();
}
