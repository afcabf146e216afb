/// @file test_ivl_distance.c
/// The stage as a whole, flown on known motions: hover, speed-up, constant speed, with readings that are late, missing, false or old.
#include "test_ivl_support.h"

#define TICK_S 0.002

/// One approach: 0.1 s of hover, then a_mps2 up to 2.5 m/s, 1.7 m below the ceiling at the start.
typedef struct
{
    fix_t  fix;
    double a_mps2, t_s, d_m, v_mps, bias_mps2;
    double rrev_period_s, rrev_delay_s, range_period_s, range_delay_s;
    double tilt_rad;
    double q_WB[4];  ///< attitude, if it is not that tilt: x, y, z, w
} run_t;

static double speed_at(const run_t *r, double t)
{
    const double v = r->a_mps2 * (t - 0.1);
    return (t < 0.1) ? 0.0 : ((v < 2.5) ? v : 2.5);
}

static double distance_at(const run_t *r, double t)
{
    const double t1 = 0.1 + 2.5 / r->a_mps2, s = t - 0.1;
    if (t <= 0.1)
    {
        return 1.7;
    }
    return 1.7 - ((t < t1) ? 0.5 * r->a_mps2 * s * s : 3.125 / r->a_mps2 + 2.5 * (t - t1));
}

static void begin(run_t *r, ivl_source_t source)
{
    memset(r, 0, sizeof *r);
    fix_init(&r->fix);
    r->fix.cfg.d_source = (uint8_t)source;
    r->a_mps2 = 4.3;
    r->rrev_period_s = 0.02;
    r->fix.cfg.h_ceil_m = 2.7f;
    ivl_init(&r->fix.cfg, &r->fix.state);
    r->fix.state.sense.up_z = 1.0f;
}

/// The reading that arrives at this tick, if one does.
static void tell(double t, double period, double delay, ivl_reading_t *reading, double (*value)(const run_t *, double), const run_t *r)
{
    if (!(period > 0.0))
    {
        return;
    }
    // sampling instants are multiples of the period
    const double   last = floor((t - delay + 1.0e-9) / period) * period;
    const uint64_t arrival_us = (uint64_t)((last + delay + 1.0) * 1.0e6 + 0.5);
    if ((last >= 0.0) && (arrival_us != reading->t_us))
    {
        *reading = (ivl_reading_t){arrival_us, (float)value(r, last), 1u};
    }
}

static double rrev_at(const run_t *r, double t)
{
    return speed_at(r, t) / distance_at(r, t);
}

static double range_at(const run_t *r, double t)
{
    return distance_at(r, t) / cos(r->tilt_rad);
}

/// The same force, seen from any attitude: the third row of its matrix.
static void lean(ivl_in_t *in, const double q[4], double up)
{
    in->q_WB = (ivl_quat_t){(float)q[0], (float)q[1], (float)q[2], (float)q[3]};
    in->f_B_mps2 = ivl_vec3((float)(up * 2.0 * (q[0] * q[2] - q[1] * q[3])), (float)(up * 2.0 * (q[1] * q[2] + q[0] * q[3])),
                            (float)(up * (1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]))));
}

