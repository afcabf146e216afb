/// @file test_sil_wire.c
/// What other languages are told of packets, records, configuration and logs is what the vehicle's own functions do with them.
#include "sil_wire.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "ivl_cfg.h"
#include "ivl_guard.h"
#include "ivl_record.h"
#include "ivl_wire.h"
#include "sim_fixture.h"

enum
{
    GUARD_BYTES = 64,
    GUARD = 0xa5
};

static const ivl_sil_field_t *fields;
static uint32_t               n_fields, item_size;
static uint8_t                bytes[IVL_WIRE_SIZE_MAX + GUARD_BYTES];

static void look_at(int code)
{
    n_fields = item_size = 77777u;
    fields = ivl_sil_layout(code, &n_fields, &item_size);
    TEST_ASSERT_NOT_NULL(fields);
}

static const ivl_sil_field_t *field(const char *name)
{
    for (uint32_t i = 0; i < n_fields; i++)
    {
        if (strcmp(fields[i].name, name) == 0)
        {
            return &fields[i];
        }
    }
    TEST_FAIL_MESSAGE(name);
    return NULL;
}

/// Value of a field in bytes that are laid out as the fields say.
static double value_at(const uint8_t *data, const ivl_sil_field_t *f, uint32_t index)
{
    const char     kind = f->type[0];
    const uint32_t size = (uint32_t)(f->type[1] - '0');
    const uint8_t *at = data + f->offset + size * index;
    if (kind == 'f')
    {
        float value;
        TEST_ASSERT_EQUAL_UINT32(4u, size);
        memcpy(&value, at, sizeof value);
        return (double)value;
    }
    uint32_t raw = 0;
    memcpy(&raw, at, size);  // this machine is little-endian, as the wire is
    const bool is_negative = (kind == 'i') && ((raw >> (8u * size - 1u)) != 0u);
    return is_negative ? (double)raw - ldexp(1.0, (int)(8u * size)) : (double)raw;
}

// ---- packets

