/// @file test_cf_flight.c
/// The software vehicle as an operator flies it: tables, arming, set-points, the high-level commander, poses from outside, aborts, resets.
#include "cf_fixture.h"

#include <errno.h>
#include <math.h>

static ivl_sim_model_t model;

void setUp(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.5;
    model = fixture_model(&params);
    open_vehicle(&model);
}

void tearDown(void)
{
    ivl_cf_close(vehicle);
}

static void assert_at(double x, double y, double z, double within)
{
    TEST_ASSERT_DOUBLE_WITHIN(within, x, read_log("simTruth", "x"));
    TEST_ASSERT_DOUBLE_WITHIN(within, y, read_log("simTruth", "y"));
    TEST_ASSERT_DOUBLE_WITHIN(within, z, read_log("simTruth", "z"));
}

static void take_off(void)
{
    run_ms(200);
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    run_ms(3000);
    assert_at(0.0, 0.0, 1.0, 0.01);
}

static void configure(void)
{
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(1, 5.0f, 0.008f).status);
}

static void heartbeat(ivl_request_t request, int ms)
{
    for (int t = 0; t < ms; t += 50)
    {
        (void)send_command(request, 0.0f, 0.0f, 1.0f, 0.5f, 1.5f);
        run_ms(46);
    }
}

// ---- tables

static void test_tables_name_each_value_once_in_24_characters(void)
{
    size_t                n_params, n_logs;
    const ivl_cf_param_t *p = ivl_cf_params(vehicle, &n_params);
    const ivl_cf_log_t   *l = ivl_cf_logs(vehicle, &n_logs);
    TEST_ASSERT_TRUE(n_params > 100 && n_logs > 80);
    for (size_t i = 0; i < n_params; i++)
    {
        TEST_ASSERT_TRUE_MESSAGE(strlen(p[i].group) + strlen(p[i].name) <= 24, p[i].name);
        TEST_ASSERT_NOT_NULL(p[i].address);
        TEST_ASSERT_EQUAL_PTR_MESSAGE(&p[i], find_param(p[i].group, p[i].name), p[i].name);
    }
    for (size_t i = 0; i < n_logs; i++)
    {
        TEST_ASSERT_TRUE_MESSAGE(strlen(l[i].group) + strlen(l[i].name) <= 24, l[i].name);
        TEST_ASSERT_NOT_NULL(l[i].address);
        for (size_t k = 0; k < i; k++)
        {
            TEST_ASSERT_TRUE_MESSAGE(strcmp(l[i].group, l[k].group) != 0 || strcmp(l[i].name, l[k].name) != 0, l[i].name);
        }
    }
}

static void test_every_row_of_the_core_is_served_and_starts_as_the_simulated_vehicle_needs_it(void)
{
#define SERVED(ctype, group, name, field, unit, lo, hi, dflt, doc)                                                                         \
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&model.firmware.field, find_param(group, name)->address, sizeof(ctype), name);
    IVL_PARAMS(SERVED)
#undef SERVED
#define LOGGED(ctype, group, name, owner, field, unit, doc) (void)read_log(group, name);
    IVL_LOGS(LOGGED)
#undef LOGGED
    TEST_ASSERT_TRUE(find_param("deck", "bcFlow2")->read_only && find_param("supervisor", "tmblChckEn")->persistent);
}

static void test_a_vehicle_is_one_a_process_and_flies_at_a_rate_of_the_stabilizer(void)
{
    char error[200] = "";
    TEST_ASSERT_NULL(ivl_cf_open(&model, 1, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "open already"));
    ivl_cf_close(vehicle);
    ivl_sim_params_t raw = fixture_params();
    ivl_cfg_t        cfg;
    ivl_sim_model_t  other;
    ivl_cfg_defaults(&cfg);
    cfg.tick_hz = 400.0f;
    TEST_ASSERT_TRUE(ivl_sim_model_init(&other, &raw, &cfg, error, sizeof error));
    TEST_ASSERT_NULL(ivl_cf_open(&other, 1, error, sizeof error));
    TEST_ASSERT_NOT_NULL(strstr(error, "tick_hz: 400"));
    open_vehicle(&model);
    // nor does the app take another rate than the world's
    write_f32("ivl", "tick_hz", 250.0f);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_RANGE, commit_config(1).status);
}

static void test_the_other_rates_fly_too(void)
{
    const float rates_hz[] = {1000.0f, 250.0f};
    for (int i = 0; i < 2; i++)
    {
        ivl_cf_close(vehicle);
        ivl_sim_params_t raw = fixture_params();
        ivl_cfg_t        cfg;
        char             error[200];
        ivl_cfg_defaults(&cfg);
        cfg.tick_hz = rates_hz[i];
        TEST_ASSERT_TRUE(ivl_sim_model_init(&model, &raw, &cfg, error, sizeof error));
        open_vehicle(&model);
        configure();
        take_off();
        heartbeat(IVL_REQUEST_HOVER, 500);
        assert_phase(IVL_PHASE_READY);
        assert_at(0.0, 0.0, 1.0, 0.02);
    }
}

// ---- arming

static void test_nothing_takes_off_before_it_is_armed(void)
{
    write_u8("sil", "auto_arm", 0);
    run_ms(500);
    TEST_ASSERT_TRUE(info(0) && !info(1) && !info(2) && !info(3));
    TEST_ASSERT_EQUAL_INT(EBUSY, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    const float up[3] = {0.0f, 0.0f, 1.0f};
    for (int i = 0; i < 20; i++)
    {
        (void)ivl_cf_set_position(vehicle, up, 0.0f);
        run_ms(50);
    }
    assert_at(0.0, 0.0, 0.0, 0.0);
    TEST_ASSERT_TRUE(ivl_cf_arm(vehicle, true));
    TEST_ASSERT_TRUE(ivl_cf_is_armed(vehicle));
    ivl_cf_notify_stop(vehicle, 0);
    take_off();
    TEST_ASSERT_TRUE(info(4) && info(8) && info(9));
    // disarmed in the air it comes down, and stays there
    TEST_ASSERT_TRUE(ivl_cf_arm(vehicle, false));
    run_ms(3000);
    assert_at(0.0, 0.0, 0.0, 0.01);
    TEST_ASSERT_FALSE(info(3));
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
}

static void test_a_landed_vehicle_that_arms_itself_is_ready_again(void)
{
    take_off();
    TEST_ASSERT_EQUAL_INT(EPERM, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, 1.5f));
    run_ms(2500);
    assert_at(0.0, 0.0, 0.0, 0.001);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("motor", "m1"));
    run_ms(6000);
    TEST_ASSERT_TRUE(info(1) && info(3) && !info(4) && !info(8));
    take_off();
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, 1.5f));
    TEST_ASSERT_EQUAL_INT(EPERM, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, 1.5f));
}

