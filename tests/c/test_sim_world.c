/// @file test_sim_world.c
/// Contact events: what must happen, when, and what must never happen.
#include "world_group.h"

#include "sim_fixture.h"

static const ivl_sim_foot_t FREE[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
static const ivl_sim_foot_t ALL_STUCK[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK};
static const ivl_sim_foot_t FORE_STUCK[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_STUCK};
static const double         TICK = 0.002;

static ivl_sim_group_t group;

static void advance_ticks(double span_s)
{
    for (int i = 0; i < (int)(span_s / TICK + 0.5); i++)
    {
        advance(&group, TICK);
    }
}

static double gap_of(const ivl_sim_kin_t *kin, int leg)
{
    return group.model->raw.world_ceiling_height_m - kin->p_foot_W_m[leg][2] - group.model->raw.leg_foot_radius_m;
}

/// Lifts a vehicle until its highest point, of a foot or a plate, is `gap` below the ceiling.
static void raise_to(const ivl_sim_model_t *model, double gap, ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    double          highest = -1.0e9;
    for (int i = 0; i < 4; i++)
    {
        highest = fmax(highest, kin->p_foot_W_m[i][2] + model->raw.leg_foot_radius_m);
    }
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        highest = fmax(highest, kin->p_WB_m[2] + ivl_sim_plate_top(&model->plate[i], R.row[2]));
    }
    const double lift = model->raw.world_ceiling_height_m - gap - highest;
    kin->p_WB_m[2] += lift;
    for (int i = 0; i < 4; i++)
    {
        kin->p_foot_W_m[i][2] += lift;
    }
}

/// Nose-up by `angle`, all parts moving with v and turning together at `rate` (nose-up), highest point `gap` below.
static ivl_sim_kin_t arriving(const ivl_sim_model_t *model, double angle, ivl_d3_t v, double rate, double gap)
{
    ivl_sim_kin_t kin = resting_kin(model, 0.0, 0.0, 1.0);
    double        q[4];
    nose_up(angle, q);
    turn_kin(model, q, &kin);
    raise_to(model, gap, &kin);
    const ivl_d3_t w = ivl_d3(0.0, -rate, 0.0);
    ivl_d3_store(kin.v_WB_mps, v);
    ivl_d3_store(kin.w_B_radps, w);
    for (int i = 0; i < 4; i++)
    {
        const ivl_d3_t arm = ivl_d3_sub(ivl_d3_load(kin.p_foot_W_m[i]), ivl_d3_load(kin.p_WB_m));
        ivl_d3_store(kin.v_foot_W_mps[i], ivl_d3_add(v, ivl_d3_cross(w, arm)));
    }
    return kin;
}

/// A vehicle that lands on its fore feet, motors off.
static ivl_sim_kin_t landing(const ivl_sim_model_t *model)
{
    return arriving(model, 2.0, ivl_d3(0.3, 0.0, 2.0), 12.0, 0.01);
}

// ---- touching ------------------------------------------------------------------------------------------------------------

/// Upside down in free fall; one leg is bent away from the ceiling and springs back: its foot rises, passes
/// its rest position and returns.  The dip into the ceiling is shorter than a step.
static ivl_sim_kin_t ringing(const ivl_sim_model_t *model, double gap)
{
    const double  inverted[4] = {1.0, 0.0, 0.0, 0.0};
    ivl_sim_kin_t kin = resting_kin(model, 0.0, 0.0, 1.0);
    turn_kin(model, inverted, &kin);
    // leg 1 turned by 0.05 rad beyond rest, towards the ceiling, and on its way up at 6 rad/s: it turns back within 2 ms
    const ivl_rot_t R = ivl_rot_from_quat(inverted);
    const double    bend = -0.05, L = model->raw.leg_length_m;
    const ivl_d3_t  e1 = model->leg.rest_B[0], e2 = model->leg.inplane_B[0];
    const ivl_d3_t  n = ivl_d3_add(ivl_d3_scale(cos(bend), e1), ivl_d3_scale(sin(bend), e2));
    const ivl_d3_t  along = ivl_d3_sub(ivl_d3_scale(cos(bend), e2), ivl_d3_scale(sin(bend), e1));
    const ivl_d3_t  foot = ivl_d3_add(model->leg.hip_B_m[0], ivl_d3_scale(L, n));
    ivl_d3_store(kin.p_foot_W_m[0], ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_rot_apply(&R, foot)));
    ivl_d3_store(kin.v_foot_W_mps[0], ivl_rot_apply(&R, ivl_d3_scale(-6.0 * L, along)));
    raise_to(model, gap, &kin);
    return kin;
}

