/// @file test_ivl_region.c
/// Shape REGION of the approach: the aim by itself, and the reference that goes there.
#include "test_ivl_support.h"

static const float      DT_S = 0.002f;
static const ivl_room_t UNKNOWN = {0.0f, 0.0f};
static const ivl_vec3_t ORIGIN = {0.0f, 0.0f, 0.0f};

static ivl_cfg_t region_cfg(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    cfg.shape = (uint8_t)IVL_SHAPE_REGION;
    return cfg;
}

static ivl_aim_t asked(float vx_mps, float vz_mps)
{
    return (ivl_aim_t){.vx_mps = vx_mps, .vz_mps = vz_mps};
}

static ivl_room_t distance(float d_ceil_m)
{
    return (ivl_room_t){.d_ceil_m = d_ceil_m};
}

static ivl_aim_t aim_from_rest(const ivl_cfg_t *cfg, float d_ceil_m, float vx_mps, float vz_mps)
{
    const ivl_room_t room = distance(d_ceil_m);
    return ivl_region_aim(cfg, &room, ORIGIN, ORIGIN, asked(vx_mps, vz_mps));
}

// v of v^2 / 2a + v / R = d + v0^2 / 2a, as a student solves it
static float root_of_the_quadratic(float a, float rrev, float d_m, float v0)
{
    return a * (sqrtf(1.0f / (rrev * rrev) + 2.0f * (d_m + 0.5f * v0 * v0 / a) / a) - 1.0f / rrev);
}

// ---- the aim

static void test_with_enough_room_the_aim_is_the_region_or_what_is_asked_beyond_it(void)
{
    const ivl_cfg_t cfg = region_cfg();
    const float     in[][4] = {{0.0f, 0.25f, 1.2f, 2.0f}, {3.0f, 0.5f, 3.0f, 2.0f}, {0.2f, 3.5f, 1.2f, 3.5f}, {1.5f, 2.5f, 1.5f, 2.5f}};
    for (int i = 0; i < 4; i++)
    {
        const ivl_aim_t aim = aim_from_rest(&cfg, 4.0f, in[i][0], in[i][1]);
        TEST_ASSERT_EQUAL_FLOAT(in[i][2], aim.vx_mps);
        TEST_ASSERT_EQUAL_FLOAT(in[i][3], aim.vz_mps);
        TEST_ASSERT_EQUAL_FLOAT(4.3f, aim.accel_mps2);
    }
}

static void test_too_little_room_gives_the_root_of_the_quadratic(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.region_vx_mps = 0.0f;
    for (int i = 1; i <= 8; i++)
    {
        const float d_m = 0.1f * (float)i;
        const float v = root_of_the_quadratic(4.3f, 4.0f, d_m, 0.0f);
        TEST_ASSERT_TRUE(v < 2.0f);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, v, aim_from_rest(&cfg, d_m, 0.0f, 0.1f).vz_mps);
    }
    // 2 m/s needs 4 / 8.6 + 2 / 4 m
    TEST_ASSERT_TRUE(aim_from_rest(&cfg, 0.9640f, 0.0f, 0.1f).vz_mps < 2.0f);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, aim_from_rest(&cfg, 0.9652f, 0.0f, 0.1f).vz_mps);
}

static void test_speed_along_the_ceiling_ends_at_the_fence(void)
{
    const ivl_cfg_t  cfg = region_cfg();
    const ivl_room_t room = distance(2.0f);
    const ivl_vec3_t p = {cfg.fence_x_m_max - 1.0f, 0.0f, 0.0f}, v = {0.6f, 0.0f, 0.0f};
    const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, p, v, asked(0.0f, 0.1f));
    TEST_ASSERT_EQUAL_FLOAT(2.0f, aim.vz_mps);
    // what is there carries on for as long as the change from (0.6, 0) to (1.2, 2) takes, and then there are 2 m at 2 m/s
    const float carried_m = 0.5f * 0.6f * sqrtf(0.6f * 0.6f + 2.0f * 2.0f) / 4.3f;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, root_of_the_quadratic(4.3f, 1.0f, 1.0f - carried_m, 0.0f), aim.vx_mps);
}

