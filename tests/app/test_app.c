/// @file test_app.c
/// The Crazyflie app on a stand-in for the SDK: conversion, staged parameters, change of the controller, packets, recorder, its task.
#include <math.h>
#include <string.h>

#include "app.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "controller.h"
#include "ivl_cfg_name.h"
#include "policy_fixture.h"
#include "sdk_double.h"
#include "unity.h"

#define HOVER_THRUST (65535.0f * 0.0325f * 9.81f / (4.0f * 0.18f))

// ---- helpers

static void run_task(int n_loops)
{
    sdk.n_receive_left = n_loops;
    if (setjmp(sdk.leave) == 0)
    {
        appMain();
    }
}

static void start(void)
{
    // what a reboot does: the app's memory is zero, but its memory handler stays registered in this process
    static const MemoryHandlerDef_t *memory;
    memset(&ivl_app, 0, sizeof ivl_app);
    sdk_double_reset();
    controllerOutOfTreeInit();
    memory = (sdk.memory != NULL) ? sdk.memory : memory;
    sdk.memory = memory;
    sdk_double_run(20);
    run_task(2);
}

static const sdk_packet_t *last_sent(void)
{
    TEST_ASSERT_TRUE(sdk.n_sent > 0);
    return &sdk.sent[sdk.n_sent - 1];
}

static ivl_wire_config_echo_t commit(uint32_t seq)
{
    sdk_double_write_u32("commit", seq);
    sdk_double_run(5);
    run_task(1);
    ivl_wire_config_echo_t echo = {0};
    TEST_ASSERT_TRUE(ivl_wire_get_config_echo(last_sent()->bytes, last_sent()->size, &echo));
    TEST_ASSERT_EQUAL_UINT32(seq, echo.seq);
    return echo;
}

/// What the app's task does with a packet until it is in force or cannot be.
static void handle(const uint8_t *bytes, size_t size)
{
    app_packets_handle(&ivl_app, bytes, size);
    while (app_packets_waiting(&ivl_app))
    {
        sdk_double_run(1);
        app_packets_poll(&ivl_app);
    }
}

static ivl_wire_policy_echo_t send_part(const ivl_wire_policy_t *packet)
{
    uint8_t bytes[IVL_WIRE_SIZE_MAX];
    handle(bytes, ivl_wire_put_policy(bytes, packet));
    ivl_wire_policy_echo_t echo = {0};
    TEST_ASSERT_TRUE(ivl_wire_get_policy_echo(last_sent()->bytes, last_sent()->size, &echo));
    TEST_ASSERT_EQUAL_UINT32(packet->seq, echo.seq);
    // only a policy of several parts lacks any
    TEST_ASSERT_TRUE((packet->n > IVL_WIRE_THETAS) || (echo.missing == 0u));
    return echo;
}

static ivl_wire_policy_echo_t send_policy(uint32_t seq, float rrev, float moment)
{
    const ivl_wire_policy_t packet = constant_packet(seq, rrev, moment);
    return send_part(&packet);
}

static ivl_wire_command_echo_t send_command(ivl_request_t request)
{
    static uint16_t          seq;
    const ivl_wire_command_t packet = {++seq, (uint8_t)request, 0.0f, 0.0f, 1.0f, 2.5f, 1.2f};
    uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
    sdk.n_sent = 0;
    handle(bytes, ivl_wire_put_command(bytes, &packet));
    ivl_wire_command_echo_t echo = {0};
    TEST_ASSERT_TRUE(ivl_wire_get_command_echo(last_sent()->bytes, last_sent()->size, &echo));
    TEST_ASSERT_EQUAL_UINT16(seq, echo.seq);
    return echo;
}

static void heartbeat(ivl_request_t request, int ms)
{
    for (int t = 0; t < ms; t += 50)
    {
        (void)send_command(request);
        sdk_double_run(47);
    }
}

static void assert_phase(ivl_phase_t expected)
{
    TEST_ASSERT_EQUAL_STRING(ivl_phase_name(expected), ivl_phase_name(ivl_app.out.phase));
}

/// In flight with the stock controller, configured, with a policy.
static void start_in_flight(void)
{
    start();
    sdk.pid_thrust = 1.05f * HOVER_THRUST;
    sdk.setpoint.mode.z = modeAbs;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit(1).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(11, 4.0f, 0.008f).status);
}

static void start_ready(void)
{
    start_in_flight();
    (void)send_command(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY);
}

/// The controller triggers, turns over and coasts.
static void flip(void)
{
    heartbeat(IVL_REQUEST_APPROACH, 100);
    assert_phase(IVL_PHASE_APPROACH);
    sdk.state.position.z = 1.6f;
    sdk.state.velocity.z = 2.5f;
    sdk_double_run(4);
    assert_phase(IVL_PHASE_FLIP);
}

static float sum_of_forces(void)
{
    TEST_ASSERT_EQUAL_INT(controlModeForce, sdk.control.controlMode);
    float sum = 0.0f;
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_TRUE((sdk.control.normalizedForces[i] >= 0.0f) && (sdk.control.normalizedForces[i] <= 1.0f));
        sum += sdk.control.normalizedForces[i];
    }
    return sum;
}

// ---- conversion

static void test_units_and_frames_are_converted(void)
{
    const sensorData_t sensors = {.acc = {1.0f, -2.0f, 0.5f}, .gyro = {180.0f, 90.0f, -360.0f}};
    const ivl_vec3_t   w = app_w_B_radps(&sensors), f = app_f_B_mps2(&sensors);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 3.14159265f, w.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 1.57079633f, w.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -6.2831853f, w.z);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 9.80665f, f.x);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, -19.6133f, f.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, 4.903325f, f.z);
    const state_t state = {
        .attitudeQuaternion = {0.1f, 0.2f, 0.3f, 0.9f}, .position = {7, 1.0f, 2.0f, 3.0f}, .velocity = {7, 4.0f, 5.0f, 6.0f}};
    const ivl_quat_t q = app_q_WB(&state), q_expected = {0.1f, 0.2f, 0.3f, 0.9f};
    const ivl_vec3_t p = app_p_W_m(&state), p_expected = {1.0f, 2.0f, 3.0f};
    const ivl_vec3_t v = app_v_W_mps(&state), v_expected = {4.0f, 5.0f, 6.0f};
    TEST_ASSERT_EQUAL_MEMORY(&q_expected, &q, sizeof q);
    TEST_ASSERT_EQUAL_MEMORY(&p_expected, &p, sizeof p);
    TEST_ASSERT_EQUAL_MEMORY(&v_expected, &v, sizeof v);
}

static void test_positive_gyro_y_and_positive_core_moment_both_push_the_nose_down(void)
{
    // the SDK's Euler pitch has the other sign; the quaternion of a nose that is down has a positive y
    start_in_flight();
    sdk.sensors.gyro.y = 100.0f;
    for (int i = 0; i < 9; i++)
    {
        sdk_double_run(1);
    }
    TEST_ASSERT_TRUE(ivl_app.senses.attitude.q_WB.y > 0.005f);
    // a rate sensed nose down makes a moment nose up: the front pair pushes harder
    (void)send_command(IVL_REQUEST_HOVER);
    sdk_double_run(10);
    TEST_ASSERT_TRUE(ivl_app.out.pitch_moment_Nm < -1.0e-4f);
    TEST_ASSERT_TRUE(sdk.control.normalizedForces[0] > sdk.control.normalizedForces[1]);
    TEST_ASSERT_TRUE(sdk.control.normalizedForces[3] > sdk.control.normalizedForces[2]);
}

