/// @file test_sim_rollout.c
/// Whole landings in C, and the flat interface: starts, ends, outcomes, specs that are none, lanes, threads, time series.
#include "world_rollout.h"

#include "sil.h"
#include "sim_fixture.h"

enum
{
    N_BATCH = 43  // no multiple of the lanes
};

/// Landings one after the other, as ivl_sim_fly asks for them.
typedef struct
{
    const ivl_sim_spec_t *spec;
    ivl_sim_outcome_t    *outcome;
    ivl_sim_tracer_t     *tracer;
    int                   n, next;
} list_t;

static bool next_of_list(void *context, ivl_sim_job_t *job)
{
    list_t *list = context;
    if (list->next == list->n)
    {
        return false;
    }
    *job = (ivl_sim_job_t){&list->spec[list->next], &list->outcome[list->next], list->tracer};
    list->next++;
    return true;
}

static ivl_sim_outcome_t fly(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec)
{
    ivl_sim_outcome_t outcome;
    memset(&outcome, 0x55, sizeof outcome);  // every field must be written
    list_t list = {spec, &outcome, NULL, 1, 0};
    ivl_sim_fly(model, next_of_list, &list);
    return outcome;
}

static ivl_sim_spec_t spec_of(double speed, double angle, double rrev_c, double moment, ivl_sim_start_t start)
{
    return (ivl_sim_spec_t){.speed_mps = {speed},
                            .angle_deg = {angle},
                            .theta = {rrev_c, 1.0e-3 * moment},
                            .d_ceil_m = {0.5},
                            .seed = {1},
                            .start = {(int32_t)start}};
}

static void draw_batch(ivl_sim_spec_t spec[N_BATCH])
{
    draws_t draws = {10};
    for (int i = 0; i < N_BATCH; i++)
    {
        spec[i] = spec_of(draw(&draws, 0.5, 4.0), draw(&draws, 20.0, 90.0), draw(&draws, 2.0, 7.0), draw(&draws, 3.0, 11.0),
                          (ivl_sim_start_t)(i % IVL_SIM_START_COUNT));
        spec[i].stream[0] = (uint64_t)i;
    }
}

static ivl_sim_params_t noisy_params(void)
{
    ivl_sim_params_t params = fixture_params();
    params.sense_position_noise_m = 0.01;
    params.sense_velocity_noise_mps = 0.05;
    params.sense_latency_s = 0.01;
    params.rotor_thrust_scatter_norm = 0.02;
    params.leg_stick_delay_s = 0.001;
    return params;
}

// ---- lanes and threads ------------------------------------------------------------------------------------------------

static void test_a_landing_has_the_same_bits_alone_among_others_in_another_lane_and_on_any_number_of_threads(void)
{
    const ivl_sim_params_t params = noisy_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_spec_t         spec[N_BATCH], reversed[N_BATCH];
    ivl_sim_outcome_t      alone[N_BATCH], batch[N_BATCH];
    draw_batch(spec);
    for (int i = 0; i < N_BATCH; i++)
    {
        alone[i] = fly(&model, &spec[i]);
        reversed[N_BATCH - 1 - i] = spec[i];
    }
    const int threads[] = {1, 2, 3, 7, 0};
    for (int k = 0; k < 5; k++)
    {
        memset(batch, 0xaa, sizeof batch);
        TEST_ASSERT_EQUAL(0, ivl_sil_rollouts(&model, spec, N_BATCH, threads[k], batch, NULL));
        TEST_ASSERT_EQUAL_MEMORY(alone, batch, sizeof alone);
        TEST_ASSERT_EQUAL(0, ivl_sil_rollouts(&model, reversed, N_BATCH, threads[k], batch, NULL));
        for (int i = 0; i < N_BATCH; i++)
        {
            TEST_ASSERT_EQUAL_MEMORY(&alone[i], &batch[N_BATCH - 1 - i], sizeof alone[i]);
        }
    }
    TEST_ASSERT_EQUAL(0, ivl_sil_rollouts(&model, spec, 0, 4, batch, NULL));  // none
}

