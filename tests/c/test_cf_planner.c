/// @file test_cf_planner.c
/// The high-level commander's ways: polynomials that meet both of their ends, uploaded trajectories in both forms, spirals, and memories full of
/// anything.
#include "cf_planner.h"

#include <math.h>
#include <string.h>

#include "ivl_math.h"
#include "test_ivl_support.h"
#include "unity.h"

static ivl_cf_planner_t planner;
static rng_t            rng;

void setUp(void)
{
    ivl_cf_planner_init(&planner);
    rng = (rng_t){.state = 7};
}

void tearDown(void)
{
}

static ivl_cf_goal_t any_goal(void)
{
    return (ivl_cf_goal_t){.p_W_m = rng_vec3(&rng, 3.0f),
                           .v_W_mps = rng_vec3(&rng, 1.0f),
                           .a_W_mps2 = rng_vec3(&rng, 1.0f),
                           .yaw_rad = rng_float(&rng, -3.0f, 3.0f)};
}

static void assert_near(ivl_vec3_t expected, ivl_vec3_t actual, float within)
{
    TEST_ASSERT_FLOAT_WITHIN(within, expected.x, actual.x);
    TEST_ASSERT_FLOAT_WITHIN(within, expected.y, actual.y);
    TEST_ASSERT_FLOAT_WITHIN(within, expected.z, actual.z);
}

static ivl_cf_setpoint_t setpoint_at(uint32_t ms)
{
    ivl_cf_setpoint_t sp;
    TEST_ASSERT_TRUE(ivl_cf_planner_next(&planner, ms, &sp));
    return sp;
}

// ---- polynomials

static void test_a_piece_meets_position_velocity_and_acceleration_at_both_ends(void)
{
    for (int i = 0; i < 2000; i++)
    {
        const ivl_cf_goal_t  from = any_goal(), to = any_goal();
        const float          T = rng_float(&rng, 0.5f, 5.0f);
        const ivl_cf_piece_t piece = ivl_cf_piece_between(&from, &to, T);
        const ivl_cf_goal_t  first = ivl_cf_piece_at(&piece, 0.0f), last = ivl_cf_piece_at(&piece, T);
        assert_near(from.p_W_m, first.p_W_m, 1e-5f);
        assert_near(from.v_W_mps, first.v_W_mps, 1e-5f);
        assert_near(from.a_W_mps2, first.a_W_mps2, 1e-5f);
        assert_near(to.p_W_m, last.p_W_m, 2e-3f);
        assert_near(to.v_W_mps, last.v_W_mps, 1e-2f);
        assert_near(to.a_W_mps2, last.a_W_mps2, 0.1f);
        TEST_ASSERT_FLOAT_WITHIN(2e-3f, to.yaw_rad, last.yaw_rad);
    }
}

static void test_from_rest_to_rest_the_coefficients_are_those_of_the_stock_firmware(void)
{
    const ivl_cf_goal_t  from = {.yaw_rad = 0.0f}, to = {.p_W_m = {2.0f, 0.0f, 0.0f}};
    const ivl_cf_piece_t piece = ivl_cf_piece_between(&from, &to, 1.0f);
    const float          expected[IVL_CF_POLY_N] = {0.0f, 0.0f, 0.0f, 0.0f, 70.0f, -168.0f, 140.0f, -40.0f};
    TEST_ASSERT_EQUAL_FLOAT_ARRAY(expected, piece.c[0], IVL_CF_POLY_N);
    // no time at all: there at once
    const ivl_cf_piece_t none = ivl_cf_piece_between(&from, &to, 0.0f);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, ivl_cf_piece_at(&none, 0.0f).p_W_m.x);
}

static void test_a_bezier_curve_begins_and_ends_at_its_outer_points_and_runs_between_them(void)
{
    // de Casteljau is another way to the same curve
    for (int i = 0; i < 500; i++)
    {
        const int   n = 1 + (int)rng_below(&rng, IVL_CF_POLY_N);
        const float T = rng_float(&rng, 0.5f, 4.0f), share = rng_float(&rng, 0.0f, 1.0f);
        float       points[IVL_CF_POLY_N], work[IVL_CF_POLY_N];
        for (int k = 0; k < n; k++)
        {
            work[k] = points[k] = rng_float(&rng, -2.0f, 2.0f);
        }
        for (int level = n - 1; level > 0; level--)
        {
            for (int k = 0; k < level; k++)
            {
                work[k] += share * (work[k + 1] - work[k]);
            }
        }
        ivl_cf_piece_t piece = {.duration_s = T};
        ivl_cf_piece_bezier(piece.c[0], points, n, T);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, work[0], ivl_cf_piece_at(&piece, share * T).p_W_m.x);
    }
}