static void test_speed_that_is_there_already_needs_less_room(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.region_vx_mps = 0.0f;
    const ivl_room_t room = distance(0.6f);
    const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, ORIGIN, ivl_vec3(0.0f, 0.0f, 1.0f), asked(0.0f, 0.5f));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, root_of_the_quadratic(4.3f, 4.0f, 0.6f, 1.0f), aim.vz_mps);
    // and is kept where even that is too much
    const ivl_room_t less = distance(0.1f);
    TEST_ASSERT_EQUAL_FLOAT(1.0f, ivl_region_aim(&cfg, &less, ORIGIN, ivl_vec3(0.0f, 0.0f, 1.0f), asked(0.0f, 0.5f)).vz_mps);
}

static void test_fence_above_counts_as_room_also_when_the_distance_is_not_known(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.region_vx_mps = 0.0f;
    cfg.fence_z_m_max = 1.5f;
    const float v = root_of_the_quadratic(4.3f, 4.0f, 0.5f, 0.0f);
    const float d[] = {0.0f, 3.0f, 1.0e9f, NAN};
    for (int i = 0; i < 4; i++)
    {
        const ivl_room_t room = distance(d[i]);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, v, ivl_region_aim(&cfg, &room, ivl_vec3(0.0f, 0.0f, 1.0f), ORIGIN, asked(0.0f, 0.1f)).vz_mps);
    }
}

static void test_fence_ahead_limits_the_speed_along_the_ceiling(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.fence_x_m_max = 0.7f;
    cfg.region_vx_mps = 3.0f;
    // 3 m at 2 m/s towards the ceiling: 1.5 s for v_x; v^2 / 8.6 + 1.5 v = 0.5
    const ivl_room_t room = distance(3.0f);
    const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, ivl_vec3(0.2f, 0.0f, 0.0f), ORIGIN, asked(0.0f, 0.1f));
    TEST_ASSERT_EQUAL_FLOAT(2.0f, aim.vz_mps);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 4.3f * (sqrtf(1.5f * 1.5f + 2.0f * 0.5f / 4.3f) - 1.5f), aim.vx_mps);
    // beyond the fence nothing is left, and the command stands
    TEST_ASSERT_EQUAL_FLOAT(0.4f, ivl_region_aim(&cfg, &room, ivl_vec3(0.9f, 0.0f, 0.0f), ORIGIN, asked(0.4f, 0.1f)).vx_mps);
}

static void test_acceleration_is_what_the_thrust_left_allows(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.region_vx_mps = 0.0f;
    cfg.motor_thrust_N_max = 0.25f * 1.2f * cfg.mass_kg * 9.81f;
    // up: 0.8 of 0.2 g
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 0.16f * 9.81f, aim_from_rest(&cfg, 4.0f, 0.0f, 0.1f).accel_mps2);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, root_of_the_quadratic(0.16f * 9.81f, 4.0f, 1.0f, 0.0f), aim_from_rest(&cfg, 1.0f, 0.0f, 0.1f).vz_mps);
    // along the ceiling the same thrust leaves sqrt(1.16^2 - 1) g, more than is asked for
    cfg.approach_accel_mps2 = 20.0f;
    cfg.region_vz_mps = 0.0f;
    TEST_ASSERT_FLOAT_WITHIN(2.0e-3f, 9.81f * sqrtf(1.16f * 1.16f - 1.0f), aim_from_rest(&cfg, 4.0f, 1.0f, 0.0f).accel_mps2);
}

