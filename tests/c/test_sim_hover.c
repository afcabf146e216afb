/// @file test_sim_hover.c
/// Hovers from set-point to set-point: rows, starts, lanes, set-points in time, flights that end, the flat interface.
#include "world_hover.h"

#include "sil.h"
#include "sim_fixture.h"

enum
{
    N_FLIGHTS = 19,  // no multiple of the lanes
    N_ROWS = 151,
    N_SETPOINTS = 3
};

static const double PERIOD_S = 0.02;

static ivl_sim_setpoint_t setpoint[N_FLIGHTS][N_SETPOINTS];
static ivl_sim_hover_t    flight[N_FLIGHTS];
static ivl_sim_trace_t    rows[N_FLIGHTS][N_ROWS], alone[N_ROWS];

static ivl_sim_model_t noisy_model(void)
{
    ivl_sim_params_t p = fixture_params();
    p.sense_velocity_noise_mps = 0.02;
    p.sense_position_noise_m = 0.001;
    p.sense_latency_s = 0.008;
    return fixture_model(&p);
}

/// Flights between points of their own; the second set-point holds from 1 s on, the third for a moment only.
static void draw_flights(void)
{
    draws_t draws = {4};
    for (int i = 0; i < N_FLIGHTS; i++)
    {
        for (int k = 0; k < N_SETPOINTS; k++)
        {
            setpoint[i][k].t_s = 1.0 * k + ((k == 2) ? 0.9 : 0.0);
            setpoint[i][k].p_W_m[0] = draw(&draws, -0.2, 0.2);
            setpoint[i][k].p_W_m[1] = draw(&draws, -0.2, 0.2);
            setpoint[i][k].p_W_m[2] = draw(&draws, 1.0, 1.4);
        }
        flight[i] = (ivl_sim_hover_t){{7, (uint64_t)i}, setpoint[i], N_SETPOINTS, rows[i]};
    }
}

static void test_rows_stand_at_their_times_and_a_flight_starts_at_rest_at_its_first_set_point(void)
{
    const ivl_sim_model_t model = noisy_model();
    draw_flights();
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    for (int i = 0; i < N_FLIGHTS; i++)
    {
        TEST_ASSERT_EQUAL_DOUBLE_ARRAY(setpoint[i][0].p_W_m, rows[i][0].p_WB_m, 3);
        TEST_ASSERT_EQUAL_DOUBLE(1.0, rows[i][0].q_WB[3]);
        for (int k = 0; k < N_ROWS; k++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, PERIOD_S * k, rows[i][k].t_s[0]);
            TEST_ASSERT_EQUAL_INT32((k == 0) ? IVL_PHASE_IDLE : IVL_PHASE_READY, rows[i][k].phase[0]);
        }
    }
}

static void test_a_set_point_holds_from_its_time_on(void)
{
    const ivl_sim_model_t model = noisy_model();
    draw_flights();
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    for (int i = 0; i < N_FLIGHTS; i++)
    {
        for (int axis = 0; axis < 3; axis++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(0.01, setpoint[i][0].p_W_m[axis], rows[i][50].p_WB_m[axis]);
        }
        // 0.3 s after a step of the height half of it is flown, and not before
        const double step = setpoint[i][1].p_W_m[2] - setpoint[i][0].p_W_m[2];
        const double flown = rows[i][65].p_WB_m[2] - rows[i][50].p_WB_m[2];
        TEST_ASSERT_TRUE(flown / step > 0.3 || fabs(step) < 0.05);
    }
}

static void test_a_flight_has_the_same_bits_alone_and_among_others(void)
{
    const ivl_sim_model_t model = noisy_model();
    draw_flights();
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    for (int i = 0; i < N_FLIGHTS; i += 3)
    {
        ivl_sim_hover_t one = flight[i];
        one.rows = alone;
        ivl_sim_hover(&model, &one, 1, PERIOD_S, N_ROWS);
        TEST_ASSERT_EQUAL_MEMORY(rows[i], alone, sizeof alone);
    }
}

static void test_a_flight_that_is_none_ends_and_disturbs_no_other(void)
{
    const ivl_sim_model_t model = noisy_model();
    draw_flights();
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    memcpy(alone, rows[9], sizeof alone);
    setpoint[4][0].p_W_m[2] = NAN;
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    TEST_ASSERT_EQUAL_MEMORY(alone, rows[9], sizeof alone);
    for (int k = 1; k < N_ROWS; k++)
    {
        TEST_ASSERT_TRUE(isnan(rows[4][k].t_s[0]));
    }
}

static void test_no_flights_are_no_flights(void)
{
    const ivl_sim_model_t model = noisy_model();
    ivl_sim_hover(&model, NULL, 0, PERIOD_S, N_ROWS);
}

static void test_the_flat_interface_flies_the_same_and_refuses_what_is_no_flight(void)
{
    static double          points[N_FLIGHTS][N_SETPOINTS][4];
    static uint64_t        seeds[N_FLIGHTS][2];
    static ivl_sim_trace_t flat[N_FLIGHTS][N_ROWS];
    const ivl_sim_model_t  model = noisy_model();
    draw_flights();
    ivl_sim_hover(&model, flight, N_FLIGHTS, PERIOD_S, N_ROWS);
    for (int i = 0; i < N_FLIGHTS; i++)
    {
        seeds[i][0] = 7;
        seeds[i][1] = (uint64_t)i;
        for (int k = 0; k < N_SETPOINTS; k++)
        {
            points[i][k][0] = setpoint[i][k].t_s;
            memcpy(&points[i][k][1], setpoint[i][k].p_W_m, sizeof setpoint[i][k].p_W_m);
        }
    }
    TEST_ASSERT_EQUAL_INT(0, ivl_sil_hover(&model, points[0][0], N_SETPOINTS, seeds[0], N_FLIGHTS, PERIOD_S, flat, N_ROWS));
    TEST_ASSERT_EQUAL_MEMORY(rows, flat, sizeof flat);
    TEST_ASSERT_EQUAL_INT(-1, ivl_sil_hover(&model, points[0][0], N_SETPOINTS, seeds[0], N_FLIGHTS, 0.0, flat, N_ROWS));
    TEST_ASSERT_EQUAL_INT(-1, ivl_sil_hover(&model, points[0][0], N_SETPOINTS, seeds[0], N_FLIGHTS, NAN, flat, N_ROWS));
    TEST_ASSERT_EQUAL_INT(-1, ivl_sil_hover(&model, points[0][0], 0, seeds[0], N_FLIGHTS, PERIOD_S, flat, N_ROWS));
    TEST_ASSERT_EQUAL_INT(-1, ivl_sil_hover(&model, points[0][0], N_SETPOINTS, seeds[0], N_FLIGHTS, PERIOD_S, flat, 0));
    TEST_ASSERT_EQUAL_INT(0, ivl_sil_hover(&model, NULL, N_SETPOINTS, NULL, 0, PERIOD_S, NULL, N_ROWS));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rows_stand_at_their_times_and_a_flight_starts_at_rest_at_its_first_set_point);
    RUN_TEST(test_a_set_point_holds_from_its_time_on);
    RUN_TEST(test_a_flight_has_the_same_bits_alone_and_among_others);
    RUN_TEST(test_a_flight_that_is_none_ends_and_disturbs_no_other);
    RUN_TEST(test_no_flights_are_no_flights);
    RUN_TEST(test_the_flat_interface_flies_the_same_and_refuses_what_is_no_flight);
    return UNITY_END();
}