static void test_thrust_is_a_share_of_the_largest(void)
{
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, app_norm_of_N(0.09f));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.5f, app_norm_of_stock(32767.5f));
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 65535.0f, app_stock_of_norm(1.2f));
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, app_stock_of_norm(NAN));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.3f, app_sigma_m(0.01f, 0.09f, 0.04f));
    TEST_ASSERT_TRUE(isnan(app_sigma_m(NAN, 0.0f, 0.0f)) && isnan(app_sigma_m(0.0f, 0.0f, NAN)));
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.5f, app_s_between(1000u, 1501000u));
    TEST_ASSERT_TRUE(app_s_between(2000u, 1000u) > 100.0f);
}

// ---- configuration

static void test_defaults_are_good_and_know_the_airframe(void)
{
    start();
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(&ivl_app.cfg));
    TEST_ASSERT_TRUE(controllerOutOfTreeTest());
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.18f, ivl_app.cfg.motor_thrust_N_max);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-4f, 0.0325f, ivl_app.cfg.arm_x_m);
}

static void test_every_parameter_of_the_table_can_be_written_and_none_is_flown_before_the_commit(void)
{
    start();
    const ivl_cfg_t before = ivl_app.cfg;
    sdk_double_write_float("h_ceil", 3.0f);
    sdk_double_write_float("mass", 0.04f);
    sdk_double_run(50);
    TEST_ASSERT_EQUAL_MEMORY(&before, &ivl_app.cfg, sizeof before);
    const ivl_wire_config_echo_t echo = commit(77);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, echo.status);
    TEST_ASSERT_EQUAL_UINT8(255, echo.bad);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 3.0f, ivl_app.cfg.h_ceil_m);
    TEST_ASSERT_EQUAL_HEX32(ivl_cfg_crc(&ivl_app.cfg), echo.crc);
    TEST_ASSERT_TRUE(sdk_double_read_log("cfg_seq") == 77.0);
    TEST_ASSERT_TRUE(sdk_double_read_log("cfg_crc") == (double)echo.crc);
    int n = 0;
    for (const struct param_s *p = sdk_params_ivl; p->type != (PARAM_GROUP | PARAM_STOP); p++, n++)
    {
        TEST_ASSERT_TRUE(strlen(p->name) + strlen("ivl") <= 24u);
    }
    while (ivl_cfg_name(n - 2) == NULL)
    {
        n--;
    }
    TEST_ASSERT_EQUAL_STRING("pwm_max", ivl_cfg_name(n - 2));
}

static void test_value_out_of_range_or_no_number_is_refused_named_and_taken_back(void)
{
    const float bad[] = {NAN, INFINITY, -1.0f, 1.0e6f};
    for (int i = 0; i < 4; i++)
    {
        start();
        sdk_double_write_float("h_ceil", 3.0f);
        sdk_double_write_float("kp_pos_z", bad[i]);
        const ivl_wire_config_echo_t echo = commit(5);
        TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_RANGE, echo.status);
        TEST_ASSERT_EQUAL_STRING("kp_pos_z", ivl_cfg_name(echo.bad));
        TEST_ASSERT_NOT_NULL(strstr(sdk.printed, "refused"));
        // nothing of it is in force, not even the good half
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 2.1f, ivl_app.cfg.h_ceil_m);
        TEST_ASSERT_TRUE(fabs(sdk_double_read_param("h_ceil") - 2.1) < 1.0e-6);
        // clients are told of both
        TEST_ASSERT_EQUAL_INT(2, sdk.n_told);
        TEST_ASSERT_FALSE(ivl_app.configured);
    }
}

static void test_platform_refuses_a_rate_it_does_not_have_and_a_thrust_it_cannot_make(void)
{
    start();
    sdk_double_write_float("tick_hz", 400.0f);
    const uint8_t rate = commit(1).bad;
    TEST_ASSERT_EQUAL_STRING("tick_hz", ivl_cfg_name(rate));
    sdk_double_write_float("motor_thrust_max", 0.19f);
    const uint8_t thrust = commit(2).bad;
    TEST_ASSERT_EQUAL_STRING("motor_thrust_max", ivl_cfg_name(thrust));
    // more than another value is needed
    TEST_ASSERT_NOT_NULL(strstr(app_config_remedy(thrust), "make -C firmware"));
    TEST_ASSERT_EQUAL_STRING("", app_config_remedy(rate));
    TEST_ASSERT_EQUAL_STRING("", app_config_remedy((uint8_t)APP_CONFIG_NONE));
    TEST_ASSERT_EQUAL_INT(2, sdk.n_told);
    sdk_double_write_float("tick_hz", 1000.0f);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit(3).status);
    TEST_ASSERT_EQUAL_INT(2, sdk.n_told);
    const uint32_t n = ivl_app.state.diag.n_tick;
    sdk_double_run(100);
    TEST_ASSERT_EQUAL_UINT32(n + 100u, ivl_app.state.diag.n_tick);
}

static void test_core_runs_at_its_rate(void)
{
    start();
    const uint32_t n = ivl_app.state.diag.n_tick;
    sdk_double_run(100);
    TEST_ASSERT_EQUAL_UINT32(n + 50u, ivl_app.state.diag.n_tick);
}

static void test_commit_in_flight_of_the_core_is_refused(void)
{
    start_ready();
    sdk_double_write_float("h_ceil", 3.0f);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_PHASE, commit(9).status);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 2.1f, ivl_app.cfg.h_ceil_m);
    assert_phase(IVL_PHASE_READY);
}

static void test_commit_is_answered_when_another_controller_is_selected(void)
{
    start();
    sdk.controller_runs = false;
    sdk_double_write_u32("commit", 4);
    run_task(40);
    ivl_wire_config_echo_t echo = {0};
    TEST_ASSERT_TRUE(ivl_wire_get_config_echo(last_sent()->bytes, last_sent()->size, &echo));
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_NO_CONTROLLER, echo.status);
    sdk.controller_runs = true;
    sdk_double_run(20);
    TEST_ASSERT_FALSE(ivl_app.configured);
}

// ---- who flies

static void test_stock_controller_flies_until_the_core_is_asked(void)
{
    start_in_flight();
    const int n = sdk.n_pid;
    sdk_double_run(100);
    TEST_ASSERT_EQUAL_INT(n + 100, sdk.n_pid);
    TEST_ASSERT_EQUAL_INT(controlModeLegacy, sdk.control.controlMode);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, sdk.pid_thrust, sdk.control.thrust);
}

static void test_core_takes_over_and_gives_back_without_a_step(void)
{
    start_in_flight();
    float last = sdk.control.thrust / 65535.0f;
    // stock to core: 5 % less thrust in the end
    sdk_double_run(1);
    ivl_app.command_in.value = (ivl_command_t){.request = IVL_REQUEST_HOVER, .p_hover_W_m = {0.0f, 0.0f, 1.0f}};
    atomic_store(&ivl_app.command_in.full, true);
    for (int i = 0; i < 400; i++)
    {
        sdk_double_run(1);
        const float now = (sdk.control.controlMode == controlModeForce) ? 0.25f * sum_of_forces() : sdk.control.thrust / 65535.0f;
        TEST_ASSERT_FLOAT_WITHIN(2.0e-3f, last, now);
        last = now;
    }
    assert_phase(IVL_PHASE_READY);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, HOVER_THRUST / 65535.0f, last);
    // and back: the stock controller starts anew, with all its loops at once
    const int n_null = sdk.n_pid_null;
    sdk.null_pid_step = 77;
    ivl_app.command_in.value.request = IVL_REQUEST_IDLE;
    atomic_store(&ivl_app.command_in.full, true);
    for (int i = 0; i < 400; i++)
    {
        const bool was_core = sdk.control.controlMode == controlModeForce;
        sdk_double_run(1);
        const bool  is_core = sdk.control.controlMode == controlModeForce;
        const float now = is_core ? 0.25f * sum_of_forces() : sdk.control.thrust / 65535.0f;
        TEST_ASSERT_FLOAT_WITHIN(2.0e-3f, last, now);
        if (was_core && !is_core)
        {
            TEST_ASSERT_EQUAL_UINT32(0, sdk.last_pid_step);
            TEST_ASSERT_EQUAL_UINT32(0, sdk.null_pid_step);
        }
        last = now;
    }
    TEST_ASSERT_EQUAL_INT(n_null + 1, sdk.n_pid_null);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 1.05f * HOVER_THRUST / 65535.0f, last);
}

