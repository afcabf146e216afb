/// @file cf_fixture.h
/// Shared by the tests of the software vehicle: an operator who writes parameters, sends packets to the app and waits.
/// In a header, since only these tests are linked with the vehicle.
#ifndef CF_FIXTURE_H
#define CF_FIXTURE_H
#include "cf.h"
#include "policy_fixture.h"
#include "sim_fixture.h"

static ivl_cf_t *vehicle;

static inline void open_vehicle(const ivl_sim_model_t *model)
{
    char error[200] = "";
    vehicle = ivl_cf_open(model, 1, error, sizeof error);
    TEST_ASSERT_NOT_NULL_MESSAGE(vehicle, error);
    ivl_cf_link(vehicle, true);
}

static inline void run_ms(int ms)
{
    for (int i = 0; i < ms; i++)
    {
        ivl_cf_step(vehicle);
    }
}

// ---- tables

static inline const ivl_cf_param_t *find_param(const char *group, const char *name)
{
    size_t                n;
    const ivl_cf_param_t *p = ivl_cf_params(vehicle, &n);
    for (size_t i = 0; i < n; i++)
    {
        if (strcmp(p[i].group, group) == 0 && strcmp(p[i].name, name) == 0)
        {
            return &p[i];
        }
    }
    TEST_FAIL_MESSAGE(name);
    return NULL;
}

static inline void write_param(const char *group, const char *name, const void *bytes, size_t size)
{
    const ivl_cf_param_t *p = find_param(group, name);
    memcpy(p->address, bytes, size);
    if (p->changed != NULL)
    {
        p->changed();
    }
}

static inline void write_u8(const char *group, const char *name, uint8_t value)
{
    TEST_ASSERT_EQUAL_UINT8(IVL_CF_PARAM_U8, find_param(group, name)->type);
    write_param(group, name, &value, sizeof value);
}

static inline void write_u32(const char *group, const char *name, uint32_t value)
{
    TEST_ASSERT_EQUAL_UINT8(IVL_CF_PARAM_U32, find_param(group, name)->type);
    write_param(group, name, &value, sizeof value);
}

static inline void write_f32(const char *group, const char *name, float value)
{
    TEST_ASSERT_EQUAL_UINT8(IVL_CF_PARAM_F32, find_param(group, name)->type);
    write_param(group, name, &value, sizeof value);
}

static inline void write_f64(const char *group, const char *name, double value)
{
    TEST_ASSERT_EQUAL_UINT8(IVL_CF_PARAM_F64, find_param(group, name)->type);
    write_param(group, name, &value, sizeof value);
}

static inline double read_log(const char *group, const char *name)
{
    size_t              n;
    const ivl_cf_log_t *l = ivl_cf_logs(vehicle, &n);
    ivl_cf_logs_refresh(vehicle);
    for (size_t i = 0; i < n; i++)
    {
        if (strcmp(l[i].group, group) == 0 && strcmp(l[i].name, name) == 0)
        {
            switch (l[i].type)
            {
            case IVL_CF_LOG_F32:
                return (double)*(const float *)l[i].address;
            case IVL_CF_LOG_U32:
                return (double)*(const uint32_t *)l[i].address;
            case IVL_CF_LOG_U16:
                return (double)*(const uint16_t *)l[i].address;
            case IVL_CF_LOG_I16:
                return (double)*(const int16_t *)l[i].address;
            case IVL_CF_LOG_I32:
                return (double)*(const int32_t *)l[i].address;
            case IVL_CF_LOG_I8:
                return (double)*(const int8_t *)l[i].address;
            default:
                return (double)*(const uint8_t *)l[i].address;
            }
        }
    }
    TEST_FAIL_MESSAGE(name);
    return 0.0;
}

static inline bool info(int bit)
{
    return (ivl_cf_supervisor_info(vehicle) >> bit & 1) != 0;
}

// ---- the app