static void test_noise_differs_between_streams_and_seeds_and_only_there(void)
{
    const ivl_sim_params_t  params = noisy_params();
    const ivl_sim_model_t   model = fixture_model(&params);
    ivl_sim_spec_t          spec = spec_of(2.5, 80.0, 4.5, 8.0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t first = fly(&model, &spec), again = fly(&model, &spec);
    TEST_ASSERT_EQUAL_MEMORY(&first, &again, sizeof first);
    spec.stream[0] = 1;
    const ivl_sim_outcome_t stream = fly(&model, &spec);
    spec.stream[0] = 0;
    spec.seed[0] = 2;
    const ivl_sim_outcome_t seed = fly(&model, &spec);
    TEST_ASSERT_TRUE(fabs(first.rrev_trigger[0] - stream.rrev_trigger[0]) > 0.0);
    TEST_ASSERT_TRUE(fabs(first.rrev_trigger[0] - seed.rrev_trigger[0]) > 0.0);
}

// ---- ends ------------------------------------------------------------------------------------------------------------

static void test_a_landing_ends_a_second_after_its_first_contact(void)
{
    const ivl_sim_params_t  params = fixture_params();
    const ivl_sim_model_t   model = fixture_model(&params);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 5.0, 8.0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&model, &spec);
    TEST_ASSERT_EQUAL(IVL_SIM_END_CONTACT_TIME, o.end_reason[0]);
    TEST_ASSERT_TRUE(o.t_end_s[0] >= o.t_impact_s[0] + 1.0 - 1.0e-9 && o.t_end_s[0] < o.t_impact_s[0] + 1.0 + model.tick_s);
    TEST_ASSERT_EQUAL(1, o.triggered[0]);
    TEST_ASSERT_TRUE(o.t_trigger_s[0] < o.t_impact_s[0]);
    TEST_ASSERT_TRUE(o.theta_impact_deg[0] > 30.0 && o.theta_impact_deg[0] < 270.0);
    TEST_ASSERT_TRUE(o.rate_impact_radps[0] > 0.0 && o.vz_impact_mps[0] > 0.0);
    TEST_ASSERT_TRUE(o.rrev_trigger[0] >= 5.0);
    TEST_ASSERT_DOUBLE_WITHIN(2.0, o.t_end_s[0] / model.tick_s, (double)o.n_ticks[0]);
    TEST_ASSERT_TRUE(o.n_steps[0] > o.n_ticks[0] / 2);
}

static void check_no_contact(const ivl_sim_outcome_t *o)
{
    TEST_ASSERT_EQUAL(0, o->n_legs[0]);
    TEST_ASSERT_EQUAL(0, o->body_contact[0] + o->base_contact[0]);
    TEST_ASSERT_TRUE(isnan(o->t_impact_s[0]) && isnan(o->theta_impact_deg[0]) && isnan(o->vx_impact_mps[0]) && isnan(o->vz_impact_mps[0]) &&
                     isnan(o->rate_impact_radps[0]));
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_EQUAL_INT8(0, o->leg_order[i]);
    }
}

static void test_a_landing_ends_when_the_ceiling_is_out_of_reach_for_good(void)
{
    const ivl_sim_params_t  params = fixture_params();
    const ivl_sim_model_t   model = fixture_model(&params);
    const ivl_sim_spec_t    spec = spec_of(1.0, 60.0, 2.0, 9.0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&model, &spec);
    TEST_ASSERT_EQUAL(IVL_SIM_END_MISSED, o.end_reason[0]);
    TEST_ASSERT_TRUE(o.t_end_s[0] < 2.0);
    check_no_contact(&o);
}

static void test_a_landing_ends_some_time_after_a_trigger_without_contact(void)
{
    ivl_sim_params_t params = fixture_params();
    params.end_missed_time_s = 0.1;
    const ivl_sim_model_t   model = fixture_model(&params);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 2.0, 0.5, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&model, &spec);
    TEST_ASSERT_EQUAL(IVL_SIM_END_MISSED_TIME, o.end_reason[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.01 * model.tick_s, o.t_trigger_s[0] + 0.1, o.t_end_s[0]);
    check_no_contact(&o);
}