/// One tick of the stage alone.
static ivl_ceiling_t advance(run_t *r)
{
    ivl_in_t    *in = &r->fix.in;
    const double a = (speed_at(r, r->t_s + TICK_S) - speed_at(r, r->t_s)) / TICK_S + r->bias_mps2;
    r->t_s += TICK_S;
    r->d_m = distance_at(r, r->t_s);
    r->v_mps = speed_at(r, r->t_s);
    in->t_us = (uint64_t)((r->t_s + 1.0) * 1.0e6 + 0.5);
    in->t_pose_us = in->t_us;
    in->p_WB_m = ivl_vec3(0.0f, 0.0f, (float)(2.7 - r->d_m));
    in->v_WB_mps = ivl_vec3(0.0f, 0.0f, (float)r->v_mps);
    in->q_WB = (ivl_quat_t){0.0f, (float)sin(0.5 * r->tilt_rad), 0.0f, (float)cos(0.5 * r->tilt_rad)};
    // a force straight up in W, seen from a body that leans about b_y
    const double up = 9.81 + a;
    in->f_B_mps2 = ivl_vec3((float)(-up * sin(r->tilt_rad)), 0.0f, (float)(up * cos(r->tilt_rad)));
    if (r->q_WB[0] > 0.0)
    {
        lean(in, r->q_WB, up);
    }
    tell(r->t_s, r->rrev_period_s, r->rrev_delay_s, &in->rrev, rrev_at, r);
    tell(r->t_s, r->range_period_s, r->range_delay_s, &in->range, range_at, r);
    ivl_sense_update(&r->fix.cfg, &r->fix.state.sense, in, (float)TICK_S);
    see(&r->fix.cfg, &r->fix.state.sense);
    return ivl_distance_update(&r->fix.cfg, &r->fix.state.distance, &r->fix.state.sense, in, true, (float)TICK_S);
}

static ivl_ceiling_t advance_to(run_t *r, double d_m)
{
    ivl_ceiling_t ceiling = {0};
    while (r->t_s < 0.02 || r->d_m > d_m)
    {
        ceiling = advance(r);
    }
    return ceiling;
}

// known delays, whatever they are, cost nothing: estimates with late readings are as good as with prompt ones
static void test_the_filter_knows_distance_and_speed_at_constant_speed_with_late_readings(void)
{
    const double delays[] = {0.0, 0.007, 0.02, 0.04};
    for (int i = 0; i < 4; i++)
    {
        run_t r;
        begin(&r, IVL_SOURCE_FILTER);
        r.rrev_delay_s = delays[i];
        r.tilt_rad = 0.2;
        r.fix.cfg.h_ceil_m = 3.1f;  // thought to be 0.4 m higher than it is
        // the port tells arrival, the configuration the delay before it
        r.fix.cfg.rrev_delay_s = (float)delays[i];
        const ivl_ceiling_t seen = advance_to(&r, 0.52);
        TEST_ASSERT_TRUE(seen.valid);
        TEST_ASSERT_FLOAT_WITHIN(0.03f, (float)r.d_m, seen.d_ceil_m);
        TEST_ASSERT_FLOAT_WITHIN(0.12f, (float)r.v_mps, seen.v_close_mps);
        TEST_ASSERT_TRUE((seen.d_sigma_m > 0.0f) && (seen.d_sigma_m < 0.06f));
        TEST_ASSERT_TRUE(fabsf(seen.d_ceil_m - (float)r.d_m) < 3.0f * seen.d_sigma_m);
    }
}