// ---- planned ways

static void test_a_linear_way_has_a_steady_speed_and_then_stands(void)
{
    ivl_cf_planner_go(&planner, ivl_vec3(2.0f, -1.0f, 0.5f), 1.0f, true, 2.0f, 100);
    for (uint32_t ms = 100; ms <= 2100; ms += 50)
    {
        const ivl_cf_setpoint_t sp = setpoint_at(ms);
        assert_near(ivl_vec3(1.0f, -0.5f, 0.25f), sp.v_mps, 1e-4f);
        assert_near(ivl_scale(ivl_vec3(1.0f, -0.5f, 0.25f), (float)(ms - 100) * 1e-3f), sp.p_W_m, 1e-4f);
    }
    assert_near(ivl_vec3(0.0f, 0.0f, 0.0f), setpoint_at(2110).v_mps, 0.0f);
    TEST_ASSERT_TRUE(ivl_cf_planner_finished(&planner, 2110) && planner.plan == IVL_CF_PLAN_FLYING);
}

static void test_a_heading_turns_the_short_way_round(void)
{
    planner.last.yaw_rad = 3.0f;
    ivl_cf_planner_go(&planner, ivl_vec3(0.0f, 0.0f, 0.0f), -3.0f, false, 1.0f, 0);
    TEST_ASSERT_TRUE(fabsf(setpoint_at(500).yaw_rad) > 3.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, -3.0f, setpoint_at(1000).yaw_rad);
}

static void test_a_new_way_goes_on_in_the_motion_of_the_last_and_a_landing_stops(void)
{
    ivl_cf_planner_go(&planner, ivl_vec3(2.0f, 0.0f, 0.0f), 0.0f, false, 2.0f, 0);
    const ivl_cf_setpoint_t before = setpoint_at(1000);
    ivl_cf_planner_go(&planner, ivl_vec3(2.0f, 2.0f, 0.0f), 0.0f, false, 2.0f, 1000);
    const ivl_cf_setpoint_t after = setpoint_at(1000);
    assert_near(before.p_W_m, after.p_W_m, 1e-5f);
    assert_near(before.v_mps, after.v_mps, 1e-5f);
    ivl_cf_planner_lift(&planner, IVL_CF_PLAN_LANDING, 0.0f, 0.0f, 1.0f, 2000);
    TEST_ASSERT_EQUAL_INT(IVL_CF_MODE_ABS, setpoint_at(3000).z);
    TEST_ASSERT_EQUAL_INT(IVL_CF_MODE_OFF, setpoint_at(3010).z);
    TEST_ASSERT_TRUE(ivl_cf_planner_rests(&planner));
}

static void test_a_way_that_begins_after_another_has_ended_begins_at_rest_whatever_the_last_set_point_was(void)
{
    ivl_cf_planner_go(&planner, ivl_vec3(0.02f, 0.0f, 0.0f), 0.0f, false, 0.04f, 0);
    // the last set-point was made in full deceleration
    (void)setpoint_at(30);
    TEST_ASSERT_TRUE(planner.last.a_W_mps2.x < -5.0f);
    ivl_cf_planner_catch_up(&planner, 41);
    ivl_cf_planner_go(&planner, ivl_vec3(-1.0f, 0.0f, 0.0f), 0.0f, false, 2.0f, 41);
    for (uint32_t ms = 41; ms < 2041; ms += 20)
    {
        TEST_ASSERT_TRUE(setpoint_at(ms).p_W_m.x <= 0.0201f);
    }
}