static void test_planner_is_sent_to_the_vehicle_when_the_core_gives_back(void)
{
    start_ready();
    sdk.state.position.x = 0.7f;
    (void)send_command(IVL_REQUEST_HOVER);
    sdk.high_level_is_stopped = false;
    (void)send_command(IVL_REQUEST_IDLE);
    run_task(1);
    TEST_ASSERT_EQUAL_INT(1, sdk.n_go_to);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.7f, sdk.go_to[0]);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, sdk.go_to[2]);
    run_task(3);
    TEST_ASSERT_EQUAL_INT(1, sdk.n_go_to);
}

static void test_flip_is_as_commanded_from_its_first_tick(void)
{
    start_ready();
    flip();
    const float front = 0.008f / (2.0f * 0.70710678f * 0.046f) / 0.18f;
    const float expected[4] = {front, 0.0f, 0.0f, front};
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_FLOAT_WITHIN(1.0e-5f, expected[i], sdk.control.normalizedForces[i]);
    }
}

static void test_estimator_is_not_followed_in_the_flip(void)
{
    start_ready();
    flip();
    // the estimator says level for ever, and jumps; the gyro says nose up
    sdk.sensors.gyro.y = -1000.0f;
    sdk.sensors.acc.z = 0.0f;
    int ms = 0;
    for (; (ms < 200) && (ivl_app.out.phase == IVL_PHASE_FLIP); ms++)
    {
        sdk.state.attitudeQuaternion.z = (float)(ms % 2) * 0.1f;
        sdk_double_run(1);
    }
    assert_phase(IVL_PHASE_COAST);
    TEST_ASSERT_INT_WITHIN(4, 90, ms);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, sum_of_forces());
}

static void test_motors_stay_off_after_the_landing_whatever_the_stock_controller_wants(void)
{
    start_ready();
    flip();
    sdk.sensors.acc.x = 5.0f;
    sdk_double_run(4);
    assert_phase(IVL_PHASE_ATTACHED);
    sdk.sensors.acc = (Axis3f){0.0f, 0.0f, -1.0f};
    sdk.state.attitudeQuaternion = (quaternion_t){0.0f, 1.0f, 0.0f, 0.0f};
    sdk.state.velocity.z = 0.0f;
    heartbeat(IVL_REQUEST_APPROACH, 2000);
    assert_phase(IVL_PHASE_DONE);
    heartbeat(IVL_REQUEST_IDLE, 3000);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, sum_of_forces());
    // taken off the ceiling and put down; the planner still asks for thrust
    sdk.sensors.acc.z = 1.0f;
    sdk.state.attitudeQuaternion = (quaternion_t){0.0f, 0.0f, 0.0f, 1.0f};
    heartbeat(IVL_REQUEST_IDLE, 3000);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, sum_of_forces());
    sdk.setpoint.mode.z = modeDisable;
    heartbeat(IVL_REQUEST_IDLE, 2000);
    TEST_ASSERT_EQUAL_INT(controlModeLegacy, sdk.control.controlMode);
}

static void test_controller_that_is_switched_away_in_the_air_comes_back_with_its_motors_off(void)
{
    start_ready();
    controllerOutOfTreeInit();
    sdk_double_run(10);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, sum_of_forces());
    // one that was idle comes back as it was
    start_in_flight();
    controllerOutOfTreeInit();
    sdk_double_run(10);
    TEST_ASSERT_EQUAL_INT(controlModeLegacy, sdk.control.controlMode);
}

// ---- safety that needs the SDK

static void test_tumble_check_is_off_in_flip_and_coast_only_and_on_after_a_restart(void)
{
    start();
    TEST_ASSERT_EQUAL_UINT8(1, tumbleCheckEnabled);
    start_ready();
    TEST_ASSERT_EQUAL_UINT8(1, tumbleCheckEnabled);
    flip();
    TEST_ASSERT_EQUAL_UINT8(0, tumbleCheckEnabled);
    sdk.sensors.acc = (Axis3f){0.0f, 0.0f, 0.0f};
    sdk_double_run(1010);
    assert_phase(IVL_PHASE_COAST);
    TEST_ASSERT_EQUAL_UINT8(0, tumbleCheckEnabled);
    sdk.sensors.acc.z = -1.0f;
    sdk_double_run(210);
    assert_phase(IVL_PHASE_ATTACHED);
    TEST_ASSERT_EQUAL_UINT8(1, tumbleCheckEnabled);
    // a host that switched it off, or a stored 0, does not last
    tumbleCheckEnabled = 0;
    sdk_double_run(2);
    TEST_ASSERT_EQUAL_UINT8(1, tumbleCheckEnabled);
    sdk.controller_runs = false;
    tumbleCheckEnabled = 0;
    run_task(1);
    TEST_ASSERT_EQUAL_UINT8(1, tumbleCheckEnabled);
}

/// A vehicle that flips, coasts and hangs: the idle thrust in each of these phases.
static void assert_idle_through_a_landing(unsigned int found, unsigned int on_ground)
{
    start();
    sdk.idle_thrust = found;
    app_task_start();
    sdk.pid_thrust = 1.05f * HOVER_THRUST;
    sdk.setpoint.mode.z = modeAbs;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit(1).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(11, 4.0f, 0.008f).status);
    (void)send_command(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY);
    TEST_ASSERT_EQUAL_UINT(found, sdk.idle_thrust);
    flip();
    TEST_ASSERT_EQUAL_UINT(on_ground, sdk.idle_thrust);
    sdk.sensors.acc = (Axis3f){0.0f, 0.0f, 0.0f};
    sdk_double_run(1010);
    assert_phase(IVL_PHASE_COAST);
    TEST_ASSERT_EQUAL_UINT(on_ground, sdk.idle_thrust);
    sdk.sensors.acc.z = -1.0f;
    sdk_double_run(210);
    assert_phase(IVL_PHASE_ATTACHED);
    TEST_ASSERT_EQUAL_UINT(on_ground, sdk.idle_thrust);
}

static void give_back_to_stock(void)
{
    sdk.sensors.acc.z = 1.0f;
    sdk.setpoint = (setpoint_t){.mode.z = modeDisable};
    heartbeat(IVL_REQUEST_IDLE, 3000);
    TEST_ASSERT_TRUE(ivl_app.out.stock_allowed);
}

static void test_idle_thrust_is_off_where_the_core_stops_motors_and_comes_back(void)
{
    const unsigned int found[] = {1, 7000, 15000, 65535};
    for (size_t i = 0; i < sizeof found / sizeof found[0]; i++)
    {
        assert_idle_through_a_landing(found[i], 0);
        TEST_ASSERT_EQUAL_INT(1, sdk.n_idle_told);
        give_back_to_stock();
        TEST_ASSERT_EQUAL_UINT(found[i], sdk.idle_thrust);
        TEST_ASSERT_EQUAL_INT(2, sdk.n_idle_told);
    }
    // brushed motors have none: nothing is written, nobody is told
    assert_idle_through_a_landing(0, 0);
    give_back_to_stock();
    TEST_ASSERT_EQUAL_INT(0, sdk.n_idle_told);
}

