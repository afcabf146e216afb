/// @file test_ivl_fuzz.c
/// Seeded random flights: valid and garbage inputs mixed, requests and policies at random, over all phases.
/// After every tick: outputs finite and in range, motors off where they must be, at most one trigger per arm cycle and only on an input
/// that is good by this file's own judgement, the snapshot unchanged until the next cycle, and no motor on inputs that have been bad for long.
#include "ivl_general.h"
#include "test_ivl_support.h"

// fewer on a slow machine, more for a long search
#ifndef N_FLIGHTS
#define N_FLIGHTS 6000
#endif
#define N_TICKS     500
#define N_TICKS_ALL ((uint64_t)N_FLIGHTS * N_TICKS)

typedef struct
{
    rng_t          rng;
    fix_t          fix;
    float          garbage_norm;  // share of spoiled inputs in this flight
    float          stay_norm;     // chance per tick that a burst of spoiled inputs goes on
    bool           in_burst;
    uint32_t       burst_kind;
    uint32_t       n_trigger_cycle;  // triggers since the last arming
    uint32_t       n_bad_pose_run;   // ticks in a row whose pose was bad
    uint64_t       t_last_us;
    bool           was_latched_off;
    ivl_phase_t    last_phase;
    uint32_t       decided_crc;  // of the policy that was in force when it was decided last
    ivl_snapshot_t snapshot;
} flight_t;

static uint64_t n_ticks_in[IVL_PHASE_COUNT];
static uint64_t n_triggers, n_estimated, n_general, n_spoiled, n_cycles;

// ---- this file's own judgement of an input, from the stated ranges

static bool number_in(float x, float limit)
{
    return isfinite(x) && (x >= -limit) && (x <= limit);
}

static bool pose_is_good(const ivl_in_t *in, const ivl_cfg_t *cfg, uint64_t t_last_us)
{
    const float limits[SPOIL_FLOATS] = {200.0f, 200.0f, 200.0f,  50.0f,   50.0f,   50.0f,  2.0f,   2.0f,
                                        2.0f,   2.0f,   1000.0f, 1000.0f, 1000.0f, 1.0e6f, 1.0e6f, 1.0e6f};
    ivl_in_t    copy = *in;
    for (uint32_t i = 0; i < SPOIL_FLOATS; i++)
    {
        if (!number_in(*spoil_float(&copy, i), limits[i]))
        {
            return false;
        }
    }
    const float n2 = in->q_WB.x * in->q_WB.x + in->q_WB.y * in->q_WB.y + in->q_WB.z * in->q_WB.z + in->q_WB.w * in->q_WB.w;
    const bool  is_unit = (n2 >= 0.949f) && (n2 <= 1.051f);
    const bool  is_recent =
        (in->t_pose_us <= in->t_us) && ((double)(in->t_us - in->t_pose_us) * 1.0e-6 <= (double)cfg->stale_s_max + 1.0e-6);
    return is_unit && is_recent && (in->t_us > t_last_us);
}

static bool approach_is_good(const ivl_command_t *cmd, const ivl_cfg_t *cfg)
{
    return (cmd->request == IVL_REQUEST_APPROACH) && isfinite(cmd->speed_mps) && isfinite(cmd->angle_rad) &&
           (cmd->speed_mps >= cfg->speed_mps_min) && (cmd->speed_mps <= cfg->speed_mps_max) && (cmd->angle_rad >= 0.0f) &&
           (cmd->angle_rad < 1.5708f);
}

static bool vitals_are_good(const ivl_vitals_t *v, const ivl_cfg_t *cfg)
{
    return !v->given ||
           (v->can_fly && (v->vbat_V >= cfg->vbat_V_min) && (v->link_age_s <= cfg->link_s_max) &&
            (v->setpoint_age_s <= cfg->setpoint_s_max) && (v->host_age_s <= cfg->host_s_max) && (v->p_sigma_m <= cfg->p_sigma_m_max));
}

// ---- random vehicles and inputs

