/// @file test_sim_surface.c
/// Any plane, at rest or moving, is the level ceiling seen from another frame: the same landing, turned or carried along.
#include "phys_surface.h"

#include "sim_fixture.h"

static ivl_sim_group_t level, other;

/// A frame: what is at p in the level world is at turn p + shift + velocity t in the other one.
typedef struct
{
    double   q[4];
    ivl_d3_t shift_m, velocity_mps;
} frame_t;

static ivl_d3_t turned(const frame_t *frame, const double a[3])
{
    const ivl_rot_t R = ivl_rot_from_quat(frame->q);
    return ivl_rot_apply(&R, ivl_d3_load(a));
}

static frame_t draw_frame(draws_t *draws, bool turns, bool moves)
{
    frame_t frame = {.q = {0.0, 0.0, 0.0, 1.0}};
    if (turns)
    {
        draw_quat(draws, frame.q);
        frame.shift_m = draw_d3(draws, 5.0);
    }
    if (moves)
    {
        frame.velocity_mps = draw_d3(draws, 2.0);
    }
    return frame;
}

/// The same vehicle, with the level world's surface and gravity as they are in the other frame.
static ivl_sim_model_t model_in(const frame_t *frame, const ivl_sim_model_t *model)
{
    ivl_sim_model_t moved = *model;
    double          point[3], normal[3], up[3];
    ivl_d3_store(point, model->surface.point_W_m);
    ivl_d3_store(normal, model->surface.normal_W);
    ivl_d3_store(up, model->up_W);
    moved.surface = (ivl_sim_surface_t){.point_W_m = ivl_d3_add(turned(frame, point), frame->shift_m),
                                        .normal_W = turned(frame, normal),
                                        .velocity_W_mps = frame->velocity_mps};
    moved.up_W = turned(frame, up);
    return moved;
}

static void place_in(const frame_t *frame, double t, const double p[3], const double v[3], double p_out[3], double v_out[3])
{
    ivl_d3_store(p_out, ivl_d3_add(ivl_d3_add(turned(frame, p), frame->shift_m), ivl_d3_scale(t, frame->velocity_mps)));
    ivl_d3_store(v_out, ivl_d3_add(turned(frame, v), frame->velocity_mps));
}

static ivl_sim_kin_t kin_in(const frame_t *frame, double t, const ivl_sim_kin_t *kin)
{
    ivl_sim_kin_t  moved = *kin;
    const double  *a = frame->q, *b = kin->q_WB;
    const ivl_d3_t u = ivl_d3_load(a), v = ivl_d3_load(b);
    const ivl_d3_t w = ivl_d3_add(ivl_d3_add(ivl_d3_scale(a[3], v), ivl_d3_scale(b[3], u)), ivl_d3_cross(u, v));
    ivl_d3_store(moved.q_WB, w);
    moved.q_WB[3] = a[3] * b[3] - ivl_d3_dot(u, v);
    place_in(frame, t, kin->p_WB_m, kin->v_WB_mps, moved.p_WB_m, moved.v_WB_mps);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        place_in(frame, t, kin->p_foot_W_m[i], kin->v_foot_W_mps[i], moved.p_foot_W_m[i], moved.v_foot_W_mps[i]);
    }
    return moved;
}

/// A vehicle on its way to the ceiling, at any attitude about upside down.
static ivl_sim_kin_t approaching(const ivl_sim_model_t *model, draws_t *draws)
{
    ivl_sim_kin_t kin = resting_kin(model, draw(draws, -1.0, 1.0), draw(draws, -1.0, 1.0), 2.85);
    double        q[4];
    const double  roll = draw(draws, -0.4, 0.4), angle = draw(draws, 1.2, 4.5);
    nose_up(angle, q);
    const double square = 1.0 / sqrt(1.0 + roll * roll);
    q[0] = square * roll * q[3];
    q[2] = -square * roll * q[1];
    q[1] *= square;
    q[3] *= square;
    turn_kin(model, q, &kin);
    const double v[3] = {draw(draws, -1.0, 1.0), draw(draws, -0.5, 0.5), draw(draws, 1.5, 3.5)};
    const double w[3] = {draw(draws, -2.0, 2.0), draw(draws, -12.0, 2.0), draw(draws, -2.0, 2.0)};
    memcpy(kin.v_WB_mps, v, sizeof v);
    memcpy(kin.w_B_radps, w, sizeof w);
    const ivl_rot_t R = ivl_rot_from_quat(kin.q_WB);
    const ivl_d3_t  w_W = ivl_rot_apply(&R, ivl_d3_load(w));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t arm = ivl_d3_sub(ivl_d3_load(kin.p_foot_W_m[i]), ivl_d3_load(kin.p_WB_m));
        ivl_d3_store(kin.v_foot_W_mps[i], ivl_d3_add(ivl_d3_load(v), ivl_d3_cross(w_W, arm)));
    }
    return kin;
}

