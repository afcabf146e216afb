/// @file test_sim_sensors.c
/// What the flight core is told: when samples are taken and delivered, how noisy they are, what an accelerometer feels.
#include "sensors_fixture.h"

static const double        A_NONE[3] = {0.0, 0.0, 0.0};
static const ivl_sim_rng_t RNG = {5, 6};

static ivl_in_t read_at(const ivl_sim_model_t *model, double t)
{
    const ivl_sim_kin_t kin = accelerated(0.0, t);
    ivl_in_t            in = {.t_us = 0};
    look(model, &RNG, &kin, A_MOVING, t, &in);
    return in;
}

static ivl_sim_model_t model_with(double rate_hz, double latency_s, double phase_random)
{
    ivl_sim_params_t params = fixture_params();
    params.sense_pose_rate_hz = rate_hz;
    params.sense_latency_s = latency_s;
    params.sense_phase_random_norm = phase_random;
    return fixture_model(&params);
}

static void begin(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng)
{
    const ivl_sim_kin_t kin = accelerated(0.0, 0.0);
    ivl_sim_sensors_init(model, rng, &kin, &sensors);
}

/// Sampling instants in seconds since the start, from the core's clock, which starts at 1 s.
static double pose_time(const ivl_in_t *in)
{
    return (double)in->t_pose_us * 1.0e-6 - 1.0;
}

static void test_samples_come_at_the_stated_rate_and_are_held_in_between(void)
{
    const double rates[] = {50.0, 100.0, 120.0, 500.0};
    for (int k = 0; k < 4; k++)
    {
        const ivl_sim_model_t model = model_with(rates[k], 0.0, 1.0);
        begin(&model, &RNG);
        double last = pose_time(&(ivl_in_t){.t_pose_us = 0});
        int    fresh = 0;
        for (int tick = 0; tick < 1000; tick++)
        {
            const double   t = 0.002 * tick;
            const ivl_in_t in = read_at(&model, t);
            const double   sampled = pose_time(&in), age = t - sampled;
            // never older than a period, never from the future
            TEST_ASSERT_TRUE(age > -1.0e-6 && age < 1.0 / rates[k] + 1.0e-6);
            fresh += (sampled > last + 1.0e-6) ? 1 : 0;
            last = sampled;
            TEST_ASSERT_FLOAT_WITHIN(2.0e-6f, (float)sampled, in.p_WB_m.x);  // x = t: the sample is that of its own instant
            TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, (float)(2.0 + 3.0 * fmax(sampled, 0.0)), in.v_WB_mps.z);
        }
        TEST_ASSERT_INT_WITHIN(2, (int)(2.0 * rates[k]), fresh);
    }
}

static void test_a_sample_due_at_a_tick_is_taken_and_delivered_at_that_tick(void)
{
    const double latencies[] = {0.0, 0.004, 0.01};
    for (int k = 0; k < 3; k++)
    {
        const ivl_sim_model_t model = model_with(500.0, latencies[k], 0.0);
        begin(&model, &RNG);
        for (int tick = 0; tick < 2000; tick++)
        {
            const ivl_in_t in = read_at(&model, 0.002 * tick);
            TEST_ASSERT_DOUBLE_WITHIN(1.1e-6, 0.002 * tick - latencies[k], pose_time(&in));
        }
    }
}

static void test_samples_between_ticks_are_exact_for_constant_acceleration(void)
{
    const ivl_sim_model_t model = model_with(120.0, 0.0, 1.0);
    begin(&model, &RNG);
    for (int tick = 0; tick < 500; tick++)
    {
        const ivl_in_t in = read_at(&model, 0.002 * tick);
        const double   s = pose_time(&in);
        if (s > 0.0)
        {
            TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, (float)(2.0 * s + 1.5 * s * s), in.p_WB_m.z);
            TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, (float)(2.0 + 3.0 * s), in.v_WB_mps.z);
        }
    }
}

static void test_latency_delays_delivery_by_that_much(void)
{
    const double latencies[] = {0.0, 0.004, 0.01, 0.013, 0.1};
    for (int k = 0; k < 5; k++)
    {
        const ivl_sim_model_t model = model_with(100.0, latencies[k], 1.0);
        begin(&model, &RNG);
        double least = 1.0, most = 0.0;
        for (int tick = 0; tick < 2000; tick++)
        {
            const ivl_in_t in = read_at(&model, 0.002 * tick);
            const double   age = 0.002 * tick - pose_time(&in);
            least = fmin(least, age);
            most = fmax(most, age);
        }
        // a sample is used from its delivery, at the next tick, until the next one is delivered
        TEST_ASSERT_TRUE(least >= latencies[k] - 1.0e-6 && least < latencies[k] + 0.002);
        TEST_ASSERT_TRUE(most < latencies[k] + 0.01 + 1.0e-6 && most > latencies[k] + 0.007);
    }
}