static void test_a_spiral_keeps_its_distance_and_turns_with_it(void)
{
    for (int k = 0; k < 4; k++)
    {
        const bool            sideways = (k & 1) != 0, clockwise = (k & 2) != 0;
        const ivl_cf_spiral_t s = {sideways, clockwise, 1.5707963f, 0.8f, 0.8f, 0.4f, 3.0f};
        ivl_cf_planner_init(&planner);
        planner.last.yaw_rad = 0.3f;
        ivl_cf_planner_spiral(&planner, &s, 0);
        const float sense = clockwise ? -1.0f : 1.0f;
        // the way to the centre: left of the heading, right if clockwise; sideways behind it, ahead if clockwise
        const float      to_centre = 0.3f + (sideways ? (clockwise ? 0.0f : 3.14159265f) : sense * 1.5707963f);
        const ivl_vec3_t centre = {0.8f * cosf(to_centre), 0.8f * sinf(to_centre), 0.0f};
        for (uint32_t ms = 0; ms <= 3000; ms += 100)
        {
            const ivl_cf_setpoint_t sp = setpoint_at(ms);
            TEST_ASSERT_FLOAT_WITHIN(0.02f, 0.8f, hypotf(sp.p_W_m.x - centre.x, sp.p_W_m.y - centre.y));
        }
        const ivl_cf_setpoint_t end = setpoint_at(3000);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, 0.3f + sense * 1.5707963f, end.yaw_rad);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, 0.4f, end.p_W_m.z);
    }
}

// ---- uploaded trajectories

static void put(uint32_t at, const void *bytes, size_t n)
{
    memcpy(planner.uploaded.bytes + at, bytes, n);
}

/// Two pieces: 1 m along x within a second, then 1 m along y within two, turning.
static void upload_plain(void)
{
    const ivl_cf_piece_t pieces[2] = {{.c = {{1.0f, 1.0f}, {2.0f}, {0.5f}, {0.0f}}, .duration_s = 1.0f},
                                      {.c = {{2.0f}, {2.0f, 0.5f}, {0.5f}, {0.0f, 0.25f}}, .duration_s = 2.0f}};
    put(8, pieces, sizeof pieces);
    planner.uploaded.defined[2] = (ivl_cf_definition_t){IVL_CF_TRAJECTORY_IN_MEMORY, IVL_CF_TRAJECTORY_PLAIN, 8, 2};
}

static void start(uint8_t id, bool position, bool yaw, bool reversed, float timescale)
{
    const ivl_cf_start_t how = {position, yaw, reversed, timescale};
    TEST_ASSERT_TRUE(ivl_cf_planner_start(&planner, id, &how, 0));
}

static void test_a_plain_trajectory_is_flown_as_it_is(void)
{
    upload_plain();
    start(2, false, false, false, 1.0f);
    assert_near(ivl_vec3(1.5f, 2.0f, 0.5f), setpoint_at(500).p_W_m, 1e-5f);
    assert_near(ivl_vec3(1.0f, 0.0f, 0.0f), setpoint_at(500).v_mps, 1e-5f);
    assert_near(ivl_vec3(2.0f, 2.5f, 0.5f), setpoint_at(2000).p_W_m, 1e-5f);
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.25f, setpoint_at(2000).yaw_rad);
    TEST_ASSERT_FALSE(ivl_cf_planner_finished(&planner, 2999));
    TEST_ASSERT_TRUE(ivl_cf_planner_finished(&planner, 3000));
    assert_near(ivl_vec3(2.0f, 3.0f, 0.5f), setpoint_at(9000).p_W_m, 1e-5f);
    assert_near(ivl_vec3(0.0f, 0.0f, 0.0f), setpoint_at(9000).v_mps, 0.0f);
}

static void test_slower_backwards_moved_and_turned(void)
{
    upload_plain();
    start(2, false, false, false, 2.0f);
    assert_near(ivl_vec3(1.5f, 2.0f, 0.5f), setpoint_at(1000).p_W_m, 1e-5f);
    assert_near(ivl_vec3(0.5f, 0.0f, 0.0f), setpoint_at(1000).v_mps, 1e-5f);
    start(2, false, false, true, 1.0f);
    assert_near(ivl_vec3(2.0f, 3.0f, 0.5f), setpoint_at(0).p_W_m, 1e-5f);
    assert_near(ivl_vec3(0.0f, -0.5f, 0.0f), setpoint_at(1000).v_mps, 1e-5f);
    assert_near(ivl_vec3(1.5f, 2.0f, 0.5f), setpoint_at(2500).p_W_m, 1e-5f);
    assert_near(ivl_vec3(1.0f, 2.0f, 0.5f), setpoint_at(5000).p_W_m, 1e-5f);
    planner.last = (ivl_cf_goal_t){.p_W_m = {-1.0f, 0.0f, 1.0f}, .yaw_rad = 1.5707963f};
    start(2, true, false, false, 1.0f);
    assert_near(ivl_vec3(-1.0f, 0.0f, 1.0f), setpoint_at(0).p_W_m, 1e-5f);
    assert_near(ivl_vec3(-0.5f, 0.0f, 1.0f), setpoint_at(500).p_W_m, 1e-5f);
    // turned about the origin of the trajectory, as the stock firmware does it
    planner.last = (ivl_cf_goal_t){.p_W_m = {-1.0f, 0.0f, 1.0f}, .yaw_rad = 1.5707963f};
    start(2, true, true, false, 1.0f);
    const ivl_cf_setpoint_t sp = setpoint_at(500);
    assert_near(ivl_vec3(0.0f, 1.0f, 0.0f), sp.v_mps, 1e-5f);
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, 1.5707963f, sp.yaw_rad);
    assert_near(ivl_vec3(-1.0f - 1.0f - 2.0f, 1.5f - 2.0f, 1.0f), sp.p_W_m, 1e-5f);
}