static void random_cfg(flight_t *f)
{
    ivl_cfg_t *cfg = &f->fix.cfg;
    ivl_cfg_defaults(cfg);
    cfg->tick_hz = (rng_below(&f->rng, 2) == 0u) ? 500.0f : 1000.0f;
    cfg->mass_kg = rng_float(&f->rng, 0.02f, 0.05f);
    cfg->kp_pos_xy_Npm = rng_float(&f->rng, 0.0f, 100.0f);
    cfg->kp_att_xy_Nmprad = rng_float(&f->rng, 0.0f, 1.0f);
    cfg->tilt_cmd_rad_max = rng_float(&f->rng, 0.1f, 1.2f);
    cfg->stale_s_max = rng_float(&f->rng, 0.004f, 0.05f);
    cfg->flip_s_max = rng_float(&f->rng, 0.01f, 0.3f);
    cfg->coast_s_max = rng_float(&f->rng, 0.1f, 0.3f);
    cfg->attached_s = rng_float(&f->rng, 0.0f, 0.2f);
    cfg->approach_s_max = rng_float(&f->rng, 0.1f, 1.0f);
    cfg->hang_s = rng_float(&f->rng, 0.02f, 0.1f);
    cfg->d_source = (uint8_t)((rng_below(&f->rng, 2) == 0u) ? 0u : rng_below(&f->rng, 4));
    cfg->d_predict = (uint8_t)rng_below(&f->rng, 2);
    cfg->of_source = (uint8_t)rng_below(&f->rng, 2);
    cfg->shape = (uint8_t)rng_below(&f->rng, 4);
    cfg->d_sigma_norm_max = rng_float(&f->rng, 0.05f, 10.0f);
    cfg->rrev_delay_s = rng_float(&f->rng, 0.0f, 0.03f);
    cfg->accel_delay_s = rng_float(&f->rng, 0.0f, 0.02f);
    cfg->cut_at_inverted = (uint8_t)rng_below(&f->rng, 2);
    cfg->cut_on_contact = (uint8_t)rng_below(&f->rng, 2);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(cfg));
}

static void random_request(flight_t *f)
{
    ivl_command_t *cmd = &f->fix.in.cmd;
    const uint32_t dice = rng_below(&f->rng, 16);
    cmd->request = (dice < 3u)    ? IVL_REQUEST_IDLE
                   : (dice < 8u)  ? IVL_REQUEST_HOVER
                   : (dice < 15u) ? IVL_REQUEST_APPROACH
                                  : IVL_REQUEST_ABORT;
    cmd->p_hover_W_m = rng_vec3(&f->rng, 3.0f);
    cmd->speed_mps = rng_float(&f->rng, 0.1f, 6.0f);
    cmd->angle_rad = rng_float(&f->rng, 0.0f, 1.57f);
}

static void random_state(flight_t *f)
{
    ivl_in_t      *in = &f->fix.in;
    const uint32_t dice = rng_below(&f->rng, 8);
    in->p_WB_m = rng_vec3(&f->rng, 2.2f);
    in->v_WB_mps = rng_vec3(&f->rng, 4.0f);
    in->w_B_radps = rng_vec3(&f->rng, (dice == 0u) ? 900.0f : 10.0f);
    in->q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
    if (dice < 2u)
    {
        in->q_WB = rng_quat(&f->rng);
    }
    in->f_B_mps2 = ivl_vec3(0.0f, 0.0f, (dice == 2u) ? -9.81f : 9.81f);
    if (dice == 3u)
    {
        in->f_B_mps2 = rng_vec3(&f->rng, 1.0e5f);
    }
}

// mostly good; each member bad now and then, sometimes no number
static void random_vitals(flight_t *f)
{
    const float   bad = (rng_below(&f->rng, 2) == 0u) ? NAN : 11.0f;
    ivl_vitals_t *v = &f->fix.in.vitals;
    *v = (ivl_vitals_t){.given = rng_below(&f->rng, 4) != 0u, .vbat_V = 4.0f};
    v->configured = rng_below(&f->rng, 16) != 0u;
    v->can_fly = rng_below(&f->rng, 16) != 0u;
    v->bypassed = rng_below(&f->rng, 16) == 0u;
    v->stock_idle = rng_below(&f->rng, 2) == 0u;
    float *const ages[] = {&v->link_age_s, &v->setpoint_age_s, &v->host_age_s, &v->p_sigma_m};
    for (int i = 0; i < 4; i++)
    {
        *ages[i] = (rng_below(&f->rng, 24) == 0u) ? bad : 0.0f;
    }
    if (rng_below(&f->rng, 24) == 0u)
    {
        v->vbat_V = isnan(bad) ? bad : 2.6f;
    }
}

