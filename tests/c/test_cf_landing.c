/// @file test_cf_landing.c
/// Landings of the software vehicle: the same bits as in the host's process, with the app's own files in between.
#include "cf_fixture.h"
#include "ivl_record.h"
#include "world_rollout.h"

enum
{
    N_GEARS = 6,
    N_EACH = 60,
    TICK_MS_MAX = 4  // of the core: an echo may come before its tick
};

// length, rest angle and mass of a leg: the six designs of the paper as simulated
static const double GEARS[N_GEARS][3] = {{0.05, 0.0, 4.4e-4},  {0.05, 30.0, 4.4e-4},  {0.05, 50.0, 4.4e-4},
                                         {0.075, 0.0, 6.6e-4}, {0.075, 30.0, 6.6e-4}, {0.075, 50.0, 6.6e-4}};

static bool  is_linked;
static float hover_z_m;

static bool next_of_one(void *context, ivl_sim_job_t *job)
{
    if (is_linked)
    {
        return false;
    }
    is_linked = true;
    *job = *(ivl_sim_job_t *)context;
    return true;
}

/// The same landing without the vehicle.
static ivl_sim_outcome_t fly_linked(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec)
{
    ivl_sim_outcome_t outcome;
    ivl_sim_job_t     job = {spec, &outcome, NULL};
    is_linked = false;
    ivl_sim_fly(model, next_of_one, &job);
    return outcome;
}

static ivl_sim_params_t noisy_params(int gear)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    params.leg_length_m = GEARS[gear][0];
    params.leg_angle_deg = GEARS[gear][1];
    params.leg_mass_kg = GEARS[gear][2];
    params.sense_position_noise_m = 0.01;
    params.sense_velocity_noise_mps = 0.05;
    params.sense_attitude_noise_rad = 0.01;
    params.sense_gyro_noise_radps = 0.02;
    params.sense_accel_noise_mps2 = 0.2;
    params.sense_latency_s = 0.01;
    params.rotor_thrust_scatter_norm = 0.02;
    params.leg_stick_delay_s = 0.001;
    params.aero_ceiling_gain_norm = 0.1;
    return params;
}

static ivl_sim_spec_t draw_spec(draws_t *draws, ivl_sim_start_t start)
{
    return (ivl_sim_spec_t){
        .speed_mps = {draw(draws, 0.5, 4.0)},
        .angle_deg = {draw(draws, 20.0, 90.0)},
        .theta = {draw(draws, 2.0, 7.0), 1.0e-3 * draw(draws, 3.0, 11.0)},
        .d_ceil_m = {draw(draws, 0.1, 1.0)},
        .seed = {draw_u64(draws)},
        .stream = {draw_u64(draws)},
        .start = {(int32_t)start},
    };
}

static ivl_sim_spec_t spec_of(double speed_mps, double angle_deg, double rrev_c_per_s, double moment_Nmm, double d_ceil_m, uint64_t seed,
                              uint64_t stream, ivl_sim_start_t start)
{
    return (ivl_sim_spec_t){
        .speed_mps = {speed_mps},
        .angle_deg = {angle_deg},
        .theta = {rrev_c_per_s, 1.0e-3 * moment_Nmm},
        .d_ceil_m = {d_ceil_m},
        .seed = {seed},
        .stream = {stream},
        .start = {(int32_t)start},
    };
}

static void write_spec(const ivl_sim_spec_t *spec)
{
    write_u32("sil", "seed_lo", (uint32_t)spec->seed[0]);
    write_u32("sil", "seed_hi", (uint32_t)(spec->seed[0] >> 32));
    write_u32("sil", "stream_lo", (uint32_t)spec->stream[0]);
    write_u32("sil", "stream_hi", (uint32_t)(spec->stream[0] >> 32));
    write_u8("sil", "start", (uint8_t)spec->start[0]);
    write_f64("sil", "d_ceil", spec->d_ceil_m[0]);
    write_f64("sil", "speed", spec->speed_mps[0]);
    write_f64("sil", "angle", spec->angle_deg[0]);
}

