/// @file cf_sdk.c
/// The functions of the SDK that the app calls, answered by the simulated vehicle.
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "FreeRTOS.h"
#include "app_channel.h"
#include "cf_vehicle.h"
#include "commander.h"
#include "crtp.h"
#include "crtp_commander_high_level.h"
#include "debug.h"
#include "log.h"
#include "mem.h"
#include "param.h"
#include "platform_defaults.h"
#include "pm.h"
#include "range.h"
#include "supervisor.h"
#include "task.h"
#include "usec_time.h"

ivl_cf_platform_t ivl_cf_platform;

// ---- time

uint64_t usecTimestamp(void)
{
    return ivl_cf_time_us(&ivl_cf_the);
}

TickType_t xTaskGetTickCount(void)
{
    return ivl_cf_now_ms(&ivl_cf_the);
}

/// The vehicle calls the app's task when its wait is over, so there is nothing left to wait for.
void vTaskDelay(TickType_t ticks)
{
    (void)ticks;
}

// ---- the vehicle

float pmGetBatteryVoltage(void)
{
    return ivl_cf_the.power.vbat_V;
}

bool supervisorCanFly(void)
{
    return ivl_cf_supervisor_can_fly(&ivl_cf_the.supervisor);
}

bool crtpIsConnected(void)
{
    return ivl_cf_the.link_up;
}

bool crtpCommanderHighLevelIsStopped(void)
{
    return ivl_cf_the.planner.plan == IVL_CF_PLAN_STOPPED;
}

int crtpCommanderHighLevelGoTo(const float x, const float y, const float z, const float yaw, const float duration_s, const bool relative)
{
    const float p_W_m[3] = {x, y, z};
    return ivl_cf_hl_go_to(&ivl_cf_the, relative, false, p_W_m, yaw, duration_s);
}

void commanderRelaxPriority(void)
{
    ivl_cf_relax(&ivl_cf_the);
}

/// Only where the world has such a sensor: in the process of the host there is no other.
float rangeGet(rangeDirection_t direction)
{
    return (direction == rangeUp && ivl_cf_the.has_range) ? (float)ivl_cf_the.range_mm[IVL_CF_UP] : 0.0f;
}

/// The world's alone: its sensors and motors know no other.
bool app_has_rate(float tick_hz)
{
    return tick_hz >= ivl_cf_the.model.firmware.tick_hz && tick_hz <= ivl_cf_the.model.firmware.tick_hz;
}

// ---- the host

int appchannelSendDataPacket(void *data, size_t length)
{
    return ivl_cf_packets_put(&ivl_cf_the.from_app, data, length) ? 1 : 0;
}

size_t appchannelReceiveDataPacket(void *buffer, size_t max_length, int timeout_ms)
{
    ivl_cf_the.app_wake_ms = ivl_cf_the.t_ms + (uint64_t)timeout_ms;
    return ivl_cf_packets_take(&ivl_cf_the.to_app, buffer, max_length);
}

static void print(const char *format, va_list arguments)
{
    char line[160];
    (void)vsnprintf(line, sizeof line, format, arguments);
    ivl_cf_text_put(&ivl_cf_the.text, line);
}

void ivl_cf_print(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    print(format, arguments);
    va_end(arguments);
}

void sdk_print(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    print(format, arguments);
    va_end(arguments);
}

// ---- values by name

static const uint16_t NOT_FOUND = 0xffffu;

logVarId_t logGetVarId(const char *group, const char *name)
{
    size_t              n;
    const ivl_cf_log_t *logs = ivl_cf_logs(&ivl_cf_the, &n);
    for (size_t i = 0; i < n; i++)
    {
        if (strcmp(logs[i].group, group) == 0 && strcmp(logs[i].name, name) == 0)
        {
            return (logVarId_t)i;
        }
    }
    return NOT_FOUND;
}

/// Of the two types that the app asks for.
float logGetFloat(logVarId_t varid)
{
    size_t              n;
    const ivl_cf_log_t *logs = ivl_cf_logs(&ivl_cf_the, &n);
    float               value = 0.0f;
    if (varid < n && logs[varid].type == IVL_CF_LOG_F32)
    {
        memcpy(&value, logs[varid].address, sizeof value);
    }
    else if (varid < n && logs[varid].type == IVL_CF_LOG_U16)
    {
        uint16_t whole;
        memcpy(&whole, logs[varid].address, sizeof whole);
        value = (float)whole;
    }
    return value;
}

paramVarId_t paramGetVarId(const char *group, const char *name)
{
    size_t                n;
    const ivl_cf_param_t *params = ivl_cf_params(&ivl_cf_the, &n);
    for (size_t i = 0; i < n; i++)
    {
        if (strcmp(params[i].group, group) == 0 && strcmp(params[i].name, name) == 0)
        {
            return (paramVarId_t){.id = (uint16_t)i, .index = (uint16_t)i};
        }
    }
    return (paramVarId_t){.id = NOT_FOUND};
}

static void *address_of(paramVarId_t varid, ivl_cf_param_type_t type)
{
    size_t                n;
    const ivl_cf_param_t *params = ivl_cf_params(&ivl_cf_the, &n);
    return (varid.id < n && params[varid.id].type == type) ? params[varid.id].address : NULL;
}

/// Of the two types that the app asks for.
unsigned int paramGetUint(paramVarId_t varid)
{
    const uint8_t *const  byte = address_of(varid, IVL_CF_PARAM_U8);
    const uint32_t *const word = address_of(varid, IVL_CF_PARAM_U32);
    return (byte != NULL) ? *byte : ((word != NULL) ? *word : 0u);
}

/// The server sees by itself what has changed.  Of the same types.
void paramSetInt(paramVarId_t varid, int valuei)
{
    uint8_t *const  byte = address_of(varid, IVL_CF_PARAM_U8);
    uint32_t *const word = address_of(varid, IVL_CF_PARAM_U32);
    if (byte != NULL)
    {
        *byte = (uint8_t)valuei;
    }
    if (word != NULL)
    {
        *word = (uint32_t)valuei;
    }
}

void paramSetFloat(paramVarId_t varid, float valuef)
{
    void *const at = address_of(varid, IVL_CF_PARAM_F32);
    if (at != NULL)
    {
        memcpy(at, &valuef, sizeof valuef);
    }
}

// ---- memories

static const MemoryHandlerDef_t *handler;

void memoryRegisterHandler(const MemoryHandlerDef_t *handlerDef)
{
    handler = handlerDef;
}

static uint32_t app_memory_size(void)
{
    return handler->getSize(handler->internal_id);
}

static bool app_memory_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return size <= UINT8_MAX && handler->read(handler->internal_id, address, (uint8_t)size, bytes);
}

const ivl_cf_memory_t *ivl_cf_app_memory(void)
{
    static const ivl_cf_memory_t memory = {.type = MEM_TYPE_APP, .size = app_memory_size, .read = app_memory_read};
    return (handler != NULL) ? &memory : NULL;
}