// readings of a ceiling that is somewhere, and of none
static void random_reading(flight_t *f, ivl_reading_t *reading, float limit)
{
    const float    values[] = {NAN, INFINITY, -INFINITY, FLT_MAX};
    const uint32_t dice = rng_below(&f->rng, 40);
    *reading = (ivl_reading_t){f->fix.in.t_us - rng_below(&f->rng, 3000), rng_float(&f->rng, 0.0f, limit), (uint8_t)(dice != 39u)};
    if (dice < 4u)
    {
        reading->value = values[dice];
    }
    if (dice == 4u)
    {
        reading->t_us += 5000u;
    }
}

static void random_readings(flight_t *f)
{
    if (rng_below(&f->rng, 8) == 0u)
    {
        random_reading(f, &f->fix.in.rrev, 8.0f);
    }
    if (rng_below(&f->rng, 8) == 0u)
    {
        random_reading(f, &f->fix.in.range, 2.0f);
    }
    if (rng_below(&f->rng, 8) == 0u)
    {
        random_reading(f, &f->fix.in.flow, 8.0f);
    }
}

// of any form: the first parameter is a threshold or its constant part, some are out of range
static void random_policy(flight_t *f)
{
    uint32_t n_forms = 0;
    while (ivl_form(n_forms) != NULL)
    {
        n_forms++;
    }
    // a quarter of them the paper's, and those that are drawn
    const uint32_t    number = (rng_below(&f->rng, 4) == 0u) ? 0u : rng_below(&f->rng, n_forms);
    const ivl_form_t *form = ivl_form(number);
    ivl_policy_t      policy = {.id = {.seq = 1, .form = (uint8_t)number}, .n = form->n_params};
    for (uint32_t i = 0; i < policy.n; i++)
    {
        const ivl_form_group_t *group = ivl_form_group_of(form, i);
        // coefficients near 0 and thresholds that are met: the middle of a range is where flips happen
        const float span = (group->hi > 1.0f) ? 0.02f * (group->hi - group->lo) : 0.25f * (group->hi - group->lo);
        const float middle = (group->lo < 0.0f) ? 0.0f : group->lo + span;
        policy.theta[i] = middle + rng_float(&f->rng, -1.05f, 1.05f) * span;
    }
    policy.theta[0] = rng_float(&f->rng, -0.1f, 8.0f);
    // a form with go / no-go: one half of the landings is thought improbable
    if (form->groups[form->n_groups - 1u].n == IVL_GENERAL_N_GO - 1)
    {
        policy.theta[policy.n - (uint32_t)IVL_GENERAL_N_GO] = rng_float(&f->rng, 0.0f, 1.0f);
    }
    policy.id.crc = ivl_policy_crc(&policy);
    (void)ivl_policy_commit(&f->fix.cfg, &f->fix.state, &policy);
}

static void next_input(flight_t *f)
{
    ivl_in_t      *in = &f->fix.in;
    const uint64_t period_us = (uint64_t)(1.0e6f / f->fix.cfg.tick_hz);
    in->t_us = f->t_last_us + period_us;
    in->t_pose_us = in->t_us - rng_below(&f->rng, 4000);
    random_readings(f);
    if (rng_below(&f->rng, 30) == 0u)
    {
        random_request(f);
    }
    if (rng_below(&f->rng, 30) == 0u)
    {
        random_state(f);
    }
    if (rng_below(&f->rng, 60) == 0u)
    {
        random_vitals(f);
    }
    if (rng_below(&f->rng, 100) == 0u)
    {
        random_policy(f);
    }
}