static void test_low_battery_leaves_less_thrust(void)
{
    ivl_cfg_t cfg = region_cfg();
    cfg.region_vx_mps = 0.0f;
    cfg.approach_accel_mps2 = 20.0f;
    cfg.motor_thrust_N_max = 0.25f * 2.0f * cfg.mass_kg * 9.81f;
    const float volts[] = {0.9f * 3.7f, 3.7f, 5.0f, 0.0f, NAN}, full[] = {2.0f * 0.81f, 2.0f, 2.0f, 2.0f, 2.0f};
    for (int i = 0; i < 5; i++)
    {
        const ivl_room_t room = {.d_ceil_m = 4.0f, .vbat_V = volts[i]};
        const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, ORIGIN, ORIGIN, asked(0.0f, 0.1f));
        TEST_ASSERT_FLOAT_WITHIN(2.0e-3f, 0.8f * (full[i] - 1.0f) * 9.81f, aim.accel_mps2);
    }
    // a supply that never sags
    cfg.vbat_V_rated = 0.0f;
    const ivl_room_t room = {.d_ceil_m = 4.0f, .vbat_V = 1.0f};
    TEST_ASSERT_FLOAT_WITHIN(2.0e-3f, 0.8f * 9.81f, ivl_region_aim(&cfg, &room, ORIGIN, ORIGIN, asked(0.0f, 0.1f)).accel_mps2);
}

static void test_nothing_left_of_the_thrust_still_gives_a_finite_aim(void)
{
    ivl_cfg_t        cfg = region_cfg();
    const ivl_room_t room = {.d_ceil_m = 1.0f, .vbat_V = 0.5f};
    const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, ORIGIN, ORIGIN, asked(0.0f, 0.2f));
    TEST_ASSERT_EQUAL_FLOAT(0.1f, aim.accel_mps2);
    TEST_ASSERT_TRUE((aim.vz_mps >= 0.2f) && (aim.vz_mps < 0.5f));
}

// anything that a float can be, more often numbers near those of a flight
static float wild(rng_t *rng)
{
    const float    odd[] = {0.0f, -0.0f, NAN, INFINITY, -INFINITY, FLT_MAX, -FLT_MAX, FLT_MIN, 1.0e-30f};
    const uint32_t dice = rng_below(rng, 18);
    return (dice < 9u) ? odd[dice] : rng_float(rng, -6.0f, 6.0f);
}

static void test_aim_is_never_slower_than_asked_nor_faster_than_allowed_whatever_is_measured(void)
{
    rng_t rng = {11};
    for (int i = 0; i < 200000; i++)
    {
        ivl_cfg_t cfg = region_cfg();
        cfg.region_vx_mps = rng_float(&rng, 0.0f, 5.0f);
        cfg.region_vz_mps = rng_float(&rng, 0.0f, 5.0f);
        cfg.region_rrev_per_s = rng_float(&rng, 0.5f, 20.0f);
        cfg.approach_accel_mps2 = rng_float(&rng, 0.1f, 20.0f);
        cfg.fence_x_m_max = rng_float(&rng, -1.0f, 5.0f);
        cfg.fence_z_m_max = rng_float(&rng, -1.0f, 5.0f);
        const float      speed = rng_float(&rng, 0.1f, 6.0f), angle = rng_float(&rng, 0.0f, IVL_HALF_PI);
        const ivl_aim_t  ask = asked(speed * cosf(angle), speed * sinf(angle));
        const ivl_room_t room = {.d_ceil_m = wild(&rng), .vbat_V = wild(&rng)};
        const ivl_vec3_t p = {wild(&rng), wild(&rng), wild(&rng)}, v = {wild(&rng), wild(&rng), wild(&rng)};
        const ivl_aim_t  aim = ivl_region_aim(&cfg, &room, p, v, ask);
        TEST_ASSERT_TRUE((aim.vx_mps >= ask.vx_mps) && (aim.vz_mps >= ask.vz_mps));
        TEST_ASSERT_TRUE(sqrtf(aim.vx_mps * aim.vx_mps + aim.vz_mps * aim.vz_mps) <= cfg.speed_mps_max * 1.00001f);
        TEST_ASSERT_TRUE((aim.accel_mps2 >= 0.1f) && (aim.accel_mps2 <= cfg.approach_accel_mps2));
        // no further than region or command ask
        TEST_ASSERT_TRUE((aim.vx_mps <= fmaxf(cfg.region_vx_mps, ask.vx_mps)) && (aim.vz_mps <= fmaxf(cfg.region_vz_mps, ask.vz_mps)));
    }
}

