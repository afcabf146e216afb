#include "crtp_list.h"

#include <stdio.h>

#include "crtp_control.h"
#include "crtp_params.h"

static const char *name_of_param_type(uint8_t type)
{
    static const char *const NAMES[] = {
        [IVL_CF_PARAM_I8] = "i8",   [IVL_CF_PARAM_I16] = "i16", [IVL_CF_PARAM_I32] = "i32", [IVL_CF_PARAM_I64] = "i64",
        [IVL_CF_PARAM_F32] = "f32", [IVL_CF_PARAM_F64] = "f64", [IVL_CF_PARAM_U8] = "u8",   [IVL_CF_PARAM_U16] = "u16",
        [IVL_CF_PARAM_U32] = "u32", [IVL_CF_PARAM_U64] = "u64",
    };
    return NAMES[type];
}

static const char *name_of_log_type(uint8_t type)
{
    static const char *const NAMES[] = {
        [IVL_CF_LOG_U8] = "u8",   [IVL_CF_LOG_U16] = "u16", [IVL_CF_LOG_U32] = "u32", [IVL_CF_LOG_I8] = "i8",
        [IVL_CF_LOG_I16] = "i16", [IVL_CF_LOG_I32] = "i32", [IVL_CF_LOG_F32] = "f32",
    };
    return NAMES[type];
}

static const char *text_if(bool holds, const char *text)
{
    return holds ? text : "";
}

static void list_param(ivl_crtp_t *crtp, const ivl_cf_param_t *row)
{
    char      name[IVL_CRTP_NAME_MAX + 2], reply[IVL_CRTP_CONTROL_BYTES];
    const int n = snprintf(name, sizeof name, "%s.%s", row->group, row->name);
    ivl_crtp_control(crtp, name, (size_t)n, reply);
    printf("param\t%s\t%s\t%s\t%s\t%s\t%s\t%s\n", name, name_of_param_type(row->type), row->read_only ? "r" : "rw",
           text_if(row->persistent, "persistent"), text_if(row->core, "core"), row->held ? "held" : "live", reply + n + 1);
}

void ivl_crtp_list(ivl_crtp_t *crtp)
{
    for (uint16_t i = 0; i < crtp->params.toc.n; i++)
    {
        list_param(crtp, &crtp->params.rows[i]);
    }
    for (uint16_t i = 0; i < crtp->logs.toc.n; i++)
    {
        const ivl_cf_log_t *row = &crtp->logs.rows[i];
        printf("log\t%s.%s\t%s\tr\t\t%s\t%s\t\n", row->group, row->name, name_of_log_type(row->type), text_if(row->core, "core"),
               row->held ? "held" : "live");
    }
}