#define GIVE_MEMBER(type, name, unit, doc)                                                                                                 \
    next++;                                                                                                                                \
    sent.name = (ivl_##type##_t)next;

#define CHECK_MEMBER(kind, member, measure, text)                                                                                          \
    TEST_ASSERT_EQUAL_STRING(#member, fields[next].name);                                                                                  \
    TEST_ASSERT_EQUAL_UINT32(1u, fields[next].count);                                                                                      \
    TEST_ASSERT_EQUAL_INT(next + 1, (int)value_at(bytes, &fields[next], 0));                                                               \
    next++;

/// Every member a number of its own, found where the layout says; nothing behind the packet is touched.
#define CHECK_PACKET(lower, UPPER)                                                                                                         \
    do                                                                                                                                     \
    {                                                                                                                                      \
        int                  next = 0;                                                                                                     \
        ivl_wire_##lower##_t sent;                                                                                                         \
        memset(&sent, 0, sizeof sent);                                                                                                     \
        IVL_WIRE_##UPPER(GIVE_MEMBER) memset(bytes, GUARD, sizeof bytes);                                                                  \
        const size_t size = ivl_wire_put_##lower(bytes, &sent);                                                                            \
        look_at(IVL_WIRE_TYPE_##UPPER);                                                                                                    \
        TEST_ASSERT_EQUAL_INT(next, (int)n_fields);                                                                                        \
        TEST_ASSERT_EQUAL_UINT64(size, item_size);                                                                                         \
        next = 0;                                                                                                                          \
        IVL_WIRE_##UPPER(CHECK_MEMBER) TEST_ASSERT_EACH_EQUAL_HEX8(GUARD, bytes + size, GUARD_BYTES);                                      \
        struct                                                                                                                             \
        {                                                                                                                                  \
            ivl_wire_##lower##_t packet;                                                                                                   \
            uint8_t              guard[GUARD_BYTES];                                                                                       \
        } got;                                                                                                                             \
        memset(&got, GUARD, sizeof got);                                                                                                   \
        TEST_ASSERT_TRUE(ivl_wire_get_##lower(bytes, size, &got.packet));                                                                  \
        TEST_ASSERT_EACH_EQUAL_HEX8(GUARD, got.guard, GUARD_BYTES);                                                                        \
        uint8_t again[IVL_WIRE_SIZE_MAX];                                                                                                  \
        TEST_ASSERT_EQUAL_UINT64(size, ivl_wire_put_##lower(again, &got.packet));                                                          \
        TEST_ASSERT_EQUAL_MEMORY(bytes, again, size);                                                                                      \
    } while (0)

static void test_packets_are_laid_out_as_they_are_written(void)
{
    CHECK_PACKET(policy, POLICY);
    CHECK_PACKET(command, COMMAND);
    CHECK_PACKET(reading, READING);
    CHECK_PACKET(policy_echo, POLICY_ECHO);
    CHECK_PACKET(command_echo, COMMAND_ECHO);
    CHECK_PACKET(config_echo, CONFIG_ECHO);
}

static void test_the_version_is_that_of_every_packet(void)
{
    const ivl_wire_reading_t packet = {.valid = 1u};
    (void)ivl_wire_put_reading(bytes, &packet);
    TEST_ASSERT_EQUAL_INT(bytes[1], ivl_sil_wire_version());
}

static void test_there_is_no_other_layout(void)
{
    const int codes[] = {-1, 0, 0x7f, 0xff, IVL_SIL_LAYOUT_RECORD_HEADER - 1, IVL_SIL_LAYOUT_LOGS + 1};
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++)
    {
        TEST_ASSERT_NULL(ivl_sil_layout(codes[i], &n_fields, &item_size));
    }
}

// ---- records

static void test_rows_of_the_recorder_are_laid_out_as_they_are_kept(void)
{
    const ivl_record_header_t header = {.magic = 0x01020304u, .version = 5u, .row_size = 6u, .n_rows = 7u, .trigger_row = 8u, .frozen = 9u};
    look_at(IVL_SIL_LAYOUT_RECORD_HEADER);
    TEST_ASSERT_EQUAL_UINT64(sizeof header, item_size);
    const struct
    {
        const char *name;
        double      value;
    } HEADER[] = {{"magic", 0x01020304}, {"version", 5}, {"row_size", 6}, {"n_rows", 7}, {"trigger_row", 8}, {"frozen", 9}};
    for (size_t i = 0; i < sizeof HEADER / sizeof HEADER[0]; i++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(0.0, HEADER[i].value, value_at((const uint8_t *)&header, field(HEADER[i].name), 0));
    }
    ivl_record_row_t row;
    memset(&row, 0, sizeof row);
    row.t_us[0] = 0xfffffff0u;
    for (uint32_t i = 0; i < 3u; i++)
    {
        row.p[i] = (int16_t)(-1 - (int)i);
        row.q[i + 1u] = (int16_t)(-32767 + (int)i);
        row.f[i] = (int16_t)(7 + (int)i);
    }
    look_at(IVL_SIL_LAYOUT_RECORD_ROW);
    TEST_ASSERT_EQUAL_UINT64(sizeof row, item_size);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 4294967280.0, value_at((const uint8_t *)&row, field("t_us"), 0));
    TEST_ASSERT_EQUAL_UINT32(4u, field("q")->count);
    for (uint32_t i = 0; i < 3u; i++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(0.0, (double)row.p[i], value_at((const uint8_t *)&row, field("p"), i));
        TEST_ASSERT_DOUBLE_WITHIN(0.0, (double)row.q[i + 1u], value_at((const uint8_t *)&row, field("q"), i + 1u));
        TEST_ASSERT_DOUBLE_WITHIN(0.0, (double)row.f[i], value_at((const uint8_t *)&row, field("f"), i));
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 1000.0, field("p")->dflt);
    TEST_ASSERT_DOUBLE_WITHIN(0.0, 32767.0, field("q")->dflt);
}

// ---- configuration and logs

static void test_the_defaults_lie_where_the_layout_says_and_within_their_ranges(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    look_at(IVL_SIL_LAYOUT_CONFIG);
    TEST_ASSERT_EQUAL_UINT64(sizeof cfg, item_size);
    TEST_ASSERT_TRUE(n_fields > 40u);
    for (uint32_t i = 0; i < n_fields; i++)
    {
        const ivl_sil_field_t *f = &fields[i];
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(1u, f->count, f->name);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.0, (double)(float)f->dflt, value_at((const uint8_t *)&cfg, f, 0), f->name);
        TEST_ASSERT_TRUE_MESSAGE((f->lo <= f->dflt) && (f->dflt <= f->hi), f->name);
    }
    TEST_ASSERT_EQUAL_UINT64(offsetof(ivl_cfg_t, host_s_max), field("ivl.host_s_max")->offset);
}

static void test_logs_have_names_and_types_alone(void)
{
    look_at(IVL_SIL_LAYOUT_LOGS);
    TEST_ASSERT_EQUAL_UINT32(0u, item_size);
    TEST_ASSERT_TRUE(n_fields > 10u);
    for (uint32_t i = 0; i < n_fields; i++)
    {
        TEST_ASSERT_EQUAL_UINT32(0u, fields[i].offset);
        TEST_ASSERT_EQUAL_UINT32(1u, fields[i].count);
        TEST_ASSERT_NOT_NULL(strchr(fields[i].name, '.'));
    }
    TEST_ASSERT_EQUAL_STRING("u1", field("ivl.phase")->type);
    TEST_ASSERT_EQUAL_STRING("f4", field("ivl.thrust1")->type);
}

static void test_the_configuration_of_a_model_is_that_of_its_core(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    ivl_cfg_t              cfg;
    memset(&cfg, GUARD, sizeof cfg);
    TEST_ASSERT_EQUAL_HEX32(ivl_cfg_crc(&model.firmware), ivl_sil_model_config(&model, &cfg));
    TEST_ASSERT_EQUAL_MEMORY(&model.firmware, &cfg, sizeof cfg);
}

static void test_rules_are_those_of_the_guard_and_no_others(void)
{
    int n_discards = 0;
    for (int code = 0; code < (int)IVL_RULE_COUNT; code++)
    {
        TEST_ASSERT_EQUAL_INT((int)ivl_guard_discards((ivl_rule_t)code), ivl_sil_rule_discards(code));
        TEST_ASSERT_EQUAL_STRING(ivl_guard_name((ivl_rule_t)code), ivl_sil_rule_name(code));
        n_discards += ivl_sil_rule_discards(code);
    }
    TEST_ASSERT_TRUE((n_discards > 0) && (n_discards < (int)IVL_RULE_COUNT));
    const int none[] = {-1, -1000, (int)IVL_RULE_COUNT, (int)IVL_RULE_COUNT + 1, 1000};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++)
    {
        TEST_ASSERT_EQUAL_INT(-1, ivl_sil_rule_discards(none[i]));
        TEST_ASSERT_EQUAL_STRING("?", ivl_sil_rule_name(none[i]));
    }
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
    RUN_TEST(test_packets_are_laid_out_as_they_are_written);
    RUN_TEST(test_the_version_is_that_of_every_packet);
    RUN_TEST(test_there_is_no_other_layout);
    RUN_TEST(test_rows_of_the_recorder_are_laid_out_as_they_are_kept);
    RUN_TEST(test_the_defaults_lie_where_the_layout_says_and_within_their_ranges);
    RUN_TEST(test_logs_have_names_and_types_alone);
    RUN_TEST(test_the_configuration_of_a_model_is_that_of_its_core);
    RUN_TEST(test_rules_are_those_of_the_guard_and_no_others);
    return UNITY_END();
}
