/// @file test_ivl_cfg.c
/// The parameter table and the check of a configuration, row by row; the log table's paths.
#include "ivl_cfg_name.h"
#include "test_ivl_support.h"

typedef struct
{
    const char *type, *group, *name, *unit, *doc;
    size_t      offset;
    double      min, max, dflt;
} param_t;

#define PARAM_ROW(ctype, group_, name_, field, unit_, min_, max_, dflt_, doc_)                                                             \
    {#ctype, group_, name_, unit_, doc_, offsetof(ivl_cfg_t, field), (double)(min_), (double)(max_), (double)(dflt_)},
static const param_t PARAMS[] = {IVL_PARAMS(PARAM_ROW)};
#define N_PARAMS (sizeof PARAMS / sizeof PARAMS[0])

typedef struct
{
    const char *group, *name, *unit, *doc;
    size_t      offset, size;
} log_row_t;

#define LOG_ROW(ctype, group_, name_, where, field, unit_, doc_)                                                                           \
    {group_, name_, unit_, doc_, offsetof(where, field), sizeof(((where *)0)->field)},
static const log_row_t LOGS[] = {IVL_LOGS(LOG_ROW)};
#define N_LOGS (sizeof LOGS / sizeof LOGS[0])

// the type that a log row states must be the type of the member (bool is logged as a byte)
#define LOG_TYPE(ctype, group_, name_, where, field, unit_, doc_)                                                                          \
    _Static_assert(_Generic(((where *)0)->field, ctype: 1, bool: sizeof(ctype) == sizeof(bool), default: 0), "type of log " name_);
IVL_LOGS(LOG_TYPE)

static void set_param(ivl_cfg_t *cfg, const param_t *row, double value)
{
    unsigned char *at = (unsigned char *)cfg + row->offset;
    if (strcmp(row->type, "float") == 0)
    {
        const float f = (float)value;
        memcpy(at, &f, sizeof f);
        return;
    }
    TEST_ASSERT_EQUAL_STRING("uint8_t", row->type);
    *at = (unsigned char)value;
}

static void test_defaults_are_good(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_cfg_check(&cfg));
    TEST_ASSERT_NULL(ivl_cfg_bad_name(&cfg));
}

static void test_defaults_are_those_of_the_table(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_t expected;
    memset(&cfg, 0xa5, sizeof cfg);
    ivl_cfg_defaults(&cfg);
    // what is between the members does not matter
    expected = cfg;
    for (size_t i = 0; i < N_PARAMS; i++)
    {
        set_param(&expected, &PARAMS[i], PARAMS[i].dflt);
    }
    TEST_ASSERT_EQUAL_MEMORY(&expected, &cfg, sizeof cfg);
}

static void test_check_names_the_parameter_when_it_is_out_of_range(void)
{
    for (size_t i = 0; i < N_PARAMS; i++)
    {
        const param_t *row = &PARAMS[i];
        const bool     is_float = strcmp(row->type, "float") == 0;
        const double   step = is_float ? 1.0e-3 * (row->max - row->min) : 1.0;
        const double   bad[] = {row->max + step, row->min - step, (double)NAN, (double)INFINITY, -(double)INFINITY};
        // a byte has neither a value below zero nor one that is no number
        const size_t n_bad = is_float ? sizeof bad / sizeof bad[0] : 1u;
        for (size_t k = 0; k < n_bad; k++)
        {
            ivl_cfg_t cfg;
            ivl_cfg_defaults(&cfg);
            set_param(&cfg, row, bad[k]);
            TEST_ASSERT_EQUAL_INT(IVL_ERR_RANGE, ivl_cfg_check(&cfg));
            TEST_ASSERT_EQUAL_STRING(row->name, ivl_cfg_bad_name(&cfg));
        }
    }
}

static void test_check_refuses_members_that_do_not_fit_each_other(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    cfg.d_ceil_m_min = 0.5f;
    cfg.d_ceil_m_max = 0.5f;
    TEST_ASSERT_EQUAL_STRING("d_ceil_min", ivl_cfg_bad_name(&cfg));
    ivl_cfg_defaults(&cfg);
    cfg.speed_mps_min = 6.0f;
    TEST_ASSERT_EQUAL_STRING("speed_min", ivl_cfg_bad_name(&cfg));
    // four times 0.08 N lift 32 g, not 35.84 g
    ivl_cfg_defaults(&cfg);
    cfg.motor_thrust_N_max = 0.08f;
    TEST_ASSERT_EQUAL_STRING("motor_thrust_max", ivl_cfg_bad_name(&cfg));
    // (16.46 - 8.72) / 5 = 1.55 rad: too near the pole of the tangent
    ivl_cfg_defaults(&cfg);
    cfg.pwm_c_gf = 5.0f;
    TEST_ASSERT_EQUAL_STRING("pwm_c", ivl_cfg_bad_name(&cfg));
}

