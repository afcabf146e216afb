/// @file test_ivl_step.c
/// The whole pipeline: one landing step by step, and a rigid body that is flown by it.
#include "test_ivl_support.h"

static fix_t fix;

// ---- a rigid body with ideal motors, in double precision; written only from Newton and Euler

typedef struct
{
    double p[3], v[3], w[3];
    double q[4];   // x, y, z, w
    double f[3];   // specific force in B of the last step
    double pitch;  // accumulated rotation about b_y, rad
} body_t;

static void turn(const double q[4], const double b[3], double out[3])  // body to world
{
    const double u[3] = {q[0], q[1], q[2]};
    double       t[3];
    for (int i = 0; i < 3; i++)
    {
        t[i] = 2.0 * (u[(i + 1) % 3] * b[(i + 2) % 3] - u[(i + 2) % 3] * b[(i + 1) % 3]);
    }
    for (int i = 0; i < 3; i++)
    {
        out[i] = b[i] + q[3] * t[i] + u[(i + 1) % 3] * t[(i + 2) % 3] - u[(i + 2) % 3] * t[(i + 1) % 3];
    }
}

static void turn_on(double q[4], const double w[3], double h_s)
{
    const double x = q[0], y = q[1], z = q[2], s = q[3], k = 0.5 * h_s;
    q[0] += k * (s * w[0] + y * w[2] - z * w[1]);
    q[1] += k * (s * w[1] + z * w[0] - x * w[2]);
    q[2] += k * (s * w[2] + x * w[1] - y * w[0]);
    q[3] -= k * (x * w[0] + y * w[1] + z * w[2]);
    const double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
    {
        q[i] /= n;
    }
}

// forces straight from the motor positions, not through the mixer
static void body_step(body_t *b, const ivl_cfg_t *cfg, const float thrust_N[4], double h_s)
{
    const double mass = (double)cfg->mass_kg, j[3] = {(double)cfg->jxx_kgm2, (double)cfg->jyy_kgm2, (double)cfg->jzz_kgm2};
    const double x[4] = {1.0, -1.0, -1.0, 1.0}, y[4] = {-1.0, -1.0, 1.0, 1.0}, spin[4] = {-1.0, 1.0, -1.0, 1.0};
    double       up[3] = {0.0, 0.0, 0.0}, m[3] = {0.0, 0.0, 0.0}, a[3];
    for (int i = 0; i < 4; i++)
    {
        const double f = (double)thrust_N[i];
        up[2] += f / mass;
        m[0] += y[i] * (double)cfg->arm_y_m * f;
        m[1] -= x[i] * (double)cfg->arm_x_m * f;
        m[2] += spin[i] * (double)cfg->torque_per_thrust_m * f;
    }
    turn(b->q, up, a);
    a[2] -= (double)cfg->gravity_mps2;
    const double w[3] = {b->w[0], b->w[1], b->w[2]};
    for (int i = 0; i < 3; i++)
    {
        const int k = (i + 1) % 3, l = (i + 2) % 3;
        b->v[i] += h_s * a[i];
        b->p[i] += h_s * b->v[i];
        b->w[i] += h_s * (m[i] - (j[l] - j[k]) * w[k] * w[l]) / j[i];
        b->f[i] = up[i];
    }
    b->pitch += h_s * b->w[1];
    turn_on(b->q, b->w, h_s);
}

static ivl_vec3_t vec_of(const double a[3])
{
    return ivl_vec3((float)a[0], (float)a[1], (float)a[2]);
}

static void sense_body(const body_t *b, ivl_in_t *in)
{
    in->p_WB_m = vec_of(b->p);
    in->v_WB_mps = vec_of(b->v);
    in->w_B_radps = vec_of(b->w);
    in->f_B_mps2 = vec_of(b->f);
    in->q_WB = (ivl_quat_t){(float)b->q[0], (float)b->q[1], (float)b->q[2], (float)b->q[3]};
}

// fly on: sense, one tick of the core, four substeps of the body
static void fly(body_t *b, double duration_s)
{
    const double period_s = 1.0 / (double)fix.cfg.tick_hz;
    const int    n = (int)(duration_s / period_s + 0.5);
    for (int i = 0; i < n; i++)
    {
        sense_body(b, &fix.in);
        fix_tick(&fix);
        assert_output_sane(&fix);
        for (int k = 0; k < 4; k++)
        {
            body_step(b, &fix.cfg, fix.out.thrust_N, 0.25 * period_s);
        }
    }
}