static void test_stop_and_watchdog_lock_the_vehicle_and_only_a_reset_helps(void)
{
    for (int kind = 0; kind < 3; kind++)
    {
        write_u8("sil", "reset", 1);
        run_ms(500);
        assert_at(0.0, 0.0, 1.25, 0.01);
        if (kind == 0)
        {
            ivl_cf_estop(vehicle);
        }
        else if (kind == 1)
        {
            ivl_cf_estop_watchdog(vehicle);
            run_ms(1100);
        }
        else
        {
            write_u8("stabilizer", "stop", 1);
        }
        run_ms(100);
        TEST_ASSERT_TRUE(info(6) && !info(1) && !info(3));
        run_ms(3000);
        assert_at(0.0, 0.0, 0.0, 0.01);
        TEST_ASSERT_EQUAL_INT(EBUSY, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.0f));
    }
    char   text[1500];
    size_t n = ivl_cf_console_take(vehicle, text, sizeof text - 1);
    text[n] = '\0';
    TEST_ASSERT_NOT_NULL(strstr(text, "Locked, reboot required"));
    // clients do not look at the answer
    TEST_ASSERT_NOT_NULL(strstr(text, "HLCMD: take-off refused: the motors may not run"));
    TEST_ASSERT_EQUAL_UINT(0, ivl_cf_console_take(vehicle, text, sizeof text));
}

// ---- set-points

static void test_set_points_age_into_levelling_out_and_a_lock(void)
{
    write_u8("sil", "reset", 1);
    const float v[3] = {1.0f, 0.0f, 0.0f};
    for (int i = 0; i < 40; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_velocity(vehicle, v, 0.0f));
        run_ms(100);
    }
    TEST_ASSERT_TRUE(info(4));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 1.0, read_log("stateEstimate", "vx"));
    run_ms(700);
    // level, but still in flight
    TEST_ASSERT_TRUE(info(4) && info(3));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 0.0, read_log("stateEstimate", "pitch"));
    run_ms(1500);
    TEST_ASSERT_TRUE(info(6) && !info(3));
}

static void test_a_host_that_hands_back_in_time_lands(void)
{
    write_u8("sil", "reset", 1);
    for (int i = 0; i < 10; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, 0.2f, 0.0f, 0.0f, 1.0f));
        run_ms(100);
    }
    // what the planner wants does not matter while set-points come
    TEST_ASSERT_FALSE(info(8));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_go_to(vehicle, false, false, (const float[3]){5.0f, 5.0f, 1.0f}, 0.0f, 1.0f));
    TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, 0.2f, 0.0f, 0.0f, 1.0f));
    run_ms(100);
    TEST_ASSERT_TRUE(read_log("simTruth", "x") < 0.5);
    ivl_cf_notify_stop(vehicle, 100);
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, 1.5f));
    run_ms(2500);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
    TEST_ASSERT_FALSE(info(6) || info(7));
}

static void test_each_kind_of_set_point_is_followed(void)
{
    const float p[3] = {0.4f, -0.3f, 1.3f}, zero[3] = {0.0f, 0.0f, 0.0f}, q[4] = {0.0f, 0.0f, 0.70710678f, 0.70710678f};
    write_u8("sil", "reset", 1);
    for (int i = 0; i < 60; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_position(vehicle, p, -90.0f));
        run_ms(100);
    }
    assert_at(0.4, -0.3, 1.3, 0.02);
    TEST_ASSERT_DOUBLE_WITHIN(2.0, -90.0, read_log("stateEstimate", "yaw"));
    for (int i = 0; i < 60; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_full_state(vehicle, p, zero, zero, q, zero));
        run_ms(100);
    }
    assert_at(0.4, -0.3, 1.3, 0.02);
    TEST_ASSERT_DOUBLE_WITHIN(2.0, 90.0, read_log("stateEstimate", "yaw"));
    // in heading axes, forward is now world y
    for (int i = 0; i < 50; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, 0.3f, 0.0f, 0.0f, 1.0f));
        run_ms(100);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.3, read_log("stateEstimate", "vy"));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.0, read_log("stateEstimate", "vx"));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, read_log("stateEstimate", "z"));
    // a nose 10 degrees down; the pitch of the set-point and of the estimate is nose up
    for (int i = 0; i < 5; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_zdistance(vehicle, 0.0f, -10.0f, 0.0f, 1.0f));
        run_ms(100);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.5, -10.0, read_log("stateEstimate", "pitch"));
    TEST_ASSERT_TRUE(read_log("stateEstimate", "vy") > 0.6);
    for (int i = 0; i < 5; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_manual(vehicle, 10.0f, 0.0f, 90.0f, 38000, false));
        run_ms(100);
    }
    TEST_ASSERT_DOUBLE_WITHIN(2.0, 10.0, read_log("stateEstimate", "roll"));
    // 45 degrees are asked for within this time; the heading lags
    TEST_ASSERT_TRUE(read_log("stateEstimate", "yaw") > 100.0 && read_log("stateEstimate", "yaw") < 140.0);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 38000.0, read_log("stabilizer", "thrust"));
    TEST_ASSERT_TRUE(ivl_cf_set_stop(vehicle));
    run_ms(20);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("stabilizer", "thrust"));
}

static void test_thrust_of_the_sticks_is_locked_until_it_was_zero_once(void)
{
    run_ms(200);
    // nobody has had the set-point for longer than the planner
    for (int i = 0; i < 10; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_rpyt(vehicle, 0.0f, 0.0f, 0.0f, 45000));
        run_ms(50);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("stabilizer", "thrust"));
    TEST_ASSERT_TRUE(ivl_cf_set_rpyt(vehicle, 0.0f, 0.0f, 0.0f, 0));
    for (int i = 0; i < 10; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_rpyt(vehicle, 0.0f, 0.0f, 0.0f, 45000));
        run_ms(50);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 45000.0, read_log("stabilizer", "thrust"));
    TEST_ASSERT_TRUE(read_log("simTruth", "z") > 0.1);
    TEST_ASSERT_TRUE(ivl_cf_set_rpyt(vehicle, 0.0f, 0.0f, 0.0f, 999));
    run_ms(2);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("stabilizer", "thrust"));
}

