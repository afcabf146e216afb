/// @file test_sim_step.c
/// How long a step may be: the limit of stability, what it follows from, and the bound on the work of a motion.
#include "world_step_size.h"

#include "sim_fixture.h"
#include "world_group.h"

static const ivl_sim_foot_t FREE[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
static const ivl_sim_foot_t ALL_STUCK[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK};

static ivl_sim_group_t group;

// ---- the limit -----------------------------------------------------------------------------------------------------------

/// Left side of the condition of stability near rest, which asks for less than 1.
static double criterion(const ivl_sim_model_t *model, double dt)
{
    return dt * (model->step.swing_damping_per_s + dt * model->step.swing_quarter_per_s2);
}

/// Step at which the condition has the given value.
static double step_of(const ivl_sim_model_t *model, double value)
{
    double lo = 0.0, hi = 1.0;
    for (int i = 0; i < 60; i++)
    {
        const double mid = 0.5 * (lo + hi);
        *((criterion(model, mid) > value) ? &hi : &lo) = mid;
    }
    return lo;
}

/// Fastest relative motion of a foot and its hip, in the legs' free swing.
static double swinging(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    double          most = 0.0;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = ivl_rot_apply(&R, ivl_d3_cross(ivl_d3_load(kin->w_B_radps), model->leg.hip_B_m[i]));
        const ivl_d3_t v = ivl_d3_sub(ivl_d3_load(kin->v_foot_W_mps[i]), ivl_d3_add(ivl_d3_load(kin->v_WB_mps), hip));
        most = fmax(most, sqrt(ivl_d3_dot(v, v)));
    }
    return most;
}

/// How much a small swing of the free legs has grown after 600 equal steps, or a million if it takes fewer.
static double growth(const ivl_sim_model_t *model, double dt, uint64_t seed)
{
    draws_t           draws = {seed};
    ivl_sim_kin_t     kin = draw_kin(model, &draws, 1.0e-6);
    ivl_sim_state_t   state, next;
    ivl_sim_contact_t contact;
    ivl_sim_rate_t    last, rate;
    ivl_sim_load_t    load;
    const ivl_wide_t  step = ivl_wide(dt), none = ivl_wide(0.0);
    memset(kin.v_WB_mps, 0, sizeof kin.v_WB_mps);
    memset(kin.w_B_radps, 0, sizeof kin.w_B_radps);
    memset(kin.v_foot_W_mps, 0, sizeof kin.v_foot_W_mps);
    memset(&contact, 0, sizeof contact);
    memset(&load, 0, sizeof load);
    load.surface_height_m = ivl_wide(ivl_sim_surface_height(&model->surface, 0.0));
    memset(&last, 0, sizeof last);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_lane_set(&state, lane, &kin);
        ivl_sim_contact_set(model, &contact, lane, FREE);
    }
    ivl_sim_leapfrog(model, &contact, &load, &none, &state, &last, &next, &last);
    double start = 0.0, end = 0.0;
    for (int i = 0; i < 600 && end < 1.0e6 * start + 1.0; i++)
    {
        ivl_sim_leapfrog(model, &contact, &load, &step, &state, &last, &next, &rate);
        state = next;
        last = rate;
        ivl_sim_lane_get(&state, 0, &kin);
        end = (i % 20 == 0) ? 0.0 : fmax(end, swinging(model, &kin));  // the largest of the last twenty
        start = (i == 19) ? end : start;
    }
    return end / start;
}

static ivl_sim_params_t draw_legs(draws_t *draws)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_length_m = draw(draws, 0.03, 0.12);
    params.leg_angle_deg = draw(draws, 0.0, 80.0);
    params.leg_mass_kg = draw(draws, 2.0e-4, 1.5e-3);
    params.leg_stiffness_Nmprad = draw(draws, 0.01, 0.2);
    params.leg_damping_Nmsprad = draw(draws, 0.0, 3.0e-4);
    params.body_inertia_xx_kgm2 = draw(draws, 1.0e-5, 8.0e-5);
    params.body_inertia_yy_kgm2 = draw(draws, 1.0e-5, 8.0e-5);
    params.body_inertia_zz_kgm2 = draw(draws, 2.0e-5, 8.0e-5);
    return params;
}

