/// @file test_ivl_guard_table.c
/// The search in the table of rules against a plain scan of all its rows.  The table is private, so its file is compiled here once more.
#define ivl_guard_find     searched
#define ivl_guard_act      table_act
#define ivl_guard_discards table_discards
#define ivl_guard_applies  table_applies
#define ivl_guard_name     table_name
#define ivl_guard_lock_out table_lock_out
#include "ivl_guard.c"
#include "test_ivl_support.h"

enum
{
    N_STATES = 200000
};

/// The vehicle's build has no names.
static const char *rule_text(ivl_rule_t rule)
{
#ifdef IVL_NO_TEXT
    (void)rule;
    return "rule";
#else
    return table_name(rule);
#endif
}

typedef bool (*condition_t)(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen);

#define WHEN(id, name, phases, when, act, discards) [IVL_RULE_##id] = (when),
static const condition_t CONDITIONS[] = {RULES(WHEN)};

/// What the table says, row by row, in the order of the numbers of the rules.
static ivl_rule_t scanned(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen)
{
    for (int i = 1; i < (int)IVL_RULE_COUNT; i++)
    {
        if (((ROWS[i].phases >> state->phase) & 1u) != 0u && CONDITIONS[i](cfg, state, seen))
        {
            return (ivl_rule_t)i;
        }
    }
    return IVL_RULE_NONE;
}

/// Bad now and then, so that late rows are reached too.
static bool seldom(rng_t *rng)
{
    return rng_float(rng, 0.0f, 1.0f) < 0.04f;
}

static ivl_vitals_t random_vitals(rng_t *rng)
{
    return (ivl_vitals_t){.given = !seldom(rng),
                          .configured = !seldom(rng),
                          .can_fly = !seldom(rng),
                          .bypassed = seldom(rng),
                          .vbat_V = seldom(rng) ? rng_float(rng, 2.5f, 4.2f) : 4.1f,
                          .link_age_s = seldom(rng) ? 100.0f : 0.0f,
                          .setpoint_age_s = seldom(rng) ? 100.0f : 0.0f,
                          .host_age_s = seldom(rng) ? NAN : 0.0f,
                          .p_sigma_m = seldom(rng) ? 10.0f : 0.001f};
}

static void random_state(rng_t *rng, ivl_state_t *state, ivl_seen_t *seen)
{
    state->guard.vitals = random_vitals(rng);
    state->triggered = seldom(rng);
    state->has_policy = !seldom(rng);
    state->n_phase_tick = seldom(rng) ? 1000000u : 0u;
    state->landed_s = seldom(rng) ? 3.0f : 0.0f;
    state->sense.cmd.request = seldom(rng) ? IVL_REQUEST_APPROACH : IVL_REQUEST_HOVER;
    state->sense.pose_usable = !seldom(rng);
    state->sense.pose_fresh = !seldom(rng);
    state->sense.cmd_usable = !seldom(rng);
    state->sense.cmd_fresh = !seldom(rng);
    state->sense.up_z = seldom(rng) ? -1.0f : 1.0f;
    state->sense.sample.p_WB_m = ivl_vec3(seldom(rng) ? 1000.0f : 0.0f, 0.0f, 1.0f);
    state->sense.sample.v_WB_mps = ivl_vec3(0.0f, seldom(rng) ? 40.0f : 0.0f, 0.0f);
    state->decision.asked = seldom(rng);
    state->contact.contact = seldom(rng);
    state->contact.hanging = seldom(rng);
    seen->ceiling.valid = !seldom(rng);
    seen->ceiling.d_ceil_m = seldom(rng) ? 0.0f : 1.0f;
    seen->cues.valid = !seldom(rng);
    seen->cues.rrev_per_s = seldom(rng) ? 0.0f : 1.0f;
    state->action.flip = rng_below(rng, 2u) == 0u;
    state->action.go = !seldom(rng);
    state->decision.made = seldom(rng);
}

static void test_the_search_finds_what_a_scan_of_all_rows_finds_in_every_phase(void)
{
    static int  n_found[IVL_PHASE_COUNT][IVL_RULE_COUNT];
    rng_t       rng = {.state = 5};
    ivl_cfg_t   cfg;
    ivl_state_t state;
    ivl_cfg_defaults(&cfg);
    cfg.d_abort_m = 0.2f;
    cfg.cut_on_contact = 1u;
    ivl_init(&cfg, &state);
    for (int i = 0; i < N_STATES; i++)
    {
        ivl_seen_t seen = {.cues = {.valid = false}};
        random_state(&rng, &state, &seen);
        // at rest a battery may have to hold less than in flight, or the rule in flight would never be the first
        cfg.vbat_V_rest_min = (rng_below(&rng, 2u) == 0u) ? 0.0f : 3.9f;
        state.phase = (ivl_phase_t)(i % (int)IVL_PHASE_COUNT);
        const ivl_rule_t rule = searched(&cfg, &state, &seen);
        TEST_ASSERT_EQUAL_INT(scanned(&cfg, &state, &seen), rule);
        n_found[state.phase][rule]++;
    }
    // each row was found in each of its phases, and in no other
    for (int phase = 0; phase < (int)IVL_PHASE_COUNT; phase++)
    {
        for (int rule = 1; rule < (int)IVL_RULE_COUNT; rule++)
        {
            TEST_ASSERT_EQUAL_INT_MESSAGE(table_applies((ivl_rule_t)rule, (ivl_phase_t)phase), n_found[phase][rule] > 0,
                                          rule_text((ivl_rule_t)rule));
        }
    }
}

static void test_rules_that_refuse_or_speak_of_others_discard_a_flight(void)
{
    const ivl_rule_t of_others[] = {IVL_RULE_NONE,     IVL_RULE_STATE, IVL_RULE_COMMAND, IVL_RULE_SUPERVISOR, IVL_RULE_LINK,
                                    IVL_RULE_SETPOINT, IVL_RULE_HOST,  IVL_RULE_BATTERY, IVL_RULE_UNCERTAIN,  IVL_RULE_NO_POLICY};
    for (int rule = 0; rule < (int)IVL_RULE_COUNT; rule++)
    {
        bool expected = ROWS[rule].act == IVL_ACT_REFUSE;
        for (size_t i = 0; i < sizeof of_others / sizeof of_others[0]; i++)
        {
            expected = expected || (rule == (int)of_others[i]);
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(expected, table_discards((ivl_rule_t)rule), rule_text((ivl_rule_t)rule));
    }
    TEST_ASSERT_FALSE(table_discards(IVL_RULE_COUNT));
}

void setUp(void)
{
}

void tearDown(void)
{
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_search_finds_what_a_scan_of_all_rows_finds_in_every_phase);
    RUN_TEST(test_rules_that_refuse_or_speak_of_others_discard_a_flight);
    return UNITY_END();
}