/// From (0.1, 0.2, 0.3) m and 10 degrees: a straight piece in x and a turn, then cubic in y, then the end.
static void upload_compressed(void)
{
    const uint8_t bytes[] = {100,  0,    200, 0,    0x2c, 1,    100, 0,        // start: mm, tenths of a degree
                             0x41, 0xe8, 3,   0x4c, 4,    0x84, 3,             // 1000 ms, x 1.1 m, yaw 90 degrees
                             0x08, 0xd0, 7,   200,  0,    0xe8, 3,   0xe8, 3,  // 2000 ms, y by 0.2, 1, 1 m
                             0,    0,    0};
    put(100, bytes, sizeof bytes);
    planner.uploaded.defined[5] = (ivl_cf_definition_t){IVL_CF_TRAJECTORY_IN_MEMORY, IVL_CF_TRAJECTORY_COMPRESSED, 100, 0};
}

static void test_a_compressed_trajectory_is_flown_piece_by_piece(void)
{
    upload_compressed();
    start(5, false, false, false, 1.0f);
    assert_near(ivl_vec3(0.1f, 0.2f, 0.3f), setpoint_at(0).p_W_m, 1e-5f);
    const ivl_cf_setpoint_t sp = setpoint_at(500);
    assert_near(ivl_vec3(0.6f, 0.2f, 0.3f), sp.p_W_m, 1e-5f);
    assert_near(ivl_vec3(1.0f, 0.0f, 0.0f), sp.v_mps, 1e-4f);
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, 50.0f * 0.0174532925f, sp.yaw_rad);
    // half-way along a cubic: (p0 + 3 p1 + 3 p2 + p3) / 8
    assert_near(ivl_vec3(1.1f, (0.2f + 3.0f * 0.2f + 3.0f + 1.0f) / 8.0f, 0.3f), setpoint_at(2000).p_W_m, 1e-4f);
    TEST_ASSERT_FALSE(ivl_cf_planner_finished(&planner, 2999));
    TEST_ASSERT_TRUE(ivl_cf_planner_finished(&planner, 3000));
    assert_near(ivl_vec3(1.1f, 1.0f, 0.3f), setpoint_at(60000).p_W_m, 1e-4f);
    assert_near(ivl_vec3(0.0f, 0.0f, 0.0f), setpoint_at(60000).v_mps, 0.0f);
    planner.last.p_W_m = ivl_vec3(5.0f, 5.0f, 1.0f);
    start(5, true, false, false, 1.0f);
    assert_near(ivl_vec3(6.0f, 5.0f, 1.0f), setpoint_at(1000).p_W_m, 1e-4f);
}