/// Smallest gap that leg 1 reaches without a ceiling in the way, in fine steps, and when.
static double deepest(const ivl_sim_model_t *model, double *when_s)
{
    ivl_sim_kin_t kin = ringing(model, 0.5);
    double        least = 1.0, t = 0.0;
    place_alone(model, &group, &kin, FREE);
    while (t < 0.004)
    {
        advance(&group, 2.0e-6);
        t += 2.0e-6;
        kin = ivl_sim_world_kin(&group, 0);
        *when_s = (gap_of(&kin, 0) < least) ? t : *when_s;
        least = fmin(least, gap_of(&kin, 0));
    }
    return 0.5 - least;
}

static void test_a_foot_that_rings_into_the_ceiling_within_one_step_is_not_missed(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_gravity_mps2 = 1.0;  // the least that the flight core accepts
    const ivl_sim_model_t model = fixture_model(&params);
    double                when_s = 0.0;
    const double          dip = deepest(&model, &when_s);
    TEST_ASSERT_TRUE(dip > 5.0e-5 && when_s < 0.0015);  // it turns well within the step of 2 ms
    int missed = 0;
    for (int i = 1; i < 100; i++)
    {
        ivl_sim_kin_t kin = ringing(&model, dip * i / 100.0);
        place_alone(&model, &group, &kin, FREE);
        advance(&group, TICK);
        missed += (group.world[0].foot[0] == IVL_SIM_FOOT_STUCK) ? 0 : 1;
        TEST_ASSERT_TRUE(group.world[0].foot[0] == IVL_SIM_FOOT_STUCK || i > 80);
    }
    // only grazing touches may go unseen: the cubic knows the dip to the order of the step's error
    TEST_ASSERT_LESS_THAN(20, missed);
    for (int i = 130; i < 200; i += 10)
    {
        ivl_sim_kin_t kin = ringing(&model, dip * i / 100.0);
        place_alone(&model, &group, &kin, FREE);
        advance(&group, TICK);
        TEST_ASSERT_EQUAL(IVL_SIM_FOOT_FREE, group.world[0].foot[0]);
    }
}

static void test_touch_is_located_on_the_ceiling_whatever_the_step(void)
{
    ivl_sim_params_t params = fixture_params();
    draws_t          draws = {3};
    for (int i = 0; i < 300; i++)
    {
        params.step_flight_s = draw(&draws, 1.0e-4, 0.002);
        const ivl_sim_model_t model = fixture_model(&params);
        const ivl_sim_kin_t   kin =
            arriving(&model, draw(&draws, 0.5, 4.0), ivl_d3(draw(&draws, -1.0, 1.0), draw(&draws, -0.5, 0.5), draw(&draws, 1.0, 4.0)),
                     draw(&draws, -20.0, 20.0), draw(&draws, 1.0e-4, 0.03));
        place_alone(&model, &group, &kin, FREE);
        advance_ticks(0.06);
        const ivl_sim_impact_t *impact = &group.world[0].impact;
        TEST_ASSERT_TRUE(impact->happened);
        const ivl_sim_kin_t end = ivl_sim_world_kin(&group, 0);
        for (int leg = 0; leg < 4; leg++)
        {
            // no foot stands above the ceiling, and what is stuck is on it
            TEST_ASSERT_TRUE(gap_of(&end, leg) > -1.5e-7);
            TEST_ASSERT_TRUE(group.world[0].foot[leg] == IVL_SIM_FOOT_FREE || fabs(gap_of(&end, leg)) < 1.5e-7);
        }
    }
}

