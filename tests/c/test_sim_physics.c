/// @file test_sim_physics.c
/// Motions with known answers: free fall, tumble, hover, ringing leg, pendulum, energy, mirror image, order of convergence.
#include "sim_fixture.h"

static const ivl_sim_foot_t FREE[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
static const double         TICK = 0.002;

static ivl_sim_group_t group;

static void advance_ticks(int n)
{
    for (int i = 0; i < n; i++)
    {
        advance(&group, TICK);
    }
}

static ivl_sim_params_t open_sky(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 20.0;
    return params;
}

// ---- flight --------------------------------------------------------------------------------------------------------------

static void test_free_fall_is_that_of_galileo(void)
{
    const ivl_sim_params_t params = open_sky();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_kin_t          kin = resting_kin(&model, 1.0, 2.0, 10.0);
    const double           v[3] = {0.7, -0.3, 2.0}, t = 1.0, g = params.world_gravity_mps2;
    memcpy(kin.v_WB_mps, v, sizeof v);
    for (int i = 0; i < 4; i++)
    {
        memcpy(kin.v_foot_W_mps[i], v, sizeof v);
    }
    place_alone(&model, &group, &kin, FREE);
    advance_ticks(500);
    const ivl_sim_kin_t end = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 1.0 + v[0] * t, end.p_WB_m[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 2.0 + v[1] * t, end.p_WB_m[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 10.0 + v[2] * t - 0.5 * g * t * t, end.p_WB_m[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, v[2] - g * t, end.v_WB_mps[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 0.0, end.w_B_radps[1]);
}

/// A body with three different moments tumbles torque-free; its legs swing.  Without damping nothing but the step is lost.
static void tumble(double scale, double *lost_energy, double *lost_momentum)
{
    ivl_sim_params_t params = open_sky();
    params.body_inertia_xx_kgm2 = 3.0e-5;
    params.leg_damping_Nmsprad = 0.0;
    params.step_scale_norm = scale;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {5};
    const ivl_sim_kin_t   kin = draw_kin(&model, &draws, 0.02);
    place_alone(&model, &group, &kin, FREE);
    double        l0[3], a0[3], l1[3], a1[3];
    ivl_sim_kin_t end;
    const double  energy = total_energy(&group);
    *lost_energy = 0.0;
    for (int i = 0; i < 250; i++)
    {
        advance_ticks(1);
        *lost_energy = fmax(*lost_energy, fabs(total_energy(&group) - energy));
    }
    end = ivl_sim_world_kin(&group, 0);
    ivl_sim_momentum(&model, &kin, l0, a0);
    ivl_sim_momentum(&model, &end, l1, a1);
    // angular momentum about the origin changes by the moment of the weight, m g x(t): the centre of mass moves straight in x, y
    const double m = model.mass_total_kg, g = params.world_gravity_mps2, t = 0.5;
    // centre of mass at the start from the momentum's moment: use the body's and the legs' places
    ivl_d3_t        sum = ivl_d3_scale(params.body_mass_kg, ivl_d3_load(kin.p_WB_m));
    const ivl_rot_t R = ivl_rot_from_quat(kin.q_WB);
    for (int i = 0; i < 4; i++)
    {
        const ivl_d3_t hip = ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_rot_apply(&R, model.leg.hip_B_m[i]));
        sum = ivl_d3_add(sum, ivl_d3_scale(0.5 * params.leg_mass_kg, hip));
        sum = ivl_d3_add(sum, ivl_d3_scale(0.5 * params.leg_mass_kg + params.leg_foot_mass_kg, ivl_d3_load(kin.p_foot_W_m[i])));
    }
    const double mean_x = sum.x / m + 0.5 * l0[0] / m * t, mean_y = sum.y / m + 0.5 * l0[1] / m * t;
    const double expected[3] = {a0[0] - m * g * mean_y * t, a0[1] + m * g * mean_x * t, a0[2]};
    *lost_momentum = fmax(fmax(fabs(a1[0] - expected[0]), fabs(a1[1] - expected[1])), fabs(a1[2] - expected[2]));
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-7, l0[0], l1[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-7, l0[2] - m * g * t, l1[2]);
}

static void test_torque_free_tumble_keeps_angular_momentum_and_energy(void)
{
    double energy[2], momentum[2];
    tumble(0.1, &energy[0], &momentum[0]);
    tumble(0.05, &energy[1], &momentum[1]);
    // of about 0.2 J and 1e-3 N m s at 20 rad/s; second order: halving the step leaves a quarter
    TEST_ASSERT_LESS_THAN_DOUBLE(2.0e-5, energy[0]);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.0e-6, momentum[0]);
    TEST_ASSERT_LESS_THAN_DOUBLE(energy[0] / 3.0, energy[1]);
    TEST_ASSERT_LESS_THAN_DOUBLE(momentum[0] / 3.0, momentum[1]);
}

static void test_vehicle_stays_where_it_is_when_thrust_equals_weight(void)
{
    const ivl_sim_params_t params = open_sky();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_rng_t    rng = {1, 2};
    const double           p[3] = {0.5, -0.5, 10.0}, v[3] = {0.0, 0.0, 0.0};
    ivl_sim_group_init(&model, &group);
    ivl_sim_world_start(&group, 0, &rng, p, v);  // rotors at hover
    advance_ticks(500);
    // the legs sag under their weight, m g l / 2 / K = 1.3e-3 rad, which moves their mass by less than 0.1 mm
    const ivl_sim_kin_t end = ivl_sim_world_kin(&group, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-5, 0.5, end.p_WB_m[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-5, -0.5, end.p_WB_m[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-4, 10.0, end.p_WB_m[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 0.0, end.v_WB_mps[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, 1.0, end.q_WB[3]);
}

static void test_yaw_torque_turns_the_body_against_the_rotors(void)
{
    const ivl_sim_params_t params = open_sky();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_rng_t    rng = {1, 2};
    const double           p[3] = {0.0, 0.0, 10.0}, v[3] = {0.0, 0.0, 0.0};
    // motors 1 and 3 faster, 2 and 4 slower by the same thrust: a pure yaw torque of -4 * 0.01 N * 0.00612 m
    const float  f = (float)(0.25 * model.mass_total_kg * params.world_gravity_mps2);
    const float  command[4] = {f + 0.01f, f - 0.01f, f + 0.01f, f - 0.01f};
    const double legs = 4.0 * (params.leg_mass_kg * 0.04 * 0.04);  // about: rods from 24 to 62 mm off the axis
    ivl_sim_group_init(&model, &group);
    ivl_sim_world_start(&group, 0, &rng, p, v);
    command_rotors(&group, command);
    advance_ticks(50);
    const double expected = -4.0 * 0.01 * 0.00612 / (params.body_inertia_zz_kgm2 + legs) * 0.1;
    TEST_ASSERT_DOUBLE_WITHIN(0.25 * fabs(expected), expected, ivl_sim_world_kin(&group, 0).w_B_radps[2]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, ivl_sim_world_kin(&group, 0).w_B_radps[1]);
}

// ---- legs ------------------------------------------------------------------------------------------------------------------

/// Zero crossings, upwards, of a signal sampled at t: linear interpolation.  Amplitude is the largest since the last one.
typedef struct
{
    double last_t, last_x, first_cross, last_cross, peak, first_peak, last_peak;
    int    n;
} crossings_t;

static void watch(crossings_t *c, double t, double x)
{
    c->peak = fmax(c->peak, x);
    if (t > 0.0 && c->last_x < 0.0 && x >= 0.0)
    {
        const double cross = c->last_t + (t - c->last_t) * c->last_x / (c->last_x - x);
        c->n++;
        if (c->n == 1)
        {
            c->first_cross = cross;
        }
        if (c->n == 2)
        {
            c->first_peak = c->peak;
        }
        c->last_cross = cross;
        c->last_peak = c->peak;
        c->peak = 0.0;
    }
    c->last_t = t;
    c->last_x = x;
}

static double period_of(const crossings_t *c)
{
    return (c->last_cross - c->first_cross) / (c->n - 1);
}

/// Rate at which the amplitude decays, from the first and last peaks between crossings.
static double decay_of(const crossings_t *c)
{
    return log(c->first_peak / c->last_peak) / ((c->n - 2) * period_of(c));
}

/// All legs deflected sideways alike, in free fall: the forces on the body cancel, the moments turn it about z, which a
/// large moment of inertia prevents.  Each leg then rings as beta'' + 2 zeta w beta' + w^2 beta = 0, w = sqrt(K / I).
static void test_a_leg_rings_with_its_frequency_and_damping(void)
{
    ivl_sim_params_t params = open_sky();
    params.body_inertia_zz_kgm2 = 1.0e-2;
    params.leg_damping_Nmsprad = 1.0e-5;  // many periods
    params.step_scale_norm = 0.02;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = resting_kin(&model, 0.0, 0.0, 15.0);
    const double          beta = 0.02, L = params.leg_length_m, fall = params.world_gravity_mps2;
    for (int i = 0; i < 4; i++)
    {
        const ivl_d3_t e1 = model.leg.rest_B[i], e3 = model.leg.sideways_B[i];
        const ivl_d3_t rod = ivl_d3_scale(L, ivl_d3_add(ivl_d3_scale(cos(beta), e1), ivl_d3_scale(sin(beta), e3)));
        ivl_d3_store(kin.p_foot_W_m[i], ivl_d3_add(ivl_d3_load(kin.p_WB_m), ivl_d3_add(model.leg.hip_B_m[i], rod)));
    }
    place_alone(&model, &group, &kin, FREE);
    crossings_t c = {.n = 0};
    for (int i = 0; i < 6000; i++)
    {
        advance(&group, 2.0e-5);
        const ivl_sim_kin_t now = ivl_sim_world_kin(&group, 0);
        const ivl_d3_t      hip = ivl_d3_add(ivl_d3_load(now.p_WB_m), model.leg.hip_B_m[0]);
        watch(&c, group.progress.t_s[0], ivl_d3_dot(ivl_d3_sub(ivl_d3_load(now.p_foot_W_m[0]), hip), model.leg.sideways_B[0]) / L);
    }
    const double zeta = model.leg_damping_ratio, w = model.leg_frequency_radps;
    TEST_ASSERT_TRUE(c.n > 5 && fall > 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(2.0e-3, 1.0, 2.0 * IVL_SIM_PI / period_of(&c) / (w * sqrt(1.0 - zeta * zeta)));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, decay_of(&c) / (zeta * w));
}

// ---- hanging ---------------------------------------------------------------------------------------------------------------

/// A vehicle with stiff hips hangs from held feet and swings as one rigid body (10 N m/rad against m g l = 0.02 N m: the hips
/// give by 2e-3 of the swing).
static ivl_sim_params_t stiff_params(void)
{
    ivl_sim_params_t params = fixture_params();
    params.leg_stiffness_Nmprad = 10.0;
    params.leg_damping_Nmsprad = 5.0e-4;
    params.step_scale_norm = 0.01;  // the legs ring at 5000 rad/s
    return params;
}

/// Mass, centre and moment of inertia of the whole rigid vehicle about an axis through point a along unit vector e, level
/// attitude, body origin at 0.
typedef struct
{
    double   mass, moment;
    ivl_d3_t center;
} rigid_t;

static void add_point(rigid_t *r, double mass, ivl_d3_t p, ivl_d3_t a, ivl_d3_t e)
{
    const ivl_d3_t d = ivl_d3_cross(ivl_d3_sub(p, a), e);
    r->moment += mass * ivl_d3_dot(d, d);
    r->center = ivl_d3_scale(1.0 / (r->mass + mass), ivl_d3_add(ivl_d3_scale(r->mass, r->center), ivl_d3_scale(mass, p)));
    r->mass += mass;
}

static rigid_t rigid_about(const ivl_sim_model_t *model, ivl_d3_t a, ivl_d3_t e)
{
    const ivl_sim_params_t *raw = &model->raw;
    rigid_t                 r = {.mass = 0.0};
    add_point(&r, raw->body_mass_kg, ivl_d3(0.0, 0.0, 0.0), a, e);
    r.moment += raw->body_inertia_xx_kgm2 * e.x * e.x + raw->body_inertia_yy_kgm2 * e.y * e.y + raw->body_inertia_zz_kgm2 * e.z * e.z;
    for (int i = 0; i < 4; i++)
    {
        // a uniform rod: Simpson's three points are exact, 1/6, 4/6, 1/6 of the mass
        const ivl_d3_t hip = model->leg.hip_B_m[i], rod = ivl_d3_scale(raw->leg_length_m, model->leg.rest_B[i]);
        add_point(&r, raw->leg_mass_kg / 6.0, hip, a, e);
        add_point(&r, raw->leg_mass_kg * 4.0 / 6.0, ivl_d3_add(hip, ivl_d3_scale(0.5, rod)), a, e);
        add_point(&r, raw->leg_mass_kg / 6.0 + raw->leg_foot_mass_kg, ivl_d3_add(hip, rod), a, e);
    }
    return r;
}

/// Attitude in which the direction d, of the body, points down, turned about the body's axis e (across d) by `tilt` more.
static void hang(ivl_d3_t d, ivl_d3_t e, double tilt, double q[4])
{
    const ivl_d3_t down = ivl_d3(0.0, 0.0, -1.0);
    const double   angle = atan2(ivl_d3_dot(e, ivl_d3_cross(d, down)), ivl_d3_dot(d, down)) + tilt;
    q[0] = sin(0.5 * angle) * e.x;
    q[1] = sin(0.5 * angle) * e.y;
    q[2] = sin(0.5 * angle) * e.z;
    q[3] = cos(0.5 * angle);
}

/// Swings about the body axis e through the feet that hold; compares period and decay with
/// I theta'' + c theta' + m g l sin(theta) = 0:  T = 2 pi sqrt(I / (m g l)) (1 + theta0^2 / 16), decay c / (2 I).
static void check_pendulum(const ivl_sim_foot_t foot[4], ivl_d3_t e, double foot_damping)
{
    ivl_sim_params_t params = stiff_params();
    params.leg_foot_damping_Nmsprad = foot_damping;
    const ivl_sim_model_t model = fixture_model(&params);
    const int             one = (foot[0] == IVL_SIM_FOOT_STUCK) ? 0 : 1;
    const ivl_d3_t        pivot = ivl_d3_add(model.leg.hip_B_m[one], ivl_d3_scale(params.leg_length_m, model.leg.rest_B[one]));
    const rigid_t         rigid = rigid_about(&model, pivot, e);
    // arm: from the axis to the centre of mass
    ivl_d3_t arm = ivl_d3_sub(rigid.center, pivot);
    arm = ivl_d3_sub(arm, ivl_d3_scale(ivl_d3_dot(arm, e), e));
    const double l = sqrt(ivl_d3_dot(arm, arm)), g = params.world_gravity_mps2, tilt = 0.05;
    double       q[4];
    hang(ivl_d3_scale(1.0 / l, arm), e, tilt, q);
    ivl_sim_kin_t kin = resting_kin(&model, 0.0, 0.0, 2.0);
    turn_kin(&model, q, &kin);
    place_alone(&model, &group, &kin, foot);

    crossings_t     c = {.n = 0};
    const ivl_rot_t R0 = ivl_rot_from_quat(q);
    const ivl_d3_t  e_W = ivl_rot_apply(&R0, e), side = ivl_d3_cross(e_W, ivl_d3(0.0, 0.0, 1.0));
    for (int i = 0; i < 8000; i++)
    {
        advance(&group, 0.0005);
        const ivl_sim_kin_t now = ivl_sim_world_kin(&group, 0);
        const ivl_rot_t     R = ivl_rot_from_quat(now.q_WB);
        watch(&c, group.progress.t_s[0], ivl_d3_dot(ivl_rot_apply(&R, arm), side) / l);
    }
    const double period = 2.0 * IVL_SIM_PI * sqrt(rigid.moment / (rigid.mass * g * l)) * (1.0 + tilt * tilt / 16.0);
    TEST_ASSERT_GREATER_THAN(4, c.n);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 1.0, period_of(&c) / period);
    double friction = 0.0;
    for (int i = 0; i < 4; i++)
    {
        // a rod's joint rubs against its swing, not against its spin about itself
        const double along = ivl_d3_dot(model.leg.rest_B[i], e);
        friction += (foot[i] == IVL_SIM_FOOT_STUCK) ? foot_damping * (1.0 - along * along) : 0.0;
    }
    // the hips, which give a little, damp a little too
    TEST_ASSERT_DOUBLE_WITHIN(0.02 + 0.02 * friction / (2.0 * rigid.moment), friction / (2.0 * rigid.moment), decay_of(&c));
}

static void test_body_swings_from_two_feet_as_a_compound_pendulum(void)
{
    const ivl_sim_foot_t fore[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_STUCK};
    const ivl_sim_foot_t rear[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_FREE};
    check_pendulum(fore, ivl_d3(0.0, 1.0, 0.0), 0.0);
    check_pendulum(fore, ivl_d3(0.0, 1.0, 0.0), 5.0e-5);
    check_pendulum(rear, ivl_d3(0.0, 1.0, 0.0), 5.0e-5);
}

static void test_body_swings_from_one_foot_as_a_compound_pendulum(void)
{
    // in the plane of the leg, which is one of symmetry: about the horizontal axis across it
    const ivl_sim_foot_t one[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    const double         r = sqrt(0.5);
    check_pendulum(one, ivl_d3(r, r, 0.0), 0.0);
    check_pendulum(one, ivl_d3(r, r, 0.0), 1.0e-4);
}

// ---- landings ----------------------------------------------------------------------------------------------------------------

/// Near the ceiling, inverted by `pitch` and rolled a little, all parts moving and turning together.
static ivl_sim_kin_t oblique(const ivl_sim_model_t *model, double pitch, double roll, ivl_d3_t v, ivl_d3_t w_B)
{
    ivl_sim_kin_t kin = resting_kin(model, 0.0, 0.0, model->raw.world_ceiling_height_m - 0.1);
    const double  cp = cos(0.5 * pitch), sp = -sin(0.5 * pitch), cr = cos(0.5 * roll), sr = sin(0.5 * roll);
    const double  q[4] = {cp * sr, sp * cr, -sp * sr, cp * cr};  // pitch about y, then roll about the body's x
    turn_kin(model, q, &kin);
    const ivl_rot_t R = ivl_rot_from_quat(q);
    const ivl_d3_t  w = ivl_rot_apply(&R, w_B);
    ivl_d3_store(kin.v_WB_mps, v);
    ivl_d3_store(kin.w_B_radps, w_B);
    for (int i = 0; i < 4; i++)
    {
        const ivl_d3_t arm = ivl_d3_sub(ivl_d3_load(kin.p_foot_W_m[i]), ivl_d3_load(kin.p_WB_m));
        ivl_d3_store(kin.v_foot_W_mps[i], ivl_d3_add(v, ivl_d3_cross(w, arm)));
    }
    return kin;
}

static void test_a_landing_mirrored_in_y_is_the_mirror_image(void)
{
    ivl_sim_params_t params = fixture_params();
    params.step_scale_norm = 0.5;
    const ivl_sim_model_t model = fixture_model(&params);
    const int             partner[4] = {3, 2, 1, 0};
    draws_t               draws = {77};
    for (int k = 0; k < 20; k++)
    {
        const double   pitch = draw(&draws, 1.8, 3.4), roll = draw(&draws, -0.3, 0.3);
        const ivl_d3_t v = ivl_d3(draw(&draws, -1.0, 1.0), draw(&draws, -0.5, 0.5), draw(&draws, 1.0, 3.0)), w = draw_d3(&draws, 8.0);
        ivl_sim_kin_t  end[2];
        int8_t         order[2][4];
        for (int side = 0; side < 2; side++)
        {
            // a mirror turns y components of vectors, and x, z components of rotations
            const double        s = side ? -1.0 : 1.0;
            const ivl_sim_kin_t kin = oblique(&model, pitch, s * roll, ivl_d3(v.x, s * v.y, v.z), ivl_d3(s * w.x, w.y, s * w.z));
            place_alone(&model, &group, &kin, FREE);
            advance_ticks(60);
            end[side] = ivl_sim_world_kin(&group, 0);
            memcpy(order[side], group.world[0].stuck_order, sizeof order[side]);
        }
        // what rounding differs by grows with the swing: 1e-7 after 0.12 s
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, end[0].p_WB_m[2], end[1].p_WB_m[2]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, end[0].p_WB_m[1], -end[1].p_WB_m[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-5, end[0].pitch_rad, end[1].pitch_rad);
        for (int i = 0; i < 4; i++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, end[0].p_foot_W_m[i][1], -end[1].p_foot_W_m[partner[i]][1]);
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, end[0].p_foot_W_m[i][2], end[1].p_foot_W_m[partner[i]][2]);
            TEST_ASSERT_EQUAL_INT8(order[0][i], order[1][i] ? 5 - order[1][i] : 0);
        }
    }
}

/// With the motors off, dE/dt = -(dampers) <= 0 and impulses take energy away.  A second-order step adds an oscillation,
/// (w dt)^2 / 8 of the energy of each mode w: it must shrink fourfold with half the step, which a contact that pumps would not.
static double rise_of_energy(double step_s)
{
    ivl_sim_params_t params = fixture_params();
    params.step_flight_s = params.step_swing_s = params.step_touch_s = step_s;  // equal steps
    params.step_turn_rad = 1.0;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {78};
    double                rise = 0.0;
    for (int k = 0; k < 60; k++)
    {
        const ivl_d3_t      v = ivl_d3(draw(&draws, -1.0, 1.0), draw(&draws, -0.3, 0.3), draw(&draws, 1.0, 3.0));
        const ivl_sim_kin_t kin = oblique(&model, draw(&draws, 2.0, 2.9), 0.1, v, ivl_d3(0.0, draw(&draws, -15.0, 0.0), 0.0));
        place_alone(&model, &group, &kin, FREE);
        double least = total_energy(&group);
        for (int i = 0; i < 100; i++)
        {
            advance_ticks(1);
            const double energy = total_energy(&group);
            rise = fmax(rise, energy - least);
            least = fmin(least, energy);
        }
    }
    return rise;
}

static void test_energy_never_grows_through_a_touch_down_beyond_the_step_s_oscillation(void)
{
    const double coarse = rise_of_energy(5.0e-4), fine = rise_of_energy(2.5e-4);
    TEST_ASSERT_LESS_THAN_DOUBLE(2.0e-3, coarse);  // of 0.1 to 0.3 J
    TEST_ASSERT_LESS_THAN_DOUBLE(coarse / 3.0, fine);
}

/// State a while after touch-down, in equal steps.
static ivl_sim_kin_t landed(double step_s)
{
    ivl_sim_params_t params = fixture_params();
    params.step_flight_s = params.step_swing_s = params.step_touch_s = step_s;
    const ivl_sim_model_t model = fixture_model(&params);
    const ivl_sim_kin_t   kin = oblique(&model, 2.3, 0.0, ivl_d3(0.3, 0.0, 2.0), ivl_d3(0.0, -10.0, 0.0));
    place_alone(&model, &group, &kin, FREE);
    advance_ticks(40);
    TEST_ASSERT_EQUAL(2, ivl_sim_world_count_stuck(&group.world[0]));
    return ivl_sim_world_kin(&group, 0);
}

static void test_motion_through_touch_down_converges_with_the_second_order(void)
{
    const ivl_sim_kin_t exact = landed(5.0e-6);
    double              error[3];
    for (int i = 0; i < 3; i++)
    {
        const ivl_sim_kin_t end = landed(4.0e-4 / (1 << i));
        error[i] = fabs(end.pitch_rad - exact.pitch_rad) + fabs(end.p_WB_m[2] - exact.p_WB_m[2]) + fabs(end.p_WB_m[0] - exact.p_WB_m[0]);
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(2.0e-3, error[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 4.0, error[0] / error[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 4.0, error[1] / error[2]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_free_fall_is_that_of_galileo);
    RUN_TEST(test_torque_free_tumble_keeps_angular_momentum_and_energy);
    RUN_TEST(test_vehicle_stays_where_it_is_when_thrust_equals_weight);
    RUN_TEST(test_yaw_torque_turns_the_body_against_the_rotors);
    RUN_TEST(test_a_leg_rings_with_its_frequency_and_damping);
    RUN_TEST(test_body_swings_from_two_feet_as_a_compound_pendulum);
    RUN_TEST(test_body_swings_from_one_foot_as_a_compound_pendulum);
    RUN_TEST(test_a_landing_mirrored_in_y_is_the_mirror_image);
    RUN_TEST(test_energy_never_grows_through_a_touch_down_beyond_the_step_s_oscillation);
    RUN_TEST(test_motion_through_touch_down_converges_with_the_second_order);
    return UNITY_END();
}