static void test_what_cannot_be_flown_changes_nothing(void)
{
    const ivl_cf_start_t fine = {.timescale = 1.0f}, slow = {.timescale = 2.0f}, back = {.reversed = true, .timescale = 1.0f};
    ivl_cf_planner_go(&planner, ivl_vec3(1.0f, 0.0f, 0.0f), 0.0f, false, 1.0f, 0);
    upload_plain();
    upload_compressed();
    const ivl_cf_planner_t before = planner;
    TEST_ASSERT_FALSE(ivl_cf_planner_start(&planner, 0, &fine, 0) || ivl_cf_planner_start(&planner, IVL_CF_TRAJECTORIES, &fine, 0));
    TEST_ASSERT_FALSE(ivl_cf_planner_start(&planner, 5, &slow, 0) || ivl_cf_planner_start(&planner, 5, &back, 0));
    TEST_ASSERT_EQUAL_MEMORY(&before, &planner, sizeof planner);
    ivl_cf_definition_t      *d = &planner.uploaded.defined[2];
    const ivl_cf_definition_t good = *d,
                              bad[] = {{1, 0, 4000, 1}, {1, 0, UINT32_MAX, 1}, {1, 0, 8, 255}, {1, 0, 8, 0}, {1, 7, 8, 1}, {2, 0, 8, 1}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
    {
        *d = bad[i];
        TEST_ASSERT_FALSE(ivl_cf_planner_start(&planner, 2, &fine, 0));
    }
    *d = good;
    const float nan_s = NAN;
    put(8 + 128, &nan_s, sizeof nan_s);
    TEST_ASSERT_FALSE(ivl_cf_planner_start(&planner, 2, &fine, 0));
    TEST_ASSERT_EQUAL_INT(IVL_CF_PLAN_FLYING, planner.plan);
}

static void test_a_trajectory_that_breaks_while_it_is_flown_ends_without_set_points(void)
{
    ivl_cf_setpoint_t sp;
    const float       broken = NAN;
    upload_plain();
    start(2, false, false, false, 1.0f);
    (void)setpoint_at(100);
    put(8, &broken, sizeof broken);
    TEST_ASSERT_FALSE(ivl_cf_planner_next(&planner, 200, &sp));
    TEST_ASSERT_EQUAL_INT(IVL_CF_PLAN_DISABLED, planner.plan);
    TEST_ASSERT_FALSE(ivl_cf_planner_next(&planner, 210, &sp));
    ivl_cf_planner_stop(&planner);
    TEST_ASSERT_TRUE(ivl_cf_planner_next(&planner, 220, &sp));
}

static void test_any_bytes_are_flown_or_refused_and_every_set_point_is_a_number(void)
{
    uint32_t n_flown = 0;
    for (int i = 0; i < 3000; i++)
    {
        for (size_t k = 0; k < IVL_CF_TRAJECTORY_BYTES; k += 8)
        {
            const uint64_t word = rng_u64(&rng);
            put((uint32_t)k, &word, sizeof word);
        }
        const ivl_cf_definition_t any = {1, (uint8_t)rng_below(&rng, 2), rng_below(&rng, 4200), (uint8_t)rng_below(&rng, 40)};
        const ivl_cf_start_t      how = {rng_below(&rng, 2) != 0u, rng_below(&rng, 2) != 0u, rng_below(&rng, 4) == 0u, 1.0f};
        planner.uploaded.defined[1] = any;
        n_flown += ivl_cf_planner_start(&planner, 1, &how, 0) ? 1u : 0u;
        for (uint32_t ms = 0; ms < 400000; ms += 20000)
        {
            ivl_cf_setpoint_t sp;
            if (ivl_cf_planner_next(&planner, ms, &sp))
            {
                TEST_ASSERT_TRUE(ivl_vec3_within(sp.p_W_m, 1000.0f) && ivl_vec3_within(sp.v_mps, 1000.0f));
            }
        }
        ivl_cf_planner_stop(&planner);
    }
    TEST_ASSERT_TRUE(n_flown > 100u);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_piece_meets_position_velocity_and_acceleration_at_both_ends);
    RUN_TEST(test_from_rest_to_rest_the_coefficients_are_those_of_the_stock_firmware);
    RUN_TEST(test_a_bezier_curve_begins_and_ends_at_its_outer_points_and_runs_between_them);
    RUN_TEST(test_a_linear_way_has_a_steady_speed_and_then_stands);
    RUN_TEST(test_a_heading_turns_the_short_way_round);
    RUN_TEST(test_a_new_way_goes_on_in_the_motion_of_the_last_and_a_landing_stops);
    RUN_TEST(test_a_way_that_begins_after_another_has_ended_begins_at_rest_whatever_the_last_set_point_was);
    RUN_TEST(test_a_spiral_keeps_its_distance_and_turns_with_it);
    RUN_TEST(test_a_plain_trajectory_is_flown_as_it_is);
    RUN_TEST(test_slower_backwards_moved_and_turned);
    RUN_TEST(test_a_compressed_trajectory_is_flown_piece_by_piece);
    RUN_TEST(test_what_cannot_be_flown_changes_nothing);
    RUN_TEST(test_a_trajectory_that_breaks_while_it_is_flown_ends_without_set_points);
    RUN_TEST(test_any_bytes_are_flown_or_refused_and_every_set_point_is_a_number);
    return UNITY_END();
}