static void test_more_room_never_makes_it_slower(void)
{
    const ivl_cfg_t cfg = region_cfg();
    rng_t           rng = {12};
    for (int i = 0; i < 5000; i++)
    {
        const float d_m = rng_float(&rng, 0.02f, 3.0f), vx = rng_float(&rng, 0.0f, 3.0f), vz = rng_float(&rng, 0.0f, 3.0f);
        const float near_mps = aim_from_rest(&cfg, d_m, vx, vz).vz_mps, far_mps = aim_from_rest(&cfg, 1.1f * d_m, vx, vz).vz_mps;
        TEST_ASSERT_TRUE(far_mps >= near_mps - 1.0e-3f);
    }
}

// ---- the reference

/// An approach that has its first aim.
static void begin(const ivl_cfg_t *cfg, ivl_approach_t *approach, const ivl_room_t *room, ivl_vec3_t p_W_m, ivl_vec3_t v_W_mps,
                  float speed_mps, float angle_rad)
{
    ivl_approach_begin(cfg, approach, p_W_m, v_W_mps, speed_mps, angle_rad);
    ivl_approach_aim(cfg, approach, room, false);
}

static void test_reference_reaches_the_aim_in_a_straight_line_before_the_flip_starts(void)
{
    rng_t rng = {13};
    int   n_short = 0;
    for (int i = 0; i < 500; i++)
    {
        const ivl_cfg_t  cfg = region_cfg();
        const float      d_m = rng_float(&rng, 0.4f, 2.5f), angle = rng_float(&rng, 0.35f, IVL_HALF_PI);
        const ivl_room_t room = distance(d_m);
        ivl_approach_t   approach;
        begin(&cfg, &approach, &room, ORIGIN, ORIGIN, 0.25f, angle);
        const ivl_aim_t aim = approach.aim;
        n_short += (aim.vz_mps < 2.0f) ? 1 : 0;
        ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        while (ref.v_W_mps.z < cfg.region_rrev_per_s * (d_m - ref.p_W_m.z))
        {
            TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 0.0f, ref.p_W_m.x * aim.vz_mps - ref.p_W_m.z * aim.vx_mps);
            ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        }
        // a tick of the ramp is 9 mm/s; where the speed is lowered, the ramp is flatter than the one that was reckoned with
        const float part = (aim.vz_mps < 2.0f) ? 0.08f : 0.0f;
        TEST_ASSERT_FLOAT_WITHIN(0.02f + part * aim.vx_mps, aim.vx_mps, ref.v_W_mps.x);
        TEST_ASSERT_FLOAT_WITHIN(0.02f + part * aim.vz_mps, aim.vz_mps, ref.v_W_mps.z);
    }
    TEST_ASSERT_TRUE((n_short > 50) && (n_short < 450));
}

// promised from a hover, as long as the command itself is braked inside the fence
static void test_reference_that_is_braked_at_the_ceiling_stays_inside_the_fence(void)
{
    rng_t rng = {14};
    int   n_limited = 0;
    for (int i = 0; i < 2000; i++)
    {
        ivl_cfg_t cfg = region_cfg();
        cfg.fence_x_m_max = rng_float(&rng, 0.1f, 2.0f);
        cfg.region_vx_mps = rng_float(&rng, 0.0f, 4.0f);
        const float d_m = rng_float(&rng, 0.1f, 2.5f), angle = rng_float(&rng, 0.35f, IVL_HALF_PI), speed = rng_float(&rng, 0.25f, 4.0f);
        const ivl_room_t room = distance(d_m);
        ivl_approach_t   approach;
        begin(&cfg, &approach, &room, ORIGIN, ORIGIN, speed, angle);
        const bool by_command = approach.aim.vx_mps <= approach.asked.vx_mps;
        n_limited += (approach.aim.vx_mps < cfg.region_vx_mps) ? 1 : 0;
        ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        while (ref.p_W_m.z < d_m)
        {
            ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        }
        const float stop_m = ref.p_W_m.x + 0.5f * ref.v_W_mps.x * ref.v_W_mps.x / cfg.approach_accel_mps2;
        TEST_ASSERT_TRUE(by_command || (stop_m < cfg.fence_x_m_max + 0.01f));
    }
    TEST_ASSERT_TRUE(n_limited > 200);
}

