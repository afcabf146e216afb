/// @file sdk_double.c
#include "sdk_double.h"

#include <string.h>

#include "FreeRTOS.h"
#include "app_channel.h"
#include "commander.h"
#include "controller.h"
#include "controller_pid.h"
#include "crtp.h"
#include "crtp_commander_high_level.h"
#include "debug.h"
#include "pm.h"
#include "range.h"
#include "supervisor.h"
#include "task.h"
#include "unity.h"
#include "usec_time.h"

enum
{
    BYPASS_ID = 3,
    IDLE_ID = 4,
    FIRST_ID = 100  // of the group ivl
};

sdk_t   sdk;
uint8_t tumbleCheckEnabled;

void sdk_double_reset(void)
{
    sdk = (sdk_t){
        .cpx_handler = sdk.cpx_handler,
        .now_us = 10000000u,
        .vbat_V = 4.0f,
        .can_fly = true,
        .is_connected = true,
        .high_level_is_stopped = true,
        .controller_runs = true,
        .variance_m2 = 1.0e-6f,
        .has_variance = true,
        .state = {.attitudeQuaternion = {0.0f, 0.0f, 0.0f, 1.0f}, .position = {.z = 1.0f}},
        .sensors = {.acc = {0.0f, 0.0f, 1.0f}},
        .step = 1,
    };
    tumbleCheckEnabled = 0;
}

void sdk_double_run(int ms)
{
    for (int i = 0; i < ms; i++)
    {
        sdk.now_us += 1000u;
        sdk.setpoint.timestamp = (uint32_t)(sdk.now_us / 1000u);
        if (sdk.each_ms != NULL)
        {
            sdk.each_ms();
        }
        if (sdk.step % 10u == 0u)
        {
            sdk.state.position.y = (sdk.step % 20u == 0u) ? 1.0e-9f : 2.0e-9f;
        }
        if (sdk.controller_runs)
        {
            controllerOutOfTree(&sdk.control, &sdk.setpoint, &sdk.sensors, &sdk.state, sdk.step);
        }
        sdk.step++;
    }
}

// ---- tables

static struct param_s *find_param(const char *name)
{
    for (struct param_s *p = sdk_params_ivl + 1; p->type != (PARAM_GROUP | PARAM_STOP); p++)
    {
        if (strcmp(p->name, name) == 0)
        {
            return p;
        }
    }
    TEST_FAIL_MESSAGE(name);
    return NULL;
}

static void write_param(const char *name, const void *bytes, size_t size)
{
    struct param_s *p = find_param(name);
    memcpy(p->address, bytes, size);
    if (p->callback != NULL)
    {
        p->callback();
    }
}

void sdk_double_write_float(const char *name, float value)
{
    TEST_ASSERT_EQUAL_UINT8(PARAM_FLOAT, find_param(name)->type);
    write_param(name, &value, sizeof value);
}

void sdk_double_write_u32(const char *name, uint32_t value)
{
    TEST_ASSERT_EQUAL_UINT8(PARAM_UINT32, find_param(name)->type);
    write_param(name, &value, sizeof value);
}

double sdk_double_read_param(const char *name)
{
    const struct param_s *p = find_param(name);
    return (p->type == PARAM_FLOAT) ? (double)*(const float *)p->address : (double)*(const uint8_t *)p->address;
}

double sdk_double_read_log(const char *name)
{
    for (const struct log_s *l = sdk_logs_ivl + 1; l->type != (LOG_GROUP | LOG_STOP); l++)
    {
        if (strcmp(l->name, name) == 0)
        {
            switch (l->type)
            {
            case LOG_FLOAT:
                return (double)*(const float *)l->address;
            case LOG_UINT32:
                return (double)*(const uint32_t *)l->address;
            case LOG_UINT16:
                return (double)*(const uint16_t *)l->address;
            case LOG_INT8:
                return (double)*(const int8_t *)l->address;
            default:
                return (double)*(const uint8_t *)l->address;
            }
        }
    }
    TEST_FAIL_MESSAGE(name);
    return 0.0;
}

// ---- the SDK's functions

uint64_t usecTimestamp(void)
{
    return sdk.now_us;
}

TickType_t xTaskGetTickCount(void)
{
    return (TickType_t)(sdk.now_us / 1000u);
}

void vTaskDelay(TickType_t ticks)
{
    sdk_double_run((int)ticks);
}

float pmGetBatteryVoltage(void)
{
    return sdk.vbat_V;
}

bool supervisorCanFly(void)
{
    return sdk.can_fly;
}

bool crtpIsConnected(void)
{
    return sdk.is_connected;
}

bool crtpCommanderHighLevelIsStopped(void)
{
    return sdk.high_level_is_stopped;
}

int crtpCommanderHighLevelGoTo(const float x, const float y, const float z, const float yaw, const float duration_s, const bool relative)
{
    TEST_ASSERT_FALSE(relative);
    const float values[5] = {x, y, z, yaw, duration_s};
    memcpy(sdk.go_to, values, sizeof values);
    sdk.n_go_to++;
    return 0;
}