static void test_the_filter_knows_them_from_any_attitude(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    const double q[4] = {0.4, -0.2, 0.5, sqrt(0.55)};
    memcpy(r.q_WB, q, sizeof q);
    const ivl_ceiling_t seen = advance_to(&r, 0.52);
    TEST_ASSERT_TRUE(seen.valid);
    TEST_ASSERT_FLOAT_WITHIN(0.03f, (float)r.d_m, seen.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(0.05f, 0.0f, r.fix.state.distance.filter.b_mps2);
}

static void test_an_estimate_begins_with_what_the_pose_says(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    r.fix.cfg.kf_d_sigma_m = 0.1f;
    r.fix.state.sense.sample.p_WB_m = ivl_vec3(0.3f, -0.4f, 1.2f);
    r.fix.state.sense.sample.v_WB_mps = ivl_vec3(0.7f, -0.5f, 1.3f);
    see(&r.fix.cfg, &r.fix.state.sense);
    const ivl_sense_t *sense = &r.fix.state.sense;
    (void)ivl_distance_update(&r.fix.cfg, &r.fix.state.distance, sense, &r.fix.in, true, (float)TICK_S);
    TEST_ASSERT_EQUAL_FLOAT(1.3f, r.fix.state.distance.filter.v_mps);
    TEST_ASSERT_EQUAL_FLOAT(2.7f - 1.2f, r.fix.state.distance.filter.d_m);
}

static void test_nothing_is_shown_before_the_first_measurement_however_certain_it_would_be(void)
{
    const ivl_source_t sources[] = {IVL_SOURCE_FILTER, IVL_SOURCE_RANGE};
    for (int i = 0; i < 2; i++)
    {
        run_t r;
        begin(&r, sources[i]);
        r.rrev_period_s = 0.0;
        r.fix.cfg.kf_d_sigma_m = 0.001f;
        r.fix.cfg.d_sigma_norm_max = 10.0f;
        r.fix.cfg.d_old_s_max = 1.0f;
        for (int n = 0; n < 20; n++)
        {
            (void)advance(&r);
            // away from the ceiling: a distance that grows from nothing
            r.fix.state.sense.sample.v_WB_mps.z = -5.0f;
            const ivl_ceiling_t seen =
                ivl_distance_update(&r.fix.cfg, &r.fix.state.distance, &r.fix.state.sense, &r.fix.in, true, (float)TICK_S);
            TEST_ASSERT_FALSE(seen.valid);
        }
    }
}

static void test_a_delay_that_nobody_told_is_an_error_of_many_centimetres(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    r.rrev_delay_s = 0.03;
    const ivl_ceiling_t seen = advance_to(&r, 0.52);
    TEST_ASSERT_TRUE(fabsf(seen.d_ceil_m - (float)r.d_m) > 0.05f);
}

static void test_the_bias_of_the_accelerometer_is_carried(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    r.bias_mps2 = 0.15;
    const ivl_ceiling_t seen = advance_to(&r, 0.52);
    TEST_ASSERT_FLOAT_WITHIN(0.04f, (float)r.d_m, seen.d_ceil_m);
    TEST_ASSERT_TRUE(r.fix.state.distance.filter.b_mps2 > 0.0f);
}

static void test_ranges_are_turned_upright_and_carried_on(void)
{
    const ivl_source_t sources[] = {IVL_SOURCE_RANGE, IVL_SOURCE_FILTER};
    for (int i = 0; i < 2; i++)
    {
        run_t r;
        begin(&r, sources[i]);
        r.rrev_period_s = 0.0;
        r.range_period_s = 0.1;
        r.range_delay_s = 0.03;
        r.fix.cfg.range_delay_s = 0.03f;
        r.tilt_rad = 0.3;
        const ivl_ceiling_t seen = advance_to(&r, 0.52);
        TEST_ASSERT_TRUE(seen.valid);
        TEST_ASSERT_FLOAT_WITHIN((i == 0) ? 2.0e-3f : 0.02f, (float)r.d_m, seen.d_ceil_m);
        TEST_ASSERT_FLOAT_WITHIN((i == 0) ? 1.0e-4f : 0.05f, 2.5f, seen.v_close_mps);
    }
}

static void test_the_formula_holds_while_accelerating_and_is_invalid_at_constant_speed(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FORMULA);
    r.fix.cfg.rrev_sigma_per_s = 0.001f;
    r.fix.cfg.rrev_sigma_norm = 0.0f;
    r.fix.cfg.rrev_tau_s = 0.01f;
    const ivl_ceiling_t early = advance_to(&r, 1.1);
    TEST_ASSERT_TRUE(early.valid);
    TEST_ASSERT_FLOAT_WITHIN(0.06f, (float)r.d_m, early.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(0.15f, (float)r.v_mps, early.v_close_mps);
    TEST_ASSERT_FALSE(advance_to(&r, 0.5).valid);
}

/// Constant acceleration is what the formula is exact for: late readings are carried on by it.
static void test_the_formula_carries_late_readings_on(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FORMULA);
    r.fix.cfg.rrev_sigma_per_s = 0.001f;
    r.fix.cfg.rrev_sigma_norm = 0.0f;
    r.fix.cfg.rrev_tau_s = 0.0f;
    r.rrev_delay_s = 0.04;
    r.fix.cfg.rrev_delay_s = 0.04f;
    const ivl_ceiling_t seen = advance_to(&r, 1.05);
    TEST_ASSERT_TRUE(seen.valid);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, (float)r.d_m, seen.d_ceil_m);
    TEST_ASSERT_FLOAT_WITHIN(0.05f, (float)r.v_mps, seen.v_close_mps);
}

