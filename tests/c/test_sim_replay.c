/// @file test_sim_replay.c
/// What a landing's core was told, told to a fresh core: the same answers, bit for bit, through the model's own core port.
#include "world_replay.h"

#include <string.h>

#include "policy_fixture.h"
#include "sil.h"
#include "sim_fixture.h"
#include "world_rollout.h"

enum
{
    TICKS_MAX = 10000
};

/// A flight core that writes down what it is told and what it answers, at each tick.
typedef struct
{
    int         n_open, n_init, n_commit, n_close;
    size_t      n;
    ivl_in_t    in[TICKS_MAX];
    ivl_state_t state[TICKS_MAX];
    ivl_out_t   out[TICKS_MAX];
} diary_t;

static diary_t              diary;
static ivl_sim_replay_row_t rows[TICKS_MAX], again[TICKS_MAX];

static void *open_diary(void *context)
{
    ((diary_t *)context)->n_open++;
    return context;
}

static void close_diary(void *port)
{
    ((diary_t *)port)->n_close++;
}

static void init_diary(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state)
{
    (void)lane;
    ((diary_t *)port)->n_init++;
    ivl_init(cfg, state);
}

static ivl_status_t commit_diary(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)lane;
    ((diary_t *)port)->n_commit++;
    return ivl_policy_commit(cfg, state, policy);
}

static void step_diary(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    diary_t *d = port;
    (void)lane;
    TEST_ASSERT_LESS_THAN_size_t(TICKS_MAX, d->n);
    ivl_step(cfg, state, in, out);
    d->in[d->n] = *in;
    d->state[d->n] = *state;
    d->out[d->n] = *out;
    d->n++;
}

static const ivl_sim_core_t DIARY_CORE = {.context = &diary,
                                          .open = open_diary,
                                          .close = close_diary,
                                          .init = init_diary,
                                          .commit = commit_diary,
                                          .step = step_diary,
                                          .every_tick = true};

void setUp(void)
{
    memset(&diary, 0, sizeof diary);
    memset(rows, 0x55, sizeof rows);
}

static ivl_sim_model_t noisy_model(void)
{
    ivl_sim_params_t params = fixture_params();
    params.sense_position_noise_m = 0.003;
    params.sense_velocity_noise_mps = 0.03;
    params.sense_gyro_noise_radps = 0.05;
    params.sense_accel_noise_mps2 = 0.3;
    params.sense_latency_s = 0.013;
    return fixture_model(&params);
}

typedef struct
{
    ivl_sim_job_t job;
    bool          taken;
} one_t;

static bool next_of_one(void *context, ivl_sim_job_t *job)
{
    one_t     *one = context;
    const bool first = !one->taken;
    one->taken = true;
    *job = one->job;
    return first;
}

/// Fills the diary with one landing, and tells its outcome.
static ivl_sim_outcome_t fly(const ivl_sim_model_t *model, ivl_sim_start_t start, double rrev_c_per_s)
{
    const ivl_sim_spec_t spec = {.speed_mps = {2.5},
                                 .angle_deg = {75.0},
                                 .theta = {rrev_c_per_s, 8.0e-3},
                                 .d_ceil_m = {0.5},
                                 .seed = {3},
                                 .start = {(int32_t)start}};
    ivl_sim_model_t      watched = *model;
    ivl_sim_outcome_t    outcome;
    one_t                one = {{&spec, &outcome, NULL}, false};
    watched.core = DIARY_CORE;
    ivl_sim_fly(&watched, next_of_one, &one);
    return outcome;
}

static ivl_policy_t policy_of(double rrev_c_per_s)
{
    return constant_policy(1, (float)rrev_c_per_s, 8.0e-3f);
}

static void assert_same_float(float wanted, float found)
{
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &found, sizeof wanted);
}