void commanderRelaxPriority(void)
{
    sdk.n_relax++;
}

void controllerPidInit(void)
{
    sdk.n_pid_init++;
}

bool controllerPidTest(void)
{
    return true;
}

void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                   const stabilizerStep_t stabilizerStep)
{
    TEST_ASSERT_NOT_NULL(sensors);
    TEST_ASSERT_NOT_NULL(state);
    const bool is_null = setpoint != &sdk.setpoint;
    sdk.n_pid_null += is_null ? 1 : 0;
    sdk.n_pid += is_null ? 0 : 1;
    sdk.last_pid_step = stabilizerStep;
    sdk.null_pid_step = is_null ? stabilizerStep : sdk.null_pid_step;
    *control = (control_t){.controlMode = controlModeLegacy};
    control->thrust = is_null ? 0.0f : sdk.pid_thrust;
}

int appchannelSendDataPacket(void *data, size_t length)
{
    TEST_ASSERT_TRUE(length <= APPCHANNEL_MTU);
    TEST_ASSERT_TRUE(sdk.n_sent < SDK_SENT_MAX);
    memcpy(sdk.sent[sdk.n_sent].bytes, data, length);
    sdk.sent[sdk.n_sent++].size = length;
    return 1;
}

size_t appchannelReceiveDataPacket(void *buffer, size_t max_length, int timeout_ms)
{
    if (sdk.n_receive_left-- <= 0)
    {
        longjmp(sdk.leave, 1);
    }
    const size_t size = (sdk.incoming.size < max_length) ? sdk.incoming.size : max_length;
    memcpy(buffer, sdk.incoming.bytes, size);
    sdk.incoming.size = 0;
    sdk_double_run((size > 0u) ? 0 : timeout_ms);
    return size;
}

logVarId_t logGetVarId(const char *group, const char *name)
{
    TEST_ASSERT_EQUAL_STRING("kalman", group);
    TEST_ASSERT_EQUAL_STRING_LEN("varP", name, 4);
    return sdk.has_variance ? (logVarId_t)name[4] : 0xffffu;
}

float logGetFloat(logVarId_t varid)
{
    TEST_ASSERT_TRUE((varid >= 'X') && (varid <= 'Z'));
    return ((sdk.vague_axis == 0) || (varid == (logVarId_t)sdk.vague_axis)) ? sdk.variance_m2 : 1.0e-12f;
}

float rangeGet(rangeDirection_t direction)
{
    TEST_ASSERT_EQUAL_INT(rangeUp, direction);
    return sdk.range_up_mm;
}

paramVarId_t paramGetVarId(const char *group, const char *name)
{
    if (strcmp(group, "ivl") == 0)
    {
        return (paramVarId_t){.id = (uint16_t)(FIRST_ID + (find_param(name) - sdk_params_ivl))};
    }
    if (strcmp(group, "powerDist") == 0)
    {
        TEST_ASSERT_EQUAL_STRING("idleThrust", name);
        return (paramVarId_t){.id = sdk.has_no_idle ? 0xffffu : IDLE_ID};
    }
    TEST_ASSERT_EQUAL_STRING("motorPowerSet", group);
    TEST_ASSERT_EQUAL_STRING("enable", name);
    return (paramVarId_t){.id = sdk.has_no_motor_power_set ? 0xffffu : BYPASS_ID};
}

static void tell(paramVarId_t varid, uint8_t type, const void *bytes, size_t size)
{
    const struct param_s *p = &sdk_params_ivl[varid.id - FIRST_ID];
    TEST_ASSERT_EQUAL_UINT8(type, p->type);
    memcpy(p->address, bytes, size);
    sdk.n_told++;
}

void paramSetFloat(paramVarId_t varid, float valuef)
{
    tell(varid, PARAM_FLOAT, &valuef, sizeof valuef);
}

void paramSetInt(paramVarId_t varid, int valuei)
{
    if (varid.id == IDLE_ID)
    {
        sdk.idle_thrust = (unsigned int)valuei;
        sdk.n_idle_told++;
        return;
    }
    const uint8_t value = (uint8_t)valuei;
    tell(varid, PARAM_UINT8, &value, sizeof value);
}

unsigned int paramGetUint(paramVarId_t varid)
{
    if (varid.id == IDLE_ID)
    {
        return sdk.idle_thrust;
    }
    return (varid.id == BYPASS_ID) ? sdk.motor_power_set : 0u;  // of what there is not, the SDK reads nothing
}

void memoryRegisterHandler(const MemoryHandlerDef_t *handlerDef)
{
    sdk.memory = handlerDef;
    sdk.n_memory++;
}

void cpxRegisterAppMessageHandler(cpxAppMessageHandlerCallback_t callback)
{
    TEST_ASSERT_NULL(sdk.cpx_handler);
    sdk.cpx_handler = callback;
}

void sdk_print(const char *format, ...)
{
    strncpy(sdk.printed, format, sizeof sdk.printed - 1u);
}
