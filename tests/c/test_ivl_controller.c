/// @file test_ivl_controller.c
/// Known answers, signs, limits, and a comparison with the law written out in double-precision matrices.
#include "test_ivl_support.h"

static const float TAN_TILT_MAX = 1.0f;

static ivl_cfg_t       cfg;
static ivl_sample_t    sample;
static ivl_reference_t ref;

void setUp(void);
void setUp(void)
{
    ivl_cfg_defaults(&cfg);
    sample = (ivl_sample_t){.q_WB = {0.0f, 0.0f, 0.0f, 1.0f}};
    ref = (ivl_reference_t){.p_W_m = {0.0f, 0.0f, 0.0f}};
}

static ivl_wrench_t compute(void)
{
    return ivl_controller_compute(&cfg, &sample, &ref, TAN_TILT_MAX);
}

static void assert_moment(float x, float y, float z, ivl_vec3_t moment)
{
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, x, moment.x);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, y, moment.y);
    TEST_ASSERT_FLOAT_WITHIN(2.0e-8f, z, moment.z);
}

static void test_thrust_is_the_weight_and_moment_zero_when_there_is_no_error(void)
{
    const ivl_wrench_t wrench = compute();
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.03584f * 9.81f, wrench.thrust_N);
    assert_moment(0.0f, 0.0f, 0.0f, wrench.moment_B_Nm);
}

static void test_thrust_follows_height_speed_and_feed_forward(void)
{
    // 0.05 m too low, sinking 0.1 m/s, asked to accelerate upwards with 2 m/s^2
    ref.p_W_m.z = 0.05f;
    ref.a_W_mps2.z = 2.0f;
    sample.v_WB_mps.z = -0.1f;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.03584f * 11.81f + 1.2f * 0.05f + 0.35f * 0.1f, compute().thrust_N);
}

static void test_nose_goes_down_when_the_target_is_ahead(void)
{
    // 0.1 m ahead: F = (0.05, 0, 0.35159), sin of the tilt 0.05 / 0.355128 = 0.140794
    ref.p_W_m.x = 0.1f;
    assert_moment(0.0f, 0.004f * 0.140794f, 0.0f, compute().moment_B_Nm);
}

static void test_rolls_left_when_the_target_is_to_the_left(void)
{
    // to the left is +y; a roll about +x would tilt the thrust to -y
    ref.p_W_m.y = 0.1f;
    assert_moment(-0.004f * 0.140794f, 0.0f, 0.0f, compute().moment_B_Nm);
}

static void test_yaw_turns_back_to_heading_zero(void)
{
    // heading 0.2 rad: e_R.z = sin 0.2
    sample.q_WB = (ivl_quat_t){0.0f, 0.0f, 0.09983342f, 0.99500417f};
    assert_moment(0.0f, 0.0f, -0.003f * 0.19866933f, compute().moment_B_Nm);
}

static void test_rates_are_damped_and_the_gyroscopic_moment_is_cancelled(void)
{
    sample.w_B_radps = ivl_vec3(1.0f, -2.0f, 3.0f);
    // w x J w: ((Jz - Jy) wy wz, (Jx - Jz) wz wx, (Jy - Jx) wx wy)
    const float gx = (29.26e-6f - 49.35e-6f) * -6.0f;
    const float gy = (49.35e-6f - 29.26e-6f) * 3.0f;
    assert_moment(gx - 0.0017f, gy + 0.0034f, -0.003f, compute().moment_B_Nm);
}

static void test_tilt_is_limited_when_the_target_is_far(void)
{
    ref.p_W_m.x = 50.0f;
    const ivl_wrench_t wrench = compute();
    // tangent 1: the desired tilt is 45 degrees and the height is kept
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.03584f * 9.81f, wrench.thrust_N);
    assert_moment(0.0f, 0.004f * 0.70710678f, 0.0f, wrench.moment_B_Nm);
}

static void test_lift_stays_between_a_fifth_of_the_weight_and_four_motors(void)
{
    ref.p_W_m.z = -100.0f;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.2f * 0.03584f * 9.81f, compute().thrust_N);
    ref.p_W_m.z = 100.0f;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 4.0f * 0.1615f, compute().thrust_N);
}

static void test_desired_rate_is_bounded_when_the_speed_is_far_off(void)
{
    // level, 40 m/s too slow: the force turns at Kp 40 m/s / F, of order 50 rad/s, and is limited to a tilt of 45 degrees
    sample.v_WB_mps.x = -40.0f;
    assert_moment(0.0f, 0.004f * 0.70710678f + 0.0017f * 10.0f, 0.0f, compute().moment_B_Nm);
}