static void test_table_rows_are_named_for_the_link(void)
{
    for (size_t i = 0; i < N_PARAMS; i++)
    {
        const param_t *row = &PARAMS[i];
        TEST_ASSERT_TRUE_MESSAGE(strlen(row->name) <= 20u, row->name);
        TEST_ASSERT_TRUE_MESSAGE(strlen(row->name) + strlen(row->group) <= 24u, row->name);
        TEST_ASSERT_TRUE_MESSAGE((strlen(row->unit) > 0u) && (strlen(row->doc) > 0u), row->name);
        TEST_ASSERT_TRUE_MESSAGE((row->min <= row->dflt) && (row->dflt <= row->max), row->name);
        for (size_t k = 0; k < i; k++)
        {
            TEST_ASSERT_TRUE_MESSAGE(strcmp(row->name, PARAMS[k].name) != 0, row->name);
        }
    }
}

static void test_log_rows_are_named_for_the_link_and_differ_from_parameters(void)
{
    for (size_t i = 0; i < N_LOGS; i++)
    {
        const log_row_t *row = &LOGS[i];
        TEST_ASSERT_TRUE_MESSAGE(strlen(row->name) + strlen(row->group) <= 24u, row->name);
        TEST_ASSERT_TRUE_MESSAGE((strlen(row->unit) > 0u) && (strlen(row->doc) > 0u), row->name);
        TEST_ASSERT_TRUE_MESSAGE(row->size <= 4u, row->name);
        for (size_t k = 0; k < i; k++)
        {
            TEST_ASSERT_TRUE_MESSAGE(strcmp(row->name, LOGS[k].name) != 0, row->name);
        }
        for (size_t k = 0; k < N_PARAMS; k++)
        {
            TEST_ASSERT_TRUE_MESSAGE(strcmp(row->name, PARAMS[k].name) != 0, row->name);
        }
    }
}

static void test_core_stays_idle_for_ever_when_the_configuration_is_bad(void)
{
    fix_t fix;
    fix_init(&fix);
    fix.cfg.mass_kg = NAN;
    ivl_init(&fix.cfg, &fix.state);
    fix.in.cmd.request = IVL_REQUEST_HOVER;
    for (int i = 0; i < 100; i++)
    {
        fix_tick(&fix);
        assert_phase(IVL_PHASE_IDLE, &fix);
        assert_motors_off(&fix);
    }
}

static void test_rows_have_the_names_and_the_order_of_the_table(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    TEST_ASSERT_EQUAL_INT(-1, ivl_cfg_bad_row(&cfg));
    TEST_ASSERT_EQUAL_STRING("mass", ivl_cfg_name(0));
    TEST_ASSERT_EQUAL_STRING("jxx", ivl_cfg_name(1));
    TEST_ASSERT_NULL(ivl_cfg_name(-1));
    TEST_ASSERT_NULL(ivl_cfg_name(1000));
    cfg.jxx_kgm2 = NAN;
    TEST_ASSERT_EQUAL_INT(1, ivl_cfg_bad_row(&cfg));
}

static void test_crc_changes_with_every_parameter(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    const uint32_t crc = ivl_cfg_crc(&cfg);
    TEST_ASSERT_EQUAL_HEX32(crc, ivl_cfg_crc(&cfg));
#define CHANGE(ctype, group, name, field, unit, min, max, dflt, doc)                                                                       \
    cfg.field = (ctype)(cfg.field + (ctype)1);                                                                                             \
    TEST_ASSERT_TRUE_MESSAGE(ivl_cfg_crc(&cfg) != crc, name);                                                                              \
    cfg.field = (ctype)(dflt);
    IVL_PARAMS(CHANGE)
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_defaults_are_good);
    RUN_TEST(test_defaults_are_those_of_the_table);
    RUN_TEST(test_check_names_the_parameter_when_it_is_out_of_range);
    RUN_TEST(test_check_refuses_members_that_do_not_fit_each_other);
    RUN_TEST(test_table_rows_are_named_for_the_link);
    RUN_TEST(test_log_rows_are_named_for_the_link_and_differ_from_parameters);
    RUN_TEST(test_core_stays_idle_for_ever_when_the_configuration_is_bad);
    RUN_TEST(test_rows_have_the_names_and_the_order_of_the_table);
    RUN_TEST(test_crc_changes_with_every_parameter);
    return UNITY_END();
}
