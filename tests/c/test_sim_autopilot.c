/// @file test_sim_autopilot.c
/// Between the world and the core: units of the SDK, positions that stand still, the attitude in a flip, whole millimetres, shares of thrust.
#include <string.h>

#include "app_convert.h"
#include "sim_autopilot.h"
#include "sim_fixture.h"

static ivl_sim_told_t told;
static sensorData_t   sensors;
static state_t        state;

static ivl_in_t sensed_at(uint64_t t_us)
{
    return (ivl_in_t){.t_us = t_us,
                      .t_pose_us = t_us,
                      .p_WB_m = {1.0f, -2.0f, 0.5f},
                      .v_WB_mps = {0.1f, 0.2f, 0.3f},
                      .q_WB = {0.0f, 0.6f, 0.0f, 0.8f},
                      .w_B_radps = {3.14159265f, -1.57079633f, 6.2831853f},
                      .f_B_mps2 = {9.80665f, -19.6133f, 4.903325f}};
}

// ---- units

static void test_the_sdk_has_degrees_and_g_and_the_app_gives_the_number_back(void)
{
    const ivl_in_t in = sensed_at(1000000u);
    ivl_sim_sdk_of(&told, &in, &sensors, &state);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 180.0f, sensors.gyro.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, -90.0f, sensors.gyro.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 360.0f, sensors.gyro.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, sensors.acc.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -2.0f, sensors.acc.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, sensors.acc.z);
    const ivl_vec3_t p = app_p_W_m(&state), v = app_v_W_mps(&state);
    const ivl_quat_t q = app_q_WB(&state);
    TEST_ASSERT_EQUAL_MEMORY(&in.p_WB_m, &p, sizeof p);
    TEST_ASSERT_EQUAL_MEMORY(&in.v_WB_mps, &v, sizeof v);
    TEST_ASSERT_EQUAL_MEMORY(&in.q_WB, &q, sizeof q);
}

static void test_units_cost_one_bit_at_most(void)
{
    draws_t draws = {3};
    for (int i = 0; i < 20000; i++)
    {
        ivl_in_t in = sensed_at(1000000u);
        in.w_B_radps.y = (float)draw(&draws, -40.0, 40.0);
        in.f_B_mps2.z = (float)draw(&draws, -200.0, 200.0);
        ivl_sim_sdk_of(&told, &in, &sensors, &state);
        TEST_ASSERT_FLOAT_WITHIN(2.4e-7f * fabsf(in.w_B_radps.y), in.w_B_radps.y, app_w_B_radps(&sensors).y);
        TEST_ASSERT_FLOAT_WITHIN(2.4e-7f * fabsf(in.f_B_mps2.z), in.f_B_mps2.z, app_f_B_mps2(&sensors).z);
    }
}

static void test_a_range_is_whole_millimetres(void)
{
    const ivl_reading_t none = {.t_us = 0u}, some = {.t_us = 1u, .value = 1.2346f, .valid = 1u};
    const ivl_reading_t lost = {.t_us = 1u, .value = 1.0f}, far = {.t_us = 1u, .value = 40.0f, .valid = 1u};
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, ivl_sim_sdk_range_mm(&none));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 1235.0f, ivl_sim_sdk_range_mm(&some));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 32767.0f, ivl_sim_sdk_range_mm(&lost));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 32767.0f, ivl_sim_sdk_range_mm(&far));
}

static void test_motors_take_a_share_between_none_and_all(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, 0.09f, ivl_sim_motor_N(&model, 0.5f, 0.18f, 0.0f));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.18f, ivl_sim_motor_N(&model, 1.5f, 0.18f, 0.0f));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, ivl_sim_motor_N(&model, -0.1f, 0.18f, 0.0f));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 1.0e-6f, ivl_sim_motor_N(&model, 1.0e-6f, 1.0f, 0.0f));
}

static void test_what_is_below_the_least_thrust_is_none_or_idle(void)
{
    ivl_sim_params_t params = fixture_params();
    params.rotor_thrust_least_N = 0.02;
    const ivl_sim_model_t model = fixture_model(&params);
    const float           asked_N[] = {-0.1f, 0.0f, 1.0e-6f, 0.0199f, 0.0201f, 0.1f, 0.3f};
    const float           made_N[] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0201f, 0.1f, 0.2f};
    for (size_t i = 0; i < sizeof asked_N / sizeof asked_N[0]; i++)
    {
        TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, made_N[i], ivl_sim_motor_N(&model, asked_N[i] / 0.2f, 0.2f, 0.0f));
        const float idle_N = (made_N[i] < 0.004f) ? 0.004f : made_N[i];
        TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, idle_N, ivl_sim_motor_N(&model, asked_N[i] / 0.2f, 0.2f, 0.004f));
    }
}