static void test_idle_thrust_that_the_host_writes_meanwhile_stays(void)
{
    assert_idle_through_a_landing(7000, 0);
    sdk.idle_thrust = 5000;
    give_back_to_stock();
    TEST_ASSERT_EQUAL_UINT(5000, sdk.idle_thrust);
}

static void test_a_platform_without_an_idle_thrust_is_left_alone(void)
{
    start();
    sdk.has_no_idle = true;
    app_task_start();
    start_ready();
    flip();
    TEST_ASSERT_EQUAL_INT(0, sdk.n_idle_told);
}

static void spoil_vbat(void)
{
    sdk.vbat_V = 2.6f;
}

static void spoil_link(void)
{
    sdk.is_connected = false;
}

static void spoil_can_fly(void)
{
    sdk.can_fly = false;
}

static void spoil_setpoint(void)
{
    sdk.setpoint.timestamp = (uint32_t)(sdk.now_us / 1000u) - 450u;
}

static void test_each_fault_that_the_sdk_reports_aborts_before_the_trigger_and_not_after(void)
{
    void (*const faults[])(void) = {spoil_vbat, spoil_link, spoil_can_fly, spoil_setpoint};
    const ivl_rule_t rules[] = {IVL_RULE_BATTERY, IVL_RULE_LINK, IVL_RULE_SUPERVISOR, IVL_RULE_SETPOINT};
    for (int i = 0; i < 4; i++)
    {
        start_ready();
        sdk.each_ms = faults[i];
        heartbeat(IVL_REQUEST_HOVER, 600);
        assert_phase(IVL_PHASE_ABORTED);
        TEST_ASSERT_EQUAL_STRING(ivl_guard_name(rules[i]), ivl_guard_name((ivl_rule_t)ivl_app.state.guard.cause));
        start_ready();
        flip();
        sdk.each_ms = faults[i];
        sdk_double_run(700);
        assert_phase(IVL_PHASE_FLIP);
    }
}

static void test_host_that_falls_silent_aborts_and_the_set_point_is_given_up(void)
{
    start_ready();
    run_task(1);
    sdk_double_run(480);
    assert_phase(IVL_PHASE_READY);
    sdk_double_run(40);
    assert_phase(IVL_PHASE_ABORTED);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_HOST, ivl_app.state.guard.cause);
    run_task(3);
    TEST_ASSERT_EQUAL_INT(1, sdk.n_relax);
}

static void test_estimator_that_stands_still_aborts(void)
{
    start_ready();
    for (int i = 0; i < 120; i++)
    {
        // each call with its own step, so that the double does not move the position
        sdk.step = 1;
        sdk_double_run(1);
        sdk.step = 2;
        sdk_double_run(1);
    }
    assert_phase(IVL_PHASE_ABORTED);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_STATE, ivl_app.state.guard.cause);
}

static void test_position_that_is_uncertain_or_not_known_to_be_certain_refuses_to_arm(void)
{
    start_in_flight();
    sdk.variance_m2 = 0.04f;
    run_task(1);
    (void)send_command(IVL_REQUEST_HOVER);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_UNCERTAIN, ivl_app.state.guard.rule);
    sdk.has_variance = false;
    run_task(1);
    (void)send_command(IVL_REQUEST_HOVER);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_UNCERTAIN, ivl_app.state.guard.rule);
    sdk.has_variance = true;
    sdk.variance_m2 = 1.0e-6f;
    run_task(1);
    (void)send_command(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_READY);
}

static void test_range_that_changes_is_a_new_reading_in_metres(void)
{
    start_in_flight();
    TEST_ASSERT_EQUAL_UINT64(0, ivl_app.in.range.t_us);  // no sensor, no reading
    sdk.range_up_mm = 1234.0f;
    sdk_double_run(2);
    const ivl_reading_t first = ivl_app.in.range;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.234f, first.value);
    TEST_ASSERT_EQUAL_UINT8(1, first.valid);
    TEST_ASSERT_TRUE((first.t_us > 0u) && (first.t_us <= sdk.now_us));

    // the same again is not new; another one is
    sdk_double_run(20);
    TEST_ASSERT_EQUAL_UINT64(first.t_us, ivl_app.in.range.t_us);
    sdk.range_up_mm = 1200.0f;
    sdk_double_run(2);
    TEST_ASSERT_TRUE(ivl_app.in.range.t_us > first.t_us);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.2f, ivl_app.in.range.value);
}

static void test_range_out_of_reach_is_told_as_such(void)
{
    start_in_flight();
    sdk.range_up_mm = 32767.0f;
    sdk_double_run(2);
    TEST_ASSERT_TRUE(ivl_app.in.range.t_us > 0u);
    TEST_ASSERT_EQUAL_UINT8(0, ivl_app.in.range.valid);
}

// ---- readings of a camera

/// From the app channel, or from a deck.
static void tell_reading(app_camera_t camera, const ivl_wire_reading_t *packet)
{
    CPXPacket_t message = {.route = {.source = CPX_T_GAP8, .destination = CPX_T_STM32, .function = CPX_F_APP}};
    message.dataLength = (uint16_t)ivl_wire_put_reading(message.data, packet);
    if (camera == APP_CAMERA_CPX)
    {
        sdk.cpx_handler(&message);
    }
    else
    {
        handle(message.data, message.dataLength);
    }
}

static void assert_counts(uint32_t n_good, uint32_t n_bad)
{
    TEST_ASSERT_EQUAL_UINT32(n_good, (uint32_t)sdk_double_read_log("n_reading"));
    TEST_ASSERT_EQUAL_UINT32(n_bad, (uint32_t)sdk_double_read_log("n_reading_bad"));
}

static void test_reading_of_a_camera_reaches_the_core_at_its_sampling_instant(void)
{
    for (int camera = 0; camera < APP_CAMERAS; camera++)
    {
        start_in_flight();
        TEST_ASSERT_EQUAL_UINT64(0, ivl_app.in.rrev.t_us);  // no camera, no reading
        sdk.n_sent = 0;
        const uint64_t arrival_us = sdk.now_us;
        tell_reading((app_camera_t)camera, &(ivl_wire_reading_t){3u, 0.0125f, 4.5f, -1.5f});
        sdk_double_run(2);
        TEST_ASSERT_EQUAL_UINT64(arrival_us - 12500u, ivl_app.in.rrev.t_us);
        TEST_ASSERT_EQUAL_UINT64(arrival_us - 12500u, ivl_app.in.flow.t_us);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, 4.5f, ivl_app.in.rrev.value);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, -1.5f, ivl_app.in.flow.value);
        TEST_ASSERT_EQUAL_UINT8(1, ivl_app.in.rrev.valid & ivl_app.in.flow.valid);
        assert_counts(1, 0);
        TEST_ASSERT_EQUAL_INT(0, sdk.n_sent);  // a camera waits for no answer

        // the same is told until there is another one; each value is invalid by itself, and is then not looked at
        sdk_double_run(20);
        TEST_ASSERT_EQUAL_UINT64(arrival_us - 12500u, ivl_app.in.rrev.t_us);
        tell_reading((app_camera_t)camera, &(ivl_wire_reading_t){IVL_WIRE_VALID_FLOW, 0.0f, NAN, 2.0f});
        sdk_double_run(2);
        TEST_ASSERT_EQUAL_UINT8(0, ivl_app.in.rrev.valid);
        TEST_ASSERT_EQUAL_UINT8(1, ivl_app.in.flow.valid);
        TEST_ASSERT_FLOAT_WITHIN(0.0f, 0.0f, ivl_app.in.rrev.value);
        assert_counts(2, 0);
    }
}