static void test_reference_is_consistent_with_its_derivatives_also_when_it_aims_anew(void)
{
    rng_t rng = {15};
    for (int i = 0; i < 1000; i++)
    {
        ivl_cfg_t cfg = region_cfg();
        cfg.fence_x_m_max = rng_float(&rng, 0.2f, 3.0f);
        const ivl_room_t known = distance(rng_float(&rng, 0.1f, 3.0f));
        const int        seen_at = (int)rng_below(&rng, 100);
        ivl_approach_t   approach;
        begin(&cfg, &approach, &UNKNOWN, rng_vec3(&rng, 0.1f), rng_vec3(&rng, 2.0f), rng_float(&rng, 0.1f, 6.0f),
              rng_float(&rng, 0.0f, IVL_HALF_PI));
        ivl_reference_t a = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        for (int k = 0; k < 200; k++)
        {
            ivl_approach_aim(&cfg, &approach, (k < seen_at) ? &UNKNOWN : &known, false);
            const ivl_reference_t b = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
            const ivl_vec3_t      mean_v = ivl_scale(ivl_add(a.v_W_mps, b.v_W_mps), 0.5f);
            TEST_ASSERT_TRUE(ivl_vec3_within(ivl_sub(ivl_add(a.p_W_m, ivl_scale(mean_v, DT_S)), b.p_W_m), 4.0e-6f));
            TEST_ASSERT_TRUE(ivl_vec3_within(ivl_sub(ivl_add(a.v_W_mps, ivl_scale(a.a_W_mps2, DT_S)), b.v_W_mps), 4.0e-6f));
            TEST_ASSERT_TRUE(ivl_dot(a.a_W_mps2, a.a_W_mps2) <= 4.301f * 4.301f);
            a = b;
        }
    }
}

static void test_distance_that_comes_later_corrects_the_aim_once(void)
{
    const ivl_cfg_t cfg = region_cfg();
    ivl_approach_t  approach;
    begin(&cfg, &approach, &UNKNOWN, ORIGIN, ORIGIN, 0.5f, IVL_HALF_PI);
    TEST_ASSERT_EQUAL_FLOAT(1.2f, approach.aim.vx_mps);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, approach.aim.vz_mps);
    const ivl_room_t bad[] = {{0.0f, 0.0f}, {NAN, 0.0f}, {INFINITY, 0.0f}, {-1.0f, 0.0f}, {5.1f, 0.0f}};
    for (int i = 0; i < 50; i++)
    {
        ivl_approach_aim(&cfg, &approach, &bad[i % 5], false);
        TEST_ASSERT_EQUAL_FLOAT(2.0f, approach.aim.vz_mps);
        (void)ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
    }
    const ivl_room_t first = distance(0.5f), second = distance(0.9f);
    ivl_approach_aim(&cfg, &approach, &first, false);
    const ivl_aim_t aim = approach.aim;
    TEST_ASSERT_TRUE((aim.vz_mps > 0.5f) && (aim.vz_mps < 1.9f));
    ivl_approach_aim(&cfg, &approach, &second, false);
    TEST_ASSERT_EQUAL_MEMORY(&aim, &approach.aim, sizeof aim);
    for (int i = 0; i < 500; i++)
    {
        (void)ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
    }
    const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, aim.vx_mps, ref.v_W_mps.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, aim.vz_mps, ref.v_W_mps.z);
}

static void test_other_shapes_ignore_room_and_region_and_say_what_they_aim_at(void)
{
    ivl_cfg_t cfg = region_cfg();
    for (uint8_t shape = 0; shape < (uint8_t)IVL_SHAPE_REGION; shape++)
    {
        cfg.shape = shape;
        const ivl_room_t room = {.d_ceil_m = 0.1f, .vbat_V = 1.0f};
        ivl_approach_t   a, b;
        begin(&cfg, &a, &room, ORIGIN, ivl_vec3(0.1f, 0.0f, 0.2f), 0.5f, 0.6f);
        begin(&cfg, &b, &UNKNOWN, ORIGIN, ivl_vec3(0.1f, 0.0f, 0.2f), 0.5f, 0.6f);
        ivl_approach_aim(&cfg, &a, &room, false);
        TEST_ASSERT_EQUAL_MEMORY(&a, &b, sizeof a);
        const float speed = (shape == (uint8_t)IVL_SHAPE_ACCELERATE) ? cfg.speed_mps_max : 0.5f;
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, speed * cosf(0.6f), a.aim.vx_mps);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, speed * sinf(0.6f), a.aim.vz_mps);
    }
}