static void test_thrust_is_zero_when_upside_down(void)
{
    sample.q_WB = (ivl_quat_t){0.0f, 1.0f, 0.0f, 0.0f};
    TEST_ASSERT_EQUAL_FLOAT(0.0f, compute().thrust_N);
}

// ---- the law again, in double precision and plain matrices, without limits, the desired rate by differences

typedef struct
{
    double m[3][3];
} mat_t;

static mat_t mat_mul_t(const mat_t *a, const mat_t *b)  // a^T b
{
    mat_t c = {{{0}}};
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            for (int k = 0; k < 3; k++)
            {
                c.m[i][j] += a->m[k][i] * b->m[k][j];
            }
        }
    }
    return c;
}

static mat_t mat_of_quat(ivl_quat_t q)
{
    const double x = (double)q.x, y = (double)q.y, z = (double)q.z, w = (double)q.w;
    return (mat_t){{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                    {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                    {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

static void cross(const double a[3], const double b[3], double c[3])
{
    for (int i = 0; i < 3; i++)
    {
        c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    }
}

static void normalise(double a[3])
{
    const double n = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (int i = 0; i < 3; i++)
    {
        a[i] /= n;
    }
}

static mat_t oracle_desired(const double force[3])
{
    double       b1[3], b2[3], b3[3] = {force[0], force[1], force[2]};
    const double e1[3] = {1.0, 0.0, 0.0};
    normalise(b3);
    cross(b3, e1, b2);
    normalise(b2);
    cross(b2, b3, b1);
    mat_t d;
    for (int i = 0; i < 3; i++)
    {
        d.m[i][0] = b1[i];
        d.m[i][1] = b2[i];
        d.m[i][2] = b3[i];
    }
    return d;
}

// desired force, t_s later, while position and speed change with speed v and acceleration a
static void oracle_force(const double a[3], double t_s, double force[3])
{
    const double kp[3] = {0.5, 0.5, 1.2}, kd[3] = {0.4, 0.4, 0.35};
    const double p[3] = {(double)sample.p_WB_m.x, (double)sample.p_WB_m.y, (double)sample.p_WB_m.z};
    const double v[3] = {(double)sample.v_WB_mps.x, (double)sample.v_WB_mps.y, (double)sample.v_WB_mps.z};
    const double pr[3] = {(double)ref.p_W_m.x, (double)ref.p_W_m.y, (double)ref.p_W_m.z};
    const double vr[3] = {(double)ref.v_W_mps.x, (double)ref.v_W_mps.y, (double)ref.v_W_mps.z};
    const double ar[3] = {(double)ref.a_W_mps2.x, (double)ref.a_W_mps2.y, (double)ref.a_W_mps2.z};
    for (int i = 0; i < 3; i++)
    {
        const double e_p = p[i] - pr[i] + t_s * (v[i] - vr[i]);
        const double e_v = v[i] - vr[i] + t_s * (a[i] - ar[i]);
        force[i] = 0.03584 * (ar[i] + (i == 2 ? 9.81 : 0.0)) - kp[i] * e_p - kd[i] * e_v;
    }
}

// vee of (a - a^T) / 2
static void vee(const mat_t *a, double v[3])
{
    for (int i = 0; i < 3; i++)
    {
        v[i] = 0.5 * (a->m[(i + 2) % 3][(i + 1) % 3] - a->m[(i + 1) % 3][(i + 2) % 3]);
    }
}

// rate of the desired axes by a central difference, expressed in B: R^T R_d vee(R_d^T R_d')
static void oracle_rate(const double a[3], const mat_t *d, const mat_t *r, double w_d[3])
{
    const double h_s = 1.0e-5;
    double       before[3], after[3], in_d[3];
    oracle_force(a, -h_s, before);
    oracle_force(a, h_s, after);
    const mat_t d0 = oracle_desired(before), d1 = oracle_desired(after);
    mat_t       slope;
    for (int i = 0; i < 9; i++)
    {
        slope.m[i / 3][i % 3] = (d1.m[i / 3][i % 3] - d0.m[i / 3][i % 3]) / (2.0 * h_s);
    }
    const mat_t hat = mat_mul_t(d, &slope);
    const mat_t rel = mat_mul_t(r, d);
    vee(&hat, in_d);
    for (int i = 0; i < 3; i++)
    {
        w_d[i] = rel.m[i][0] * in_d[0] + rel.m[i][1] * in_d[1] + rel.m[i][2] * in_d[2];
    }
}

static void oracle(double *thrust_N, double moment_Nm[3])
{
    const double kr[3] = {0.004, 0.004, 0.003}, kw[3] = {0.0017, 0.0017, 0.001}, j[3] = {49.35e-6, 49.35e-6, 29.26e-6};
    const double w[3] = {(double)sample.w_B_radps.x, (double)sample.w_B_radps.y, (double)sample.w_B_radps.z};
    const double rest[3] = {0.0, 0.0, 0.0};
    double       force[3], acc[3], spin[3], gyro[3], e_r[3], w_d[3];
    oracle_force(rest, 0.0, force);
    const mat_t r = mat_of_quat(sample.q_WB);
    const mat_t d = oracle_desired(force);
    *thrust_N = force[0] * r.m[0][2] + force[1] * r.m[1][2] + force[2] * r.m[2][2];
    for (int i = 0; i < 3; i++)
    {
        acc[i] = *thrust_N * r.m[i][2] / 0.03584 - (i == 2 ? 9.81 : 0.0);
        spin[i] = j[i] * w[i];
    }
    oracle_rate(acc, &d, &r, w_d);
    cross(w, spin, gyro);
    const mat_t rel = mat_mul_t(&d, &r);
    vee(&rel, e_r);
    for (int i = 0; i < 3; i++)
    {
        moment_Nm[i] = -kr[i] * e_r[i] - kw[i] * (w[i] - w_d[i]) + gyro[i];
    }
}

static ivl_quat_t rng_near_level(rng_t *rng)
{
    const ivl_vec3_t u = rng_vec3(rng, 0.25f);
    const float      k = 1.0f / sqrtf(1.0f + ivl_dot(u, u));
    return (ivl_quat_t){u.x * k, u.y * k, u.z * k, k};
}

static void test_wrench_is_that_of_the_law_in_double_precision(void)
{
    rng_t rng = {6};
    cfg.motor_thrust_N_max = 1.0f;  // no limit on lift
    for (int i = 0; i < 10000; i++)
    {
        sample.q_WB = rng_near_level(&rng);
        sample.p_WB_m = rng_vec3(&rng, 0.05f);
        sample.v_WB_mps = rng_vec3(&rng, 0.1f);
        sample.w_B_radps = rng_vec3(&rng, 20.0f);
        ref.p_W_m = rng_vec3(&rng, 0.05f);
        ref.v_W_mps = rng_vec3(&rng, 0.1f);
        ref.a_W_mps2 = rng_vec3(&rng, 1.0f);
        double thrust_N, moment_Nm[3];
        oracle(&thrust_N, moment_Nm);
        const ivl_wrench_t got = ivl_controller_compute(&cfg, &sample, &ref, 1.0e6f);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, thrust_N > 0.0 ? thrust_N : 0.0, (double)got.thrust_N);
        TEST_ASSERT_DOUBLE_WITHIN(3.0e-8, moment_Nm[0], (double)got.moment_B_Nm.x);
        TEST_ASSERT_DOUBLE_WITHIN(3.0e-8, moment_Nm[1], (double)got.moment_B_Nm.y);
        TEST_ASSERT_DOUBLE_WITHIN(3.0e-8, moment_Nm[2], (double)got.moment_B_Nm.z);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_thrust_is_the_weight_and_moment_zero_when_there_is_no_error);
    RUN_TEST(test_thrust_follows_height_speed_and_feed_forward);
    RUN_TEST(test_nose_goes_down_when_the_target_is_ahead);
    RUN_TEST(test_rolls_left_when_the_target_is_to_the_left);
    RUN_TEST(test_yaw_turns_back_to_heading_zero);
    RUN_TEST(test_rates_are_damped_and_the_gyroscopic_moment_is_cancelled);
    RUN_TEST(test_tilt_is_limited_when_the_target_is_far);
    RUN_TEST(test_lift_stays_between_a_fifth_of_the_weight_and_four_motors);
    RUN_TEST(test_desired_rate_is_bounded_when_the_speed_is_far_off);
    RUN_TEST(test_thrust_is_zero_when_upside_down);
    RUN_TEST(test_wrench_is_that_of_the_law_in_double_precision);
    return UNITY_END();
}