static void test_reading_that_is_no_number_out_of_range_or_too_old_is_refused_and_counted(void)
{
    const ivl_wire_reading_t bad[] = {
        {3u, 0.0f, NAN, 0.0f},    {3u, 0.0f, INFINITY, 0.0f}, {3u, 0.0f, 20.1f, 0.0f},    {3u, 0.0f, -20.1f, 0.0f},
        {3u, 0.0f, 1.0f, NAN},    {3u, 0.0f, 1.0f, -100.5f},  {3u, 0.0f, 1.0f, 100.5f},   {3u, NAN, 1.0f, 0.0f},
        {3u, -0.01f, 1.0f, 0.0f}, {3u, 0.0601f, 1.0f, 0.0f},  {3u, INFINITY, 1.0f, 0.0f}, {4u, 0.0f, 1.0f, 0.0f},
    };
    for (int camera = 0; camera < APP_CAMERAS; camera++)
    {
        start_in_flight();
        tell_reading((app_camera_t)camera, &(ivl_wire_reading_t){3u, 0.0f, 2.0f, 0.5f});
        sdk_double_run(2);
        const ivl_in_t before = ivl_app.in;
        const uint32_t n = (uint32_t)(sizeof bad / sizeof bad[0]);
        for (uint32_t i = 0; i < n; i++)
        {
            tell_reading((app_camera_t)camera, &bad[i]);
            sdk_double_run(2);
            assert_counts(1, i + 1u);
            TEST_ASSERT_EQUAL_MEMORY(&before.rrev, &ivl_app.in.rrev, sizeof before.rrev);
            TEST_ASSERT_EQUAL_MEMORY(&before.flow, &ivl_app.in.flow, sizeof before.flow);
        }
        // the oldest, with the longest way that an operator can state
        sdk_double_write_float("rrev_delay", 0.06f);
        TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit(2).status);
        tell_reading((app_camera_t)camera, &(ivl_wire_reading_t){3u, 0.06f, 1.0f, 0.0f});
        sdk_double_run(2);
        assert_counts(2, n);
    }
}

static void test_reading_that_comes_too_soon_or_was_sampled_before_the_last_one_changes_nothing(void)
{
    start_in_flight();
    tell_reading(APP_CAMERA_CPX, &(ivl_wire_reading_t){3u, 0.0f, 2.0f, 0.5f});
    tell_reading(APP_CAMERA_CPX, &(ivl_wire_reading_t){3u, 0.0f, 3.0f, 0.5f});
    assert_counts(1, 1);
    sdk_double_run(2);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 2.0f, ivl_app.in.rrev.value);
    // two cameras: the later sampling instant counts, whichever comes first
    tell_reading(APP_CAMERA_CHANNEL, &(ivl_wire_reading_t){3u, 0.05f, 4.0f, 0.5f});
    sdk_double_run(2);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 2.0f, ivl_app.in.rrev.value);
    tell_reading(APP_CAMERA_CHANNEL, &(ivl_wire_reading_t){3u, 0.001f, 4.0f, 0.5f});
    sdk_double_run(2);
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 4.0f, ivl_app.in.rrev.value);
}

static void test_message_of_a_deck_that_is_no_reading_is_counted_and_commands_nothing(void)
{
    start_in_flight();
    CPXPacket_t              message = {.route = {.source = CPX_T_GAP8, .function = CPX_F_APP}};
    const ivl_wire_policy_t  policy = constant_packet(99, 1.0f, 0.001f);
    const ivl_wire_command_t command = {.seq = 1, .request = IVL_REQUEST_HOVER};
    sdk.n_sent = 0;
    message.dataLength = (uint16_t)ivl_wire_put_policy(message.data, &policy);
    sdk.cpx_handler(&message);
    message.dataLength = (uint16_t)ivl_wire_put_command(message.data, &command);
    sdk.cpx_handler(&message);
    message.dataLength = 0;
    sdk.cpx_handler(&message);
    sdk_double_run(20);
    run_task(3);
    assert_counts(0, 3);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_EQUAL_UINT32(11, ivl_app.state.policy.id.seq);
    TEST_ASSERT_EQUAL_INT(0, sdk.n_sent);
}

static void test_message_of_anybody_but_the_camera_is_refused_and_counted(void)
{
    const CPXTarget_t        strangers[] = {0, CPX_T_STM32, CPX_T_ESP32, CPX_T_WIFI_HOST, 5, 6, 7};
    const ivl_wire_reading_t packet = {3u, 0.0f, 2.0f, 0.5f};
    const uint32_t           n = (uint32_t)(sizeof strangers / sizeof strangers[0]);
    start_in_flight();
    for (uint32_t i = 0; i < n; i++)
    {
        CPXPacket_t message = {.route = {.source = strangers[i], .destination = CPX_T_STM32, .function = CPX_F_APP}};
        message.dataLength = (uint16_t)ivl_wire_put_reading(message.data, &packet);
        sdk.cpx_handler(&message);
        sdk_double_run(20);
    }
    assert_counts(0, n);
    TEST_ASSERT_EQUAL_UINT64(0, ivl_app.in.rrev.t_us);
}

static void test_motors_driven_past_the_controller_refuse_to_arm(void)
{
    start_in_flight();
    sdk.motor_power_set = 1;
    run_task(1);
    (void)send_command(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_BYPASS, ivl_app.state.guard.rule);
}

static void test_nothing_arms_before_a_configuration_is_in_force(void)
{
    start();
    (void)send_policy(1, 4.0f, 0.008f);
    (void)send_command(IVL_REQUEST_HOVER);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_CONFIG, ivl_app.state.guard.rule);
}

// ---- packets

static void test_policy_is_echoed_as_it_is_in_force(void)
{
    start();
    ivl_wire_policy_echo_t echo = send_policy(42, 4.5f, 0.0075f);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, echo.status);
    TEST_ASSERT_EQUAL_UINT32(42, echo.seq_in_force);
    const uint32_t crc = constant_packet(42, 4.5f, 0.0075f).crc;
    TEST_ASSERT_EQUAL_HEX32(crc, echo.crc_in_force);
    TEST_ASSERT_EQUAL_UINT8(0, echo.form_in_force);
    // refused: the old one stays
    const float bad[][2] = {{NAN, 0.008f}, {4.0f, NAN}, {-1.0f, 0.008f}, {4.0f, 0.021f}, {INFINITY, 0.008f}};
    for (int i = 0; i < 5; i++)
    {
        echo = send_policy(43, bad[i][0], bad[i][1]);
        TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_RANGE, echo.status);
        TEST_ASSERT_EQUAL_UINT32(42, echo.seq_in_force);
        TEST_ASSERT_EQUAL_HEX32(crc, echo.crc_in_force);
    }
    TEST_ASSERT_TRUE(sdk_double_read_log("n_refused") == 5.0);
}

static void test_policy_with_a_wrong_checksum_or_form_is_refused(void)
{
    start();
    (void)send_policy(42, 4.5f, 0.0075f);
    ivl_wire_policy_t packet = constant_packet(43, 5.0f, 0.0075f);
    packet.theta0 = 5.1f;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_CRC, send_part(&packet).status);
    packet = constant_packet(43, 5.0f, 0.0075f);
    packet.form = 200u;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_FORM, send_part(&packet).status);
    packet.form = 0u;
    packet.n = 3u;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_FORM, send_part(&packet).status);
    packet.n = 2u;
    packet.part = 1u;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_RANGE, send_part(&packet).status);
    TEST_ASSERT_EQUAL_UINT32(42, send_part(&packet).seq_in_force);
    TEST_ASSERT_EQUAL_UINT32(42, ivl_app.state.policy.id.seq);
}