static void begin(ivl_sim_group_t *group, const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const float thrust_N[4])
{
    const ivl_sim_foot_t free_feet[IVL_SIM_LEGS] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    place_alone(model, group, kin, free_feet);
    command_rotors(group, thrust_N);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        group->rotor.speed_radps[i][0] = group->rotor.command_radps[i][0];
    }
}

/// How far the two worlds are apart, seen from the level one; large if they disagree on what has happened.
static double apart(const frame_t *frame)
{
    const ivl_sim_world_t *a = &level.world[0], *b = &other.world[0];
    const ivl_sim_kin_t    there = ivl_sim_world_kin(&level, 0), found = ivl_sim_world_kin(&other, 0);
    const ivl_sim_kin_t    expected = kin_in(frame, level.progress.t_s[0], &there);
    if (memcmp(a->foot, b->foot, sizeof a->foot) != 0 || memcmp(a->stuck_order, b->stuck_order, sizeof a->stuck_order) != 0 ||
        memcmp(a->plate_touched, b->plate_touched, sizeof a->plate_touched) != 0 || a->impact.happened != b->impact.happened)
    {
        return 1.0e3;
    }
    double worst = fabs(a->impact.t_s - b->impact.t_s) + fabs(level.progress.d_min_m[0] - other.progress.d_min_m[0]);
    worst = fmax(worst, fabs(ivl_sim_world_gap_m(&level, 0) - ivl_sim_world_gap_m(&other, 0)));
    for (int k = 0; k < 3; k++)
    {
        worst = fmax(worst, fabs(expected.p_WB_m[k] - found.p_WB_m[k]));
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            worst = fmax(worst, fabs(expected.p_foot_W_m[i][k] - found.p_foot_W_m[i][k]));
        }
    }
    return worst;
}

/// What a set of landings was about.
typedef struct
{
    int    n_stuck, n_struck, n_other;
    double worst_m;
} tally_t;

static tally_t land(const ivl_sim_params_t *params, bool turns, bool moves, uint64_t seed, int n, double span_s)
{
    ivl_sim_model_t model = fixture_model(params);
    draws_t         draws = {seed};
    model.up_W = ivl_d3(0.48, -0.36, 0.8);  // not the normal: who takes one for the other is found out
    tally_t tally = {0, 0, 0, 0.0};
    for (int i = 0; i < n; i++)
    {
        const frame_t         frame = draw_frame(&draws, turns, moves);
        const ivl_sim_model_t there = model_in(&frame, &model);
        const ivl_sim_kin_t   start = approaching(&model, &draws), same = kin_in(&frame, 0.0, &start);
        float                 thrust_N[4];
        for (int k = 0; k < 4; k++)
        {
            thrust_N[k] = (float)draw(&draws, 0.0, 0.12);
        }
        begin(&level, &model, &start, thrust_N);
        begin(&other, &there, &same, thrust_N);
        for (int step = 0; step < (int)(span_s / 0.002); step++)
        {
            advance(&level, 0.002);
            advance(&other, 0.002);
        }
        tally.n_stuck += ivl_sim_world_count_stuck(&level.world[0]);
        tally.n_struck += (level.world[0].plate_touched[0] || level.world[0].plate_touched[1]) ? 1 : 0;
        const double distance = apart(&frame);
        tally.n_other += (distance < 100.0) ? 0 : 1;
        tally.worst_m = fmax(tally.worst_m, distance);
    }
    return tally;
}

static void check(const tally_t *tally, int n)
{
    TEST_ASSERT_EQUAL_INT(0, tally->n_other);
    TEST_ASSERT_TRUE(tally->worst_m < 1.0e-9);
    TEST_ASSERT_TRUE(tally->n_stuck > n / 2);
    TEST_ASSERT_TRUE(tally->n_struck > n / 10);
}

/// A vehicle that feels the air and the ceiling's nearness: both turn along.
static ivl_sim_params_t airy(void)
{
    ivl_sim_params_t params = fixture_params();
    params.aero_drag_xy_Nspm = 0.01;
    params.aero_drag_z_Nspm = 0.02;
    params.aero_ceiling_gain_norm = 0.5;
    params.rotor_inflow_loss_spm = 0.05;
    return params;
}