// bursts, so that samples also grow old; several fields may be bad at once
static void maybe_spoil(flight_t *f)
{
    const float dice = rng_float(&f->rng, 0.0f, 1.0f);
    f->in_burst = f->in_burst ? (dice < f->stay_norm) : (dice < f->garbage_norm);
    if (f->in_burst)
    {
        const uint32_t n = 1u + rng_below(&f->rng, 3);
        for (uint32_t i = 0; i < n; i++)
        {
            spoil(&f->fix.in, (i == 0u) ? f->burst_kind : rng_below(&f->rng, SPOIL_COUNT));
        }
        n_spoiled++;
        return;
    }
    f->burst_kind = rng_below(&f->rng, SPOIL_COUNT);
}

// ---- what must hold

/// The flip began where the policy says so, from what was latched alone, and after a go.
static void check_region(const flight_t *f)
{
    const ivl_state_t    *state = &f->fix.state;
    const ivl_snapshot_t *s = &state->snapshot;
    const ivl_seen_t      seen = {.ceiling = {.valid = true, .d_ceil_m = s->d_ceil_m},
                                  .cues = {.valid = true, .rrev_per_s = s->rrev_per_s, .of_y_radps = s->of_y_radps}};
    const ivl_action_t    action = ivl_form(state->policy.id.form)->decide(state->policy.theta, &seen);
    TEST_ASSERT_EQUAL_HEX32(state->policy.id.crc, s->policy.crc);
    TEST_ASSERT_EQUAL_HEX32(f->decided_crc, s->policy.crc);
    TEST_ASSERT_TRUE(action.flip);
    TEST_ASSERT_EQUAL_FLOAT(action.moment_Nm, s->action.moment_Nm);
    TEST_ASSERT_TRUE(state->decision.made && state->decision.go);
    n_general += (state->policy.id.form != 0u) ? 1u : 0u;
}

/// After each tick: whose decision it is that stands.
static void note_decision(flight_t *f, bool was_decided)
{
    const ivl_state_t *state = &f->fix.state;
    f->decided_crc = (state->decision.made && !was_decided) ? state->policy.id.crc : f->decided_crc;
}

static void check_trigger(flight_t *f, uint32_t n_trigger_before, bool is_pose_good)
{
    const ivl_state_t *state = &f->fix.state;
    const bool         is_armed = (f->last_phase == IVL_PHASE_IDLE) && (f->fix.out.phase != IVL_PHASE_IDLE);
    if (is_armed)
    {
        f->n_trigger_cycle = 0;
        n_cycles++;
    }
    if (state->diag.n_trigger != n_trigger_before)
    {
        f->n_trigger_cycle++;
        n_triggers++;
        TEST_ASSERT_EQUAL_UINT32(n_trigger_before + 1u, state->diag.n_trigger);
        TEST_ASSERT_TRUE(is_pose_good && approach_is_good(&f->fix.in.cmd, &f->fix.cfg));
        TEST_ASSERT_TRUE(vitals_are_good(&f->fix.in.vitals, &f->fix.cfg));
        check_region(f);
        TEST_ASSERT_TRUE((state->snapshot.rrev_per_s > 0.0f) && (state->snapshot.d_ceil_m > 0.0f));
        TEST_ASSERT_TRUE(state->snapshot.d_sigma_m >= 0.0f);
        TEST_ASSERT_TRUE(state->snapshot.d_sigma_m <= f->fix.cfg.d_sigma_norm_max * state->snapshot.d_ceil_m);
        n_estimated += (f->fix.cfg.d_source != 0u) ? 1u : 0u;
        memcpy(&f->snapshot, &state->snapshot, sizeof f->snapshot);
    }
    TEST_ASSERT_TRUE(f->n_trigger_cycle <= 1u);
    if (f->n_trigger_cycle == 1u)
    {
        TEST_ASSERT_EQUAL_MEMORY(&f->snapshot, &state->snapshot, sizeof f->snapshot);
    }
}