static void test_free_legs_ring_out_below_the_limit_and_without_end_above_it(void)
{
    draws_t draws = {31};
    int     n = 0, hardly_damped = 0;
    for (int i = 0; i < 400; i++)
    {
        ivl_sim_params_t params = draw_legs(&draws);
        params.leg_damping_Nmsprad *= (i % 3 == 0) ? 0.01 : 1.0;
        const ivl_sim_model_t model = fixture_model(&params);
        if (step_of(&model, 1.05) < model.step.longest_s)  // the rods have a limit of their own
        {
            TEST_ASSERT_TRUE(growth(&model, step_of(&model, IVL_SIM_STABLE), (uint64_t)i) < 3.0);
            TEST_ASSERT_TRUE(growth(&model, step_of(&model, 1.05), (uint64_t)i) > 100.0);
            n++;
            hardly_damped += (i % 3 == 0) ? 1 : 0;
        }
    }
    TEST_ASSERT_TRUE(n > 50 && hardly_damped > 5);
}

static void test_the_body_s_share_in_the_swing_shortens_the_limit(void)
{
    ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t  model = fixture_model(&params);
    // a body that hardly moves leaves the legs alone
    params.body_mass_kg = 0.05;
    params.body_inertia_xx_kgm2 = params.body_inertia_yy_kgm2 = params.body_inertia_zz_kgm2 = 9.0e-4;
    const ivl_sim_model_t heavy = fixture_model(&params);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 1.0, params.leg_damping_Nmsprad / heavy.leg.moment_pivot_kgm2 / heavy.step.swing_damping_per_s);
    TEST_ASSERT_TRUE(model.step.swing_damping_per_s > 1.05 * heavy.step.swing_damping_per_s);
}

static void test_the_shipped_legs_keep_their_steps_of_two_milliseconds(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    TEST_ASSERT_TRUE(criterion(&model, 0.002) < IVL_SIM_STABLE - 0.1);
    const ivl_sim_pace_t rest = {ivl_wide(1.0), ivl_wide(0.0), ivl_wide(0.0)};
    TEST_ASSERT_EQUAL_DOUBLE(0.002, ivl_sim_step_longest(&model.step, &rest, ivl_wide(0.002))[0]);
    TEST_ASSERT_TRUE(model.step.longest_s > 0.002);
}

static void test_the_longest_step_is_just_allowed(void)
{
    draws_t draws = {32};
    for (int i = 0; i < 1000; i++)
    {
        const ivl_sim_params_t params = draw_legs(&draws);
        const ivl_sim_model_t  model = fixture_model(&params);
        ivl_sim_pace_t         pace;
        // another motion in each lane
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            pace.swing_norm[lane] = draw(&draws, 0.0, (i % 2 == 0) ? 2.0 : 400.0);
            pace.turn2_per_s2[lane] = draw(&draws, 0.0, (i % 3 == 0) ? 1.0e6 : 1.0e3);
            pace.stretch_norm[lane] = draw(&draws, 0.0, (i % 5 == 0) ? 0.4 : 0.1);
        }
        const ivl_wide_t dt = ivl_sim_step_longest(&model.step, &pace, ivl_wide(0.002));
        TEST_ASSERT_FALSE(ivl_mask_any(~((dt > 0.0) & (dt <= 0.002))));
        TEST_ASSERT_FALSE(ivl_mask_any(~ivl_sim_step_allowed(&model.step, &pace, 1.0 + 1.0e-9, dt)));
        TEST_ASSERT_FALSE(ivl_mask_any((dt < 0.002) & ivl_sim_step_allowed(&model.step, &pace, 1.0, 1.001 * dt)));
    }
}