static void test_touch_time_is_that_of_a_projectile_when_the_vehicle_falls_up(void)
{
    // inverted, all in translation: the gap closes as gap - v t + g t^2 / 2
    ivl_sim_params_t params = fixture_params();
    for (int i = 0; i < 20; i++)
    {
        params.step_flight_s = 0.002 / (1 + i);
        const ivl_sim_model_t model = fixture_model(&params);
        const double          v = 2.0, gap = 0.0371, g = params.world_gravity_mps2;
        const ivl_sim_kin_t   kin = arriving(&model, IVL_SIM_PI, ivl_d3(0.2, 0.0, v), 0.0, gap);
        place_alone(&model, &group, &kin, FREE);
        advance_ticks(0.04);
        TEST_ASSERT_DOUBLE_WITHIN(2.0e-7, (v - sqrt(v * v - 2.0 * g * gap)) / g, group.world[0].impact.t_s);
        TEST_ASSERT_EQUAL(4, ivl_sim_world_count_stuck(&group.world[0]));
    }
}

static double touch_time(double scale)
{
    ivl_sim_params_t params = fixture_params();
    params.step_scale_norm = scale;
    const ivl_sim_model_t model = fixture_model(&params);
    // a bent leg swings while the vehicle arrives
    ivl_sim_kin_t kin = ringing(&model, 0.012);
    for (int i = 0; i < 4; i++)
    {
        kin.v_foot_W_mps[i][2] += 1.5;
    }
    kin.v_WB_mps[2] += 1.5;
    place_alone(&model, &group, &kin, FREE);
    advance_ticks(0.02);
    TEST_ASSERT_TRUE(group.world[0].impact.happened);
    return group.world[0].impact.t_s;
}

static void test_touch_time_converges_with_the_step(void)
{
    const double exact = touch_time(0.01);
    const double coarse = fabs(touch_time(1.0) - exact), fine = fabs(touch_time(0.25) - exact);
    TEST_ASSERT_TRUE(coarse < 2.0e-4);
    TEST_ASSERT_TRUE(fine < coarse / 8.0 + 2.0e-7);  // second order: 16 times, and the tolerance of the location
}

static void test_stuck_feet_do_not_move_at_all(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_kin_t    start = landing(&model);
    double                 at[4][3];
    bool                   seen[4] = {false, false, false, false};
    place_alone(&model, &group, &start, FREE);
    for (int i = 0; i < 500; i++)
    {
        advance(&group, TICK);
        const ivl_sim_kin_t kin = ivl_sim_world_kin(&group, 0);
        for (int leg = 0; leg < 4; leg++)
        {
            if (group.world[0].foot[leg] != IVL_SIM_FOOT_STUCK)
            {
                TEST_ASSERT_FALSE(seen[leg]);  // unbreakable
                continue;
            }
            if (!seen[leg])
            {
                memcpy(at[leg], kin.p_foot_W_m[leg], sizeof at[leg]);
                seen[leg] = true;
            }
            TEST_ASSERT_EQUAL_MEMORY(at[leg], kin.p_foot_W_m[leg], sizeof at[leg]);
        }
    }
    TEST_ASSERT_TRUE(seen[0] && seen[3]);
}

static double worst_rod_error(double scale)
{
    ivl_sim_params_t params = fixture_params();
    params.step_scale_norm = scale;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {8};
    double                worst = 0.0;
    for (int i = 0; i < 100; i++)
    {
        const ivl_d3_t      v = ivl_d3(draw(&draws, -1.0, 1.0), draw(&draws, -0.5, 0.5), draw(&draws, 1.0, 3.5));
        const ivl_sim_kin_t kin = arriving(&model, draw(&draws, 2.0, 4.0), v, draw(&draws, -20.0, 20.0), 0.005);
        place_alone(&model, &group, &kin, FREE);
        for (int k = 0; k < 100; k++)
        {
            advance(&group, TICK);
            const ivl_sim_kin_t now = ivl_sim_world_kin(&group, 0);
            worst = fmax(worst, rod_error(&model, &now));
        }
    }
    return worst;
}