static void test_policy_of_every_form_is_taken_in_parts(void)
{
    start();
    uint32_t number = 0;
    for (; ivl_form(number) != NULL; number++)
    {
        const ivl_form_t *form = ivl_form(number);
        ivl_policy_t      policy = {.id = {.seq = 50u + number, .form = (uint8_t)number}, .n = form->n_params};
        for (uint32_t i = 0; i < policy.n; i++)
        {
            policy.theta[i] = 0.5f * (ivl_form_group_of(form, i)->lo + ivl_form_group_of(form, i)->hi);
        }
        policy.id.crc = ivl_policy_crc(&policy);
        TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_check(&ivl_app.cfg, &policy));
        const uint8_t last = (uint8_t)(ivl_parts_count(policy.n) - 1u);
        const int     n_sent = sdk.n_sent;
        for (uint8_t part = 0; part < last; part++)
        {
            const ivl_wire_policy_t packet = packet_of(&policy, part);
            uint8_t                 bytes[IVL_WIRE_SIZE_MAX];
            handle(bytes, ivl_wire_put_policy(bytes, &packet));
        }
        TEST_ASSERT_EQUAL_INT(n_sent, sdk.n_sent);  // the last part alone is answered
        const ivl_wire_policy_t      packet = packet_of(&policy, last);
        const ivl_wire_policy_echo_t echo = send_part(&packet);
        TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, echo.status);
        TEST_ASSERT_EQUAL_UINT8(number, echo.form_in_force);
        TEST_ASSERT_EQUAL_MEMORY(&policy, &ivl_app.state.policy, sizeof policy);
    }
#ifdef IVL_FORMS_FILE
    TEST_ASSERT_GREATER_THAN_UINT32(1, number);
#endif
}

static void test_policy_after_the_trigger_is_refused(void)
{
    start_ready();
    flip();
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_PHASE, send_policy(99, 3.0f, 0.005f).status);
    TEST_ASSERT_EQUAL_UINT32(11, ivl_app.state.policy.id.seq);
}

static void test_packets_are_answered_and_not_kept_when_another_controller_is_selected(void)
{
    start();
    sdk.controller_runs = false;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_NO_CONTROLLER, send_policy(1, 4.0f, 0.008f).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_NO_CONTROLLER, send_command(IVL_REQUEST_HOVER).status);
    sdk.controller_runs = true;
    sdk_double_run(100);
    TEST_ASSERT_FALSE(ivl_app.state.has_policy);
    TEST_ASSERT_EQUAL_INT(IVL_REQUEST_IDLE, ivl_app.in.cmd.request);
}

static void test_command_that_makes_no_sense_is_refused_and_is_no_heartbeat(void)
{
    start_ready();
    for (int i = 0; i < 12; i++)
    {
        const ivl_wire_command_t packet = {.seq = 5, .request = IVL_REQUEST_HOVER, .hover_x_m = NAN};
        uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
        sdk.n_sent = 0;
        handle(bytes, ivl_wire_put_command(bytes, &packet));
        ivl_wire_command_echo_t echo = {0};
        TEST_ASSERT_TRUE(ivl_wire_get_command_echo(last_sent()->bytes, last_sent()->size, &echo));
        TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_RANGE, echo.status);
        sdk_double_run(50);
    }
    assert_phase(IVL_PHASE_ABORTED);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_HOST, ivl_app.state.guard.cause);
}

/// What the vehicle was asked for last, after a command with a number of its own.
static ivl_request_t asked_after(ivl_request_t request, uint16_t seq)
{
    const ivl_wire_command_t packet = {seq, (uint8_t)request, 0.0f, 0.0f, 1.0f, 2.5f, 1.2f};
    uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
    handle(bytes, ivl_wire_put_command(bytes, &packet));
    return (ivl_request_t)ivl_app.in.cmd.request;
}

static void test_command_that_was_overtaken_is_not_obeyed_unless_it_stops(void)
{
    const uint16_t numbers[] = {30u, 65535u, 0u, 32768u};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
    {
        const uint16_t seq = numbers[i];
        start_ready();
        ivl_app.has_command = false;  // another host
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_HOVER, asked_after(IVL_REQUEST_HOVER, seq));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_APPROACH, asked_after(IVL_REQUEST_APPROACH, (uint16_t)(seq + 1u)));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_APPROACH, asked_after(IVL_REQUEST_HOVER, seq));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_APPROACH, asked_after(IVL_REQUEST_HOVER, (uint16_t)(seq - 63u)));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_APPROACH, asked_after(IVL_REQUEST_APPROACH, (uint16_t)(seq + 1u)));  // it came twice
        assert_phase(IVL_PHASE_APPROACH);
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_HOVER, asked_after(IVL_REQUEST_HOVER, (uint16_t)(seq - 64u)));  // of another host
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_HOVER, asked_after(IVL_REQUEST_HOVER, (uint16_t)(seq + 1u)));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_ABORT, asked_after(IVL_REQUEST_ABORT, seq));
        TEST_ASSERT_EQUAL_INT(IVL_REQUEST_IDLE, asked_after(IVL_REQUEST_IDLE, (uint16_t)(seq - 1u)));
    }
}

/// Moving up fast under a ceiling that is near: every condition of a flip holds but the time before it.
static void test_one_packet_does_not_lead_from_idle_into_a_flip(void)
{
    start_in_flight();
    sdk.state.position.z = 1.9f;
    sdk.state.velocity.z = 2.5f;
    const uint32_t n_trigger = ivl_app.state.diag.n_trigger;
    heartbeat(IVL_REQUEST_APPROACH, 100);
    TEST_ASSERT_EQUAL_INT(IVL_PHASE_IDLE, ivl_app.state.phase);
    TEST_ASSERT_EQUAL_UINT32(n_trigger, ivl_app.state.diag.n_trigger);
    // asked to hover first, it flips
    heartbeat(IVL_REQUEST_HOVER, 20);
    TEST_ASSERT_EQUAL_INT(IVL_PHASE_READY, ivl_app.state.phase);
    heartbeat(IVL_REQUEST_APPROACH, 20);
    TEST_ASSERT_EQUAL_UINT32(n_trigger + 1u, ivl_app.state.diag.n_trigger);
}

static void test_a_firmware_that_does_not_say_whether_motors_are_driven_past_the_controller_counts_as_if_they_were(void)
{
    start();
    sdk.n_receive_left = 10;
    app_task_once();
    TEST_ASSERT_FALSE(atomic_load(&ivl_app.motors_bypassed));
    sdk.has_no_motor_power_set = true;
    app_task_start();
    app_task_once();
    TEST_ASSERT_TRUE(atomic_load(&ivl_app.motors_bypassed));
}

/// The least certain axis counts, whichever it is.
static void test_the_position_is_as_uncertain_as_its_least_certain_axis(void)
{
    start();
    sdk.n_receive_left = 10;
    for (char axis = 'X'; axis <= 'Z'; axis++)
    {
        sdk.variance_m2 = 0.04f;
        sdk.vague_axis = axis;
        app_task_once();
        TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 0.2f, atomic_load(&ivl_app.p_sigma_m));
    }
    for (char axis = 'X'; axis <= 'Z'; axis++)
    {
        // one that is no number is seen
        sdk.variance_m2 = NAN;
        sdk.vague_axis = axis;
        app_task_once();
        TEST_ASSERT_TRUE(isnan(atomic_load(&ivl_app.p_sigma_m)));
    }
}