static double tilt_rad(const body_t *b)
{
    return acos(fmin(1.0, 1.0 - 2.0 * (b->q[0] * b->q[0] + b->q[1] * b->q[1])));
}

static body_t start_hovering(float tick_hz, float h_ceil_m)
{
    fix_init(&fix);
    fix.cfg.tick_hz = tick_hz;
    fix.cfg.h_ceil_m = h_ceil_m;
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(&fix.cfg));
    ivl_init(&fix.cfg, &fix.state);
    fix_policy(&fix, 4.0f, 0.008f);
    const body_t body = {.p = {0.0, 0.0, 1.0}, .q = {0.0, 0.0, 0.0, 1.0}, .f = {0.0, 0.0, 9.81}};
    fix.in.cmd = (ivl_command_t){.request = IVL_REQUEST_HOVER, .p_hover_W_m = {0.0f, 0.0f, 1.0f}};
    return body;
}

static void test_hover_settles_at_the_point_from_a_disturbed_start(void)
{
    body_t b = start_hovering(500.0f, 50.0f);
    b.p[0] = 0.3;
    b.p[1] = -0.2;
    b.p[2] = 1.2;
    b.w[0] = 3.0;
    b.q[2] = sin(0.25);  // heading 0.5 rad
    b.q[3] = cos(0.25);
    fly(&b, 6.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, b.p[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, b.p[1]);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 1.0, b.p[2]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, tilt_rad(&b));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, b.q[2]);
    TEST_ASSERT_FLOAT_WITHIN(0.002f, 0.03584f * 9.81f, fix.out.thrust_total_N);
}

static void test_a_hover_point_far_below_is_descended_to_upright(void)
{
    const double below_m[] = {0.2, 0.6, 2.0, 4.0};
    for (size_t i = 0; i < sizeof below_m / sizeof below_m[0]; i++)
    {
        // Given a hover that is pushed
        body_t b = start_hovering(500.0f, 50.0f);
        b.p[2] = 1.0 + below_m[i];
        b.w[0] = 3.0;
        b.v[0] = 0.2;

        // When the point to hold is far below
        double fastest_mps = 0.0, tilt_max_rad = 0.0;
        for (int t = 0; t < 1000; t++)
        {
            fly(&b, 0.01);
            fastest_mps = fmax(fastest_mps, -b.v[2]);
            tilt_max_rad = (t > 20) ? fmax(tilt_max_rad, tilt_rad(&b)) : 0.0;
        }

        // Then it comes down no faster than the height loop lets it from where that asks for the least lift, level, and holds there
        const double ahead_m = 0.8 * (double)(fix.cfg.mass_kg * fix.cfg.gravity_mps2 / fix.cfg.kp_pos_z_Npm);
        TEST_ASSERT_TRUE(fastest_mps < 1.05 * ahead_m * (double)(fix.cfg.kp_pos_z_Npm / fix.cfg.kd_vel_z_Nspm));
        TEST_ASSERT_TRUE(tilt_max_rad < 0.2);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.0, b.p[2]);
        assert_phase(IVL_PHASE_READY, &fix);
    }
}

static void fly_approach(float tick_hz, float speed_mps, float angle_deg)
{
    // Given a hover
    body_t b = start_hovering(tick_hz, 90.0f);
    fly(&b, 0.5);

    // When an approach is flown for the ramp and two and a half seconds more
    const double angle_rad = (double)angle_deg * 3.14159265358979 / 180.0;
    fix.in.cmd.request = IVL_REQUEST_APPROACH;
    fix.in.cmd.speed_mps = speed_mps;
    fix.in.cmd.angle_rad = (float)angle_rad;
    fly(&b, (double)(speed_mps / fix.cfg.approach_accel_mps2) + 2.5);

    // Then it has the speed within 2 %, in both components, flies straight, and is level
    assert_phase(IVL_PHASE_APPROACH, &fix);
    const double tolerance = 0.02 * (double)speed_mps;
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, (double)speed_mps * cos(angle_rad), b.v[0]);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, (double)speed_mps * sin(angle_rad), b.v[2]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 0.0, b.p[1]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, tilt_rad(&b));
}

static void test_approach_reaches_its_speed_and_stays_level(void)
{
    const float speeds[] = {1.0f, 2.5f, 4.0f};
    const float angles[] = {90.0f, 70.0f, 45.0f, 20.0f};
    for (int i = 0; i < 3; i++)
    {
        for (int k = 0; k < 4; k++)
        {
            fly_approach(500.0f, speeds[i], angles[k]);
            fly_approach(1000.0f, speeds[i], angles[k]);
        }
    }
}