static void test_legs_that_no_step_could_follow_are_refused_with_the_reason(void)
{
    ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t  model;
    ivl_cfg_t        cfg;
    char             error[256] = "";
    ivl_cfg_defaults(&cfg);
    params.leg_damping_Nmsprad = 0.1;
    params.leg_length_m = 0.005;
    TEST_ASSERT_FALSE(ivl_sim_model_init(&model, &params, &cfg, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "leg.damping"));
    TEST_ASSERT_NOT_NULL(strstr(error, "shortest allowed are 1e-06 s"));
}

// ---- what it is for --------------------------------------------------------------------------------------------------------

/// Largest rise of the energy of a vehicle that nothing drives, over what it was before.
static double largest_rise(const ivl_sim_model_t *model, double span_s)
{
    double least = total_energy(&group), rise = 0.0;
    for (double t = 0.0; t < span_s; t += model->tick_s)
    {
        advance(&group, model->tick_s);
        const double energy = total_energy(&group);
        TEST_ASSERT_TRUE(isfinite(energy) && !group.world[0].gave_up);
        rise = fmax(rise, energy - least);
        least = fmin(least, energy);
    }
    return rise;
}

/// The smallest vehicle whose landing never ended: dampers three times as strong make the swing of its free legs unstable at
/// 2 ms, and it need not even fly.
static void test_strongly_damped_legs_of_a_vehicle_in_free_fall_come_to_rest(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_damping_Nmsprad = 2.2e-4;
    const ivl_sim_model_t model = fixture_model(&params);
    TEST_ASSERT_TRUE(criterion(&model, 0.002) > 1.1);
    draws_t             draws = {33};
    const ivl_sim_kin_t kin = draw_kin(&model, &draws, 0.1);
    place_alone(&model, &group, &kin, FREE);
    TEST_ASSERT_TRUE(largest_rise(&model, 0.3) < 1.0e-3);
}

/// A leg that is bent sideways has less inertia about its first hinge: a step that is stable at rest is not there.
static void test_legs_bent_far_sideways_do_not_gain_energy(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_damping_Nmsprad = 2.0e-5;
    params.leg_stiffness_Nmprad = 0.12;
    const ivl_sim_model_t model = fixture_model(&params);
    TEST_ASSERT_TRUE(criterion(&model, 0.002) < IVL_SIM_STABLE);
    for (int degrees = 20; degrees <= 75; degrees += 5)
    {
        const double  angle = degrees * (IVL_SIM_PI / 180.0);
        ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 1.0);
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            const ivl_d3_t n = ivl_d3_add(ivl_d3_scale(cos(angle), model.leg.rest_B[i]),
                                          ivl_d3_scale(((i % 2 == 0) ? 1.0 : -0.7) * sin(angle), model.leg.sideways_B[i]));
            const ivl_d3_t rod = ivl_d3_scale(params.leg_length_m / sqrt(ivl_d3_dot(n, n)), n);
            ivl_d3_store(kin.p_foot_W_m[i], ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_d3_add(model.leg.hip_B_m[i], rod)));
        }
        place_alone(&model, &group, &kin, FREE);
        const double before = total_energy(&group), rest = model.mass_total_kg * params.world_gravity_mps2;
        // what may rise is the oscillation of a second-order step, and it dies away
        TEST_ASSERT_TRUE(largest_rise(&model, 0.2) < 0.6 * (before - rest));
        TEST_ASSERT_TRUE(total_energy(&group) < before);
    }
}

static double worst_rod(const ivl_sim_model_t *model, double span_s)
{
    double worst = 0.0;
    for (double t = 0.0; t < span_s; t += model->tick_s)
    {
        advance(&group, model->tick_s);
        const ivl_sim_kin_t kin = ivl_sim_world_kin(&group, 0);
        worst = fmax(worst, rod_error(model, &kin));
    }
    return worst / model->raw.leg_length_m;
}