// ---- a position that stands still

static float told_x(const ivl_in_t *in)
{
    ivl_sim_sdk_of(&told, in, &sensors, &state);
    return state.position.x;
}

static void test_only_a_new_sample_of_a_position_that_stands_still_is_told_as_another_one(void)
{
    const float xs_m[] = {0.0f, 1.0e-3f, 1.0f, -1.0f, 123.456f, -2.5e-9f};
    for (size_t i = 0; i < sizeof xs_m / sizeof xs_m[0]; i++)
    {
        told = (ivl_sim_told_t){.t_pose_us = 0u};
        ivl_in_t in = sensed_at(1000000u);
        in.p_WB_m.x = xs_m[i];
        float last_m = told_x(&in);
        TEST_ASSERT_EQUAL_MEMORY(&xs_m[i], &last_m, sizeof last_m);
        for (int n = 0; n < 6; n++)
        {
            in.t_us += 2000u;
            const float same_m = told_x(&in);
            TEST_ASSERT_EQUAL_MEMORY(&last_m, &same_m, sizeof same_m);
            in.t_pose_us = in.t_us;
            const float other_m = told_x(&in);
            TEST_ASSERT_TRUE(memcmp(&last_m, &other_m, sizeof other_m) != 0);
            TEST_ASSERT_FLOAT_WITHIN(1.1e-9f + 2.5e-7f * fabsf(xs_m[i]), xs_m[i], other_m);
            last_m = other_m;
        }
    }
}

// ---- a tick of the core

static ivl_in_t seen;

static void *open_port(void *context)
{
    return context;
}

static void close_port(void *port)
{
    (void)port;
}

/// A core that only writes down what it is told, and asks for four different thrusts.
static void look(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *firmware, const ivl_in_t *in, ivl_out_t *out)
{
    (void)port, (void)lane, (void)cfg, (void)firmware;
    const float asked_N[4] = {-1.0f, 0.0f, 0.05f, 100.0f};
    seen = *in;
    memcpy(out->thrust_N, asked_N, sizeof asked_N);
}

static ivl_sim_autopilot_t autopilot;
static ivl_state_t         firmware;
static ivl_out_t           out;

static double idle_N;  // of the model in these tests

static void tick(const ivl_in_t *in, double tick_hz)
{
    ivl_sim_params_t params = fixture_params();
    params.rotor_thrust_idle_N = idle_N;
    ivl_sim_model_t model = fixture_model(&params);
    model.core = (ivl_sim_core_t){.open = open_port, .close = close_port, .step = look};
    model.tick_s = 1.0 / tick_hz;
    ivl_reference_t ref;
    TEST_ASSERT_FALSE(ivl_sim_autopilot_decide(&model, NULL, 0, in, &autopilot, &firmware, &out, &ref));
    ivl_sim_autopilot_drive(&model, &out);
}

static void test_the_core_sees_the_command_and_a_position_dated_by_its_last_change(void)
{
    ivl_in_t in = sensed_at(1000000u);
    in.t_pose_us = 990000u;  // a sample that was 10 ms under way
    in.cmd.request = IVL_REQUEST_HOVER;
    in.rrev = (ivl_reading_t){.t_us = 5u, .value = 3.0f, .valid = 1u};
    in.flow = (ivl_reading_t){.t_us = 6u, .value = 4.0f, .valid = 1u};
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_INT(IVL_REQUEST_HOVER, seen.cmd.request);
    TEST_ASSERT_EQUAL_MEMORY(&in.rrev, &seen.rrev, sizeof in.rrev);
    TEST_ASSERT_EQUAL_MEMORY(&in.flow, &seen.flow, sizeof in.flow);
    TEST_ASSERT_EQUAL_UINT64(1000000u, seen.t_us);
    TEST_ASSERT_EQUAL_UINT64(1000000u, seen.t_pose_us);
    // held: it grows old
    in.t_us = 1010000u;
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1010000u, seen.t_us);
    TEST_ASSERT_EQUAL_UINT64(1000000u, seen.t_pose_us);
    // a new sample, even of the same place
    in.t_pose_us = 1005000u;
    in.t_us = 1012000u;
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1012000u, seen.t_pose_us);
}

static void test_a_range_is_a_new_reading_when_its_millimetres_change(void)
{
    ivl_in_t in = sensed_at(1000000u);
    in.range = (ivl_reading_t){.t_us = 999000u, .value = 1.0001f, .valid = 1u};
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1000000u, seen.range.t_us);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 1.0f, seen.range.value);
    in.t_us = 1002000u;
    in.range.t_us = 1001000u;
    in.range.value = 1.0004f;
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1000000u, seen.range.t_us);
    in.t_us = 1004000u;
    in.range.value = 1.0006f;
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1004000u, seen.range.t_us);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.001f, seen.range.value);
    in.t_us = 1006000u;
    in.range.value = 0.5f;
    tick(&in, 500.0);
    TEST_ASSERT_EQUAL_UINT64(1006000u, seen.range.t_us);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, seen.range.value);
}