static void test_rods_keep_their_length_and_better_so_with_shorter_steps(void)
{
    // what the second-order step leaves while legs ring at 450 rad/s after a touch-down at 3.5 m/s: below 1 % of the length
    // in the worst instant of a hundred landings; the stabilisation then removes it at 150 / s
    const double fine = worst_rod_error(0.25), finer = worst_rod_error(0.0625);
    TEST_ASSERT_LESS_THAN_DOUBLE(5.0e-4, worst_rod_error(1.0));
    TEST_ASSERT_LESS_THAN_DOUBLE(6.0e-5, fine);
    TEST_ASSERT_LESS_THAN_DOUBLE(fine / 8.0, finer);  // 16 times, for the second order
}

/// Largest rise of the energy above what it has been before, over landings with the motors off.
static double largest_rise(const ivl_sim_model_t *model, draws_t *draws, double angle_lo, double angle_hi, int n)
{
    double rise = 0.0;
    for (int i = 0; i < n; i++)
    {
        const ivl_d3_t      v = ivl_d3(draw(draws, -1.0, 1.0), draw(draws, -0.5, 0.5), draw(draws, 1.0, 4.5));
        const ivl_sim_kin_t kin = arriving(model, draw(draws, angle_lo, angle_hi), v, draw(draws, -25.0, 25.0), 0.005);
        place_alone(model, &group, &kin, FREE);
        double least = total_energy(&group);
        for (int k = 0; k < 150; k++)
        {
            advance(&group, TICK);
            const double energy = total_energy(&group);
            TEST_ASSERT_TRUE(isfinite(energy));
            rise = fmax(rise, energy - least);
            least = fmin(least, energy);
        }
    }
    return rise;
}

/// The energy of a landing is 0.05 to 0.4 J.  A contact that is not resolved shows as a rise of that order; what is allowed is
/// the oscillation of a second-order step, (w dt)^2 / 8 of the energy that rings in legs and plates: w dt is up to 1.
static void test_energy_is_not_pumped_when_a_plate_hits_the_ceiling_or_when_all_feet_hold(void)
{
    const double gears[][3] = {{0.05, 50.0, 4.4e-4}, {0.05, 0.0, 4.4e-4}, {0.1, 60.0, 8.8e-4}};
    const double inertia[][3] = {{4.935e-5, 4.935e-5, 2.926e-5}, {1.72e-5, 1.77e-5, 3.42e-5}};
    draws_t      draws = {9};
    for (int i = 0; i < 6; i++)
    {
        ivl_sim_params_t params = fixture_params();
        params.leg_length_m = gears[i % 3][0];
        params.leg_angle_deg = gears[i % 3][1];
        params.leg_mass_kg = gears[i % 3][2];
        params.body_inertia_xx_kgm2 = inertia[i / 3][0];
        params.body_inertia_yy_kgm2 = inertia[i / 3][1];
        params.body_inertia_zz_kgm2 = inertia[i / 3][2];
        const ivl_sim_model_t model = fixture_model(&params);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.02, largest_rise(&model, &draws, 1.0, 2.0, CASES(250)));  // plates first
        TEST_ASSERT_LESS_THAN_DOUBLE(0.02, largest_rise(&model, &draws, 2.9, 3.4, CASES(250)));  // all four feet
    }
}

static void test_feet_that_arrive_together_stick_together(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_kin_t    kin = arriving(&model, 2.3, ivl_d3(0.0, 0.0, 2.0), 8.0, 0.01);
    place_alone(&model, &group, &kin, FREE);
    for (int i = 0; i < 100 && !group.world[0].impact.happened; i++)
    {
        advance(&group, 1.0e-4);
    }
    TEST_ASSERT_EQUAL(2, ivl_sim_world_count_stuck(&group.world[0]));
    TEST_ASSERT_EQUAL(IVL_SIM_FOOT_STUCK, group.world[0].foot[0]);
    TEST_ASSERT_EQUAL(IVL_SIM_FOOT_STUCK, group.world[0].foot[3]);
    TEST_ASSERT_EQUAL_INT8(1, group.world[0].stuck_order[0]);
    TEST_ASSERT_EQUAL_INT8(4, group.world[0].stuck_order[1]);
}

