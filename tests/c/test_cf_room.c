/// @file test_cf_room.c
/// Several vehicles in one room: what is remembered of each, what distance sensors see of the others, and what it is to run into one.
/// One vehicle flies here; the test moves the others, whose tracks are memory that anybody could write.
#include "cf_fixture.h"
#include "cf_room.h"

#include <math.h>

enum
{
    OTHER = 1,
    N = 2
};

static const double VEHICLE_M = 0.046;  // from the origin to a motor

static ivl_sim_model_t model;
static ivl_cf_room_t   room;

void setUp(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.5;
    params.rotor_x_m = params.rotor_y_m = VEHICLE_M * sqrt(0.5);
    model = fixture_model(&params);
    memset(&room, 0, sizeof room);
    room.n = N;
    open_vehicle(&model);
    ivl_cf_enter(vehicle, &room, 0);
    TEST_ASSERT_TRUE(ivl_cf_attach(vehicle, "bcMultiranger") && ivl_cf_attach(vehicle, "bcFlow2"));
}

void tearDown(void)
{
    ivl_cf_close(vehicle);
}

static void tell(uint64_t t_us, double x, double y, double z)
{
    const ivl_cf_place_t place = {.t_us = t_us, .is_there = true, .p_W_m = {x, y, z}};
    ivl_cf_room_tell(&room, OTHER, &place);
}

static double range_mm(const char *direction)
{
    return read_log("range", direction);
}

static void assert_sees_nothing(const char *direction)
{
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.0, 32767.0, range_mm(direction), direction);
}

// ---- tracks

static void test_a_track_remembers_where_a_vehicle_was(void)
{
    ivl_cf_place_t place;
    TEST_ASSERT_FALSE(ivl_cf_room_look(&room, OTHER, 0, &place));
    for (unsigned t_ms = 1; t_ms <= 5000; t_ms++)
    {
        tell(1000u * t_ms, t_ms, 0.0, 1.0);
        // the last of all, one between two moments, one that has not come yet
        TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 1000u * t_ms, &place));
        TEST_ASSERT_EQUAL_DOUBLE(t_ms, place.p_W_m[0]);
        TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 1000u * t_ms + 99999u, &place));
        TEST_ASSERT_EQUAL_DOUBLE(t_ms, place.p_W_m[0]);
        const unsigned then_ms = (t_ms > 700u) ? t_ms - 700u : 1u;
        TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 1000u * then_ms + 999u, &place));
        TEST_ASSERT_EQUAL_DOUBLE(then_ms, place.p_W_m[0]);
    }
    // what is forgotten is taken for the oldest that is remembered
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 17, &place));
    TEST_ASSERT_EQUAL_DOUBLE(5000 - IVL_CF_ROOM_MOMENTS + 2, place.p_W_m[0]);
    const ivl_cf_place_t gone = {.t_us = 6000000u};
    ivl_cf_room_tell(&room, OTHER, &gone);
    TEST_ASSERT_FALSE(ivl_cf_room_look(&room, OTHER, 7000000u, &place));
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 5000000u, &place));
}

/// A process that has died while it was writing must not keep others from reading.
static void test_a_moment_that_was_never_finished_is_not_waited_for(void)
{
    ivl_cf_place_t place;
    for (unsigned t_ms = 1; t_ms <= 3000; t_ms++)
    {
        tell(1000u * t_ms, t_ms, 0.0, 1.0);
    }
    room.track[OTHER].n_begun++;
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 0, &place));
    TEST_ASSERT_EQUAL_DOUBLE(3000 - IVL_CF_ROOM_MOMENTS + 2, place.p_W_m[0]);
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, OTHER, 3000000u, &place));
    TEST_ASSERT_EQUAL_DOUBLE(3000, place.p_W_m[0]);
}