static void test_vehicle_at_speed_holds_it_from_the_first_tick(void)
{
    body_t b = start_hovering(500.0f, 90.0f);
    b.v[0] = 1.0;
    b.v[2] = 2.0;
    fix.in.cmd = (ivl_command_t){.request = IVL_REQUEST_APPROACH, .speed_mps = 2.23606798f, .angle_rad = 1.10714872f};
    for (int i = 0; i < 100; i++)
    {
        fly(&b, 0.01);
        TEST_ASSERT_DOUBLE_WITHIN(2.0e-3, 1.0, b.v[0]);
        TEST_ASSERT_DOUBLE_WITHIN(2.0e-3, 2.0, b.v[2]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 0.0, tilt_rad(&b));
    }
}

// ---- a whole landing

static void test_landing_goes_through_its_phases_once(void)
{
    // Given a vertical approach from 1.7 m below the ceiling
    body_t b = start_hovering(500.0f, 2.7f);
    fly(&b, 0.2);
    fix.in.cmd = (ivl_command_t){.request = IVL_REQUEST_APPROACH, .speed_mps = 2.5f, .angle_rad = 1.57079633f};

    // When RREV reaches 4, the flip starts at that very tick
    float rrev_before = 0.0f;
    for (int i = 0; (i < 1000) && (fix.out.phase != IVL_PHASE_FLIP); i++)
    {
        rrev_before = fix.out.cues.rrev_per_s;
        fly(&b, 0.002);
    }
    assert_phase(IVL_PHASE_FLIP, &fix);
    const ivl_snapshot_t snapshot = fix.state.snapshot;
    TEST_ASSERT_TRUE((rrev_before < 4.0f) && (snapshot.rrev_per_s >= 4.0f));
    TEST_ASSERT_EQUAL_UINT64(fix.in.t_us, snapshot.sample.t_us);
    TEST_ASSERT_EQUAL_MEMORY(&fix.in.p_WB_m, &snapshot.sample.p_WB_m, sizeof snapshot.sample.p_WB_m);
    TEST_ASSERT_EQUAL_MEMORY(&fix.in.v_WB_mps, &snapshot.sample.v_WB_mps, sizeof snapshot.sample.v_WB_mps);
    TEST_ASSERT_EQUAL_FLOAT(2.7f - snapshot.sample.p_WB_m.z, snapshot.d_ceil_m);
    TEST_ASSERT_EQUAL_UINT32(7, snapshot.policy.seq);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, -0.008f, fix.out.pitch_moment_Nm);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, fix.out.thrust_N[1] + fix.out.thrust_N[2]);

    // Then the body turns nose up, and the motors are cut once it is past the horizontal
    for (int i = 0; (i < 1000) && (fix.out.phase == IVL_PHASE_FLIP); i++)
    {
        fly(&b, 0.002);
    }
    assert_phase(IVL_PHASE_COAST, &fix);
    TEST_ASSERT_TRUE(ivl_motors_latched_off(&fix.state));
    // 8 N mm on 49.35e-6 kg m^2 to 90 degrees: w = sqrt(2 alpha pi/2) = 22.6 rad/s
    TEST_ASSERT_DOUBLE_WITHIN(0.5, -22.6, b.w[1]);
    // seen at the next tick, and one more tick of flight: 2 x 2 ms x 22.6 rad/s beyond the horizontal at most
    TEST_ASSERT_DOUBLE_WITHIN(0.05, -1.5708 - 0.045, b.pitch);

    // and stay off on the way to done, whatever the attitude; the snapshot stays
    fly(&b, 1.0);
    assert_motors_off(&fix);
    TEST_ASSERT_FALSE(fix.out.ceiling.valid || fix.out.cues.valid);
    fly(&b, 2.0);
    assert_phase(IVL_PHASE_DONE, &fix);
    TEST_ASSERT_EQUAL_UINT32(1, fix.state.diag.n_trigger);
    TEST_ASSERT_EQUAL_MEMORY(&snapshot, &fix.state.snapshot, sizeof snapshot);
}