static void test_values_that_are_no_numbers_are_refused_everywhere(void)
{
    const float bad[] = {NAN, INFINITY, -INFINITY, 1.0e30f};
    write_u8("sil", "reset", 1);
    run_ms(100);
    for (int i = 0; i < 4; i++)
    {
        const float b = bad[i], p[3] = {0.0f, b, 1.0f}, fine[3] = {0.0f, 0.0f, 1.0f}, q[4] = {0.0f, 0.0f, b, 1.0f}, level[4] = {0, 0, 0, 1};
        TEST_ASSERT_FALSE(ivl_cf_set_rpyt(vehicle, b, 0.0f, 0.0f, 0) || ivl_cf_set_manual(vehicle, 0.0f, b, 0.0f, 0, true));
        TEST_ASSERT_FALSE(ivl_cf_set_velocity(vehicle, p, 0.0f) || ivl_cf_set_velocity(vehicle, fine, b));
        TEST_ASSERT_FALSE(ivl_cf_set_zdistance(vehicle, 0.0f, 0.0f, 0.0f, b) || ivl_cf_set_hover(vehicle, b, 0.0f, 0.0f, 1.0f));
        TEST_ASSERT_FALSE(ivl_cf_set_position(vehicle, p, 0.0f) || ivl_cf_set_position(vehicle, fine, b));
        TEST_ASSERT_FALSE(ivl_cf_set_full_state(vehicle, fine, p, fine, level, fine) ||
                          ivl_cf_set_full_state(vehicle, fine, fine, fine, q, fine));
        TEST_ASSERT_FALSE(ivl_cf_ext_position(vehicle, p) || ivl_cf_ext_pose(vehicle, p, level) || ivl_cf_ext_pose(vehicle, fine, q));
        TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_go_to(vehicle, false, false, p, 0.0f, 1.0f));
        TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_go_to(vehicle, true, false, fine, b, 1.0f));
        TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, b));
    }
    TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, -1.0f));
    TEST_ASSERT_EQUAL_INT(0, (int)read_log("sil", "n_pose"));
    run_ms(1000);
    assert_at(0.0, 0.0, 1.25, 0.01);
}

static void test_ways_of_the_high_level_commander_end_where_they_should_and_are_smooth(void)
{
    take_off();
    double z_last = read_log("stateEstimate", "z"), v_most = 0.0;
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_go_to(vehicle, true, false, (const float[3]){1.0f, 0.5f, 0.5f}, 1.0f, 2.0f));
    TEST_ASSERT_FALSE(info(9));
    for (int i = 0; i < 200; i++)
    {
        run_ms(10);
        const double z = read_log("ctrltarget", "z");
        TEST_ASSERT_TRUE(z >= z_last - 1.0e-4 && z - z_last < 0.01);
        v_most = fmax(v_most, (z - z_last) / 0.01);
        z_last = z;
    }
    // a polynomial of seventh degree from rest to rest is 35/16 times as fast as the mean in the middle
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.25 * 35.0 / 16.0, v_most);
    run_ms(3000);
    assert_at(1.0, 0.5, 1.5, 0.02);
    TEST_ASSERT_TRUE(info(9));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 57.3, read_log("stateEstimate", "yaw"));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_stop(vehicle));
    run_ms(20);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("stabilizer", "thrust"));
}

static void test_the_speed_of_a_take_off_and_of_a_landing_decides_how_long_it_takes(void)
{
    run_ms(200);
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff_at(vehicle, 1.0f, false, 0.0f, true, 0.5f));
    run_ms(1900);
    TEST_ASSERT_FALSE(info(9));
    run_ms(200);
    TEST_ASSERT_TRUE(info(9));
    run_ms(1500);
    assert_at(0.0, 0.0, 1.0, 0.02);
    // half a metre down at the usual speed of 0.5 m/s, and there the motors stop
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_land_at(vehicle, 0.5f, true, 0.0f, true, 0.0f));
    run_ms(900);
    TEST_ASSERT_TRUE(info(8) && !info(9));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.5, read_log("simTruth", "z"));
    run_ms(200);
    TEST_ASSERT_FALSE(info(8));
}

/// Uploads a straight way of 1 m in x within 2 s, and a quarter turn.
static void upload_straight(uint8_t id)
{
    const ivl_cf_piece_t      piece = {.c = {{0.0f, 0.5f}, {0.0f}, {0.0f}, {0.0f, 0.785398f}}, .duration_s = 2.0f};
    const ivl_cf_definition_t definition = {IVL_CF_TRAJECTORY_IN_MEMORY, IVL_CF_TRAJECTORY_PLAIN, 132, 1};
    size_t                    n;
    const ivl_cf_memory_t    *m = ivl_cf_memories(vehicle, &n);
    TEST_ASSERT_EQUAL_HEX8(0x12, m[4].type);
    TEST_ASSERT_TRUE(m[4].write(132, sizeof piece, (const uint8_t *)&piece));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_define(vehicle, id, &definition));
}

static void test_an_uploaded_trajectory_is_flown_from_where_the_vehicle_is(void)
{
    const ivl_cf_start_t how = {.relative_position = true, .timescale = 1.0f}, back = {true, false, true, 2.0f},
                         never = {.timescale = 0.0f};
    TEST_ASSERT_EQUAL_INT(EBUSY, ivl_cf_hl_start(vehicle, 3, &how));
    take_off();
    TEST_ASSERT_EQUAL_INT(ENOEXEC, ivl_cf_hl_start(vehicle, 3, &how));
    upload_straight(3);
    TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_start(vehicle, 3, &never));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_start(vehicle, 3, &how));
    run_ms(6000);
    assert_at(1.0, 0.0, 1.0, 0.03);
    TEST_ASSERT_DOUBLE_WITHIN(2.0, 90.0, read_log("stateEstimate", "yaw"));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_start(vehicle, 3, &back));
    run_ms(3900);
    TEST_ASSERT_FALSE(info(9));
    run_ms(4500);
    TEST_ASSERT_TRUE(info(9));
    assert_at(0.0, 0.0, 1.0, 0.03);
    TEST_ASSERT_EQUAL_INT(ENOEXEC, ivl_cf_hl_define(vehicle, IVL_CF_TRAJECTORIES, &(ivl_cf_definition_t){.location = 0}));
}

static void test_a_spiral_ends_on_the_other_side_of_its_centre(void)
{
    const ivl_cf_spiral_t half = {.phi_rad = 3.14159265f, .r0_m = 0.5f, .r1_m = 0.5f, .climb_m = 0.3f, .duration_s = 4.0f};
    take_off();
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_spiral(vehicle, &half));
    run_ms(2000);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.5, read_log("simTruth", "x"));
    run_ms(4000);
    // the centre is at the left, half a metre away
    assert_at(0.0, 1.0, 1.3, 0.05);
    ivl_cf_spiral_t none = half;
    none.duration_s = 0.0f;
    TEST_ASSERT_EQUAL_INT(EINVAL, ivl_cf_hl_spiral(vehicle, &none));
}