/// Waits for the app's next packet that `get` understands.
#define EXPECT_PACKET(get, packet)                                                                                                         \
    do                                                                                                                                     \
    {                                                                                                                                      \
        bool got = false;                                                                                                                  \
        for (int ms = 0; ms < 60 && !got; ms++)                                                                                            \
        {                                                                                                                                  \
            uint8_t app_bytes[IVL_CF_APP_BYTES];                                                                                           \
            run_ms(1);                                                                                                                     \
            const size_t size = ivl_cf_app_take(vehicle, app_bytes);                                                                       \
            got = size > 0 && get(app_bytes, size, packet);                                                                                \
        }                                                                                                                                  \
        TEST_ASSERT_TRUE_MESSAGE(got, #get);                                                                                               \
    } while (0)

static inline ivl_wire_config_echo_t commit_config(uint32_t seq)
{
    ivl_wire_config_echo_t echo = {0};
    write_u32("ivl", "commit", seq);
    EXPECT_PACKET(ivl_wire_get_config_echo, &echo);
    TEST_ASSERT_EQUAL_UINT32(seq, echo.seq);
    return echo;
}

static inline ivl_wire_policy_echo_t send_policy(uint32_t seq, float rrev_c_per_s, float moment_Nm)
{
    const ivl_wire_policy_t packet = constant_packet(seq, rrev_c_per_s, moment_Nm);
    ivl_wire_policy_echo_t  echo = {0};
    uint8_t                 bytes[IVL_WIRE_SIZE_MAX];
    TEST_ASSERT_TRUE(ivl_cf_app_receive(vehicle, bytes, ivl_wire_put_policy(bytes, &packet)));
    EXPECT_PACKET(ivl_wire_get_policy_echo, &echo);
    TEST_ASSERT_EQUAL_UINT32(seq, echo.seq);
    return echo;
}

static inline ivl_wire_command_echo_t send_command(ivl_request_t request, float x, float y, float z, float speed_mps, float angle_rad)
{
    static uint16_t          seq;
    const ivl_wire_command_t packet = {++seq, (uint8_t)request, x, y, z, speed_mps, angle_rad};
    ivl_wire_command_echo_t  echo = {0};
    uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
    TEST_ASSERT_TRUE(ivl_cf_app_receive(vehicle, bytes, ivl_wire_put_command(bytes, &packet)));
    EXPECT_PACKET(ivl_wire_get_command_echo, &echo);
    TEST_ASSERT_EQUAL_UINT16(seq, echo.seq);
    return echo;
}

static inline void assert_phase(ivl_phase_t expected)
{
    TEST_ASSERT_EQUAL_STRING(ivl_phase_name(expected), ivl_phase_name((ivl_phase_t)(int)read_log("ivl", "phase")));
}

/// A landing whose outcome is read as the host reads it.
static inline ivl_cf_outcome_header_t read_outcome(ivl_sim_outcome_t *outcome)
{
    size_t                  n;
    ivl_cf_outcome_header_t header;
    const ivl_cf_memory_t  *m = ivl_cf_memories(vehicle, &n);
    TEST_ASSERT_TRUE(n > 2);
    TEST_ASSERT_EQUAL_UINT8(IVL_CF_MEMORY_OUTCOME, m[1].type);
    TEST_ASSERT_EQUAL_UINT32(sizeof header + sizeof *outcome, m[1].size());
    TEST_ASSERT_TRUE(m[1].read(0, sizeof header, (uint8_t *)&header));
    TEST_ASSERT_TRUE(m[1].read(sizeof header, sizeof *outcome, (uint8_t *)outcome));
    TEST_ASSERT_EQUAL_UINT32(IVL_CF_OUTCOME_MAGIC, header.magic);
    TEST_ASSERT_EQUAL_UINT32(sizeof *outcome, header.size);
    return header;
}
#endif  // CF_FIXTURE_H