static void test_a_landing_ends_at_the_latest_time_and_says_that_nothing_was_triggered(void)
{
    ivl_sim_params_t params = fixture_params();
    params.end_time_max_s = 0.3;
    const ivl_sim_model_t   model = fixture_model(&params);
    const ivl_sim_spec_t    spec = spec_of(2.5, 90.0, 5.0, 8.0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t o = fly(&model, &spec);
    TEST_ASSERT_EQUAL(IVL_SIM_END_TIME_MAX, o.end_reason[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, 0.3, o.t_end_s[0]);
    TEST_ASSERT_EQUAL(0, o.triggered[0]);
    TEST_ASSERT_TRUE(isnan(o.t_trigger_s[0]) && isnan(o.d_trigger_m[0]) && isnan(o.rrev_trigger[0]) && isnan(o.vz_trigger_mps[0]));
    check_no_contact(&o);
}

/// Every landing that was called missed is flown on, until the time at which it would have been given up anyway.
static void check_missed(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec, int *missed)
{
    const ivl_sim_outcome_t o = fly(model, spec);
    if (o.end_reason[0] != IVL_SIM_END_MISSED)
    {
        return;
    }
    (*missed)++;
    static ivl_sim_group_t group;
    const double           angle = spec->angle_deg[0] * (IVL_SIM_PI / 180.0), V = spec->speed_mps[0];
    const double           p[3] = {0.0, 0.0, model->raw.world_ceiling_height_m + model->raw.world_sensed_gap_offset_m - V * sin(angle)};
    const double           v[3] = {V * cos(angle), 0.0, V * sin(angle)};
    const ivl_sim_rng_t    rng = {spec->seed[0], spec->stream[0]};
    ivl_sim_group_init(model, &group);
    ivl_sim_world_start(&group, 0, &rng, p, v);
    ivl_sim_world_t *w = &group.world[0];
    w->in.cmd = (ivl_command_t){.request = IVL_REQUEST_APPROACH, .speed_mps = (float)V, .angle_rad = (float)angle};
    const ivl_policy_t policy = ivl_sim_policy(spec->form[0], spec->theta, false);
    TEST_ASSERT_EQUAL(IVL_OK, ivl_policy_commit(&model->firmware, &w->firmware, &policy));
    while (group.progress.t_s[0] < o.t_trigger_s[0] + model->raw.end_missed_time_s)
    {
        ivl_sim_world_tick(&group, 0);
        while (!ivl_sim_world_ready(&group, 0))
        {
            ivl_sim_group_step(&group);
        }
    }
    TEST_ASSERT_FALSE(w->impact.happened);
}

static void test_what_is_called_missed_would_never_have_touched_even_with_rotors_that_spin_down_slowly(void)
{
    ivl_sim_params_t params = fixture_params();
    params.body_inertia_xx_kgm2 = 1.72e-5;  // the physical vehicle: light to turn, rotors that take 0.15 s to stop
    params.body_inertia_yy_kgm2 = 1.77e-5;
    params.body_inertia_zz_kgm2 = 3.42e-5;
    params.rotor_tau_up_s = 0.05;
    params.rotor_tau_down_s = 0.15;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {12};
    int                   missed = 0;
    for (int i = 0; i < CASES(400); i++)
    {
        const ivl_sim_spec_t spec = spec_of(draw(&draws, 0.5, 3.0), draw(&draws, 30.0, 90.0), draw(&draws, 1.5, 4.5),
                                            draw(&draws, 2.0, 10.0), IVL_SIM_START_IMPARTED);
        check_missed(&model, &spec, &missed);
    }
    TEST_ASSERT_GREATER_THAN(CASES(100), missed);
}

// ---- specs that are none -----------------------------------------------------------------------------------------------

static void test_a_spec_that_is_no_number_or_out_of_range_is_refused_and_disturbs_no_other(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const double           bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, -1.0, 1.0e30};
    const ivl_sim_spec_t   good = spec_of(2.5, 90.0, 5.0, 8.0, IVL_SIM_START_IMPARTED);
    ivl_sim_spec_t         spec[52];
    ivl_sim_outcome_t      outcome[52];
    int                    n = 0;
    for (int k = 0; k < 5; k++)
    {
        for (int field = 0; field < 5; field++)
        {
            spec[n] = good;
            double *const fields[] = {spec[n].speed_mps, spec[n].angle_deg, &spec[n].theta[0], &spec[n].theta[1], spec[n].d_ceil_m};
            *fields[field] = bad[k];
            spec[n++].start[0] = IVL_SIM_START_AT_TRIGGER;
            spec[n++] = good;
        }
    }
    spec[n] = good;
    spec[n++].start[0] = 3;
    spec[n] = good;
    spec[n++].start[0] = -1;
    const ivl_sim_outcome_t expected = fly(&model, &good);
    TEST_ASSERT_GREATER_THAN(2, expected.n_legs[0]);
    TEST_ASSERT_EQUAL(0, ivl_sil_rollouts(&model, spec, (size_t)n, 1, outcome, NULL));
    for (int i = 0; i < n; i++)
    {
        if (i < 50 && i % 2 == 1)
        {
            TEST_ASSERT_EQUAL_MEMORY(&expected, &outcome[i], sizeof expected);
        }
        else
        {
            TEST_ASSERT_EQUAL(IVL_SIM_END_REFUSED, outcome[i].end_reason[0]);
            TEST_ASSERT_EQUAL(0, outcome[i].triggered[0]);
            check_no_contact(&outcome[i]);
        }
    }
}

// ---- time series -------------------------------------------------------------------------------------------------------

static void test_a_time_series_has_its_rows_and_leaves_the_outcome_as_it_is(void)
{
    const ivl_sim_params_t  params = fixture_params();
    const ivl_sim_model_t   model = fixture_model(&params);
    const ivl_sim_spec_t    spec = spec_of(2.5, 70.0, 5.0, 8.0, IVL_SIM_START_IMPARTED);
    const ivl_sim_outcome_t expected = fly(&model, &spec);
    static ivl_sim_trace_t  rows[4000], few[10];
    ivl_sim_outcome_t       outcome;
    const double            period = 0.004;
    const long              n = ivl_sil_trace(&model, &spec, period, rows, 4000, &outcome);
    TEST_ASSERT_EQUAL_MEMORY(&expected, &outcome, sizeof outcome);
    TEST_ASSERT_INT_WITHIN(1, (int)(outcome.t_end_s[0] / period) + 1, n);
    for (long i = 0; i < n; i++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9, period * (double)i, rows[i].t_s[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 3.0 - rows[i].p_WB_m[2], rows[i].d_ceil_m[0]);
    }
    TEST_ASSERT_EQUAL(n, ivl_sil_trace(&model, &spec, period, few, 10, &outcome));  // counted, not written
    TEST_ASSERT_EQUAL_MEMORY(rows, few, sizeof few);
    TEST_ASSERT_EQUAL(-1, ivl_sil_trace(&model, &spec, 0.0, few, 10, &outcome));
    TEST_ASSERT_EQUAL(-1, ivl_sil_trace(&model, &spec, (double)NAN, few, 10, &outcome));
}

static void test_unwrapped_pitch_follows_a_body_that_turns_more_than_once(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 10.0;
    ivl_sim_model_t model = fixture_model(&params);
    model.firmware.cut_at_inverted = 0;
    ivl_sim_spec_t spec = spec_of(1.0, 90.0, 0.0, 3.0, IVL_SIM_START_AT_TRIGGER);
    spec.d_ceil_m[0] = 4.0;
    static ivl_sim_trace_t rows[2000];
    ivl_sim_outcome_t      outcome;
    const long             n = ivl_sil_trace(&model, &spec, 0.002, rows, 2000, &outcome);
    TEST_ASSERT_TRUE(n > 200 && rows[n - 1].pitch_deg[0] > 400.0);
    for (long i = 1; i < n; i++)
    {
        TEST_ASSERT_TRUE(fabs(rows[i].pitch_deg[0] - rows[i - 1].pitch_deg[0]) < 20.0);
    }
}

// ---- flat interface ------------------------------------------------------------------------------------------------------

static void test_tables_describe_their_records_without_gaps_or_overlaps(void)
{
    for (int table = 0; table < IVL_SIL_TABLE_COUNT; table++)
    {
        uint32_t               n = 0, size = 0, end = 0;
        const ivl_sil_field_t *f = ivl_sil_table(table, &n, &size);
        TEST_ASSERT_NOT_NULL(f);
        for (uint32_t i = 0; i < n; i++)
        {
            const uint32_t width = (uint32_t)(f[i].type[1] - '0');
            TEST_ASSERT_EQUAL_UINT32(0, f[i].offset % width);
            TEST_ASSERT_TRUE(f[i].offset >= end && f[i].offset < end + 8);
            TEST_ASSERT_TRUE(strlen(f[i].name) > 0 && strlen(f[i].unit) > 0 && strlen(f[i].doc) > 0);
            end = f[i].offset + width * f[i].count;
        }
        TEST_ASSERT_TRUE(end <= size && size < end + 8);
    }
    uint32_t n, size;
    TEST_ASSERT_NULL(ivl_sil_table(-1, &n, &size));
    TEST_ASSERT_NULL(ivl_sil_table(IVL_SIL_TABLE_COUNT, &n, &size));
    TEST_ASSERT_EQUAL(IVL_SIL_ABI_VERSION, ivl_sil_abi_version());
}

static void test_a_model_is_made_of_numbers_in_range_only(void)
{
    uint32_t               n, size;
    const ivl_sil_field_t *f = ivl_sil_table(IVL_SIL_TABLE_PARAM, &n, &size);
    const ivl_sim_params_t good = fixture_params();
    double                 values[256];
    char                   error[256];
    TEST_ASSERT_TRUE(n * sizeof(double) == size && n < 256);
    for (uint32_t i = 0; i < n; i++)
    {
        values[i] = f[i].dflt;
    }
    memcpy(values, &good, sizeof good);
    void *model = ivl_sil_model_create(values, error, sizeof error);
    TEST_ASSERT_NOT_NULL(model);
    ivl_sil_model_free(model);
    for (uint32_t i = 0; i < n; i++)
    {
        const double keep = values[i];
        values[i] = (double)NAN;
        TEST_ASSERT_NULL(ivl_sil_model_create(values, error, sizeof error));
        TEST_ASSERT_EQUAL_STRING_LEN(f[i].name, error, strlen(f[i].name));
        values[i] = keep;
    }
}

static void test_codes_have_names_and_other_numbers_have_none(void)
{
    for (int i = 0; i < IVL_SIM_END_COUNT; i++)
    {
        TEST_ASSERT_TRUE(strlen(ivl_sil_end_reason(i)) > 1);
    }
    TEST_ASSERT_EQUAL_STRING("?", ivl_sil_end_reason(-1));
    TEST_ASSERT_EQUAL_STRING("?", ivl_sil_end_reason(IVL_SIM_END_COUNT));
    TEST_ASSERT_EQUAL_STRING("?", ivl_sil_phase_name(-1));
    TEST_ASSERT_EQUAL_STRING("?", ivl_sil_phase_name(IVL_PHASE_COUNT));
    TEST_ASSERT_TRUE(strlen(ivl_sil_phase_name(IVL_PHASE_FLIP)) > 1);
}

/// A state of free flight, at rest in rotation, rotors at hover.
static ivl_sim_spec_t stated(double height_m, double vx, double vz)
{
    ivl_sim_spec_t spec = spec_of(2.5, 60.0, 0.0, 6.0, IVL_SIM_START_STATE);
    spec.p_start_W_m[2] = height_m;
    spec.v_start_W_mps[0] = vx;
    spec.v_start_W_mps[2] = vz;
    spec.q_start_WB[3] = 1.0;
    for (int i = 0; i < 4; i++)
    {
        spec.rotor_start_radps[i] = -1.0;
    }
    return spec;
}

static void test_start_at_the_trigger_is_a_case_of_a_stated_start(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_spec_t         level = spec_of(2.5, 60.0, 4.0, 6.0, IVL_SIM_START_AT_TRIGGER);
    level.d_ceil_m[0] = 0.5;
    double sin_angle, cos_angle;
    ivl_sim_sincos(60.0 * (IVL_SIM_PI / 180.0), &sin_angle, &cos_angle);
    const double            plane = params.world_ceiling_height_m + params.world_sensed_gap_offset_m;
    const ivl_sim_spec_t    same = stated(plane - 0.5, 2.5 * cos_angle, 2.5 * sin_angle);
    const ivl_sim_outcome_t a = fly(&model, &level), b = fly(&model, &same);
    TEST_ASSERT_EQUAL_MEMORY(&a, &b, sizeof a);
    TEST_ASSERT_EQUAL_INT32(1, a.triggered[0]);
}

static void test_stated_starts_that_are_none_are_refused(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_spec_t         spec[5];
    for (int i = 0; i < 5; i++)
    {
        spec[i] = stated(2.0, 0.0, 2.5);
    }
    spec[0].q_start_WB[3] = 0.9;                                     // no rotation
    spec[1].p_start_W_m[2] = params.world_ceiling_height_m + 0.001;  // behind the ceiling
    spec[2].w_start_B_radps[1] = NAN;
    spec[3].rotor_start_radps[2] = 1.0e6;
    spec[4].battery_start_V[0] = -1.0;
    for (int i = 0; i < 5; i++)
    {
        TEST_ASSERT_EQUAL_INT32(IVL_SIM_END_REFUSED, fly(&model, &spec[i]).end_reason[0]);
    }
}

static void test_a_stated_turn_goes_on(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_sim_spec_t         spec = stated(2.6, 0.3, 2.5);
    // nose up by 30 degrees and turning at 10 rad/s: the flip, which begins at once, arrives earlier
    spec.q_start_WB[1] = -sin(15.0 * (IVL_SIM_PI / 180.0));
    spec.q_start_WB[3] = cos(15.0 * (IVL_SIM_PI / 180.0));
    spec.w_start_B_radps[1] = -10.0;
    const ivl_sim_outcome_t turning = fly(&model, &spec);
    const ivl_sim_spec_t    level = stated(2.6, 0.3, 2.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 10.0, turning.rate_trigger_radps[0]);
    TEST_ASSERT_TRUE(turning.theta_impact_deg[0] > fly(&model, &level).theta_impact_deg[0] + 20.0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_landing_has_the_same_bits_alone_among_others_in_another_lane_and_on_any_number_of_threads);
    RUN_TEST(test_noise_differs_between_streams_and_seeds_and_only_there);
    RUN_TEST(test_a_landing_ends_a_second_after_its_first_contact);
    RUN_TEST(test_a_landing_ends_when_the_ceiling_is_out_of_reach_for_good);
    RUN_TEST(test_a_landing_ends_some_time_after_a_trigger_without_contact);
    RUN_TEST(test_a_landing_ends_at_the_latest_time_and_says_that_nothing_was_triggered);
    RUN_TEST(test_what_is_called_missed_would_never_have_touched_even_with_rotors_that_spin_down_slowly);
    RUN_TEST(test_a_spec_that_is_no_number_or_out_of_range_is_refused_and_disturbs_no_other);
    RUN_TEST(test_a_time_series_has_its_rows_and_leaves_the_outcome_as_it_is);
    RUN_TEST(test_unwrapped_pitch_follows_a_body_that_turns_more_than_once);
    RUN_TEST(test_tables_describe_their_records_without_gaps_or_overlaps);
    RUN_TEST(test_a_model_is_made_of_numbers_in_range_only);
    RUN_TEST(test_codes_have_names_and_other_numbers_have_none);
    RUN_TEST(test_start_at_the_trigger_is_a_case_of_a_stated_start);
    RUN_TEST(test_stated_starts_that_are_none_are_refused);
    RUN_TEST(test_a_stated_turn_goes_on);
    return UNITY_END();
}