static void check_motors(flight_t *f, bool is_pose_good)
{
    // a motor needs a sample younger than stale_s_max; one tick for rounding
    f->n_bad_pose_run = is_pose_good ? 0u : f->n_bad_pose_run + 1u;
    if ((float)f->n_bad_pose_run > f->fix.cfg.stale_s_max * f->fix.cfg.tick_hz + 1.0f)
    {
        TEST_ASSERT_FALSE(f->fix.out.motors_on);
    }
    // latched off means off until the cycle ends
    const bool is_latched_off = ivl_motors_latched_off(&f->fix.state);
    if (f->was_latched_off && !is_latched_off)
    {
        TEST_ASSERT_EQUAL_INT(IVL_PHASE_IDLE, f->fix.out.phase);
    }
    f->was_latched_off = is_latched_off;
    // after a trigger only the flip may run a motor
    if ((f->n_trigger_cycle == 1u) && f->fix.out.motors_on)
    {
        TEST_ASSERT_EQUAL_INT(IVL_PHASE_FLIP, f->fix.out.phase);
    }
    assert_output_sane(&f->fix);
}

static void fuzz_tick(flight_t *f)
{
    next_input(f);
    const ivl_in_t clean = f->fix.in;
    maybe_spoil(f);
    const uint32_t n_trigger = f->fix.state.diag.n_trigger;
    const bool     was_decided = (f->last_phase == IVL_PHASE_APPROACH) && f->fix.state.decision.made;
    const bool     is_pose_good = pose_is_good(&f->fix.in, &f->fix.cfg, f->t_last_us);
    ivl_step(&f->fix.cfg, &f->fix.state, &f->fix.in, &f->fix.out);
    note_decision(f, was_decided);
    check_trigger(f, n_trigger, is_pose_good);
    check_motors(f, is_pose_good);
    n_ticks_in[f->fix.out.phase]++;
    f->last_phase = f->fix.out.phase;
    f->t_last_us = clean.t_us;
    f->fix.in = clean;
}

static void fly(uint64_t seed)
{
    flight_t f = {.rng = {seed}};
    fix_init(&f.fix);
    random_cfg(&f);
    ivl_init(&f.fix.cfg, &f.fix.state);
    f.t_last_us = 4000000000u;
    const float shares[] = {0.0f, 0.002f, 0.05f, 0.5f};
    f.garbage_norm = shares[rng_below(&f.rng, 4)];
    f.stay_norm = rng_float(&f.rng, 0.0f, 0.98f);
    for (int i = 0; i < N_TICKS; i++)
    {
        fuzz_tick(&f);
    }
}

static void test_invariants_hold_over_random_flights(void)
{
    for (uint64_t seed = 0; seed < N_FLIGHTS; seed++)
    {
        fly(seed);
    }
}

static void test_random_flights_have_visited_everything(void)
{
    for (int i = 0; i < (int)IVL_PHASE_COUNT; i++)
    {
        TEST_ASSERT_TRUE_MESSAGE(n_ticks_in[i] > N_TICKS_ALL / 300u, phase_text((ivl_phase_t)i));
    }
    TEST_ASSERT_TRUE(n_triggers > N_FLIGHTS / 8u);  // a policy that is sent in an approach is refused: one flight in six triggers
    TEST_ASSERT_TRUE(n_estimated > N_FLIGHTS / 50u);
    TEST_ASSERT_TRUE(n_general > N_FLIGHTS / 50u);
    TEST_ASSERT_TRUE(n_cycles > n_triggers);
    TEST_ASSERT_TRUE(n_spoiled > N_TICKS_ALL / 30u);
}

// every byte of the input at random: nearly everything is garbage, and nothing may run
static void test_random_bytes_never_start_a_motor(void)
{
    rng_t rng = {99};
    fix_t fix;
    fix_init(&fix);
    fix_policy(&fix, 0.0f, 0.02f);
    for (int i = 0; i < N_FLIGHTS * 50; i++)
    {
        unsigned char bytes[sizeof fix.in];
        for (size_t k = 0; k < sizeof bytes; k++)
        {
            bytes[k] = (unsigned char)rng_u64(&rng);
        }
        memcpy(&fix.in, bytes, sizeof bytes);
        ivl_step(&fix.cfg, &fix.state, &fix.in, &fix.out);
        assert_motors_off(&fix);
        assert_phase(IVL_PHASE_IDLE, &fix);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_invariants_hold_over_random_flights);
    RUN_TEST(test_random_flights_have_visited_everything);
    RUN_TEST(test_random_bytes_never_start_a_motor);
    return UNITY_END();
}