static void test_a_sample_is_there_from_the_first_tick_on(void)
{
    for (uint64_t stream = 0; stream < 300; stream++)
    {
        const ivl_sim_model_t model = model_with(10.0 + (double)stream, 0.1, 1.0);
        const ivl_sim_rng_t   rng = {1, stream};
        begin(&model, &rng);
        const ivl_in_t in = read_at(&model, 0.0);
        TEST_ASSERT_TRUE(pose_time(&in) <= -0.1 + 1.0e-6 && pose_time(&in) > -0.1 - 1.0 / (10.0 + (double)stream) - 1.0e-6);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 2.0f, in.v_WB_mps.z);  // it has moved at its present velocity
        TEST_ASSERT_FLOAT_WITHIN(2.0e-5f, (float)(2.0 * pose_time(&in)), in.p_WB_m.z);
    }
}

static void test_phase_of_the_sensor_s_clock_is_uniform_when_random_and_zero_when_not(void)
{
    const ivl_sim_model_t random = model_with(100.0, 0.0, 1.0), fixed = model_with(100.0, 0.0, 0.0);
    double                sum = 0.0, square = 0.0;
    const int             n = 4000;
    for (int i = 0; i < n; i++)
    {
        const ivl_sim_rng_t rng = {2, (uint64_t)i};
        begin(&random, &rng);
        const double phase = sensors.next_s / 0.01;  // the first sample after the start
        TEST_ASSERT_TRUE(phase > 0.0 && phase < 1.0 + 1.0e-6);
        sum += phase;
        square += phase * phase;
        begin(&fixed, &rng);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.01, sensors.next_s);
    }
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(1.0 / 12.0 / n), 0.5, sum / n);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sqrt(4.0 / 45.0 / n), 1.0 / 3.0, square / n);
}

// ---- noise ------------------------------------------------------------------------------------------------------------

typedef struct
{
    double sum, square;
    int    n;
} statistics_t;

static void note(statistics_t *s, double error)
{
    s->sum += error;
    s->square += error * error;
    s->n++;
}

static void check_noise(const statistics_t *s, double sigma)
{
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sigma / sqrt(s->n), 0.0, s->sum / s->n);
    TEST_ASSERT_DOUBLE_WITHIN(5.0 * sigma / sqrt(2.0 * s->n), sigma, sqrt(s->square / s->n));
}

static void test_noise_has_the_stated_deviation_on_every_reading(void)
{
    ivl_sim_params_t params = fixture_params();
    params.sense_pose_rate_hz = 500.0;
    params.sense_position_noise_m = 0.01;
    params.sense_velocity_noise_mps = 0.05;
    params.sense_attitude_noise_rad = 0.02;
    params.sense_gyro_noise_radps = 0.1;
    params.sense_accel_noise_mps2 = 0.5;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = {.p_WB_m = {1.0, 2.0, 3.0}, .v_WB_mps = {0.5, -0.5, 1.0}, .w_B_radps = {1.0, -2.0, 3.0}};
    statistics_t          p = {0.0, 0.0, 0}, v = p, attitude = p, gyro = p, accel = p;
    draws_t               draws = {4};
    draw_quat(&draws, kin.q_WB);
    const ivl_rot_t R = ivl_rot_from_quat(kin.q_WB);
    const ivl_d3_t  g_B = ivl_rot_apply_inverse(&R, ivl_d3(0.0, 0.0, 9.81));
    ivl_sim_sensors_init(&model, &RNG, &kin, &sensors);
    for (int tick = 0; tick < 10000; tick++)
    {
        ivl_in_t in = {.t_us = 0};
        look(&model, &RNG, &kin, A_NONE, 0.002 * tick, &in);
        // the position of a sample is that of its instant: the present one less the motion since
        const double age = 0.002 * tick - pose_time(&in);
        note(&p, (double)in.p_WB_m.y - (2.0 + 0.5 * age));
        note(&v, (double)in.v_WB_mps.z - 1.0);
        note(&gyro, (double)in.w_B_radps.x - 1.0);
        note(&gyro, (double)in.w_B_radps.z - 3.0);
        note(&accel, (double)in.f_B_mps2.y - g_B.y);
        // the error of attitude is a rotation about body axes: 2 vec(q* q')
        const double *q = kin.q_WB, s[4] = {(double)in.q_WB.x, (double)in.q_WB.y, (double)in.q_WB.z, (double)in.q_WB.w};
        note(&attitude, 2.0 * (q[3] * s[0] - q[0] * s[3] - q[1] * s[2] + q[2] * s[1]));
        note(&attitude, 2.0 * (q[3] * s[2] - q[2] * s[3] - q[0] * s[1] + q[1] * s[0]));
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, 1.0, s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]);
    }
    check_noise(&p, 0.01);
    check_noise(&v, 0.05);
    check_noise(&attitude, 0.02);
    check_noise(&gyro, 0.1);
    check_noise(&accel, 0.5);
}