static void test_a_configuration_stays_when_the_controller_is_selected_again(void)
{
    start();
    sdk_double_write_float("host_s_max", 1.5f);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit(1).status);
    controllerOutOfTreeInit();
    TEST_ASSERT_FLOAT_WITHIN(0.0f, 1.5f, ivl_app.cfg.host_s_max);
}

/// Who had the motors when another controller was selected has them when the app's is selected again.
static void test_a_controller_that_is_selected_again_fades_from_whoever_had_the_motors(void)
{
    start_in_flight();
    controllerOutOfTreeInit();
    TEST_ASSERT_EQUAL_INT(APP_OWNER_STOCK, ivl_app.owner);
    start_ready();
    controllerOutOfTreeInit();
    TEST_ASSERT_EQUAL_INT(APP_OWNER_CORE, ivl_app.owner);
}

/// In flight, too, what is told first is what is wrong with it.
static void test_the_first_row_of_a_configuration_is_refused_as_any_other(void)
{
    start_ready();
    sdk_double_write_float(ivl_cfg_name(0), NAN);
    const ivl_wire_config_echo_t echo = commit(2);
    TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, echo.status);
    TEST_ASSERT_EQUAL_UINT8(0, echo.bad);
}

/// The stock controller had 5 % more thrust: what is left of that is added in an abort, too.
static void test_thrust_fades_on_when_an_abort_follows_at_once(void)
{
    start_ready();
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_ABORTED, send_command(IVL_REQUEST_ABORT).phase);
    sdk_double_run(4);
    assert_phase(IVL_PHASE_ABORTED);
    TEST_ASSERT_TRUE(fabsf(sdk.control.normalizedForces[0] - app_norm_of_N(ivl_app.out.thrust_N[0])) > 1.0e-3f);
}

static void test_the_attitude_is_the_estimators_while_the_vehicle_is_idle(void)
{
    start();
    sdk_double_run(10);
    sdk.state.attitudeQuaternion.x = 0.1f;
    sdk.state.attitudeQuaternion.y = -0.2f;
    sdk.state.attitudeQuaternion.z = 0.3f;
    sdk.state.attitudeQuaternion.w = sqrtf(1.0f - 0.14f);
    sdk_double_run(4);
    assert_phase(IVL_PHASE_IDLE);
    const ivl_quat_t expected = app_q_WB(&sdk.state), q_WB = ivl_app.senses.attitude.q_WB;
    TEST_ASSERT_FLOAT_WITHIN(1.0e-3f, 1.0f, fabsf(q_WB.x * expected.x + q_WB.y * expected.y + q_WB.z * expected.z + q_WB.w * expected.w));
}

/// Each commit has the whole time that a controller may take, whatever became of the one before.
static void test_the_time_of_a_commit_begins_with_it(void)
{
    start();
    sdk_double_write_u32("commit", 1);
    sdk_double_run(4);
    ivl_app.n_config_polls = 7;
    app_packets_poll(&ivl_app);
    TEST_ASSERT_EQUAL_INT(0, ivl_app.n_config_polls);
    sdk.controller_runs = false;
    for (uint32_t seq = 2; seq <= 3u; seq++)
    {
        int n = 0;
        sdk.n_sent = 0;
        for (sdk_double_write_u32("commit", seq); (sdk.n_sent == 0) && (n < 100); n++)
        {
            app_packets_poll(&ivl_app);
        }
        TEST_ASSERT_EQUAL_INT(21, n);
        TEST_ASSERT_EQUAL_INT(0, ivl_app.n_config_polls);
    }
}

/// A set-point of no height and any thrust, however little, is somebody who wants to fly.
static void test_the_least_thrust_of_a_setpoint_is_no_rest(void)
{
    start_in_flight();
    sdk.setpoint.mode.z = modeDisable;
    const struct
    {
        float thrust;
        bool  is_idle;
    } ROWS[] = {{0.0f, true}, {1.0e-6f, false}, {0.5f, false}, {1.0f, false}, {65535.0f, false}};
    for (size_t i = 0; i < sizeof ROWS / sizeof ROWS[0]; i++)
    {
        sdk.setpoint.thrust = ROWS[i].thrust;
        sdk_double_run(4);
        TEST_ASSERT_EQUAL_INT(ROWS[i].is_idle, ivl_app.in.vitals.stock_idle);
    }
    sdk.setpoint.thrust = 0.0f;
    sdk.setpoint.mode.z = modeAbs;
    sdk_double_run(4);
    TEST_ASSERT_FALSE(ivl_app.in.vitals.stock_idle);
}

static void test_a_packet_of_any_length_is_counted_if_it_is_none(void)
{
    start();
    sdk.n_receive_left = 10;
    for (size_t size = 1; size <= 5u; size++)
    {
        const uint32_t before = ivl_app.n_bad_packet;
        memset(sdk.incoming.bytes, 0x7f, sizeof sdk.incoming.bytes);
        sdk.incoming.size = size;
        app_task_once();
        TEST_ASSERT_EQUAL_UINT32(before + 1u, ivl_app.n_bad_packet);
    }
    const uint32_t before = ivl_app.n_bad_packet;
    app_task_once();
    TEST_ASSERT_EQUAL_UINT32(before, ivl_app.n_bad_packet);
}

/// The stabilizer takes what waits in its next call: a millisecond, and the answer goes out.
static void test_the_task_comes_back_after_a_millisecond_when_something_waits(void)
{
    start();
    sdk.n_receive_left = 10;
    const ivl_wire_policy_t packet = constant_packet(8, 5.0f, 0.006f);
    sdk.incoming.size = ivl_wire_put_policy(sdk.incoming.bytes, &packet);
    app_task_once();
    TEST_ASSERT_TRUE(app_packets_waiting(&ivl_app));
    const uint64_t before_us = sdk.now_us;
    app_task_once();
    TEST_ASSERT_EQUAL_UINT64(before_us + 1000u, sdk.now_us);
}

static void test_packets_arrive_through_the_task(void)
{
    start();
    sdk.n_sent = 0;
    const ivl_wire_policy_t packet = constant_packet(8, 5.0f, 0.006f);
    sdk.incoming.size = ivl_wire_put_policy(sdk.incoming.bytes, &packet);
    run_task(2);
    TEST_ASSERT_EQUAL_INT(1, sdk.n_sent);
    TEST_ASSERT_EQUAL_UINT32(8, ivl_app.state.policy.id.seq);
}