static void test_a_vehicle_that_was_stopped_has_forgotten_where_it_wanted_to_go(void)
{
    write_u8("sil", "auto_arm", 0);
    run_ms(200);
    TEST_ASSERT_TRUE(ivl_cf_arm(vehicle, true));
    take_off();
    TEST_ASSERT_TRUE(ivl_cf_arm(vehicle, false));
    run_ms(80);
    TEST_ASSERT_FALSE(info(8));
    run_ms(20000);
    TEST_ASSERT_TRUE(ivl_cf_arm(vehicle, true));
    for (int i = 0; i < 50; i++)
    {
        run_ms(100);
        TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("motor", "m1"));
    }
    assert_at(0.0, 0.0, 0.0, 0.01);
}

// ---- the sticks of port 3: as sent, in the stock firmware's signs and frames

static ivl_cf_setpoint_t target(void)
{
    return (ivl_cf_setpoint_t){
        .p_W_m = {(float)read_log("ctrltarget", "x"), (float)read_log("ctrltarget", "y"), (float)read_log("ctrltarget", "z")},
        .v_mps = {(float)read_log("ctrltarget", "vx"), (float)read_log("ctrltarget", "vy"), (float)read_log("ctrltarget", "vz")},
        .roll = (float)read_log("ctrltarget", "roll"),
        .pitch = (float)read_log("ctrltarget", "pitch"),
        .yawrate_radps = (float)read_log("ctrltarget", "yaw"),
    };
}

static void sticks(float roll, float pitch, float yaw, uint16_t thrust)
{
    TEST_ASSERT_TRUE(ivl_cf_set_rpyt(vehicle, roll, pitch, yaw, thrust));
}

static void assert_modes(int xy, int z, int roll, int pitch, int yaw)
{
    TEST_ASSERT_EQUAL_INT(xy, (int)read_log("ctrltarget", "mode_x"));
    TEST_ASSERT_EQUAL_INT(z, (int)read_log("ctrltarget", "mode_z"));
    TEST_ASSERT_EQUAL_INT(roll, (int)read_log("ctrltarget", "mode_roll"));
    TEST_ASSERT_EQUAL_INT(pitch, (int)read_log("ctrltarget", "mode_pitch"));
    TEST_ASSERT_EQUAL_INT(yaw, (int)read_log("ctrltarget", "mode_yaw"));
}

static void test_sticks_are_angles_and_an_inverted_rate_or_what_each_mode_makes_of_them(void)
{
    write_u8("sil", "reset", 1);
    sticks(0.0f, 0.0f, 0.0f, 0);
    sticks(5.0f, -7.0f, 90.0f, 30000);
    assert_modes(0, 0, 1, 1, 2);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 5.0, (double)target().roll);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, -7.0, (double)target().pitch);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, -90.0, (double)target().yawrate_radps);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 30000.0, read_log("ctrltarget", "thrust"));
    // a rate each
    write_u8("flightmode", "stabModeRoll", 0);
    sticks(5.0f, -7.0f, 0.0f, 30000);
    assert_modes(0, 0, 2, 1, 2);
    write_u8("flightmode", "stabModePitch", 0);
    sticks(5.0f, -7.0f, 0.0f, 30000);
    assert_modes(0, 0, 2, 2, 2);
    write_u8("flightmode", "stabModeRoll", 1);
    write_u8("flightmode", "stabModePitch", 1);
    // a heading
    write_u8("flightmode", "stabModeYaw", 1);
    sticks(0.0f, 0.0f, 30.0f, 30000);
    assert_modes(0, 0, 1, 1, 1);
    write_u8("flightmode", "stabModeYaw", 0);
    // an eighth of a turn, nose up being positive
    write_u8("flightmode", "yawMode", 1);
    sticks(10.0f, 0.0f, 0.0f, 30000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 7.071, (double)target().roll);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 7.071, (double)target().pitch);
    write_u8("flightmode", "yawMode", 2);
    // the thrust is a speed
    write_u8("flightmode", "althold", 1);
    sticks(0.0f, 0.0f, 0.0f, 49150);
    assert_modes(0, 2, 1, 1, 2);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.5, (double)target().v_mps.z);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("ctrltarget", "thrust"));
    write_u8("flightmode", "althold", 0);
    // speeds in the world
    write_u8("flightmode", "poshold", 1);
    sticks(6.0f, 15.0f, 0.0f, 30000);
    TEST_ASSERT_EQUAL_INT(2, (int)read_log("ctrltarget", "mode_x"));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.5, (double)target().v_mps.x);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.2, (double)target().v_mps.y);
    write_u8("flightmode", "poshold", 0);
    // a point
    write_u8("flightmode", "posSet", 1);
    sticks(0.2f, -0.4f, 30.0f, 1500);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("ctrltarget", "mode_z"));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.4, (double)target().p_W_m.x);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.2, (double)target().p_W_m.y);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 1.5, (double)target().p_W_m.z);
}

static void test_a_quarter_turn_by_the_sticks_goes_clockwise(void)
{
    write_u8("sil", "reset", 1);
    write_u8("flightmode", "althold", 1);
    for (int i = 0; i < 20; i++)
    {
        sticks(0.0f, 0.0f, 45.0f, 32767);
        run_ms(100);
    }
    TEST_ASSERT_TRUE(read_log("stateEstimate", "yaw") < -60.0);
}

/// At a steady speed and turn rate the way is a circle, whose radius is their quotient.
static void test_circles_have_the_radius_that_is_asked_for(void)
{
    const float wanted[][2] = {{0.3f, 72.0f}, {0.5f, 90.0f}, {0.5f, -60.0f}, {0.8f, 120.0f}, {0.4f, -150.0f}};  // m/s, deg/s
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++)
    {
        const float v_mps = wanted[i][0], turn_degps = wanted[i][1];
        double      lo = 1.0e9, hi = -1.0e9;
        write_u8("sil", "reset", 1);
        for (int t_ms = 0; t_ms < 16000; t_ms += 20)
        {
            TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, v_mps, 0.0f, turn_degps, 1.0f));
            run_ms(20);
            const double x = read_log("simTruth", "x");
            lo = (t_ms > 8000) ? fmin(lo, x) : lo;
            hi = (t_ms > 8000) ? fmax(hi, x) : hi;
        }
        const double radius_m = (double)v_mps / (fabs((double)turn_degps) * IVL_SIM_PI / 180.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.06 * radius_m, radius_m, 0.5 * (hi - lo));
    }
}

static void test_a_radio_control_levels_or_turns(void)
{
    const uint16_t pulses[4] = {1750, 1250, 1500, 1500};
    write_u8("sil", "reset", 1);
    TEST_ASSERT_TRUE(ivl_cf_set_cppm(vehicle, pulses, true));
    assert_modes(0, 0, 1, 1, 2);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, -25.0, (double)target().roll);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 25.0, (double)target().pitch);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 32767.0, read_log("ctrltarget", "thrust"));
    TEST_ASSERT_TRUE(ivl_cf_set_cppm(vehicle, pulses, false));
    assert_modes(0, 0, 2, 2, 2);
    write_f32("cppm", "angRoll", NAN);
    TEST_ASSERT_FALSE(ivl_cf_set_cppm(vehicle, pulses, true));
}