static void test_vehicles_begin_apart(void)
{
    for (size_t n_vehicles = 1; n_vehicles <= IVL_CF_ROOM_VEHICLES; n_vehicles++)
    {
        double spot_m[IVL_CF_ROOM_VEHICLES][2];
        for (size_t n = 0; n < n_vehicles; n++)
        {
            ivl_cf_room_spot(n, n_vehicles, spot_m[n]);
            for (size_t k = 0; k < n; k++)
            {
                TEST_ASSERT_TRUE(hypot(spot_m[n][0] - spot_m[k][0], spot_m[n][1] - spot_m[k][1]) >= 0.99);
            }
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.0, 0.0, fabs(spot_m[0][0]) + fabs(spot_m[0][1]));
    }
}

static void test_a_further_vehicle_stands_and_starts_at_its_spot(void)
{
    double         spot_m[2];
    ivl_cf_place_t place;
    tearDown();
    memset(&room, 0, sizeof room);
    room.n = 7;
    open_vehicle(&model);
    ivl_cf_enter(vehicle, &room, 5);
    ivl_cf_room_spot(5, 7, spot_m);
    run_ms(10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, spot_m[0], read_log("simTruth", "x"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, spot_m[1], read_log("simTruth", "y"));
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, 5, 10000, &place));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, spot_m[0], place.p_W_m[0]);
    write_u8("sil", "reset", 1);
    run_ms(500);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, spot_m[0], read_log("simTruth", "x"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, spot_m[1], read_log("simTruth", "y"));
}

// ---- seen

typedef struct
{
    const char *direction;
    double      axis[3];
} beam_t;

static const beam_t BEAMS[] = {{"front", {1, 0, 0}},  {"back", {-1, 0, 0}}, {"left", {0, 1, 0}},
                               {"right", {0, -1, 0}}, {"up", {0, 0, 1}},    {"zrange", {0, 0, -1}}};

static void test_a_distance_sensor_sees_another_vehicle_in_its_cone(void)
{
    write_u8("sil", "reset", 1);
    run_ms(1000);
    const double p[3] = {read_log("simTruth", "x"), read_log("simTruth", "y"), read_log("simTruth", "z")};
    for (size_t b = 0; b < sizeof BEAMS / sizeof BEAMS[0]; b++)
    {
        // nearer than floor and ceiling; aside by an angle: 10 degrees are in a cone of 27, 40 are not
        const double *a = BEAMS[b].axis, aside[3] = {a[1] + a[2], a[0], 0.0}, way_m = 0.6;
        for (double angle = -40.0; angle <= 40.0; angle += 10.0)
        {
            const double s = way_m * sin(angle * IVL_SIM_PI / 180.0), c = way_m * cos(angle * IVL_SIM_PI / 180.0);
            run_ms(100);
            tell(ivl_cf_time_us(vehicle), p[0] + c * a[0] + s * aside[0], p[1] + c * a[1] + s * aside[1], p[2] + c * a[2] + s * aside[2]);
            run_ms(200);
            if (fabs(angle) <= 10.0)
            {
                TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(15.0, 1000.0 * (way_m - VEHICLE_M), range_mm(BEAMS[b].direction), BEAMS[b].direction);
            }
            else if (fabs(angle) >= 30.0)
            {
                TEST_ASSERT_TRUE_MESSAGE(range_mm(BEAMS[b].direction) > 1000.0, BEAMS[b].direction);
            }
        }
    }
    // behind a wall nobody is seen, beyond four metres neither
    tell(ivl_cf_time_us(vehicle), p[0] + 2.0, p[1], p[2]);
    run_ms(200);
    TEST_ASSERT_DOUBLE_WITHIN(15.0, 1000.0 * (2.0 - VEHICLE_M), range_mm("front"));
    write_f32("sil", "wall_x", 1.0f);
    run_ms(200);
    TEST_ASSERT_DOUBLE_WITHIN(15.0, 1000.0, range_mm("front"));
    write_f32("sil", "wall_x", 0.0f);
    tell(ivl_cf_time_us(vehicle), p[0] + 4.2, p[1], p[2]);
    run_ms(200);
    assert_sees_nothing("front");
    // and who has been taken out of the room is nowhere
    const ivl_cf_place_t gone = {.t_us = ivl_cf_time_us(vehicle), .p_W_m = {p[0] + 1.0, p[1], p[2]}};
    ivl_cf_room_tell(&room, OTHER, &gone);
    run_ms(200);
    assert_sees_nothing("front");
}