static void test_what_is_too_uncertain_or_old_is_invalid(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    r.fix.cfg.d_sigma_norm_max = 0.01f;
    TEST_ASSERT_FALSE(advance_to(&r, 0.7).valid);
    r.fix.cfg.d_sigma_norm_max = 0.25f;
    TEST_ASSERT_TRUE(advance(&r).valid);
    // the sensor falls silent at constant speed
    r.rrev_period_s = 0.0;
    r.fix.cfg.d_old_s_max = 0.07f;
    for (int i = 0; i < 20; i++)
    {
        TEST_ASSERT_TRUE(advance(&r).valid);
    }
    for (int i = 0; i < 20; i++)
    {
        (void)advance(&r);
    }
    TEST_ASSERT_FALSE(advance(&r).valid);
}

static void test_an_estimate_begins_anew_with_each_approach_and_shows_nothing_outside(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    TEST_ASSERT_TRUE(advance_to(&r, 0.6).valid);
    ivl_state_t        *state = &r.fix.state;
    const ivl_ceiling_t outside = ivl_distance_update(&r.fix.cfg, &state->distance, &state->sense, &r.fix.in, false, (float)TICK_S);
    TEST_ASSERT_FALSE(outside.valid);
    r.rrev_period_s = 0.0;
    for (int i = 0; i < 5; i++)
    {
        TEST_ASSERT_FALSE(advance(&r).valid);
    }
    TEST_ASSERT_EQUAL_UINT32(0u, state->distance.n_taken);
}

static void test_readings_that_make_no_sense_are_not_looked_at(void)
{
    const float values[] = {NAN, INFINITY, -INFINITY, 20.1f, -20.1f, FLT_MAX};
    for (int i = 0; i < 8; i++)
    {
        run_t r;
        begin(&r, IVL_SOURCE_FILTER);
        (void)advance_to(&r, 0.9);
        const uint32_t n_taken = r.fix.state.distance.n_taken;
        r.rrev_period_s = 0.0;
        r.fix.in.rrev = (ivl_reading_t){r.fix.in.t_us + 1000u, (i < 6) ? values[i] : 3.0f, (uint8_t)(i != 6)};
        if (i == 7)
        {
            r.fix.in.rrev.t_us = r.fix.in.t_us - 200000u;
        }
        (void)advance(&r);
        TEST_ASSERT_EQUAL_UINT32(n_taken, r.fix.state.distance.n_taken);
        TEST_ASSERT_EQUAL_UINT32(0u, r.fix.state.distance.n_gated);
    }
}

static void test_a_wrong_estimate_becomes_uncertain_again_instead_of_refusing_for_ever(void)
{
    run_t r;
    begin(&r, IVL_SOURCE_FILTER);
    (void)advance_to(&r, 1.2);
    r.fix.state.distance.filter.d_m = 0.3f;
    r.fix.state.distance.filter.d1 = 1.0e-6f;
    const ivl_ceiling_t seen = advance_to(&r, 0.45);
    TEST_ASSERT_TRUE(r.fix.state.distance.n_gated >= 5u);
    TEST_ASSERT_TRUE(!seen.valid || (fabsf(seen.d_ceil_m - (float)r.d_m) < 4.0f * seen.d_sigma_m));
}

// ---- anything at all: a distance that is called valid is positive and finite and has a sigma that is