// ---- the app

static void test_the_app_flies_hover_and_hands_back(void)
{
    take_off();
    // before it was configured it may not
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_CONFIG, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).rule);
    configure();
    heartbeat(IVL_REQUEST_HOVER, 1000);
    assert_phase(IVL_PHASE_READY);
    assert_at(0.0, 0.0, 1.0, 0.01);
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_IDLE, send_command(IVL_REQUEST_IDLE, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f).phase);
    run_ms(2000);
    assert_at(0.0, 0.0, 1.0, 0.02);
    TEST_ASSERT_TRUE(info(4));
}

static void test_a_hand_back_empties_the_memory_of_the_stock_controller(void)
{
    const float still[3] = {0.0f, 0.0f, 0.0f};
    take_off();
    configure();
    for (int ms = 0; ms < 5500; ms += 50)
    {
        // the stock controller's wanted point stays behind while the core flies elsewhere
        TEST_ASSERT_TRUE(ivl_cf_set_velocity(vehicle, still, 0.0f));
        const ivl_request_t request = (ms >= 500) ? IVL_REQUEST_HOVER : IVL_REQUEST_IDLE;
        (void)send_command(request, 1.0f, 0.0f, 1.0f, 0.0f, 0.0f);
        run_ms(46);
    }
    assert_at(1.0, 0.0, 1.0, 0.02);
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_IDLE, send_command(IVL_REQUEST_IDLE, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f).phase);
    TEST_ASSERT_TRUE(ivl_cf_set_velocity(vehicle, still, 0.0f));
    run_ms(400);
    assert_at(1.0, 0.0, 1.0, 0.02);
}

static void test_a_silent_host_a_lost_link_and_a_request_abort_before_the_trigger(void)
{
    for (int kind = 0; kind < 3; kind++)
    {
        write_u8("sil", "reset", 1);
        ivl_cf_link(vehicle, true);
        configure();
        heartbeat(IVL_REQUEST_HOVER, 300);
        heartbeat(IVL_REQUEST_APPROACH, 100);
        assert_phase(IVL_PHASE_APPROACH);
        ivl_cf_link(vehicle, kind != 1);
        for (int t = 0; t < 600; t += 50)
        {
            if (kind == 1)
            {
                (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 0.5f, 1.5f);
            }
            run_ms(50);
        }
        if (kind == 2)
        {
            (void)send_command(IVL_REQUEST_ABORT, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
        }
        run_ms(10);
        assert_phase(IVL_PHASE_ABORTED);
        const int cause[] = {IVL_RULE_HOST, IVL_RULE_LINK, IVL_RULE_HOST};
        TEST_ASSERT_EQUAL_INT(cause[kind], (int)read_log("ivl", "cause"));
        // hovers, comes down, cuts the motors
        run_ms(12000);
        TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
        TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("motor", "m1"));
        TEST_ASSERT_TRUE(fabs(read_log("simTruth", "x")) < 0.5);
        TEST_ASSERT_FALSE(info(6) || info(7));
    }
}

static void test_motors_that_are_driven_past_the_core_keep_it_from_arming_and_turn_whatever_the_supervisor_says(void)
{
    take_off();
    configure();
    write_u8("motorPowerSet", "enable", 1);
    run_ms(20);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_BYPASS, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).rule);
    const uint16_t some = 12345;
    write_param("motorPowerSet", "m2", &some, sizeof some);
    write_u8("stabilizer", "stop", 1);
    run_ms(200);
    TEST_ASSERT_TRUE(info(6));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 12345.0, read_log("motor", "m2"));
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("motor", "m1"));
}

static void test_the_stock_controller_flies_alone_and_the_app_says_that_it_does_not_run(void)
{
    take_off();
    configure();
    write_u8("stabilizer", "controller", 1);
    run_ms(2000);
    assert_at(0.0, 0.0, 1.0, 0.01);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_NO_CONTROLLER, send_policy(5, 4.0f, 0.007f).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_ERR_NO_CONTROLLER, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).status);
    write_u8("stabilizer", "controller", 6);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(6, 4.0f, 0.007f).status);
    heartbeat(IVL_REQUEST_HOVER, 500);
    assert_phase(IVL_PHASE_READY);
}

static void test_a_weak_battery_refuses_and_one_that_is_flown_gets_weak(void)
{
    configure();
    take_off();
    const double full_V = read_log("pm", "vbat");
    TEST_ASSERT_TRUE(full_V > 3.9 && full_V < 4.1);
    run_ms(60000);
    TEST_ASSERT_TRUE(read_log("pm", "vbat") < full_V - 0.05);
    TEST_ASSERT_TRUE(read_log("pm", "batteryLevel") < 90.0);
    write_f32("sil", "vbat", 3.15f);
    run_ms(6000);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 3.15, read_log("pm", "vbat"));
    TEST_ASSERT_EQUAL_INT(3, (int)read_log("pm", "state"));
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_BATTERY_REST, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).rule);
}

// ---- sensors

static void test_the_level_of_the_battery_follows_its_voltage(void)
{
    const float  volts[] = {2.8f, 3.0f, 3.5f, 3.85f, 3.95f, 4.05f, 4.3f};
    const double levels[] = {0.0, 0.0, 10.0, 30.0, 60.0, 90.0, 90.0};
    for (size_t i = 0; i < sizeof volts / sizeof volts[0]; i++)
    {
        write_f32("sil", "vbat", volts[i]);
        run_ms(20);
        TEST_ASSERT_DOUBLE_WITHIN(0.0, levels[i], read_log("pm", "batteryLevel"));
    }
}

static void test_a_vehicle_at_rest_is_never_exactly_level(void)
{
    run_ms(20);
    const double roll = read_log("stabilizer", "roll"), pitch = read_log("stabilizer", "pitch");
    TEST_ASSERT_TRUE(fabs(roll) > 0.05 && fabs(roll) < 0.6 && fabs(pitch) > 0.05 && fabs(pitch) < 0.6);
}

// ---- decks

static double range_mm(const char *direction)
{
    return read_log("range", direction);
}