// ---- through the pipeline

// 1.1 m below the ceiling of the defaults
static void test_core_tells_the_approach_its_distance_and_battery(void)
{
    fix_t fix;
    fix_init(&fix);
    fix.cfg.shape = (uint8_t)IVL_SHAPE_REGION;
    fix.in.cmd.speed_mps = 0.5f;
    fix.in.cmd.angle_rad = IVL_HALF_PI;
    fix_policy(&fix, 15.0f, 8.0e-3f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    TEST_ASSERT_EQUAL_INT(IVL_PHASE_APPROACH, fix.state.phase);
    // the first tick only holds the velocity
    TEST_ASSERT_EQUAL_INT(IVL_APPROACH_AIM, fix.state.approach.wants);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, fix.state.approach.accel_mps2);
    fix_tick(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_APPROACH_NOTHING, fix.state.approach.wants);
    TEST_ASSERT_EQUAL_FLOAT(1.2f, fix.state.approach.aim.vx_mps);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, fix.state.approach.aim.vz_mps);
    TEST_ASSERT_EQUAL_FLOAT(4.3f, fix.state.approach.aim.accel_mps2);
    // the same in another flight with a battery of half the voltage: a quarter of the thrust, with which nothing can fly
    fix_init(&fix);
    fix.cfg.shape = (uint8_t)IVL_SHAPE_REGION;
    fix.in.cmd.speed_mps = 0.5f;
    fix.in.cmd.angle_rad = IVL_HALF_PI;
    fix_policy(&fix, 15.0f, 8.0e-3f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix.in.vitals = (ivl_vitals_t){.given = 1u, .configured = 1u, .can_fly = 1u, .stock_idle = 1u, .vbat_V = 0.5f * 3.7f};
    fix.cfg.vbat_V_min = 1.0f;
    fix_request(&fix, IVL_REQUEST_APPROACH);
    fix_tick(&fix);
    TEST_ASSERT_EQUAL_INT(IVL_PHASE_APPROACH, fix.state.phase);
    TEST_ASSERT_EQUAL_FLOAT(0.1f, fix.state.approach.aim.accel_mps2);
    TEST_ASSERT_TRUE(fix.state.approach.aim.vz_mps < 1.0f);
}

static void test_core_aims_anew_when_an_estimator_has_its_first_distance(void)
{
    fix_t fix;
    fix_init(&fix);
    fix.cfg.shape = (uint8_t)IVL_SHAPE_REGION;
    fix.cfg.d_source = (uint8_t)IVL_SOURCE_RANGE;
    fix.in.cmd.speed_mps = 0.5f;
    fix.in.cmd.angle_rad = IVL_HALF_PI;
    fix_policy(&fix, 15.0f, 8.0e-3f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    fix_ticks(&fix, 0.1f);
    TEST_ASSERT_EQUAL_INT(IVL_APPROACH_DISTANCE, fix.state.approach.wants);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, fix.state.approach.aim.vz_mps);
    fix.in.range = (ivl_reading_t){.t_us = fix.in.t_us, .value = 0.4f, .valid = 1u};
    fix_ticks(&fix, 0.01f);
    TEST_ASSERT_EQUAL_INT(IVL_PHASE_APPROACH, fix.state.phase);
    TEST_ASSERT_EQUAL_INT(IVL_APPROACH_NOTHING, fix.state.approach.wants);
    TEST_ASSERT_TRUE(fix.state.approach.aim.vz_mps < 1.7f);
}