static void test_a_plate_that_touches_is_noted_once_and_pushed_out(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_kin_t          kin = resting_kin(&model, 0.0, 0.0, params.world_ceiling_height_m - 0.02);
    kin.v_WB_mps[2] = 1.0;
    for (int i = 0; i < 4; i++)
    {
        kin.v_foot_W_mps[i][2] = 1.0;
    }
    place_alone(&model, &group, &kin, FREE);
    advance_ticks(0.04);
    const ivl_sim_world_t *w = &group.world[0];
    TEST_ASSERT_TRUE(w->plate_touched[IVL_SIM_PROP_PLATE]);
    TEST_ASSERT_FALSE(w->plate_touched[IVL_SIM_BASE_PLATE]);
    TEST_ASSERT_TRUE(w->impact.happened);
    const double g = params.world_gravity_mps2, gap = 0.02 - 0.0135;
    TEST_ASSERT_DOUBLE_WITHIN(2.0e-6, (1.0 - sqrt(1.0 - 2.0 * g * gap)) / g, w->impact.t_s);
    TEST_ASSERT_DOUBLE_WITHIN(2.0e-6, 0.0135, params.world_ceiling_height_m - w->impact.kin.p_WB_m[2]);
    kin = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_TRUE(kin.v_WB_mps[2] < -0.1);
    TEST_ASSERT_TRUE(group.progress.d_min_m[0] < 0.0135 && group.progress.d_min_m[0] > 0.008);
}

// ---- coming off ------------------------------------------------------------------------------------------------------------

/// Largest pull on foot 1 while the vehicle swings from its fore feet, sampled each 0.1 ms; and the first time beyond `limit`.
static double largest_pull(const ivl_sim_model_t *model, double span_s, double limit, double *when_s)
{
    const double  start_angle = 2.2;
    ivl_sim_kin_t kin = arriving(model, start_angle, ivl_d3(0.0, 0.0, 0.0), 0.0, 0.0);
    double        most = 0.0, t = 0.0;
    place_alone(model, &group, &kin, FORE_STUCK);
    *when_s = -1.0;
    while (t < span_s && group.world[0].foot[0] == IVL_SIM_FOOT_STUCK)
    {
        advance(&group, 1.0e-4);
        t += 1.0e-4;
        const double pull = group.last.pull_N[0][0];
        *when_s = (*when_s < 0.0 && pull > limit) ? t : *when_s;
        most = fmax(most, pull);
    }
    return most;
}

static void test_a_foot_comes_off_at_the_stated_pull_and_not_before(void)
{
    ivl_sim_params_t params = fixture_params();
    ivl_sim_model_t  model = fixture_model(&params);
    double           crosses = 0.0, unused = 0.0;
    const double     most = largest_pull(&model, 0.15, 1.0e9, &unused);
    TEST_ASSERT_TRUE(most > 0.2);  // more than half the weight
    const double limit = 0.6 * most;
    largest_pull(&model, 0.15, limit, &crosses);
    TEST_ASSERT_TRUE(crosses > 0.0);

    params.leg_adhesion_N = limit;
    model = fixture_model(&params);
    const double reached = largest_pull(&model, 0.15, limit, &unused);
    TEST_ASSERT_NOT_EQUAL(IVL_SIM_FOOT_STUCK, group.world[0].foot[0]);
    TEST_ASSERT_TRUE(reached <= limit);
    TEST_ASSERT_DOUBLE_WITHIN(3.0e-4, crosses, group.progress.t_s[0]);

    params.leg_adhesion_N = 1.01 * most;
    model = fixture_model(&params);
    largest_pull(&model, 0.15, limit, &unused);
    TEST_ASSERT_EQUAL(IVL_SIM_FOOT_STUCK, group.world[0].foot[0]);
}

static void test_a_foot_that_came_off_stays_off_until_it_has_moved_away(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_adhesion_N = 1.0e-3;  // next to nothing: it comes off at once
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = arriving(&model, IVL_SIM_PI, ivl_d3(0.0, 0.0, 0.0), 0.0, 0.0);
    place_alone(&model, &group, &kin, ALL_STUCK);
    advance_ticks(0.1);
    // it falls: freely, but for the first instants
    kin = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_EQUAL(0, ivl_sim_world_count_stuck(&group.world[0]));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, -9.81 * 0.1, kin.v_WB_mps[2]);
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_FALSE(group.world[0].detached[i]);
    }
}