static void assert_row(size_t i)
{
    const ivl_out_t   *o = &diary.out[i];
    const ivl_state_t *s = &diary.state[i];
    assert_same_float(o->ceiling.d_ceil_m, rows[i].d_ceil_m);
    assert_same_float(o->cues.rrev_per_s, rows[i].rrev_per_s);
    assert_same_float(o->cues.of_y_radps, rows[i].of_y_radps);
    assert_same_float(o->thrust_N[0], rows[i].thrust1_N);
    assert_same_float(o->thrust_N[3], rows[i].thrust4_N);
    assert_same_float(o->pitch_moment_Nm, rows[i].pitch_moment_Nm);
    assert_same_float(s->snapshot.rrev_per_s, rows[i].trigger_rrev_per_s);
    TEST_ASSERT_EQUAL_UINT8(o->phase, rows[i].phase);
    TEST_ASSERT_EQUAL_UINT8(s->guard.rule, rows[i].rule);
    TEST_ASSERT_EQUAL_UINT8(o->cues.valid, rows[i].cue_valid);
    TEST_ASSERT_EQUAL_UINT8(s->triggered, rows[i].triggered);
}

// ---- the same answers -------------------------------------------------------------------------------------------------

static void test_a_landing_s_inputs_give_its_own_answers_bit_for_bit(void)
{
    const ivl_sim_model_t model = noisy_model();
    const ivl_policy_t    policy = policy_of(4.6);
    const ivl_sim_start_t starts[] = {IVL_SIM_START_IMPARTED, IVL_SIM_START_FLOWN};
    for (int k = 0; k < 2; k++)
    {
        setUp();
        const ivl_sim_outcome_t outcome = fly(&model, starts[k], 4.6);
        TEST_ASSERT_EQUAL_INT(1, outcome.triggered[0]);
        TEST_ASSERT_EQUAL_INT(IVL_SIM_REPLAY_DONE, ivl_sim_replay(&model, &model.firmware, &policy, diary.in, diary.n, rows));
        for (size_t i = 0; i < diary.n; i++)
        {
            assert_row(i);
        }
        TEST_ASSERT_EQUAL_UINT8(1, rows[diary.n - 1].triggered);
    }
}

static void test_a_replay_can_be_repeated(void)
{
    const ivl_sim_model_t model = noisy_model();
    const ivl_policy_t    policy = policy_of(4.6);
    (void)fly(&model, IVL_SIM_START_IMPARTED, 4.6);
    memset(again, 0xaa, sizeof again);
    (void)ivl_sim_replay(&model, &model.firmware, &policy, diary.in, diary.n, rows);
    (void)ivl_sim_replay(&model, &model.firmware, &policy, diary.in, diary.n, again);
    TEST_ASSERT_EQUAL_MEMORY(rows, again, diary.n * sizeof rows[0]);
}

static void test_another_policy_or_plane_is_another_trigger(void)
{
    const ivl_sim_model_t model = noisy_model();
    const ivl_policy_t    policy = policy_of(4.6), later = policy_of(5.2);
    (void)fly(&model, IVL_SIM_START_IMPARTED, 4.6);
    ivl_cfg_t lower = model.firmware;
    lower.h_ceil_m -= 0.1f;
    const struct
    {
        const ivl_cfg_t    *cfg;
        const ivl_policy_t *policy;
    } cases[] = {{&model.firmware, &policy}, {&model.firmware, &later}, {&lower, &policy}};
    size_t first[3];
    for (int k = 0; k < 3; k++)
    {
        (void)ivl_sim_replay(&model, cases[k].cfg, cases[k].policy, diary.in, diary.n, rows);
        for (first[k] = 0; first[k] < diary.n && rows[first[k]].triggered == 0; first[k]++)
        {
        }
    }
    TEST_ASSERT_GREATER_THAN_size_t(first[0], first[1]);
    TEST_ASSERT_LESS_THAN_size_t(first[0], first[2]);
}

// ---- the port ---------------------------------------------------------------------------------------------------------

static void test_the_core_of_the_model_is_asked_once_a_tick(void)
{
    ivl_sim_model_t    model = noisy_model();
    const ivl_policy_t policy = policy_of(4.6);
    ivl_in_t           in[5];
    memset(in, 0, sizeof in);
    model.core = DIARY_CORE;
    TEST_ASSERT_EQUAL_INT(IVL_SIM_REPLAY_DONE, ivl_sim_replay(&model, &model.firmware, &policy, in, 5, rows));
    TEST_ASSERT_EQUAL_INT(1, diary.n_open);
    TEST_ASSERT_EQUAL_INT(1, diary.n_init);
    TEST_ASSERT_EQUAL_INT(1, diary.n_commit);
    TEST_ASSERT_EQUAL_size_t(5, diary.n);
    TEST_ASSERT_EQUAL_INT(1, diary.n_close);
}