static void test_a_multi_ranger_sees_walls_and_ceiling_late_and_nothing_where_nothing_is(void)
{
    TEST_ASSERT_TRUE(ivl_cf_attach(vehicle, "bcMultiranger") && !ivl_cf_attach(vehicle, "bcLoco"));
    write_f32("sil", "wall_x", 2.0f);
    write_f32("sil", "wall_y", 3.0f);
    write_u8("sil", "reset", 1);
    run_ms(1000);
    TEST_ASSERT_DOUBLE_WITHIN(20.0, 2000.0, range_mm("front"));
    TEST_ASSERT_DOUBLE_WITHIN(20.0, 2000.0, range_mm("back"));
    TEST_ASSERT_DOUBLE_WITHIN(30.0, 3000.0, range_mm("left"));
    TEST_ASSERT_DOUBLE_WITHIN(30.0, 3000.0, range_mm("right"));
    TEST_ASSERT_DOUBLE_WITHIN(20.0, 1250.0, range_mm("up"));
    // down looks the other deck
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 32767.0, range_mm("zrange"));
    write_f32("sil", "wall_x", 0.0f);
    run_ms(200);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 32767.0, range_mm("front"));
    // what is told in a climb was measured 80 ms before
    for (int i = 0; i < 60; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_velocity(vehicle, (const float[3]){0.0f, 0.0f, -0.4f}, 0.0f));
        run_ms(10);
    }
    while (ivl_cf_time_us(vehicle) / 1000u % 100u != 20u)
    {
        run_ms(1);
    }
    const double then_m = 2.5 - read_log("simTruth", "z");
    run_ms(79);
    TEST_ASSERT_TRUE(fabs(range_mm("up") - then_m * 1000.0) > 10.0);
    run_ms(1);
    TEST_ASSERT_DOUBLE_WITHIN(3.0, then_m * 1000.0, range_mm("up"));
}

static void test_a_flow_deck_sees_the_floor_pass_below(void)
{
    TEST_ASSERT_TRUE(ivl_cf_attach(vehicle, "bcFlow2"));
    write_u8("sil", "reset", 1);
    for (int i = 0; i < 40; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, 0.5f, 0.0f, 0.0f, 1.0f));
        run_ms(100);
    }
    TEST_ASSERT_DOUBLE_WITHIN(15.0, 1000.0, range_mm("zrange"));
    // 10 ms at 0.5 m/s seen from 1 m, 35 pixels for 0.717 rad: a quarter of a pixel; faster and lower it is more
    TEST_ASSERT_TRUE(read_log("motion", "deltaY") <= 0.0 && read_log("motion", "squal") > 0.0);
    for (int i = 0; i < 30; i++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_hover(vehicle, 0.0f, 2.0f, 0.0f, 0.5f));
        run_ms(100);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0, -0.01 * 2.0 / 0.5 * 35.0 / 0.71674, read_log("motion", "deltaX"));
}

// ---- memories, power, and the hand that puts it down

static const ivl_cf_memory_t *memory_of(uint8_t type, unsigned number)
{
    size_t                 n;
    const ivl_cf_memory_t *m = ivl_cf_memories(vehicle, &n);
    for (size_t i = 0; i < n; i++)
    {
        if (m[i].type == type && number-- == 0u)
        {
            return &m[i];
        }
    }
    return NULL;
}

static void test_memories_that_every_crazyflie_has(void)
{
    uint8_t bytes[300], sum = 0;
    // EEPROM: token, version 1, and a check sum over 20 bytes
    const ivl_cf_memory_t *m = memory_of(0x00, 0);
    TEST_ASSERT_NOT_NULL(m);
    TEST_ASSERT_TRUE(m->read(0, 21, bytes));
    TEST_ASSERT_EQUAL_MEMORY("0xBC\1", bytes, 5);
    for (int i = 0; i < 20; i++)
    {
        sum = (uint8_t)(sum + bytes[i]);
    }
    TEST_ASSERT_EQUAL_HEX8(sum, bytes[20]);
    TEST_ASSERT_TRUE(m->write(8190, 2, (const uint8_t[]){1, 2}) && !m->write(8190, 3, (const uint8_t[]){1, 2, 3}));
    // tester: reads its addresses, counts what is not one
    m = memory_of(0x15, 0);
    TEST_ASSERT_NOT_NULL(m);
    TEST_ASSERT_TRUE(m->read(0x1fe, 4, bytes));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[]){0xfe, 0xff, 0x00, 0x01}), bytes, 4);
    TEST_ASSERT_TRUE(m->write(0, 3, (const uint8_t[]){0, 1, 7}));
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 1.0, read_log("memTst", "errCntW"));
    write_u8("memTst", "resetW", 1);
    TEST_ASSERT_TRUE(m->write(0, 3, (const uint8_t[]){0, 1, 2}));
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("memTst", "errCntW"));
    // decks: version 3 and nothing
    m = memory_of(0x19, 0);
    TEST_ASSERT_NOT_NULL(m);
    TEST_ASSERT_TRUE(m->read(0, 257, bytes));
    TEST_ASSERT_EQUAL_HEX8(3, bytes[0]);
    TEST_ASSERT_EACH_EQUAL_HEX8(0, bytes + 1, 256);
    // one 1-wire memory a deck, which can be written
    TEST_ASSERT_NULL(memory_of(0x01, 0));
    TEST_ASSERT_TRUE(ivl_cf_attach(vehicle, "bcMultiranger") && ivl_cf_attach(vehicle, "bcFlow2"));
    m = memory_of(0x01, 1);
    TEST_ASSERT_NOT_NULL(m);
    TEST_ASSERT_NULL(memory_of(0x01, 2));
    TEST_ASSERT_TRUE(m->read(0, 112, bytes));
    TEST_ASSERT_EQUAL_HEX8(0xEB, bytes[0]);
    TEST_ASSERT_EQUAL_MEMORY("bcMultiranger", bytes + 12, 13);
    TEST_ASSERT_EQUAL_HEX8(ivl_wire_crc(0, bytes, 7) & 0xffu, bytes[7]);
    TEST_ASSERT_EQUAL_HEX8(ivl_wire_crc(0, bytes + 8, (size_t)bytes[9] + 2u) & 0xffu, bytes[10 + bytes[9]]);
}

static void open_brushless(void)
{
    ivl_cf_close(vehicle);
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.5;
    params.rotor_thrust_idle_N = 0.006;
    model = fixture_model(&params);
    open_vehicle(&model);
}