static float angle_of(const ivl_sim_spec_t *spec)
{
    return (float)(spec->angle_deg[0] * (IVL_SIM_PI / 180.0));
}

/// Heartbeats until the outcome is final.
static void wait_for_end(const ivl_sim_spec_t *spec)
{
    for (int t = 0; t < 200 && read_log("sil", "ended") < 1.0; t++)
    {
        run_ms(47);
        (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, (float)spec->speed_mps[0], angle_of(spec));
    }
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "ended"));
}

/// Until the core's next tick, at most.
static void wait_for(const char *group, const char *name, double value)
{
    for (int ms = 0; ms < TICK_MS_MAX && fabs(read_log(group, name) - value) > 0.5; ms++)
    {
        run_ms(1);
    }
}

/// As the host does it: reset, policy, hover, approach.
static ivl_sim_outcome_t fly(const ivl_sim_spec_t *spec, uint32_t seq)
{
    write_u8("sil", "reset", 1);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(seq, (float)spec->theta[0], (float)spec->theta[1]).status);
    (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, hover_z_m, 0.0f, 0.0f);
    wait_for("ivl", "phase", (double)IVL_PHASE_READY);
    assert_phase(IVL_PHASE_READY);
    write_spec(spec);
    const double before = read_log("sil", "episode");
    (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, (float)spec->speed_mps[0], angle_of(spec));
    wait_for("sil", "episode", before + 1.0);
    TEST_ASSERT_EQUAL_INT((int)before + 1, (int)read_log("sil", "episode"));
    wait_for_end(spec);
    ivl_sim_outcome_t             outcome;
    const ivl_cf_outcome_header_t header = read_outcome(&outcome);
    TEST_ASSERT_EQUAL_UINT32(seq, header.policy_seq);
    TEST_ASSERT_EQUAL_UINT32((uint32_t)before + 1u, header.episode);
    const uint64_t draws[2] = {spec->seed[0], spec->stream[0]};
    TEST_ASSERT_EQUAL_UINT32(ivl_wire_crc(ivl_wire_crc(0, draws, sizeof draws), &outcome, sizeof outcome), header.crc);
    return outcome;
}

// ---- equality

static int n_landed, n_missed;