// ---- refusals ---------------------------------------------------------------------------------------------------------

static void assert_refused(const ivl_cfg_t *cfg, const ivl_policy_t *policy, ivl_sim_replay_status_t wanted)
{
    ivl_sim_model_t model = noisy_model();
    ivl_in_t        in[3];
    memset(in, 0, sizeof in);
    setUp();
    memset(again, 0, sizeof again);
    model.core = DIARY_CORE;
    TEST_ASSERT_EQUAL_INT(wanted, ivl_sim_replay(&model, cfg, policy, in, 3, rows));
    TEST_ASSERT_EQUAL_size_t(0, diary.n);
    TEST_ASSERT_EQUAL_INT(1, diary.n_close);
    TEST_ASSERT_EQUAL_MEMORY(again, rows, 3 * sizeof rows[0]);
}

static void test_a_policy_out_of_range_is_refused_before_the_first_tick(void)
{
    const ivl_sim_model_t model = noisy_model();
    const float           bad[] = {-0.1f, 20.1f, (float)NAN, (float)INFINITY};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
    {
        const ivl_policy_t policy = constant_policy(1, bad[i], 0.008f);
        assert_refused(&model.firmware, &policy, IVL_SIM_REPLAY_BAD_POLICY);
    }
}

static void test_a_configuration_that_the_core_refuses_is_refused(void)
{
    const ivl_policy_t policy = policy_of(4.6);
    ivl_cfg_t          cfg = noisy_model().firmware;
    cfg.h_ceil_m = (float)NAN;
    assert_refused(&cfg, &policy, IVL_SIM_REPLAY_BAD_CONFIG);
}

static void test_nothing_to_replay_is_no_error(void)
{
    const ivl_sim_model_t model = noisy_model();
    const ivl_policy_t    policy = policy_of(4.6);
    TEST_ASSERT_EQUAL_INT(IVL_SIM_REPLAY_DONE, ivl_sim_replay(&model, &model.firmware, &policy, NULL, 0, rows));
}

// ---- the flat interface -----------------------------------------------------------------------------------------------

static void test_tables_describe_what_crosses_the_flat_interface(void)
{
    const ivl_sim_model_t model = noisy_model();
    uint32_t              n = 0, size = 0;
    TEST_ASSERT_NOT_NULL(ivl_sil_table(IVL_SIL_TABLE_REPLAY_IN, &n, &size));
    TEST_ASSERT_EQUAL_size_t(sizeof(ivl_in_t), size);
    TEST_ASSERT_NOT_NULL(ivl_sil_table(IVL_SIL_TABLE_REPLAY_OUT, &n, &size));
    TEST_ASSERT_EQUAL_size_t(sizeof(ivl_sim_replay_row_t), size);
    const double theta[IVL_SIM_THETAS] = {4.6, 8.0e-3}, beyond[IVL_SIM_THETAS] = {21.0};
    (void)fly(&model, IVL_SIM_START_IMPARTED, 4.6);
    TEST_ASSERT_EQUAL_INT(0, ivl_sil_replay(&model, &model.firmware, 0, theta, diary.in, diary.n, rows));
    TEST_ASSERT_EQUAL_UINT8(1, rows[diary.n - 1].triggered);
    TEST_ASSERT_EQUAL_INT(2, ivl_sil_replay(&model, &model.firmware, 0, beyond, diary.in, diary.n, rows));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_landing_s_inputs_give_its_own_answers_bit_for_bit);
    RUN_TEST(test_a_replay_can_be_repeated);
    RUN_TEST(test_another_policy_or_plane_is_another_trigger);
    RUN_TEST(test_the_core_of_the_model_is_asked_once_a_tick);
    RUN_TEST(test_a_policy_out_of_range_is_refused_before_the_first_tick);
    RUN_TEST(test_a_configuration_that_the_core_refuses_is_refused);
    RUN_TEST(test_nothing_to_replay_is_no_error);
    RUN_TEST(test_tables_describe_what_crosses_the_flat_interface);
    return UNITY_END();
}