/// What the multi-ranger tells was measured 80 ms before: another vehicle may be stepped up to that much later, or a second earlier.
static void test_what_is_seen_does_not_depend_on_who_is_stepped_first(void)
{
    const int lead_ms[] = {-79, -40, -1, 0, 1, 40, 500, 900};
    double    seen_mm[8][20];
    for (size_t i = 0; i < 8; i++)
    {
        tearDown();
        setUp();
        write_u8("sil", "reset", 1);
        unsigned other_ms = 0;
        for (int t_ms = 1; t_ms <= 2000; t_ms++)
        {
            for (; (int)other_ms < t_ms + lead_ms[i]; other_ms++)
            {
                tell(1000u * other_ms, 2.0 - 0.0005 * other_ms, 0.0, 1.25);
            }
            run_ms(1);
            if (t_ms % 100 == 0)
            {
                seen_mm[i][t_ms / 100 - 1] = range_mm("front");
            }
        }
        TEST_ASSERT_DOUBLE_WITHIN(20.0, 1000.0 * (2.0 - 0.0005 * 1920.0 - VEHICLE_M), seen_mm[i][19]);
        TEST_ASSERT_EQUAL_MEMORY(seen_mm[0] + 1, seen_mm[i] + 1, sizeof seen_mm[0] - sizeof seen_mm[0][0]);
    }
}

static void test_time_that_was_left_out_passes_for_the_others(void)
{
    write_u8("sil", "reset", 1);
    run_ms(200);
    for (unsigned t_ms = 1; t_ms <= 3200; t_ms++)
    {
        tell(1000u * t_ms, 3.0 - 0.0005 * t_ms, 0.0, 1.25);
    }
    ivl_cf_skip(vehicle, 3000000u);
    run_ms(100);
    TEST_ASSERT_DOUBLE_WITHIN(20.0, 1000.0 * (3.0 - 0.0005 * 3200.0 - VEHICLE_M), range_mm("front"));
}

// ---- felt

static void test_two_that_meet_bounce_off_each_other(void)
{
    write_u8("sil", "reset", 1);
    run_ms(500);
    double closest_m = 1.0;
    for (int t_ms = 0; t_ms < 1500; t_ms++)
    {
        TEST_ASSERT_TRUE(ivl_cf_set_velocity(vehicle, (const float[3]){0.5f, 0.0f, 0.0f}, 0.0f));
        tell(ivl_cf_time_us(vehicle), 0.4, 0.0, 1.25);
        run_ms(1);
        closest_m = fmin(closest_m, hypot(0.4 - read_log("simTruth", "x"), 1.25 - read_log("simTruth", "z")));
    }
    TEST_ASSERT_TRUE(read_log("sil", "n_bumps") >= 1.0);
    // the test's own does not give way: it is pressed a little
    TEST_ASSERT_TRUE(closest_m > 2.0 * VEHICLE_M - 0.03);
    char         text[200];
    const size_t n = ivl_cf_console_take(vehicle, text, sizeof text - 1u);
    text[n] = '\0';
    TEST_ASSERT_NOT_NULL(strstr(text, "SIL: ran into vehicle 1\n"));
}