// xorshift: the same bytes on every machine
static uint32_t next_random(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

static void test_noise_on_the_channel_starts_no_motor_and_breaks_nothing(void)
{
    start();
    (void)commit(1);
    sdk.pid_thrust = 0.0f;
    uint32_t random = 77;
    for (int i = 0; i < 20000; i++)
    {
        uint8_t      bytes[30];
        const size_t size = next_random(&random) % 31u;
        for (size_t k = 0; k < sizeof bytes; k++)
        {
            bytes[k] = (uint8_t)next_random(&random);
        }
        // half of them look like ours; requests are left to IDLE and ABORT, or the vehicle may rightly fly
        const uint32_t dice = next_random(&random) % 4u;
        sdk.n_sent = 0;
        if (dice < 2u)
        {
            bytes[0] = (uint8_t)(1u + dice);
            bytes[1] = (uint8_t)IVL_WIRE_VERSION;
            bytes[4] = ((bytes[4] & 1u) != 0u) ? (uint8_t)IVL_REQUEST_ABORT : (uint8_t)(4u + bytes[4] % 250u);
            // every second policy has its form and a right checksum, so that its numbers are looked at
            if ((dice == 0u) && ((bytes[6] & 1u) != 0u))
            {
                ivl_wire_policy_t packet;
                bytes[10] = 0u;
                bytes[11] = 2u;
                bytes[12] = 0u;
                TEST_ASSERT_TRUE(ivl_wire_get_policy(bytes, 29, &packet));
                packet.crc = constant_policy(0, packet.theta0, packet.theta1).id.crc;
                (void)ivl_wire_put_policy(bytes, &packet);
            }
            handle(bytes, (dice == 0u) ? 29u : 25u);
            TEST_ASSERT_EQUAL_INT(1, sdk.n_sent);
        }
        else
        {
            handle(bytes, size);
        }
        TEST_ASSERT_FALSE(ivl_app.out.motors_on);
        TEST_ASSERT_TRUE(!ivl_app.state.has_policy ||
                         ((ivl_app.state.policy.theta[0] >= 0.0f) && (ivl_app.state.policy.theta[1] <= 0.02f)));
    }
    TEST_ASSERT_TRUE(ivl_app.n_bad_packet > 9000u);
}

// ---- recorder

static void test_recorder_is_a_memory_of_the_app_that_is_registered_once(void)
{
    start_ready();
    TEST_ASSERT_NOT_NULL(sdk.memory);
    TEST_ASSERT_TRUE(sdk.n_memory <= 1);
    TEST_ASSERT_EQUAL_INT(MEM_TYPE_APP, sdk.memory->type);
    TEST_ASSERT_NULL(sdk.memory->write);
    TEST_ASSERT_EQUAL_UINT32(ivl_record_size(), sdk.memory->getSize(0));
    uint8_t bytes[44];
    TEST_ASSERT_TRUE(sdk.memory->read(0, 0, 32, bytes));
    TEST_ASSERT_FALSE(sdk.memory->read(0, 32, 44, bytes));
    flip();
    sdk_double_run(1000);
    TEST_ASSERT_TRUE(sdk.memory->read(0, 32, 44, bytes));
    TEST_ASSERT_TRUE(sdk.memory->read(0, 0, 32, bytes));
    TEST_ASSERT_EQUAL_UINT8(1, bytes[10]);
    TEST_ASSERT_EQUAL_UINT8(11, bytes[16]);
}

int main(void)
{
    UNITY_BEGIN();
    // first: the memory is registered by the first start of the process
    RUN_TEST(test_recorder_is_a_memory_of_the_app_that_is_registered_once);
    RUN_TEST(test_units_and_frames_are_converted);
    RUN_TEST(test_positive_gyro_y_and_positive_core_moment_both_push_the_nose_down);
    RUN_TEST(test_thrust_is_a_share_of_the_largest);
    RUN_TEST(test_defaults_are_good_and_know_the_airframe);
    RUN_TEST(test_every_parameter_of_the_table_can_be_written_and_none_is_flown_before_the_commit);
    RUN_TEST(test_value_out_of_range_or_no_number_is_refused_named_and_taken_back);
    RUN_TEST(test_platform_refuses_a_rate_it_does_not_have_and_a_thrust_it_cannot_make);
    RUN_TEST(test_core_runs_at_its_rate);
    RUN_TEST(test_commit_in_flight_of_the_core_is_refused);
    RUN_TEST(test_commit_is_answered_when_another_controller_is_selected);
    RUN_TEST(test_stock_controller_flies_until_the_core_is_asked);
    RUN_TEST(test_core_takes_over_and_gives_back_without_a_step);
    RUN_TEST(test_planner_is_sent_to_the_vehicle_when_the_core_gives_back);
    RUN_TEST(test_flip_is_as_commanded_from_its_first_tick);
    RUN_TEST(test_estimator_is_not_followed_in_the_flip);
    RUN_TEST(test_motors_stay_off_after_the_landing_whatever_the_stock_controller_wants);
    RUN_TEST(test_controller_that_is_switched_away_in_the_air_comes_back_with_its_motors_off);
    RUN_TEST(test_tumble_check_is_off_in_flip_and_coast_only_and_on_after_a_restart);
    RUN_TEST(test_idle_thrust_is_off_where_the_core_stops_motors_and_comes_back);
    RUN_TEST(test_idle_thrust_that_the_host_writes_meanwhile_stays);
    RUN_TEST(test_a_platform_without_an_idle_thrust_is_left_alone);
    RUN_TEST(test_each_fault_that_the_sdk_reports_aborts_before_the_trigger_and_not_after);
    RUN_TEST(test_host_that_falls_silent_aborts_and_the_set_point_is_given_up);
    RUN_TEST(test_estimator_that_stands_still_aborts);
    RUN_TEST(test_position_that_is_uncertain_or_not_known_to_be_certain_refuses_to_arm);
    RUN_TEST(test_range_that_changes_is_a_new_reading_in_metres);
    RUN_TEST(test_range_out_of_reach_is_told_as_such);
    RUN_TEST(test_reading_of_a_camera_reaches_the_core_at_its_sampling_instant);
    RUN_TEST(test_reading_that_is_no_number_out_of_range_or_too_old_is_refused_and_counted);
    RUN_TEST(test_reading_that_comes_too_soon_or_was_sampled_before_the_last_one_changes_nothing);
    RUN_TEST(test_message_of_a_deck_that_is_no_reading_is_counted_and_commands_nothing);
    RUN_TEST(test_message_of_anybody_but_the_camera_is_refused_and_counted);
    RUN_TEST(test_motors_driven_past_the_controller_refuse_to_arm);
    RUN_TEST(test_nothing_arms_before_a_configuration_is_in_force);
    RUN_TEST(test_policy_is_echoed_as_it_is_in_force);
    RUN_TEST(test_policy_with_a_wrong_checksum_or_form_is_refused);
    RUN_TEST(test_policy_of_every_form_is_taken_in_parts);
    RUN_TEST(test_policy_after_the_trigger_is_refused);
    RUN_TEST(test_packets_are_answered_and_not_kept_when_another_controller_is_selected);
    RUN_TEST(test_command_that_makes_no_sense_is_refused_and_is_no_heartbeat);
    RUN_TEST(test_command_that_was_overtaken_is_not_obeyed_unless_it_stops);
    RUN_TEST(test_one_packet_does_not_lead_from_idle_into_a_flip);
    RUN_TEST(test_a_firmware_that_does_not_say_whether_motors_are_driven_past_the_controller_counts_as_if_they_were);
    RUN_TEST(test_the_position_is_as_uncertain_as_its_least_certain_axis);
    RUN_TEST(test_a_configuration_stays_when_the_controller_is_selected_again);
    RUN_TEST(test_the_first_row_of_a_configuration_is_refused_as_any_other);
    RUN_TEST(test_a_controller_that_is_selected_again_fades_from_whoever_had_the_motors);
    RUN_TEST(test_thrust_fades_on_when_an_abort_follows_at_once);
    RUN_TEST(test_the_attitude_is_the_estimators_while_the_vehicle_is_idle);
    RUN_TEST(test_the_time_of_a_commit_begins_with_it);
    RUN_TEST(test_the_least_thrust_of_a_setpoint_is_no_rest);
    RUN_TEST(test_a_packet_of_any_length_is_counted_if_it_is_none);
    RUN_TEST(test_the_task_comes_back_after_a_millisecond_when_something_waits);
    RUN_TEST(test_packets_arrive_through_the_task);
    RUN_TEST(test_noise_on_the_channel_starts_no_motor_and_breaks_nothing);
    return UNITY_END();
}