static void test_armed_motors_idle_as_a_parameter_says_and_that_is_no_flight(void)
{
    open_brushless();
    const double full_N = (double)model.firmware.motor_thrust_N_max;
    const struct
    {
        uint32_t pwm;
        double   share;
    } rows[] = {{7000, 1.0}, {3500, 0.25}, {0, 0.0}, {14000, 4.0}};
    run_ms(400);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
    {
        TEST_ASSERT_TRUE(i > 0 || *(const uint32_t *)find_param("powerDist", "idleThrust")->address == rows[0].pwm);
        write_u32("powerDist", "idleThrust", rows[i].pwm);
        run_ms(1000);
        TEST_ASSERT_DOUBLE_WITHIN(1.0, 65535.0 * rows[i].share * 0.006 / full_N, read_log("motor", "m3"));
        TEST_ASSERT_TRUE(info(1) && !info(4));
    }
    write_u32("powerDist", "idleThrust", 7000);
    take_off();
    TEST_ASSERT_TRUE(info(4));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_land(vehicle, 0.0f, 0.0f, true, 2.0f));
    run_ms(4500);
    TEST_ASSERT_FALSE(info(4));
    ivl_cf_arm(vehicle, false);
    write_u8("sil", "auto_arm", 0);
    run_ms(200);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, read_log("motor", "m3"));
}

static void test_without_power_it_falls_and_after_it_boots_where_it_lies(void)
{
    take_off();
    write_u8("stabilizer", "stop", 1);
    run_ms(100);
    TEST_ASSERT_TRUE(info(6));
    write_u8("stabilizer", "stop", 0);
    write_f32("sil", "wall_x", 2.0f);
    write_f32("pid_attitude", "roll_kp", 7.0f);
    ivl_cf_power_off(vehicle);
    run_ms(3000);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
    const uint64_t before_us = ivl_cf_time_us(vehicle);
    ivl_cf_power_on(vehicle);
    ivl_cf_power_on(vehicle);
    TEST_ASSERT_EQUAL_UINT64(before_us, ivl_cf_time_us(vehicle));
    TEST_ASSERT_EQUAL_FLOAT(6.0f, *(const float *)find_param("pid_attitude", "roll_kp")->address);
    TEST_ASSERT_EQUAL_FLOAT(2.0f, *(const float *)find_param("sil", "wall_x")->address);
    run_ms(300);
    TEST_ASSERT_TRUE(!info(6) && info(3));
    const double x = read_log("simTruth", "x"), y = read_log("simTruth", "y");
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    run_ms(3000);
    assert_at(x, y, 1.0, 0.02);
}

static void test_a_hand_puts_the_vehicle_on_its_feet_below_where_it_is(void)
{
    write_f32("sil", "start_x", 0.4f);
    write_u8("sil", "reset", 1);
    write_f32("sil", "start_x", 0.0f);
    run_ms(500);
    write_u8("sil", "place", 1);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
    assert_at(0.4, 0.0, 0.0, 0.02);
    run_ms(6000);
    TEST_ASSERT_TRUE(info(3) && !info(4));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    run_ms(3000);
    assert_at(0.4, 0.0, 1.0, 0.02);
}

static void test_range_upwards_is_the_distance_to_the_ceiling_in_millimetres(void)
{
    take_off();
    TEST_ASSERT_DOUBLE_WITHIN(12.0, 1500.0, read_log("range", "up"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.0, read_log("acc", "z"));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.0, read_log("gyro", "y"));
}

/// Motion capture of a host: the truth, 100 times a second, with a nanometre that moves.
static void track(int ms, bool with_attitude)
{
    for (int t = 0; t < ms; t += 10)
    {
        const float p[3] = {(float)read_log("simTruth", "x"), (float)read_log("simTruth", "y"), (float)read_log("simTruth", "z")};
        const float q[4] = {(float)read_log("simTruth", "qx"), (float)read_log("simTruth", "qy"), (float)read_log("simTruth", "qz"),
                            (float)read_log("simTruth", "qw")};
        TEST_ASSERT_TRUE(with_attitude ? ivl_cf_ext_pose(vehicle, p, q) : ivl_cf_ext_position(vehicle, p));
        run_ms(10);
    }
}

static void test_poses_of_the_host_are_flown_on_and_their_loss_before_the_trigger_aborts(void)
{
    for (int with_attitude = 0; with_attitude < 2; with_attitude++)
    {
        write_u8("sil", "reset", 1);
        write_u8("sil", "pose_source", 1);
        configure();
        track(2000, with_attitude != 0);
        assert_at(0.0, 0.0, 1.25, 0.05);
        TEST_ASSERT_TRUE(sqrt(read_log("kalman", "varPX")) < 0.02);
        (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.25f, 0.0f, 0.0f);
        for (int i = 0; i < 10; i++)
        {
            const uint32_t n = (uint32_t)read_log("sil", "n_pose");
            track(50, with_attitude != 0);
            TEST_ASSERT_EQUAL_UINT32(n + 5u, (uint32_t)read_log("sil", "n_pose"));
            (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.25f, 0.0f, 0.0f);
        }
        assert_phase(IVL_PHASE_READY);
        assert_at(0.0, 0.0, 1.25, 0.05);
        // the cameras stop
        run_ms(150);
        assert_phase(IVL_PHASE_ABORTED);
        TEST_ASSERT_EQUAL_INT(IVL_RULE_STATE, (int)read_log("ivl", "cause"));
        run_ms(500);
        TEST_ASSERT_TRUE(sqrt(read_log("kalman", "varPX")) > 0.1);
        write_u8("sil", "pose_source", 0);
    }
}

static void test_velocity_of_tracked_positions_follows_the_motion(void)
{
    write_u8("sil", "reset", 1);
    write_u8("sil", "pose_source", 1);
    track(200, true);
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_go_to(vehicle, true, false, (const float[3]){1.0f, 0.0f, 0.0f}, 0.0f, 2.0f));
    track(1000, true);
    TEST_ASSERT_DOUBLE_WITHIN(0.08, read_log("simTruth", "vx"), read_log("stateEstimate", "vx"));
    TEST_ASSERT_TRUE(read_log("stateEstimate", "vx") > 0.7);
    track(3000, true);
    assert_at(1.0, 0.0, 1.25, 0.05);
}

static void test_an_estimate_that_begins_elsewhere_is_flown_in_its_own_axes(void)
{
    run_ms(200);
    write_f32("kalman", "initialX", 1.0f);
    write_f32("kalman", "initialY", 2.0f);
    write_f32("kalman", "initialYaw", 1.5707963f);
    write_u8("kalman", "resetEstimation", 1);
    run_ms(20);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, read_log("stateEstimate", "x"));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 2.0, read_log("kalman", "stateY"));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 90.0, read_log("stateEstimate", "yaw"));
    for (int i = 0; i < 80; i++)
    {
        // half a metre ahead of the nose
        TEST_ASSERT_TRUE(ivl_cf_set_position(vehicle, (const float[3]){1.0f, 2.5f, 1.0f}, 90.0f));
        run_ms(100);
    }
    assert_at(0.5, 0.0, 1.0, 0.03);
    write_f32("kalman", "initialX", NAN);
    write_u8("kalman", "resetEstimation", 1);
    run_ms(20);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.5, read_log("stateEstimate", "x"));
}