static void test_each_takes_half_of_the_closing_speed_and_what_bounces_back(void)
{
    write_u8("sil", "reset", 1);
    run_ms(500);
    const double         x = read_log("simTruth", "x"), z = read_log("simTruth", "z");
    const ivl_cf_place_t place = {
        .t_us = ivl_cf_time_us(vehicle), .is_there = true, .p_W_m = {x + 0.08, 0.0, z}, .v_W_mps = {-2.0, 0.0, 0.0}};
    const double before_mps = read_log("simTruth", "vx");
    ivl_cf_room_tell(&room, OTHER, &place);
    run_ms(4);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, before_mps - 0.5 * (1.0 + 0.3) * 2.0, read_log("simTruth", "vx"));
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 1.0, read_log("sil", "n_bumps"));
    // the other one has not been stepped since, and is where and as fast as it was: no second time
    run_ms(14);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 1.0, read_log("sil", "n_bumps"));
    // what others see of the moment is the velocity before it
    ivl_cf_place_t seen;
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, 0, place.t_us + 2000u, &seen));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, before_mps, seen.v_W_mps[0]);
    TEST_ASSERT_TRUE(ivl_cf_room_look(&room, 0, place.t_us + 6000u, &seen));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, before_mps - 1.3, seen.v_W_mps[0]);
}

// ---- alone

static void fly_and_note(uint8_t seen[2000][12])
{
    run_ms(300);
    TEST_ASSERT_EQUAL_INT(0, ivl_cf_hl_takeoff(vehicle, 1.0f, 0.0f, true, 1.5f));
    for (int i = 0; i < 2000; i++)
    {
        run_ms(1);
        const float p[3] = {(float)read_log("simTruth", "x"), (float)read_log("simTruth", "z"), (float)read_log("simTruth", "qy")};
        memcpy(seen[i], p, sizeof p);
    }
}

static void test_a_room_without_neighbours_changes_no_bit(void)
{
    static uint8_t alone[2000][12], with_room[2000][12];
    fly_and_note(with_room);
    tearDown();
    open_vehicle(&model);
    fly_and_note(alone);
    TEST_ASSERT_EQUAL_MEMORY(alone, with_room, sizeof alone);
}

static void test_a_landing_put_to_its_start_is_flown_without_the_others(void)
{
    ivl_cf_place_t place;
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, commit_config(1).status);
    TEST_ASSERT_EQUAL_INT(IVL_WIRE_OK, send_policy(1, 5.0f, 0.008f).status);
    for (int start = 0; start < 2; start++)
    {
        write_u8("sil", "start", (start == 0) ? 255u : 0u);
        write_u8("sil", "reset", 1);
        (void)send_command(IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.25f, 0.0f, 0.0f);
        run_ms(300);
        (void)send_command(IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.25f, 2.0f, 1.5f);
        run_ms(5);
        assert_phase(IVL_PHASE_APPROACH);
        TEST_ASSERT_EQUAL_INT(start == 0, ivl_cf_room_look(&room, 0, ivl_cf_time_us(vehicle), &place));
        (void)send_command(IVL_REQUEST_ABORT, 0.0f, 0.0f, 1.25f, 2.0f, 1.5f);
        run_ms(200);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_track_remembers_where_a_vehicle_was);
    RUN_TEST(test_a_moment_that_was_never_finished_is_not_waited_for);
    RUN_TEST(test_vehicles_begin_apart);
    RUN_TEST(test_a_further_vehicle_stands_and_starts_at_its_spot);
    RUN_TEST(test_a_distance_sensor_sees_another_vehicle_in_its_cone);
    RUN_TEST(test_what_is_seen_does_not_depend_on_who_is_stepped_first);
    RUN_TEST(test_time_that_was_left_out_passes_for_the_others);
    RUN_TEST(test_two_that_meet_bounce_off_each_other);
    RUN_TEST(test_each_takes_half_of_the_closing_speed_and_what_bounces_back);
    RUN_TEST(test_a_room_without_neighbours_changes_no_bit);
    RUN_TEST(test_a_landing_put_to_its_start_is_flown_without_the_others);
    return UNITY_END();
}