/// Flies the same random landings with the vehicle and without it.
static void compare_landings(const ivl_sim_model_t *model, draws_t *draws, int n)
{
    open_vehicle(model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    for (int i = 0; i < n; i++)
    {
        const ivl_sim_spec_t    spec = draw_spec(draws, (ivl_sim_start_t)(i % IVL_SIM_START_STATE));
        const ivl_sim_outcome_t expected = fly_linked(model, &spec), outcome = fly(&spec, 10u + (uint32_t)i);
        TEST_ASSERT_EQUAL_MEMORY(&expected, &outcome, sizeof expected);
        n_landed += (expected.n_legs[0] >= 3) ? 1 : 0;
        n_missed += (expected.n_legs[0] == 0) ? 1 : 0;
    }
    ivl_cf_close(vehicle);
    vehicle = NULL;
}

static void test_landings_have_the_bits_of_the_same_landing_in_the_process_of_the_host(void)
{
    draws_t draws = {77};
    n_landed = n_missed = 0;
    for (int gear = 0; gear < N_GEARS; gear++)
    {
        const ivl_sim_params_t params = noisy_params(gear);
        const ivl_sim_model_t  model = fixture_model(&params);
        compare_landings(&model, &draws, N_EACH);
    }
    // of both kinds enough
    TEST_ASSERT_TRUE(n_landed >= 5 && n_missed >= 5);
}

static ivl_sim_model_t model_at(const ivl_sim_params_t *params, float tick_hz, uint8_t d_source)
{
    ivl_sim_model_t model;
    ivl_cfg_t       cfg;
    char            error[256] = "";
    ivl_cfg_defaults(&cfg);
    cfg.tick_hz = tick_hz;
    cfg.d_source = d_source;
    TEST_ASSERT_TRUE_MESSAGE(ivl_sim_model_init(&model, params, &cfg, error, sizeof error), error);
    return model;
}

static void test_so_they_have_at_every_rate_of_the_stabilizer(void)
{
    const float rates_hz[] = {1000.0f, 250.0f};
    draws_t     draws = {78};
    for (int i = 0; i < 2; i++)
    {
        const ivl_sim_params_t params = noisy_params(2);
        const ivl_sim_model_t  model = model_at(&params, rates_hz[i], 0);
        compare_landings(&model, &draws, 12);
    }
}

static void test_so_they_have_with_a_camera_a_ranging_sensor_and_lost_samples(void)
{
    draws_t          draws = {79};
    ivl_sim_params_t params = noisy_params(2);
    params.sense_pose_rate_hz = 200.0;
    params.sense_pose_drop_norm = 0.1;
    params.sense_position_resolution_m = 0.001;
    params.rrev_rate_hz = 50.0;
    params.rrev_delay_s = 0.02;
    params.rrev_noise_per_s = 0.2;
    params.range_rate_hz = 40.0;
    params.range_noise_m = 0.01;
    params.range_max_m = 4.0;
    params.flow_rate_hz = 70.0;
    params.flow_noise_radps = 0.2;
    for (uint8_t d_source = 1; d_source <= 3; d_source++)
    {
        const ivl_sim_model_t model = model_at(&params, 500.0f, d_source);
        compare_landings(&model, &draws, 12);
    }
}

static void test_so_they_have_with_motors_that_idle_and_have_a_least_thrust(void)
{
    draws_t          draws = {81};
    ivl_sim_params_t params = noisy_params(2);
    params.rotor_thrust_idle_N = 0.006;
    params.rotor_thrust_least_N = 0.02;
    const ivl_sim_model_t model = fixture_model(&params);
    compare_landings(&model, &draws, 12);
}

static void test_so_they_have_without_any_noise(void)
{
    draws_t                draws = {80};
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    compare_landings(&model, &draws, 12);
}

static void open_noisy(ivl_sim_model_t *model)
{
    const ivl_sim_params_t params = noisy_params(2);
    *model = fixture_model(&params);
    open_vehicle(model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
}

static void test_speed_and_angle_come_from_the_command_unless_a_parameter_tells_them_more_precisely(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    ivl_sim_spec_t          spec = spec_of(2.2, 70.1, 4.1, 8.3, 0.5, 3, 4, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t precise = fly_linked(&model, &spec), flown_precise = fly(&spec, 1);
    TEST_ASSERT_EQUAL_MEMORY(&precise, &flown_precise, sizeof precise);
    // parameters of another landing are not taken for this one's
    const float angle_rad = angle_of(&spec);
    spec.speed_mps[0] = (double)2.2f;
    spec.angle_deg[0] = (double)angle_rad * (180.0 / IVL_SIM_PI);
    const ivl_sim_outcome_t rounded = fly_linked(&model, &spec);
    TEST_ASSERT_TRUE(memcmp(&precise, &rounded, sizeof precise) != 0);
    ivl_sim_spec_t other = spec;
    other.speed_mps[0] = 3.0;
    other.angle_deg[0] = 10.0;
    write_u8("sil", "reset", 1);
    (void)send_policy(2, (float)spec.theta[0], (float)spec.theta[1]);
    (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f);
    write_spec(&other);
    (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 2.2f, angle_rad);
    wait_for_end(&spec);
    ivl_sim_outcome_t flown;
    (void)read_outcome(&flown);
    TEST_ASSERT_EQUAL_MEMORY(&rounded, &flown, sizeof flown);
}

static void test_a_landing_that_was_cut_short_by_a_reset_leaves_no_trace_in_the_next_one(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    draws_t draws = {5};
    for (int i = 0; i < 60; i++)
    {
        const ivl_sim_spec_t    spec = draw_spec(&draws, (ivl_sim_start_t)(i % IVL_SIM_START_STATE));
        const ivl_sim_outcome_t expected = fly_linked(&model, &spec), outcome = fly(&spec, 1u + (uint32_t)i);
        TEST_ASSERT_EQUAL_MEMORY(&expected, &outcome, sizeof expected);
        // ready again in one write, whatever it does now; then into another landing, and out of it after any time
        write_u8("sil", "reset", 1);
        (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f);
        (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 3.0f, 1.2f);
        run_ms((int)(draw_u64(&draws) % 1500u));
    }
}

static void test_an_approach_as_flown_begins_where_the_vehicle_hovers_and_is_judged_too(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    const ivl_sim_model_t model = fixture_model(&params);
    open_vehicle(&model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    // from where a flown start of the same landing begins, but at rest in the vehicle's own hands
    ivl_sim_spec_t          spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.5, 0, 0, IVL_SIM_START_FLOWN);
    const ivl_sim_outcome_t expected = fly_linked(&model, &spec);
    hover_z_m = (float)(2.1 - (0.5 * 2.5 * 2.5 / (double)model.firmware.approach_accel_mps2 + 2.5 * params.start_hold_time_s));
    write_f32("sil", "start_z", hover_z_m);
    spec.start[0] = 255;
    const ivl_sim_outcome_t o = fly(&spec, 3);
    TEST_ASSERT_EQUAL_INT(1, o.triggered[0]);
    TEST_ASSERT_EQUAL_INT(IVL_SIM_END_CONTACT_TIME, o.end_reason[0]);
    TEST_ASSERT_EQUAL_INT(expected.n_legs[0], o.n_legs[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, expected.t_trigger_s[0], o.t_trigger_s[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, expected.vz_trigger_mps[0], o.vz_trigger_mps[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, expected.t_end_s[0], o.t_end_s[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, expected.d_min_m[0], o.d_min_m[0]);
}

// ---- what is left behind

static void test_motors_of_a_vehicle_that_idles_stand_still_in_flip_coast_and_hanging(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    params.rotor_thrust_idle_N = 0.006;
    const ivl_sim_model_t model = fixture_model(&params);
    open_vehicle(&model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.5, 1, 0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&spec, 1);
    TEST_ASSERT_EQUAL_INT(4, o.n_legs[0]);
    // the supervisor has not yet seen that it hangs, and would let motors idle
    TEST_ASSERT_EQUAL_INT(0, (int)read_log("motor", "m1"));
    TEST_ASSERT_EQUAL_INT(0, (int)read_log("motor", "m2"));
    TEST_ASSERT_EQUAL_UINT32(0, *(const uint32_t *)find_param("powerDist", "idleThrust")->address);
    write_u8("sil", "reset", 1);
    run_ms(100);
    TEST_ASSERT_EQUAL_UINT32(7000, *(const uint32_t *)find_param("powerDist", "idleThrust")->address);
}

static void test_a_vehicle_that_hangs_is_crashed_and_a_reset_makes_it_fly(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    const ivl_sim_model_t model = fixture_model(&params);
    open_vehicle(&model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.5, 1, 0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&spec, 1);
    TEST_ASSERT_EQUAL_INT(4, o.n_legs[0]);
    run_ms(2000);
    TEST_ASSERT_EQUAL_INT(4, (int)read_log("simTruth", "feet"));
    TEST_ASSERT_TRUE(info(5) && info(7) && !info(1) && !info(3));
    TEST_ASSERT_FALSE(ivl_cf_recover(vehicle));
    TEST_ASSERT_EQUAL_INT(0, (int)read_log("motor", "m1"));
    write_u8("sil", "reset", 1);
    run_ms(2);
    TEST_ASSERT_TRUE(info(1) && info(3) && info(4) && !info(5) && !info(7));
    run_ms(3000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.05, read_log("simTruth", "z"));
    TEST_ASSERT_TRUE(info(4) && info(8));
}

static void rest_with_the_app_idle(int ms)
{
    for (int t = 0; t < ms; t += 50)
    {
        (void)send_command(IVL_REQUEST_IDLE, 0.0f, 0.0f, 1.0f, 2.5f, 1.5f);
        run_ms(46);
    }
}

static void test_a_vehicle_that_hangs_is_put_upright_by_hand_recovered_and_lands_again(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    const ivl_sim_model_t model = fixture_model(&params);
    open_vehicle(&model);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    const ivl_sim_spec_t spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.5, 1, 0, IVL_SIM_START_IMPARTED);
    TEST_ASSERT_EQUAL_INT(4, fly(&spec, 1).n_legs[0]);
    run_ms(500);
    TEST_ASSERT_TRUE(info(5) && info(7));
    TEST_ASSERT_FALSE_MESSAGE(ivl_cf_recover(vehicle), "upside down");
    write_u8("sil", "place", 1);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
    rest_with_the_app_idle(500);
    TEST_ASSERT_TRUE_MESSAGE(info(7) && !info(5), "upright, and crashed until it is recovered");
    TEST_ASSERT_TRUE(ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f) != 0 || !info(8));
    TEST_ASSERT_TRUE(ivl_cf_recover(vehicle));
    rest_with_the_app_idle(1500);
    TEST_ASSERT_TRUE(!info(7) && info(3));
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    rest_with_the_app_idle(3000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 1.0, read_log("simTruth", "z"));
    // the next one lands as the first
    TEST_ASSERT_EQUAL_INT(4, fly(&spec, 2).n_legs[0]);
}

static void test_the_flight_recorder_holds_the_flip_of_the_landing_in_vehicle_time(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    const ivl_sim_spec_t spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.5, 1, 0, IVL_SIM_START_IMPARTED);
    run_ms(1000);
    (void)fly(&spec, 99);
    run_ms(1500);
    size_t                 n;
    ivl_record_header_t    header;
    const ivl_cf_memory_t *m = ivl_cf_memories(vehicle, &n);
    TEST_ASSERT_EQUAL_UINT8(0x18, m[0].type);
    TEST_ASSERT_EQUAL_UINT32(ivl_record_size(), m[0].size());
    TEST_ASSERT_TRUE(m[0].read(0, sizeof header, (uint8_t *)&header));
    TEST_ASSERT_EQUAL_UINT8(1, header.frozen);
    TEST_ASSERT_EQUAL_UINT32(99, header.policy_seq);
    ivl_record_row_t row;
    const uint32_t   where = (uint32_t)(sizeof header + header.trigger_row * sizeof row);
    TEST_ASSERT_TRUE(m[0].read(where, sizeof row, (uint8_t *)&row));
    TEST_ASSERT_EQUAL_UINT32(header.t_trigger_us, row.t_us[0]);
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_FLIP, row.phase[0]);
    TEST_ASSERT_TRUE(row.t_us[0] > 1000000u && row.t_us[0] < (uint32_t)ivl_cf_time_us(vehicle));
    TEST_ASSERT_FALSE(m[0].read(m[0].size(), 1, (uint8_t *)&row));
}

static void test_the_recording_of_a_landing_begins_at_its_start(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 5.0, 8.0, 0.4, 1, 0, IVL_SIM_START_AT_TRIGGER);
    const ivl_sim_outcome_t o = fly(&spec, 7);
    size_t                  n;
    ivl_record_header_t     header;
    TEST_ASSERT_TRUE(ivl_cf_memories(vehicle, &n)[0].read(0, sizeof header, (uint8_t *)&header));
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(o.t_trigger_s[0] / model.tick_s + 0.5), header.trigger_row);
}

static void test_a_landing_may_be_asked_for_on_the_floor(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    const ivl_sim_spec_t spec = spec_of(2.5, 80.0, 5.0, 8.0, 0.4, 8, 9, IVL_SIM_START_IMPARTED);
    run_ms(200);
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
    (void)send_policy(7, 5.0f, 0.008f);
    write_spec(&spec);
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_APPROACH, send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 2.5f, angle_of(&spec)).phase);
    TEST_ASSERT_EQUAL_INT(0, (int)read_log("sil", "grounded"));
    wait_for_end(&spec);
    ivl_sim_outcome_t       outcome;
    const ivl_sim_outcome_t expected = fly_linked(&model, &spec);
    (void)read_outcome(&outcome);
    TEST_ASSERT_EQUAL_MEMORY(&expected, &outcome, sizeof outcome);
}