static ivl_sim_params_t weak(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_adhesion_N = 1.0;
    params.leg_stick_delay_s = 0.004;
    params.leg_foot_damping_Nmsprad = 5.0e-4;
    params.aero_ceiling_gain_norm = 0.5;
    return params;
}

static void test_a_tilted_plane_is_the_level_one_turned(void)
{
    const ivl_sim_params_t params = airy();
    const tally_t          tally = land(&params, true, false, 11, 100, 0.2);
    check(&tally, 100);
}

static void test_feet_that_slide_and_come_off_do_so_on_a_tilted_plane(void)
{
    const ivl_sim_params_t params = weak();
    const tally_t          tally = land(&params, true, false, 12, 60, 0.15);
    TEST_ASSERT_EQUAL_INT(0, tally.n_other);
    TEST_ASSERT_TRUE(tally.worst_m < 1.0e-9);
}

static void test_a_moving_plane_is_the_one_at_rest_carried_along(void)
{
    const ivl_sim_params_t params = fixture_params();
    const tally_t          tally = land(&params, false, true, 13, 100, 0.2);
    check(&tally, 100);
}

static void test_a_plane_that_is_tilted_and_moves(void)
{
    const ivl_sim_params_t params = weak();
    const tally_t          tally = land(&params, true, true, 14, 60, 0.15);
    TEST_ASSERT_EQUAL_INT(0, tally.n_other);
    TEST_ASSERT_TRUE(tally.worst_m < 1.0e-9);
}

static void test_gap_closing_and_tangential_speed(void)
{
    const double            s = sqrt(0.5);
    const ivl_sim_surface_t wall = {.point_W_m = {2.0, 5.0, 7.0}, .normal_W = {1.0, 0.0, 0.0}, .velocity_W_mps = {0.5, 0.0, -1.0}};
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 2.0 + 0.5 * 3.0, ivl_sim_surface_height(&wall, 3.0));
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 1.25, ivl_sim_surface_height_of(&wall, ivl_d3(1.25, -3.0, 9.0)));
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 1.5, ivl_sim_surface_closing(&wall, ivl_d3(2.0, 4.0, 3.0)));
    const ivl_d3_t along = ivl_sim_surface_tangential(&wall, ivl_d3(2.0, 4.0, 3.0));
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, fabs(along.x) + fabs(along.y - 4.0) + fabs(along.z - 4.0));
    // forward on a wall in front is down, on a slope the level direction bent
    const ivl_d3_t down = ivl_sim_surface_forward(&wall);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, fabs(down.x) + fabs(down.y) + fabs(down.z + 1.0));
    const ivl_sim_surface_t slope = {.normal_W = {s, 0.0, s}};
    const ivl_d3_t          bent = ivl_sim_surface_forward(&slope);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, fabs(bent.x - s) + fabs(bent.y) + fabs(bent.z + s));
    const ivl_sim_surface_t ceiling = ivl_sim_surface_level(3.0);
    const ivl_d3_t          ahead = ivl_sim_surface_forward(&ceiling);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, fabs(ahead.x - 1.0) + fabs(ahead.y) + fabs(ahead.z));
}