/// Stiff legs that are hardly damped swing at 700 rad/s.  What a step leaves as an error of the rods' lengths grows with the fourth
/// power of such rates; without a bound of its own it grows until there are no rods any more.
static void test_rods_that_turn_fast_for_long_keep_their_length(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_mass_kg = 3.2e-4;
    params.leg_stiffness_Nmprad = 0.15;
    params.leg_damping_Nmsprad = 1.0e-5;
    const ivl_sim_model_t model = fixture_model(&params);
    for (int degrees = 10; degrees <= 60; degrees += 10)
    {
        const double  angle = degrees * (IVL_SIM_PI / 180.0);
        ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 1.0);
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            const ivl_d3_t n = ivl_d3_add(ivl_d3_scale(cos(angle), model.leg.rest_B[i]), ivl_d3_scale(sin(angle), model.leg.inplane_B[i]));
            ivl_d3_store(kin.p_foot_W_m[i],
                         ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_d3_add(model.leg.hip_B_m[i], ivl_d3_scale(params.leg_length_m, n))));
        }
        place_alone(&model, &group, &kin, FREE);
        TEST_ASSERT_TRUE(worst_rod(&model, 0.2) < 0.35);
    }
}

/// The stabilisation of the rods' lengths has a limit of its own, at 3 ms.
static void test_steps_of_four_milliseconds_after_a_contact_are_cut_to_what_the_rods_bear(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_length_m = 0.1;
    params.leg_mass_kg = 8.8e-4;
    params.step_swing_s = 0.004;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = resting_kin(&model, 0.0, 0.0, 1.0);
    const double          inverted[4] = {1.0, 0.0, 0.0, 0.0};
    turn_kin(&model, inverted, &kin);
    place_alone(&model, &group, &kin, ALL_STUCK);
    group.world[0].impact.happened = true;
    ivl_sim_world_note_contact(&group, 0);
    group.progress.graded_s[0] = group.progress.step_s[0] = 0.004;
    double worst = 0.0;
    for (int i = 0; i < 60; i++)
    {
        advance(&group, 0.02);
        kin = ivl_sim_world_kin(&group, 0);
        worst = fmax(worst, rod_error(&model, &kin));
    }
    TEST_ASSERT_TRUE(group.progress.step_s[0] < 0.003 && group.progress.step_s[0] > 0.002);
    TEST_ASSERT_TRUE(worst < 1.0e-4);
}

// ---- the bound -------------------------------------------------------------------------------------------------------------

static void test_a_motion_of_any_length_may_take_some_evaluations_but_no_more_than_so_many(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const double           spans[] = {0.0, 1.0e-12, 0.002, 1.0, 1.0e9, (double)INFINITY, (double)NAN};
    for (size_t i = 0; i < sizeof spans / sizeof spans[0]; i++)
    {
        const uint32_t evaluations = ivl_sim_step_evaluations(&model.step, spans[i]);
        TEST_ASSERT_TRUE(evaluations > 100u && evaluations <= IVL_SIM_EVALUATIONS_MAX);
    }
    // the most that any tick of a landing has been seen to take is a hundred
    TEST_ASSERT_GREATER_THAN(1000, ivl_sim_step_evaluations(&model.step, model.tick_s));
}

static void test_shorter_steps_may_take_more_evaluations(void)
{
    ivl_sim_params_t      params = fixture_params();
    const ivl_sim_model_t model = fixture_model(&params);
    params.step_scale_norm = 0.001;
    const ivl_sim_model_t fine = fixture_model(&params);
    TEST_ASSERT_TRUE(fine.step.shortest_s <= 0.001 * params.step_plate_s);
    TEST_ASSERT_GREATER_THAN(10u * ivl_sim_step_evaluations(&model.step, 0.002), ivl_sim_step_evaluations(&fine.step, 0.002));
}

/// Numbers of any size, and some that are none.
static double anything(draws_t *draws)
{
    const double special[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 0.0, 1.0e300, -1.0e300, 5.0e-324, 3.0};
    const double kind = draw(draws, 0.0, 10.0);
    if (kind < 0.3)
    {
        return special[draw_u64(draws) % 8u];
    }
    double magnitude = 1.0e-3;
    for (int i = (int)(draw_u64(draws) % 10u); i > 0; i--)
    {
        magnitude *= 10.0;
    }
    return (kind < 5.0) ? draw(draws, -magnitude, magnitude) : draw(draws, -3.0, 3.0);
}