/// A vehicle that is not put on a path is protected as a real one is.
static void test_an_approach_as_flown_that_is_asked_for_on_the_floor_waits_for_ready(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    run_ms(200);
    (void)send_policy(7, 0.0f, 0.008f);
    const double before = read_log("sil", "episode");
    TEST_ASSERT_EQUAL_UINT8(IVL_PHASE_IDLE, send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 2.5f, 1.5f).phase);
    run_ms(100);
    assert_phase(IVL_PHASE_IDLE);
    TEST_ASSERT_EQUAL_INT((int)before, (int)read_log("sil", "episode"));
    TEST_ASSERT_EQUAL_INT(1, (int)read_log("sil", "grounded"));
}

/// The same policy, in force still, asks for 7 /s; the landing before it has flipped at 5.
static void test_a_landing_that_flips_at_once_leaves_no_such_policy_behind(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    const ivl_sim_spec_t spec = spec_of(2.5, 90.0, 7.0, 8.0, 0.5, 1, 0, IVL_SIM_START_AT_TRIGGER);
    TEST_ASSERT_EQUAL_INT(1, fly(&spec, 1).triggered[0]);
    write_u8("sil", "start", 255);
    write_u8("sil", "reset", 1);
    (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f);
    wait_for("ivl", "phase", (double)IVL_PHASE_READY);
    (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 1.0f, 1.5f);
    run_ms(100);
    assert_phase(IVL_PHASE_APPROACH);
}