static void test_a_foot_that_came_off_can_stick_again(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_adhesion_N = 0.02;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = arriving(&model, IVL_SIM_PI, ivl_d3(0.0, 0.0, 0.0), 0.0, 0.0);
    place_alone(&model, &group, &kin, ALL_STUCK);
    advance_ticks(0.04);
    TEST_ASSERT_EQUAL(0, ivl_sim_world_count_stuck(&group.world[0]));
    kin = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_TRUE(gap_of(&kin, 0) > 1.0e-3);
    kin.v_WB_mps[2] = 2.0;
    for (int i = 0; i < 4; i++)
    {
        memcpy(kin.v_foot_W_mps[i], kin.v_WB_mps, sizeof kin.v_WB_mps);
    }
    ivl_sim_world_place(&group, 0, &kin);
    advance_ticks(0.04);
    TEST_ASSERT_TRUE(group.touch.t_touch_s[0][0] > 0.04);
}

// ---- stick delay -----------------------------------------------------------------------------------------------------------

static void test_a_foot_slides_first_and_sticks_after_the_delay_while_it_presses(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_stick_delay_s = 0.0031;  // no whole number of ticks or steps
    const ivl_sim_model_t model = fixture_model(&params);
    // inverted and pressed on by its speed, with a drift along the ceiling: it slides that far before it sticks
    const ivl_sim_kin_t start = arriving(&model, IVL_SIM_PI, ivl_d3(0.5, 0.0, 3.0), 0.0, 1.0e-3);
    double              touched = -1.0, stuck = -1.0, x_touch = 0.0, x_stuck = 0.0;
    place_alone(&model, &group, &start, FREE);
    for (int i = 0; i < 600; i++)
    {
        advance(&group, 2.0e-5);
        const ivl_sim_world_t *w = &group.world[0];
        const ivl_sim_kin_t    kin = ivl_sim_world_kin(&group, 0);
        if (touched < 0.0 && w->foot[0] == IVL_SIM_FOOT_SLIDING)
        {
            touched = group.touch.t_touch_s[0][0];
            x_touch = kin.p_foot_W_m[0][0];
        }
        if (w->foot[0] == IVL_SIM_FOOT_SLIDING)
        {
            TEST_ASSERT_TRUE(fabs(gap_of(&kin, 0)) < 2.0e-7);
        }
        if (stuck < 0.0 && w->foot[0] == IVL_SIM_FOOT_STUCK)
        {
            stuck = group.progress.t_s[0];
            x_stuck = kin.p_foot_W_m[0][0];
        }
    }
    TEST_ASSERT_TRUE(touched > 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(2.1e-5, touched + params.leg_stick_delay_s, stuck);
    TEST_ASSERT_TRUE(fabs(x_stuck - x_touch) > 5.0e-4);
}

static void test_a_foot_that_does_not_press_for_long_enough_bounces_off(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_stick_delay_s = 0.2;
    const ivl_sim_model_t model = fixture_model(&params);
    const ivl_sim_kin_t   start = arriving(&model, IVL_SIM_PI, ivl_d3(0.0, 0.0, 1.0), 0.0, 1.0e-3);
    bool                  slid = false;
    place_alone(&model, &group, &start, FREE);
    for (int i = 0; i < 150; i++)
    {
        advance(&group, TICK);
        slid = slid || group.world[0].foot[0] == IVL_SIM_FOOT_SLIDING;
        TEST_ASSERT_EQUAL(0, ivl_sim_world_count_stuck(&group.world[0]));
    }
    const ivl_sim_kin_t end = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_TRUE(slid);
    TEST_ASSERT_TRUE(gap_of(&end, 0) > 0.05);  // it falls
    TEST_ASSERT_EQUAL_INT8(0, group.world[0].stuck_order[0]);
}

// ---- foot joint ------------------------------------------------------------------------------------------------------------

static double swing_energy_after(double damping, double span_s)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_foot_damping_Nmsprad = damping;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = arriving(&model, 2.2, ivl_d3(0.0, 0.0, 0.0), 40.0, 0.0);
    ivl_sim_impulse(&model, FORE_STUCK, &kin);
    place_alone(&model, &group, &kin, FORE_STUCK);
    advance_ticks(span_s);
    return total_energy(&group);
}