static void test_an_estimator_without_position_refuses_the_core(void)
{
    take_off();
    configure();
    write_u8("stabilizer", "estimator", 1);
    run_ms(300);
    TEST_ASSERT_EQUAL_UINT8(IVL_RULE_STATE, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).rule);
    write_u8("stabilizer", "estimator", 2);
    run_ms(300);
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_READY, send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f).phase);
}

// ---- reset

static void test_a_reset_from_anywhere_hovers_at_the_start_point_within_a_step(void)
{
    write_f32("sil", "start_x", 0.5f);
    write_f32("sil", "start_y", -0.25f);
    write_f32("sil", "start_z", 0.8f);
    configure();
    for (int kind = 0; kind < 6; kind++)
    {
        if (kind == 1)
        {
            ivl_cf_estop(vehicle);
        }
        else if (kind == 2)
        {
            heartbeat(IVL_REQUEST_HOVER, 200);
        }
        else if (kind == 3)
        {
            (void)ivl_cf_hl_stop(vehicle);
        }
        else if (kind == 4)
        {
            (void)ivl_cf_set_position(vehicle, (const float[3]){3.0f, 0.0f, 1.0f}, 0.0f);
        }
        else if (kind == 5)
        {
            write_u8("stabilizer", "controller", 1);
        }
        run_ms(2500 + 7 * kind);
        write_u8("sil", "reset", 1);
        TEST_ASSERT_EQUAL_UINT8(0, *(const uint8_t *)find_param("sil", "reset")->address);
        TEST_ASSERT_TRUE(info(1) && info(3) && info(4) && info(8) && !info(6) && !info(7));
        run_ms(2);
        assert_at(0.5, -0.25, 0.8, 0.001);
        assert_phase(IVL_PHASE_IDLE);
        run_ms(1500);
        assert_at(0.5, -0.25, 0.8, 0.01);
    }
}

static void test_parameters_out_of_range_are_put_back(void)
{
    write_f32("sil", "start_z", NAN);
    write_f32("sil", "start_x", 1.0e9f);
    write_f64("sil", "speed", (double)NAN);
    write_f64("sil", "angle", -3.0);
    write_f32("sil", "vbat", -1.0f);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, *(const double *)find_param("sil", "speed")->address);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, *(const double *)find_param("sil", "angle")->address);
    write_u8("sil", "reset", 1);
    run_ms(1000);
    assert_at(0.0, 0.0, 1.25, 0.01);
    TEST_ASSERT_TRUE(read_log("pm", "vbat") > 3.9);
    write_u8("stabilizer", "controller", 99);
    TEST_ASSERT_EQUAL_UINT8(6, *(const uint8_t *)find_param("stabilizer", "controller")->address);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tables_name_each_value_once_in_24_characters);
    RUN_TEST(test_every_row_of_the_core_is_served_and_starts_as_the_simulated_vehicle_needs_it);
    RUN_TEST(test_a_vehicle_is_one_a_process_and_flies_at_a_rate_of_the_stabilizer);
    RUN_TEST(test_the_other_rates_fly_too);
    RUN_TEST(test_nothing_takes_off_before_it_is_armed);
    RUN_TEST(test_a_landed_vehicle_that_arms_itself_is_ready_again);
    RUN_TEST(test_stop_and_watchdog_lock_the_vehicle_and_only_a_reset_helps);
    RUN_TEST(test_set_points_age_into_levelling_out_and_a_lock);
    RUN_TEST(test_a_host_that_hands_back_in_time_lands);
    RUN_TEST(test_each_kind_of_set_point_is_followed);
    RUN_TEST(test_thrust_of_the_sticks_is_locked_until_it_was_zero_once);
    RUN_TEST(test_values_that_are_no_numbers_are_refused_everywhere);
    RUN_TEST(test_ways_of_the_high_level_commander_end_where_they_should_and_are_smooth);
    RUN_TEST(test_the_speed_of_a_take_off_and_of_a_landing_decides_how_long_it_takes);
    RUN_TEST(test_an_uploaded_trajectory_is_flown_from_where_the_vehicle_is);
    RUN_TEST(test_a_spiral_ends_on_the_other_side_of_its_centre);
    RUN_TEST(test_a_vehicle_that_was_stopped_has_forgotten_where_it_wanted_to_go);
    RUN_TEST(test_sticks_are_angles_and_an_inverted_rate_or_what_each_mode_makes_of_them);
    RUN_TEST(test_a_quarter_turn_by_the_sticks_goes_clockwise);
    RUN_TEST(test_circles_have_the_radius_that_is_asked_for);
    RUN_TEST(test_a_radio_control_levels_or_turns);
    RUN_TEST(test_the_level_of_the_battery_follows_its_voltage);
    RUN_TEST(test_a_vehicle_at_rest_is_never_exactly_level);
    RUN_TEST(test_a_multi_ranger_sees_walls_and_ceiling_late_and_nothing_where_nothing_is);
    RUN_TEST(test_a_flow_deck_sees_the_floor_pass_below);
    RUN_TEST(test_memories_that_every_crazyflie_has);
    RUN_TEST(test_armed_motors_idle_as_a_parameter_says_and_that_is_no_flight);
    RUN_TEST(test_without_power_it_falls_and_after_it_boots_where_it_lies);
    RUN_TEST(test_a_hand_puts_the_vehicle_on_its_feet_below_where_it_is);
    RUN_TEST(test_the_app_flies_hover_and_hands_back);
    RUN_TEST(test_a_hand_back_empties_the_memory_of_the_stock_controller);
    RUN_TEST(test_a_silent_host_a_lost_link_and_a_request_abort_before_the_trigger);
    RUN_TEST(test_motors_that_are_driven_past_the_core_keep_it_from_arming_and_turn_whatever_the_supervisor_says);
    RUN_TEST(test_the_stock_controller_flies_alone_and_the_app_says_that_it_does_not_run);
    RUN_TEST(test_a_weak_battery_refuses_and_one_that_is_flown_gets_weak);
    RUN_TEST(test_range_upwards_is_the_distance_to_the_ceiling_in_millimetres);
    RUN_TEST(test_poses_of_the_host_are_flown_on_and_their_loss_before_the_trigger_aborts);
    RUN_TEST(test_velocity_of_tracked_positions_follows_the_motion);
    RUN_TEST(test_an_estimate_that_begins_elsewhere_is_flown_in_its_own_axes);
    RUN_TEST(test_an_estimator_without_position_refuses_the_core);
    RUN_TEST(test_a_reset_from_anywhere_hovers_at_the_start_point_within_a_step);
    RUN_TEST(test_parameters_out_of_range_are_put_back);
    return UNITY_END();
}