static void test_numbers_of_a_start_are_kept_within_their_ranges(void)
{
    ivl_sim_model_t model;
    open_noisy(&model);
    // a distance out of range is put back into it when it is written
    const ivl_sim_spec_t spec = spec_of(2.5, 90.0, 5.0, 8.0, 1.0e-9, 1, 0, IVL_SIM_START_AT_TRIGGER);
    (void)fly(&spec, 1);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.5, *(const double *)find_param("sil", "d_ceil")->address);
    write_u8("sil", "start", 77);
    TEST_ASSERT_EQUAL_UINT8(255, *(const uint8_t *)find_param("sil", "start")->address);
}

void setUp(void)
{
    hover_z_m = 1.0f;
}

void tearDown(void)
{
    if (vehicle != NULL)
    {
        ivl_cf_close(vehicle);
        vehicle = NULL;
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_landings_have_the_bits_of_the_same_landing_in_the_process_of_the_host);
    RUN_TEST(test_so_they_have_at_every_rate_of_the_stabilizer);
    RUN_TEST(test_so_they_have_with_a_camera_a_ranging_sensor_and_lost_samples);
    RUN_TEST(test_so_they_have_with_motors_that_idle_and_have_a_least_thrust);
    RUN_TEST(test_so_they_have_without_any_noise);
    RUN_TEST(test_speed_and_angle_come_from_the_command_unless_a_parameter_tells_them_more_precisely);
    RUN_TEST(test_a_landing_that_was_cut_short_by_a_reset_leaves_no_trace_in_the_next_one);
    RUN_TEST(test_an_approach_as_flown_begins_where_the_vehicle_hovers_and_is_judged_too);
    RUN_TEST(test_motors_of_a_vehicle_that_idles_stand_still_in_flip_coast_and_hanging);
    RUN_TEST(test_a_vehicle_that_hangs_is_crashed_and_a_reset_makes_it_fly);
    RUN_TEST(test_a_vehicle_that_hangs_is_put_upright_by_hand_recovered_and_lands_again);
    RUN_TEST(test_the_flight_recorder_holds_the_flip_of_the_landing_in_vehicle_time);
    RUN_TEST(test_the_recording_of_a_landing_begins_at_its_start);
    RUN_TEST(test_a_landing_may_be_asked_for_on_the_floor);
    RUN_TEST(test_an_approach_as_flown_that_is_asked_for_on_the_floor_waits_for_ready);
    RUN_TEST(test_a_landing_that_flips_at_once_leaves_no_such_policy_behind);
    RUN_TEST(test_numbers_of_a_start_are_kept_within_their_ranges);
    return UNITY_END();
}