static void test_output_of_a_tick_is_consistent(void)
{
    fix_to_phase(&fix, IVL_PHASE_APPROACH);
    fix.in.v_WB_mps = ivl_vec3(0.5f, 0.0f, 0.8f);
    fix_tick(&fix);
    const ivl_out_t *o = &fix.out;
    TEST_ASSERT_EQUAL_INT(o->phase, o->phase_log);
    TEST_ASSERT_TRUE(o->ceiling.valid && o->cues.valid && o->motors_on);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.1f, o->ceiling.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.8f / 1.1f, o->cues.rrev_per_s);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -0.5f / 1.1f, o->cues.of_y_radps);
    TEST_ASSERT_EQUAL_FLOAT(o->thrust_N[0] + o->thrust_N[1] + o->thrust_N[2] + o->thrust_N[3], o->thrust_total_N);
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_TRUE(o->pwm[i] > 0u);
    }
}

static void test_counters_count_ticks_and_refused_inputs(void)
{
    fix_to_phase(&fix, IVL_PHASE_READY);
    const ivl_diag_t before = fix.state.diag;
    fix.in.p_WB_m.x = NAN;
    fix_ticks(&fix, 0.02f);
    fix.in.p_WB_m.x = 0.0f;
    fix.in.cmd.request = IVL_REQUEST_COUNT;
    fix_ticks(&fix, 0.01f);
    TEST_ASSERT_EQUAL_UINT32(before.n_tick + 15u, fix.state.diag.n_tick);
    TEST_ASSERT_EQUAL_UINT32(before.n_bad_pose + 10u, fix.state.diag.n_bad_pose);
    TEST_ASSERT_EQUAL_UINT32(before.n_bad_command + 5u, fix.state.diag.n_bad_command);
}

static void test_same_inputs_give_the_same_bits(void)
{
    ivl_out_t first[200];
    for (int run = 0; run < 2; run++)
    {
        body_t b = start_hovering(500.0f, 2.7f);
        b.p[0] = 0.1;
        for (int i = 0; i < 200; i++)
        {
            fly(&b, 0.002);
            if (run == 0)
            {
                memcpy(&first[i], &fix.out, sizeof fix.out);
            }
            TEST_ASSERT_EQUAL_MEMORY(first[i].thrust_N, fix.out.thrust_N, sizeof fix.out.thrust_N);
            TEST_ASSERT_EQUAL_MEMORY(first[i].pwm, fix.out.pwm, sizeof fix.out.pwm);
        }
    }
}

static void test_reconfigure_takes_a_good_configuration_in_idle_only(void)
{
    fix_to_phase(&fix, IVL_PHASE_READY);
    ivl_cfg_t wanted = fix.cfg;
    wanted.h_ceil_m = 3.0f;
    TEST_ASSERT_EQUAL_INT(IVL_ERR_PHASE, ivl_reconfigure(&fix.cfg, &fix.state, &wanted));
    fix_request(&fix, IVL_REQUEST_IDLE);
    wanted.mass_kg = NAN;
    TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, ivl_reconfigure(&fix.cfg, &fix.state, &wanted));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 2.1f, fix.cfg.h_ceil_m);
    wanted.mass_kg = 0.04f;
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_reconfigure(&fix.cfg, &fix.state, &wanted));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 3.0f, fix.cfg.h_ceil_m);
    TEST_ASSERT_FALSE(fix.state.has_policy);
}

static void test_reconfigure_keeps_the_lock_out_and_the_demand_for_hover(void)
{
    fix_to_phase(&fix, IVL_PHASE_DONE);
    fix_request(&fix, IVL_REQUEST_IDLE);
    const ivl_cfg_t wanted = fix.cfg;
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_reconfigure(&fix.cfg, &fix.state, &wanted));
    fix_tick(&fix);
    TEST_ASSERT_FALSE(fix.out.stock_allowed);
    TEST_ASSERT_TRUE(fix.state.triggered);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_hover_settles_at_the_point_from_a_disturbed_start);
    RUN_TEST(test_a_hover_point_far_below_is_descended_to_upright);
    RUN_TEST(test_approach_reaches_its_speed_and_stays_level);
    RUN_TEST(test_vehicle_at_speed_holds_it_from_the_first_tick);
    RUN_TEST(test_landing_goes_through_its_phases_once);
    RUN_TEST(test_output_of_a_tick_is_consistent);
    RUN_TEST(test_counters_count_ticks_and_refused_inputs);
    RUN_TEST(test_same_inputs_give_the_same_bits);
    RUN_TEST(test_reconfigure_takes_a_good_configuration_in_idle_only);
    RUN_TEST(test_reconfigure_keeps_the_lock_out_and_the_demand_for_hover);
    return UNITY_END();
}
