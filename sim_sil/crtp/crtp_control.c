#include "crtp_control.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "crtp_log_value.h"
#include "crtp_params.h"

typedef union
{
    uint8_t bytes[IVL_CRTP_VALUE_BYTES];
    float   f32;
    double  f64;
    int64_t i64;
} value_t;

static bool is_signed(uint8_t type)
{
    return type <= IVL_CF_PARAM_I64;
}

// ---- text to bytes; the machine is little-endian, as everywhere here

static bool parse_integer(const char *text, uint8_t type, value_t *value)
{
    const int64_t  bits = 8 * (int64_t)ivl_crtp_param_size(type);
    const uint64_t largest = is_signed(type) ? UINT64_MAX >> (65 - bits) : UINT64_MAX >> (64 - bits);
    char          *end;
    errno = 0;
    const bool     negative = text[0] == '-';
    const uint64_t magnitude = strtoull(negative ? text + 1 : text, &end, 0);
    if ((errno != 0) || (*end != '\0') || !isdigit((unsigned char)text[negative ? 1 : 0]))
    {
        return false;
    }
    if (negative)
    {
        value->i64 = (int64_t)(0u - magnitude);
        return is_signed(type) && (magnitude <= largest + 1u);
    }
    value->i64 = (int64_t)magnitude;
    return magnitude <= largest;
}

static bool parse(const char *text, uint8_t type, value_t *value)
{
    if ((type != IVL_CF_PARAM_F32) && (type != IVL_CF_PARAM_F64))
    {
        return parse_integer(text, type, value);
    }
    char        *end;
    const double number = strtod(text, &end);
    if (type == IVL_CF_PARAM_F64)
    {
        value->f64 = number;
    }
    else
    {
        value->f32 = (float)number;
    }
    return (end != text) && (*end == '\0');
}

// ---- bytes to text

static void print_param(const ivl_cf_param_t *row, char *text, size_t size)
{
    value_t value = {.bytes = {0}};
    size_t  n = ivl_crtp_param_size(row->type);
    memcpy(value.bytes, row->address, n);
    if (row->type == IVL_CF_PARAM_F32)
    {
        snprintf(text, size, "%.9g", (double)value.f32);
    }
    else if (row->type == IVL_CF_PARAM_F64)
    {
        snprintf(text, size, "%.17g", value.f64);
    }
    else if (is_signed(row->type))
    {
        const unsigned shift = (unsigned)(64u - 8u * n);
        snprintf(text, size, "%" PRId64, (int64_t)((uint64_t)value.i64 << shift) >> shift);
    }
    else
    {
        snprintf(text, size, "%" PRIu64, (uint64_t)value.i64);
    }
}

static void print_log(const ivl_cf_log_t *row, char *text, size_t size)
{
    static const uint8_t PARAM_TYPE[] = {
        [IVL_CF_LOG_U8] = IVL_CF_PARAM_U8,   [IVL_CF_LOG_U16] = IVL_CF_PARAM_U16, [IVL_CF_LOG_U32] = IVL_CF_PARAM_U32,
        [IVL_CF_LOG_I8] = IVL_CF_PARAM_I8,   [IVL_CF_LOG_I16] = IVL_CF_PARAM_I16, [IVL_CF_LOG_I32] = IVL_CF_PARAM_I32,
        [IVL_CF_LOG_F32] = IVL_CF_PARAM_F32,
    };
    uint8_t bytes[4];
    (void)ivl_crtp_log_value(row, row->type, bytes);
    const ivl_cf_param_t same = {.type = PARAM_TYPE[row->type], .address = bytes};
    print_param(&same, text, size);
}

// ---- requests

static void write_param(ivl_crtp_t *crtp, uint16_t id, const char *text, char *reply)
{
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    value_t               value = {.bytes = {0}};
    if (row->read_only)
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "error: %s.%s is read-only", row->group, row->name);
    }
    else if (!parse(text, row->type, &value))
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "error: %s.%s: %.40s is no value of its type", row->group, row->name, text);
    }
    else
    {
        const ivl_crtp_fault_cfg_t before = crtp->own.fault;
        (void)ivl_crtp_params_write(crtp, id, value.bytes);
        ivl_crtp_own_keep(&crtp->own, &before);
    }
}

static void answer(ivl_crtp_t *crtp, const char *group, const char *name, const char *text, char *reply)
{
    uint16_t id;
    char     value[40] = "";
    reply[0] = '\0';
    if (ivl_crtp_toc_find(&crtp->params.toc, group, name, &id))
    {
        if (text != NULL)
        {
            write_param(crtp, id, text, reply);
        }
        print_param(&crtp->params.rows[id], value, sizeof value);
    }
    else if (ivl_crtp_toc_find(&crtp->logs.toc, group, name, &id) && (text == NULL))
    {
        ivl_cf_logs_refresh(crtp->cf);
        print_log(&crtp->logs.rows[id], value, sizeof value);
    }
    else
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "error: no %s %.30s.%.30s", (text != NULL) ? "parameter" : "variable", group, name);
    }
    if (reply[0] == '\0')
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "%.30s.%.30s=%s", group, name, value);
    }
}

void ivl_crtp_control(ivl_crtp_t *crtp, const char *request, size_t size, char reply[IVL_CRTP_CONTROL_BYTES])
{
    char line[IVL_CRTP_CONTROL_BYTES];
    while ((size > 0u) && isspace((unsigned char)request[size - 1u]))
    {
        size--;
    }
    if ((size == 0u) || (size >= sizeof line) || (memchr(request, '\0', size) != NULL))
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "error: expected group.name or group.name=value");
        return;
    }
    memcpy(line, request, size);
    line[size] = '\0';
    char *value = strchr(line, '=');
    if (value != NULL)
    {
        *value++ = '\0';
    }
    char *name = strchr(line, '.');
    if (name == NULL)
    {
        snprintf(reply, IVL_CRTP_CONTROL_BYTES, "error: expected group.name or group.name=value");
        return;
    }
    *name++ = '\0';
    answer(crtp, line, name, value, reply);
}
