#include "sil_wire.h"

#include <string.h>

#include "ivl_guard.h"
#include "ivl_record.h"
#include "ivl_wire.h"
#include "sim_model.h"

// A packet is its members without padding behind two bytes; the compiler lays such a struct out, and its offsets are taken from there.

#define NP_u8       "u1"
#define NP_u16      "u2"
#define NP_u32      "u4"
#define NP_i8       "i1"
#define NP_i16      "i2"
#define NP_f32      "f4"
#define NP_float    "f4"
#define NP_uint8_t  "u1"
#define NP_uint16_t "u2"
#define NP_uint32_t "u4"

#define PLAIN_ROW(name, np, offset, count, unit, doc)                                                                                      \
    {name, np, (uint32_t)(offset), count, unit, -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, IVL_SIM_REQUIRED, doc},

#define MEMBER(type, name, unit, doc) uint8_t name[sizeof(ivl_##type##_t)];
#define ROW(type, name, unit, doc)    PLAIN_ROW(#name, NP_##type, offsetof(packed_t, name), 1, unit, doc)

// fields of bytes have no alignment, so none of these structs has a gap
#define PACKET(ROWS, function)                                                                                                             \
    static const ivl_sil_field_t *function(uint32_t *n_fields, uint32_t *item_size)                                                        \
    {                                                                                                                                      \
        typedef struct                                                                                                                     \
        {                                                                                                                                  \
            uint8_t head[2];                                                                                                               \
            ROWS(MEMBER)                                                                                                                   \
        } packed_t;                                                                                                                        \
        static const ivl_sil_field_t FIELDS[] = {ROWS(ROW)};                                                                               \
        *n_fields = (uint32_t)(sizeof FIELDS / sizeof FIELDS[0]);                                                                          \
        *item_size = (uint32_t)sizeof(packed_t);                                                                                           \
        return FIELDS;                                                                                                                     \
    }

PACKET(IVL_WIRE_POLICY, policy)
PACKET(IVL_WIRE_COMMAND, command)
PACKET(IVL_WIRE_READING, reading)
PACKET(IVL_WIRE_POLICY_ECHO, policy_echo)
PACKET(IVL_WIRE_COMMAND_ECHO, command_echo)
PACKET(IVL_WIRE_CONFIG_ECHO, config_echo)

#define HEADER_ROW(type, name, doc) PLAIN_ROW(#name, NP_##type, offsetof(ivl_record_header_t, name), 1, "1", doc)
#define RECORD_ROW(type, name, count, per_unit, unit, doc)                                                                                 \
    {#name, NP_##type, (uint32_t)offsetof(ivl_record_row_t, name), count, unit, -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, (double)(per_unit), \
     doc},
#define CONFIG_ROW(ctype, group, name, field, unit, min, max, dflt, doc)                                                                   \
    {group "." name, NP_##ctype, (uint32_t)offsetof(ivl_cfg_t, field), 1, unit, (double)(min), (double)(max), (double)(dflt), doc},
#define LOG_ROW(ctype, group, name, owner, field, unit, doc) PLAIN_ROW(group "." name, NP_##ctype, 0, 1, unit, doc)

static const ivl_sil_field_t HEADER_FIELDS[] = {IVL_RECORD_HEADER(HEADER_ROW)};
static const ivl_sil_field_t RECORD_FIELDS[] = {IVL_RECORD_ROW(RECORD_ROW)};
static const ivl_sil_field_t CONFIG_FIELDS[] = {IVL_PARAMS(CONFIG_ROW)};
static const ivl_sil_field_t LOG_FIELDS[] = {IVL_LOGS(LOG_ROW)};

#define GIVE(array, size)                                                                                                                  \
    do                                                                                                                                     \
    {                                                                                                                                      \
        *n_fields = (uint32_t)(sizeof array / sizeof array[0]);                                                                            \
        *item_size = (uint32_t)(size);                                                                                                     \
        return array;                                                                                                                      \
    } while (0)

const ivl_sil_field_t *ivl_sil_layout(int code, uint32_t *n_fields, uint32_t *item_size)
{
    switch (code)
    {
    case IVL_WIRE_TYPE_POLICY:
        return policy(n_fields, item_size);
    case IVL_WIRE_TYPE_COMMAND:
        return command(n_fields, item_size);
    case IVL_WIRE_TYPE_READING:
        return reading(n_fields, item_size);
    case IVL_WIRE_TYPE_POLICY_ECHO:
        return policy_echo(n_fields, item_size);
    case IVL_WIRE_TYPE_COMMAND_ECHO:
        return command_echo(n_fields, item_size);
    case IVL_WIRE_TYPE_CONFIG_ECHO:
        return config_echo(n_fields, item_size);
    case IVL_SIL_LAYOUT_RECORD_HEADER:
        GIVE(HEADER_FIELDS, sizeof(ivl_record_header_t));
    case IVL_SIL_LAYOUT_RECORD_ROW:
        GIVE(RECORD_FIELDS, sizeof(ivl_record_row_t));
    case IVL_SIL_LAYOUT_CONFIG:
        GIVE(CONFIG_FIELDS, sizeof(ivl_cfg_t));
    case IVL_SIL_LAYOUT_LOGS:
        GIVE(LOG_FIELDS, 0);
    default:
        return NULL;
    }
}

int ivl_sil_wire_version(void)
{
    return (int)IVL_WIRE_VERSION;
}

uint32_t ivl_sil_model_config(const void *model, void *config)
{
    const ivl_sim_model_t *m = model;
    memcpy(config, &m->firmware, sizeof m->firmware);
    return ivl_cfg_crc(&m->firmware);
}

const char *ivl_sil_rule_name(int code)
{
    return (code >= 0) ? ivl_guard_name((ivl_rule_t)code) : "?";
}

int ivl_sil_rule_discards(int code)
{
    return (code >= 0 && code < (int)IVL_RULE_COUNT) ? (int)ivl_guard_discards((ivl_rule_t)code) : -1;
}