static void test_motor_thrusts_are_those_of_the_motors(void)
{
    const ivl_in_t in = sensed_at(1000000u);
    tick(&in, 500.0);
    const ivl_sim_params_t params = fixture_params();
    const float            most_N = fixture_model(&params).firmware.motor_thrust_N_max;
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, out.thrust_N[0]);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, out.thrust_N[1]);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, 0.05f, out.thrust_N[2]);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, most_N, out.thrust_N[3]);
}

static void test_motors_idle_unless_the_core_stops_them(void)
{
    const ivl_in_t in = sensed_at(1000000u);
    idle_N = 0.004;
    for (int phase = 0; phase < IVL_PHASE_COUNT; phase++)
    {
        for (int bits = 0; bits < 4; bits++)
        {
            out = (ivl_out_t){.phase = (ivl_phase_t)phase, .motors_on = (bits & 1) != 0, .stock_allowed = (bits & 2) != 0};
            const bool idles = out.stock_allowed || (out.motors_on && phase != IVL_PHASE_FLIP);
            tick(&in, 500.0);
            TEST_ASSERT_FLOAT_WITHIN(0.0f, idles ? 0.004f : 0.0f, out.thrust_N[0]);
            TEST_ASSERT_FLOAT_WITHIN(0.0f, idles ? 0.004f : 0.0f, out.thrust_N[1]);
            TEST_ASSERT_FLOAT_WITHIN(1.0e-8f, 0.05f, out.thrust_N[2]);
        }
    }
    idle_N = 0.0;
}

/// Pitch of what the core saw, nose down.
static float pitch_rad(void)
{
    return 2.0f * atan2f(seen.q_WB.y, seen.q_WB.w);
}

static void test_in_a_flip_the_attitude_is_the_gyro_s_at_every_rate_of_the_core(void)
{
    const double rates_hz[] = {1000.0, 500.0, 250.0};
    for (int i = 0; i < 3; i++)
    {
        autopilot = (ivl_sim_autopilot_t){.told = {.t_pose_us = 0u}};
        ivl_in_t in = sensed_at(1000000u);
        in.q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
        in.w_B_radps = ivl_vec3(0.0f, -10.0f, 0.0f);
        firmware.phase = IVL_PHASE_APPROACH;
        tick(&in, rates_hz[i]);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.0f, pitch_rad());
        // the estimator says that the vehicle has stopped; the gyro knows better
        firmware.phase = IVL_PHASE_FLIP;
        const int n = (int)(0.1 * rates_hz[i]);
        for (int k = 0; k < n; k++)
        {
            in.q_WB.z = 1.0e-6f * (float)k;
            tick(&in, rates_hz[i]);
        }
        TEST_ASSERT_FLOAT_WITHIN(0.002f, -1.0f, pitch_rad());
        // upright again, the estimator counts
        firmware.phase = IVL_PHASE_ABORTED;
        in.q_WB = (ivl_quat_t){0.0f, 0.6f, 0.0f, 0.8f};
        tick(&in, rates_hz[i]);
        TEST_ASSERT_EQUAL_MEMORY(&in.q_WB, &seen.q_WB, sizeof in.q_WB);
    }
}

void setUp(void)
{
    told = (ivl_sim_told_t){.t_pose_us = 0u};
    memset(&autopilot, 0, sizeof autopilot);
    memset(&firmware, 0, sizeof firmware);
}

void tearDown(void)
{
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_sdk_has_degrees_and_g_and_the_app_gives_the_number_back);
    RUN_TEST(test_units_cost_one_bit_at_most);
    RUN_TEST(test_a_range_is_whole_millimetres);
    RUN_TEST(test_motors_take_a_share_between_none_and_all);
    RUN_TEST(test_what_is_below_the_least_thrust_is_none_or_idle);
    RUN_TEST(test_only_a_new_sample_of_a_position_that_stands_still_is_told_as_another_one);
    RUN_TEST(test_the_core_sees_the_command_and_a_position_dated_by_its_last_change);
    RUN_TEST(test_a_range_is_a_new_reading_when_its_millimetres_change);
    RUN_TEST(test_motor_thrusts_are_those_of_the_motors);
    RUN_TEST(test_motors_idle_unless_the_core_stops_them);
    RUN_TEST(test_in_a_flip_the_attitude_is_the_gyro_s_at_every_rate_of_the_core);
    return UNITY_END();
}