static void test_friction_of_the_foot_joint_takes_energy_out_of_the_swing(void)
{
    const double none = swing_energy_after(0.0, 0.03), some = swing_energy_after(3.0e-4, 0.03), more = swing_energy_after(1.0e-3, 0.03);
    TEST_ASSERT_TRUE(none > some + 1.0e-4 && some > more + 1.0e-4);
}

// ---- groups ----------------------------------------------------------------------------------------------------------------

static void test_d_min_is_the_smallest_distance_of_the_origin(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_kin_t    kin = landing(&model);
    double                 least = 1.0;
    place_alone(&model, &group, &kin, FREE);
    for (int i = 0; i < 2000; i++)
    {
        advance(&group, 2.0e-4);
        least = fmin(least, params.world_ceiling_height_m - ivl_sim_world_kin(&group, 0).p_WB_m[2]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, least, group.progress.d_min_m[0]);
}

static void test_a_world_has_the_same_bits_in_any_lane_and_any_company(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_kin_t          alone[IVL_SIM_LANES], start[IVL_SIM_LANES];
    draws_t                draws = {70};
    const ivl_sim_rng_t    rng = {1, 2};
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        start[i] = arriving(&model, draw(&draws, 1.5, 3.5), ivl_d3(0.5, 0.1, draw(&draws, 1.0, 3.0)), draw(&draws, 0.0, 15.0),
                            draw(&draws, 1.0e-3, 0.02));
        place_alone(&model, &group, &start[i], FREE);
        advance_ticks(0.1);
        alone[i] = ivl_sim_world_kin(&group, 0);
    }
    ivl_sim_group_init(&model, &group);
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        const int lane = IVL_SIM_LANES - 1 - i;
        ivl_sim_world_start(&group, lane, &rng, start[i].p_WB_m, start[i].v_WB_mps);
        ivl_sim_world_place(&group, lane, &start[i]);
        stop_rotors(&group, lane);
    }
    advance_ticks(0.1);
    for (int i = 0; i < IVL_SIM_LANES; i++)
    {
        const ivl_sim_kin_t among = ivl_sim_world_kin(&group, IVL_SIM_LANES - 1 - i);
        TEST_ASSERT_EQUAL_MEMORY(&alone[i], &among, sizeof among);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_foot_that_rings_into_the_ceiling_within_one_step_is_not_missed);
    RUN_TEST(test_touch_is_located_on_the_ceiling_whatever_the_step);
    RUN_TEST(test_touch_time_is_that_of_a_projectile_when_the_vehicle_falls_up);
    RUN_TEST(test_touch_time_converges_with_the_step);
    RUN_TEST(test_stuck_feet_do_not_move_at_all);
    RUN_TEST(test_rods_keep_their_length_and_better_so_with_shorter_steps);
    RUN_TEST(test_energy_is_not_pumped_when_a_plate_hits_the_ceiling_or_when_all_feet_hold);
    RUN_TEST(test_feet_that_arrive_together_stick_together);
    RUN_TEST(test_a_plate_that_touches_is_noted_once_and_pushed_out);
    RUN_TEST(test_a_foot_comes_off_at_the_stated_pull_and_not_before);
    RUN_TEST(test_a_foot_that_came_off_stays_off_until_it_has_moved_away);
    RUN_TEST(test_a_foot_that_came_off_can_stick_again);
    RUN_TEST(test_a_foot_slides_first_and_sticks_after_the_delay_while_it_presses);
    RUN_TEST(test_a_foot_that_does_not_press_for_long_enough_bounces_off);
    RUN_TEST(test_friction_of_the_foot_joint_takes_energy_out_of_the_swing);
    RUN_TEST(test_d_min_is_the_smallest_distance_of_the_origin);
    RUN_TEST(test_a_world_has_the_same_bits_in_any_lane_and_any_company);
    return UNITY_END();
}