static void spoil_reading(rng_t *rng, const ivl_in_t *in, ivl_reading_t *reading)
{
    const float values[] = {NAN, INFINITY, -INFINITY, FLT_MAX, 0.0f, -1.0e-42f, 1.0e-42f};
    reading->t_us = in->t_us - rng_below(rng, 120000) + ((rng_below(rng, 10) == 0u) ? 100000u : 0u);
    reading->value = (rng_below(rng, 4) == 0u) ? values[rng_below(rng, 7)] : rng_float(rng, -25.0f, 25.0f);
    reading->valid = (uint8_t)rng_below(rng, 3);
}

static void test_no_input_gives_a_valid_distance_with_a_senseless_sigma(void)
{
    rng_t    rng = {23};
    uint64_t n_valid = 0;
    for (int run = 0; run < 400; run++)
    {
        run_t r;
        begin(&r, (ivl_source_t)(1u + rng_below(&rng, 3)));
        r.range_period_s = 0.05;
        r.fix.cfg.d_sigma_norm_max = rng_float(&rng, 0.05f, 10.0f);
        const uint32_t share = 1u << rng_below(&rng, 8);
        for (int i = 0; i < 300; i++)
        {
            r.bias_mps2 = (rng_below(&rng, share * 4u) == 0u) ? (double)rng_float(&rng, -1.0e6f, 1.0e6f) : 0.0;
            if (rng_below(&rng, share) == 0u)
            {
                spoil_reading(&rng, &r.fix.in, &r.fix.in.rrev);
                spoil_reading(&rng, &r.fix.in, &r.fix.in.range);
            }
            const ivl_ceiling_t   seen = advance(&r);
            const ivl_distance_t *d = &r.fix.state.distance;
            TEST_ASSERT_TRUE((d->filter.d1 > 0.0f) && (d->filter.d2 > 0.0f) && (d->filter.d3 > 0.0f));
            TEST_ASSERT_TRUE(isfinite(d->filter.d_m) && isfinite(d->filter.v_mps) && isfinite(d->filter.b_mps2));
            TEST_ASSERT_TRUE(isfinite(seen.d_ceil_m) && isfinite(seen.v_close_mps) && isfinite(seen.d_sigma_m));
            TEST_ASSERT_TRUE(seen.d_sigma_m >= 0.0f);
            if (seen.valid)
            {
                n_valid++;
                TEST_ASSERT_TRUE((seen.d_ceil_m >= r.fix.cfg.d_ceil_m_min) && (seen.d_ceil_m <= r.fix.cfg.d_ceil_m_max));
                TEST_ASSERT_TRUE(seen.d_sigma_m <= r.fix.cfg.d_sigma_norm_max * seen.d_ceil_m);
            }
        }
    }
    TEST_ASSERT_TRUE(n_valid > 10000u);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_filter_knows_distance_and_speed_at_constant_speed_with_late_readings);
    RUN_TEST(test_the_filter_knows_them_from_any_attitude);
    RUN_TEST(test_an_estimate_begins_with_what_the_pose_says);
    RUN_TEST(test_nothing_is_shown_before_the_first_measurement_however_certain_it_would_be);
    RUN_TEST(test_a_delay_that_nobody_told_is_an_error_of_many_centimetres);
    RUN_TEST(test_the_bias_of_the_accelerometer_is_carried);
    RUN_TEST(test_ranges_are_turned_upright_and_carried_on);
    RUN_TEST(test_the_formula_holds_while_accelerating_and_is_invalid_at_constant_speed);
    RUN_TEST(test_the_formula_carries_late_readings_on);
    RUN_TEST(test_what_is_too_uncertain_or_old_is_invalid);
    RUN_TEST(test_an_estimate_begins_anew_with_each_approach_and_shows_nothing_outside);
    RUN_TEST(test_readings_that_make_no_sense_are_not_looked_at);
    RUN_TEST(test_a_wrong_estimate_becomes_uncertain_again_instead_of_refusing_for_ever);
    RUN_TEST(test_no_input_gives_a_valid_distance_with_a_senseless_sigma);
    return UNITY_END();
}