static void test_motion_from_any_state_at_all_takes_no_more_evaluations_than_it_may(void)
{
    const double adhesion[] = {(double)INFINITY, 0.0, 0.1}, delay[] = {0.0, 0.01};
    draws_t      draws = {34};
    int          gave_up = 0;
    for (int i = 0; i < CASES(100); i++)
    {
        ivl_sim_params_t params = draw_legs(&draws);
        params.leg_adhesion_N = adhesion[i % 3];
        params.leg_stick_delay_s = delay[i % 2];
        const ivl_sim_model_t model = fixture_model(&params);
        ivl_sim_kin_t         kin = draw_kin(&model, &draws, 1.0);
        double               *number = (double *)&kin;
        kin.p_WB_m[2] = draw(&draws, 2.8, 3.1);
        for (size_t k = draw_u64(&draws) % 6u; k > 0; k--)
        {
            number[draw_u64(&draws) % (sizeof kin / sizeof *number)] = anything(&draws);
        }
        place_alone(&model, &group, &kin, (i % 4 == 3) ? ALL_STUCK : FREE);
        for (int k = 0; k < 3; k++)
        {
            const int64_t before = group.progress.n_evaluation[0];
            advance(&group, model.tick_s);
            TEST_ASSERT_TRUE(ivl_sim_world_ready(&group, 0));
            TEST_ASSERT_TRUE(group.progress.n_evaluation[0] - before <= ivl_sim_step_evaluations(&model.step, model.tick_s));
        }
        gave_up += group.world[0].gave_up ? 1 : 0;
    }
    TEST_ASSERT_GREATER_THAN(0, gave_up);
}

static void test_a_world_that_gave_up_says_so_until_it_is_placed_anew(void)
{
    const ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t        model = fixture_model(&params);
    model.step.evaluations_per_s = 0.0;
    model.step.evaluations_at_once = 3.0;
    const ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 1.0);
    place_alone(&model, &group, &kin, FREE);
    advance(&group, 0.004);
    TEST_ASSERT_FALSE(group.world[0].gave_up);  // one to begin with and two steps
    advance(&group, 0.008);
    TEST_ASSERT_TRUE(group.world[0].gave_up);
    TEST_ASSERT_TRUE(ivl_sim_world_ready(&group, 0));
    TEST_ASSERT_EQUAL_INT64(6, group.progress.n_evaluation[0]);
    ivl_sim_world_place(&group, 0, &kin);
    TEST_ASSERT_FALSE(group.world[0].gave_up);
    advance(&group, 0.004);
    TEST_ASSERT_FALSE(group.world[0].gave_up);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_free_legs_ring_out_below_the_limit_and_without_end_above_it);
    RUN_TEST(test_the_body_s_share_in_the_swing_shortens_the_limit);
    RUN_TEST(test_the_shipped_legs_keep_their_steps_of_two_milliseconds);
    RUN_TEST(test_the_longest_step_is_just_allowed);
    RUN_TEST(test_legs_that_no_step_could_follow_are_refused_with_the_reason);
    RUN_TEST(test_strongly_damped_legs_of_a_vehicle_in_free_fall_come_to_rest);
    RUN_TEST(test_legs_bent_far_sideways_do_not_gain_energy);
    RUN_TEST(test_rods_that_turn_fast_for_long_keep_their_length);
    RUN_TEST(test_steps_of_four_milliseconds_after_a_contact_are_cut_to_what_the_rods_bear);
    RUN_TEST(test_a_motion_of_any_length_may_take_some_evaluations_but_no_more_than_so_many);
    RUN_TEST(test_shorter_steps_may_take_more_evaluations);
    RUN_TEST(test_motion_from_any_state_at_all_takes_no_more_evaluations_than_it_may);
    RUN_TEST(test_a_world_that_gave_up_says_so_until_it_is_placed_anew);
    return UNITY_END();
}