// what the sensors tell is about the surface, not about the world's axes
static void test_sensors_see_a_moving_tilted_plane_as_a_level_one_at_rest(void)
{
    static ivl_sim_sensors_t here, there;
    const ivl_sim_rng_t      rng = {3, 4};
    ivl_sim_params_t         params = fixture_params();
    params.rrev_rate_hz = 90.0;
    params.range_rate_hz = 70.0;
    params.flow_rate_hz = 80.0;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {15};
    for (int i = 0; i < 50; i++)
    {
        // the turn that takes z the shortest way to the new normal, which keeps forward forward
        const double  x = draw(&draws, -0.6, 0.6), y = draw(&draws, -0.6, 0.6);
        const frame_t frame = {
            .q = {x, y, 0.0, sqrt(1.0 - x * x - y * y)}, .shift_m = draw_d3(&draws, 3.0), .velocity_mps = draw_d3(&draws, 2.0)};
        const ivl_sim_model_t tilted = model_in(&frame, &model);
        ivl_sim_kin_t         kin = resting_kin(&model, 0.3, -0.2, 2.0);
        const double          q[4] = {0.1, -0.2, 0.05, sqrt(1.0 - 0.01 - 0.04 - 0.0025)}, a[3] = {0.5, -1.0, 2.0};
        turn_kin(&model, q, &kin);
        ivl_d3_store(kin.v_WB_mps, draw_d3(&draws, 2.0));
        ivl_in_t      in = {.t_us = 0}, in_there = {.t_us = 0};
        ivl_sim_kin_t moved = kin_in(&frame, 0.0, &kin);
        ivl_sim_sensors_init(&model, &rng, &kin, &here);
        ivl_sim_sensors_init(&tilted, &rng, &moved, &there);
        for (int tick = 0; tick < 30; tick++)
        {
            const double  t = 0.002 * tick;
            ivl_sim_kin_t now = kin;
            for (int k = 0; k < 3; k++)
            {
                now.p_WB_m[k] += t * (kin.v_WB_mps[k] + 0.5 * t * a[k]);
                now.v_WB_mps[k] += t * a[k];
            }
            moved = kin_in(&frame, t, &now);
            ivl_sim_scene_t scene = {.model = &model, .kin = &now, .surface_height_m = ivl_sim_surface_height(&model.surface, t)};
            memcpy(scene.a_W_mps2, a, sizeof a);
            ivl_sim_sensors_read(&scene, &rng, t, &here, &in);
            ivl_sim_scene_t seen = {.model = &tilted, .kin = &moved, .surface_height_m = ivl_sim_surface_height(&tilted.surface, t)};
            ivl_d3_store(seen.a_W_mps2, turned(&frame, a));
            ivl_sim_sensors_read(&seen, &rng, t, &there, &in_there);
        }
        TEST_ASSERT_TRUE(in.rrev.t_us > 0 && in.range.t_us > 0 && in.flow.t_us > 0);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, in.rrev.value, in_there.rrev.value);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, in.range.value, in_there.range.value);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, in.flow.value, in_there.flow.value);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, in.f_B_mps2.x, in_there.f_B_mps2.x);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, in.f_B_mps2.y, in_there.f_B_mps2.y);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, in.f_B_mps2.z, in_there.f_B_mps2.z);
    }
}

// before a level ceiling, but gravity is not: body and feet fall where it pulls, and what they lose in level they gain in speed
static void test_gravity_pulls_where_it_points(void)
{
    const ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t        model = fixture_model(&params);
    const ivl_sim_foot_t   free_feet[IVL_SIM_LEGS] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    const double           up[3] = {0.48, -0.36, 0.8}, t = 0.1, fallen = 0.5 * params.world_gravity_mps2 * t * t;
    model.up_W = ivl_d3_load(up);
    const ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 1.5);
    place_alone(&model, &other, &kin, free_feet);
    const double energy = total_energy(&other);
    advance(&other, t);
    const ivl_sim_kin_t now = ivl_sim_world_kin(&other, 0);
    for (int k = 0; k < 3; k++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, kin.p_WB_m[k] - fallen * up[k], now.p_WB_m[k]);
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, kin.p_foot_W_m[i][k] - fallen * up[k], now.p_foot_W_m[i][k]);
        }
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, energy, total_energy(&other));
}

// a new origin of time leaves the surface where it is
static void test_a_rebased_world_keeps_its_moving_surface(void)
{
    const ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t        model = fixture_model(&params);
    const ivl_sim_foot_t   free_feet[IVL_SIM_LEGS] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    model.surface.velocity_W_mps = ivl_d3(0.3, 0.0, 0.7);
    const ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 1.0);
    place_alone(&model, &other, &kin, free_feet);
    advance(&other, 0.02);
    const double gap = ivl_sim_world_gap_m(&other, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 2.0 + 0.02 * 0.7 + 0.5 * 9.81 * 0.02 * 0.02, gap);
    ivl_sim_world_rebase(&other, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, gap, ivl_sim_world_gap_m(&other, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, gap, other.progress.d_min_m[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_gap_closing_and_tangential_speed);
    RUN_TEST(test_a_tilted_plane_is_the_level_one_turned);
    RUN_TEST(test_feet_that_slide_and_come_off_do_so_on_a_tilted_plane);
    RUN_TEST(test_a_moving_plane_is_the_one_at_rest_carried_along);
    RUN_TEST(test_a_plane_that_is_tilted_and_moves);
    RUN_TEST(test_sensors_see_a_moving_tilted_plane_as_a_level_one_at_rest);
    RUN_TEST(test_gravity_pulls_where_it_points);
    RUN_TEST(test_a_rebased_world_keeps_its_moving_surface);
    return UNITY_END();
}