// 500 measurements a second
static void test_a_sensor_that_measures_in_every_tick_does_not_put_the_aim_off_for_ever(void)
{
    fix_t fix;
    fix_init(&fix);
    fix.cfg.shape = (uint8_t)IVL_SHAPE_REGION;
    fix.cfg.d_source = (uint8_t)IVL_SOURCE_RANGE;
    fix.in.cmd.speed_mps = 0.5f;
    fix.in.cmd.angle_rad = IVL_HALF_PI;
    fix_policy(&fix, 15.0f, 8.0e-3f);
    fix_request(&fix, IVL_REQUEST_HOVER);
    fix_request(&fix, IVL_REQUEST_APPROACH);
    int n_ticks = 0;
    while (fix.state.approach.wants != (uint8_t)IVL_APPROACH_NOTHING)
    {
        fix.in.range = (ivl_reading_t){.t_us = fix.in.t_us, .value = 0.4f, .valid = 1u};
        fix_tick(&fix);
        TEST_ASSERT_TRUE(++n_ticks < 12);
    }
    TEST_ASSERT_TRUE(n_ticks > 8);
    TEST_ASSERT_TRUE((fix.state.approach.aim.vz_mps > 0.5f) && (fix.state.approach.aim.vz_mps < 1.7f));
}

static void test_the_aim_waits_for_a_tick_without_a_measurement(void)
{
    const ivl_cfg_t  cfg = region_cfg();
    const ivl_room_t room = distance(2.0f);
    ivl_approach_t   approach;
    ivl_approach_begin(&cfg, &approach, ORIGIN, ivl_vec3(0.1f, 0.0f, 0.2f), 0.5f, IVL_HALF_PI);
    for (int i = 0; i < 3; i++)
    {
        ivl_approach_aim(&cfg, &approach, &room, true);
        const ivl_reference_t ref = ivl_approach_next(&cfg, &approach, 0.0f, DT_S);
        TEST_ASSERT_EQUAL_FLOAT(0.1f, ref.v_W_mps.x);
        TEST_ASSERT_EQUAL_FLOAT(0.2f, ref.v_W_mps.z);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, ref.a_W_mps2.z);
    }
    ivl_approach_aim(&cfg, &approach, &room, false);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, approach.aim.vz_mps);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_with_enough_room_the_aim_is_the_region_or_what_is_asked_beyond_it);
    RUN_TEST(test_too_little_room_gives_the_root_of_the_quadratic);
    RUN_TEST(test_speed_along_the_ceiling_ends_at_the_fence);
    RUN_TEST(test_speed_that_is_there_already_needs_less_room);
    RUN_TEST(test_fence_above_counts_as_room_also_when_the_distance_is_not_known);
    RUN_TEST(test_fence_ahead_limits_the_speed_along_the_ceiling);
    RUN_TEST(test_acceleration_is_what_the_thrust_left_allows);
    RUN_TEST(test_low_battery_leaves_less_thrust);
    RUN_TEST(test_nothing_left_of_the_thrust_still_gives_a_finite_aim);
    RUN_TEST(test_aim_is_never_slower_than_asked_nor_faster_than_allowed_whatever_is_measured);
    RUN_TEST(test_more_room_never_makes_it_slower);
    RUN_TEST(test_reference_reaches_the_aim_in_a_straight_line_before_the_flip_starts);
    RUN_TEST(test_reference_that_is_braked_at_the_ceiling_stays_inside_the_fence);
    RUN_TEST(test_reference_is_consistent_with_its_derivatives_also_when_it_aims_anew);
    RUN_TEST(test_distance_that_comes_later_corrects_the_aim_once);
    RUN_TEST(test_other_shapes_ignore_room_and_region_and_say_what_they_aim_at);
    RUN_TEST(test_core_tells_the_approach_its_distance_and_battery);
    RUN_TEST(test_core_aims_anew_when_an_estimator_has_its_first_distance);
    RUN_TEST(test_a_sensor_that_measures_in_every_tick_does_not_put_the_aim_off_for_ever);
    RUN_TEST(test_the_aim_waits_for_a_tick_without_a_measurement);
    return UNITY_END();
}