static void test_readings_are_the_truth_when_there_is_no_noise(void)
{
    const ivl_sim_model_t model = model_with(500.0, 0.0, 0.0);
    ivl_sim_kin_t         kin = {.p_WB_m = {1.0, 2.0, 3.0}, .w_B_radps = {1.0, -2.0, 3.0}};
    draws_t               draws = {9};
    ivl_in_t              in = {.t_us = 0};
    draw_quat(&draws, kin.q_WB);
    ivl_sim_sensors_init(&model, &RNG, &kin, &sensors);
    look(&model, &RNG, &kin, A_NONE, 0.0, &in);
    TEST_ASSERT_EQUAL_FLOAT((float)kin.q_WB[0], in.q_WB.x);
    TEST_ASSERT_EQUAL_FLOAT((float)kin.q_WB[3], in.q_WB.w);
    TEST_ASSERT_EQUAL_FLOAT(-2.0f, in.w_B_radps.y);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, in.p_WB_m.y);
    TEST_ASSERT_EQUAL_UINT64(1000000u, in.t_us);
}

static void test_readings_clip_at_full_scale(void)
{
    ivl_sim_params_t params = fixture_params();
    params.sense_gyro_max_radps = 34.9;
    params.sense_accel_max_mps2 = 15.0;
    const ivl_sim_model_t model = fixture_model(&params);
    ivl_sim_kin_t         kin = {.w_B_radps = {50.0, -50.0, 34.0}, .q_WB = {0.0, 0.0, 0.0, 1.0}};
    ivl_in_t              in = {.t_us = 0};
    ivl_sim_sensors_init(&model, &RNG, &kin, &sensors);
    look(&model, &RNG, &kin, A_NONE, 0.0, &in);
    kin.v_WB_mps[0] = -1.0;  // within one tick: 500 m/s^2
    look(&model, &RNG, &kin, A_NONE, 0.002, &in);
    TEST_ASSERT_EQUAL_FLOAT(34.9f, in.w_B_radps.x);
    TEST_ASSERT_EQUAL_FLOAT(-34.9f, in.w_B_radps.y);
    TEST_ASSERT_EQUAL_FLOAT(34.0f, in.w_B_radps.z);
    TEST_ASSERT_EQUAL_FLOAT(-15.0f, in.f_B_mps2.x);
    TEST_ASSERT_EQUAL_FLOAT(9.81f, in.f_B_mps2.z);
}

// ---- accelerometer ------------------------------------------------------------------------------------------------------

static ivl_in_t feel(const double q[4], const double dv_mps[3])
{
    const ivl_sim_model_t model = model_with(100.0, 0.0, 0.0);
    ivl_sim_kin_t         kin = {.p_WB_m = {0.0, 0.0, 1.0}};
    ivl_in_t              in = {.t_us = 0};
    memcpy(kin.q_WB, q, sizeof kin.q_WB);
    ivl_sim_sensors_init(&model, &RNG, &kin, &sensors);
    look(&model, &RNG, &kin, A_NONE, 0.0, &in);
    memcpy(kin.v_WB_mps, dv_mps, sizeof kin.v_WB_mps);
    look(&model, &RNG, &kin, A_NONE, 0.002, &in);
    return in;
}

static void test_accelerometer_feels_g_upwards_hovering_reversed_hanging_and_nothing_falling(void)
{
    const double level[4] = {0.0, 0.0, 0.0, 1.0}, inverted[4] = {0.0, 1.0, 0.0, 0.0}, still[3] = {0.0, 0.0, 0.0};
    const double falling[3] = {0.0, 0.0, -9.81 * 0.002};
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 9.81f, feel(level, still).f_B_mps2.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -9.81f, feel(inverted, still).f_B_mps2.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 0.0f, feel(level, falling).f_B_mps2.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 0.0f, feel(inverted, falling).f_B_mps2.z);
}

static void test_accelerometer_feels_a_blow_between_two_ticks(void)
{
    const double level[4] = {0.0, 0.0, 0.0, 1.0}, blow[3] = {-0.1, 0.0, 0.0};
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, -50.0f, feel(level, blow).f_B_mps2.x);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_samples_come_at_the_stated_rate_and_are_held_in_between);
    RUN_TEST(test_a_sample_due_at_a_tick_is_taken_and_delivered_at_that_tick);
    RUN_TEST(test_samples_between_ticks_are_exact_for_constant_acceleration);
    RUN_TEST(test_latency_delays_delivery_by_that_much);
    RUN_TEST(test_a_sample_is_there_from_the_first_tick_on);
    RUN_TEST(test_phase_of_the_sensor_s_clock_is_uniform_when_random_and_zero_when_not);
    RUN_TEST(test_noise_has_the_stated_deviation_on_every_reading);
    RUN_TEST(test_readings_are_the_truth_when_there_is_no_noise);
    RUN_TEST(test_readings_clip_at_full_scale);
    RUN_TEST(test_accelerometer_feels_g_upwards_hovering_reversed_hanging_and_nothing_falling);
    RUN_TEST(test_accelerometer_feels_a_blow_between_two_ticks);
    return UNITY_END();
}
