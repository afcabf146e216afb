/// @file test_cf_fuzz.c
/// The software vehicle under random calls: any order, any values, any bytes in its parameters; and the same calls twice.
#include "cf_fixture.h"
#include "ivl_record.h"

enum
{
    N_CALLS = 60000,
    N_REPEATED = 3000
};

static draws_t draws;

static uint32_t dice(uint32_t n)
{
    return (uint32_t)(draw_u64(&draws) % n);
}

/// Mostly sensible; sometimes any bits at all.
static float number(void)
{
    float          value;
    const uint32_t bits = (uint32_t)draw_u64(&draws);
    memcpy(&value, &bits, sizeof value);
    return (dice(8) == 0) ? value : (float)draw(&draws, -3.0, 3.0);
}

static size_t size_of(uint8_t type)
{
    switch (type)
    {
    case IVL_CF_PARAM_U8:
    case IVL_CF_PARAM_I8:
        return 1;
    case IVL_CF_PARAM_U16:
    case IVL_CF_PARAM_I16:
        return 2;
    case IVL_CF_PARAM_U32:
    case IVL_CF_PARAM_I32:
    case IVL_CF_PARAM_F32:
        return 4;
    default:
        return 8;
    }
}

static void write_any_param(void)
{
    size_t                n;
    const ivl_cf_param_t *p = ivl_cf_params(vehicle, &n);
    p += dice((uint32_t)n);
    if (p->read_only)
    {
        return;
    }
    uint8_t bytes[8];
    for (size_t i = 0; i < sizeof bytes; i++)
    {
        bytes[i] = (dice(2) == 0) ? (uint8_t)dice(256) : (uint8_t)dice(3);
    }
    memcpy(p->address, bytes, size_of(p->type));
    if (p->changed != NULL)
    {
        p->changed();
    }
}

static void set_any(void)
{
    const float a[3] = {number(), number(), number()}, b[3] = {number(), number(), number()},
                q[4] = {number(), number(), number(), number()};
    switch (dice(10))
    {
    case 0:
        (void)ivl_cf_set_rpyt(vehicle, number() * 10.0f, number() * 10.0f, number() * 10.0f, (uint16_t)dice(65536));
        break;
    case 1:
        (void)ivl_cf_set_velocity(vehicle, a, number());
        break;
    case 2:
        (void)ivl_cf_set_zdistance(vehicle, number() * 10.0f, number() * 10.0f, number(), number());
        break;
    case 3:
        (void)ivl_cf_set_hover(vehicle, number(), number(), number() * 30.0f, number());
        break;
    case 4:
        (void)ivl_cf_set_position(vehicle, a, number() * 60.0f);
        break;
    case 5:
        (void)ivl_cf_set_manual(vehicle, number() * 10.0f, number() * 10.0f, number(), (uint16_t)dice(65536), dice(2) == 0);
        break;
    case 6:
        (void)ivl_cf_set_full_state(vehicle, a, b, a, q, b);
        break;
    case 7:
        (void)ivl_cf_ext_pose(vehicle, a, q);
        (void)ivl_cf_ext_position(vehicle, b);
        break;
    case 8:
        ivl_cf_notify_stop(vehicle, dice(1000));
        break;
    default:
        (void)ivl_cf_set_stop(vehicle);
        break;
    }
}

static void order_any(void)
{
    const float a[3] = {number(), number(), number()};
    switch (dice(9))
    {
    case 0:
        (void)ivl_cf_hl_takeoff(vehicle, number(), number(), dice(2) == 0, number());
        break;
    case 1:
        (void)ivl_cf_hl_land(vehicle, number(), number(), dice(2) == 0, number());
        break;
    case 2:
        (void)ivl_cf_hl_go_to(vehicle, dice(2) == 0, dice(2) == 0, a, number(), number());
        break;
    case 3:
        (void)ivl_cf_hl_stop(vehicle);
        break;
    case 4:
        (void)ivl_cf_arm(vehicle, dice(2) == 0);
        break;
    case 5:
        (void)ivl_cf_recover(vehicle);
        break;
    case 6:
        (dice(10) == 0) ? ivl_cf_estop(vehicle) : ivl_cf_estop_watchdog(vehicle);
        break;
    case 7:
        ivl_cf_link(vehicle, dice(10) != 0);
        break;
    default:
        write_u8("sil", "reset", 1);
        break;
    }
}

static void send_any_packet(void)
{
    uint8_t bytes[40];
    for (size_t i = 0; i < sizeof bytes; i++)
    {
        bytes[i] = (uint8_t)dice(256);
    }
    if (dice(4) == 0)
    {
        (void)ivl_cf_app_receive(vehicle, bytes, dice(sizeof bytes));
        return;
    }
    const ivl_wire_policy_t  policy = constant_packet(dice(1000), number() + 3.0f, (number() + 3.0f) * 3.0e-3f);
    const ivl_wire_command_t command = {(uint16_t)dice(65536), (uint8_t)dice(5), number(), number(), number(), number() + 2.0f, number()};
    const size_t             size = (dice(3) == 0) ? ivl_wire_put_policy(bytes, &policy) : ivl_wire_put_command(bytes, &command);
    (void)ivl_cf_app_receive(vehicle, bytes, size);
}

static void read_all(void)
{
    uint8_t                bytes[64];
    char                   text[64];
    size_t                 n;
    const ivl_cf_memory_t *m = ivl_cf_memories(vehicle, &n);
    const uint32_t         size = dice(sizeof bytes), most = m[dice((uint32_t)n)].size();
    (void)m[dice((uint32_t)n)].read((dice(4) == 0) ? (uint32_t)draw_u64(&draws) : dice(most + 2u), size, bytes);
    while (ivl_cf_app_take(vehicle, bytes) > 0 || ivl_cf_console_take(vehicle, text, sizeof text) > 0)
    {
    }
    (void)ivl_cf_supervisor_info(vehicle);
    ivl_cf_logs_refresh(vehicle);
}

static void call_any(void)
{
    switch (dice(8))
    {
    case 0:
        write_any_param();
        break;
    case 1:
        set_any();
        break;
    case 2:
        order_any();
        break;
    case 3:
        send_any_packet();
        break;
    case 4:
        read_all();
        break;
    default:
        run_ms((int)dice(12));
        break;
    }
}

static ivl_sim_model_t noisy_model(void)
{
    ivl_sim_params_t params = fixture_params();
    params.world_ceiling_height_m = 2.1;
    params.sense_position_noise_m = 0.01;
    params.sense_velocity_noise_mps = 0.05;
    params.rotor_thrust_scatter_norm = 0.02;
    return fixture_model(&params);
}

/// Configured and flying, so that random calls meet more than a vehicle on the floor.
static void begin(const ivl_sim_model_t *model)
{
    open_vehicle(model);
    (void)commit_config(1);
    write_u8("sil", "reset", 1);
    (void)send_policy(1, 4.0f, 0.008f);
}

static void test_motors_stay_within_their_limits_whatever_is_called(void)
{
    const ivl_sim_model_t model = noisy_model();
    uint32_t              n_landings = 0;
    draws = (draws_t){123};
    begin(&model);
    for (int i = 0; i < N_CALLS; i++)
    {
        call_any();
        // now and then a vehicle that could be flown again, and a landing
        if (dice(200) == 0)
        {
            const uint8_t on = 1;
            write_u8("motorPowerSet", "enable", 0);
            write_u8("stabilizer", "stop", 0);
            write_u8("stabilizer", "estimator", 2);
            write_u8("stabilizer", "controller", 6);
            write_u8("sil", "pose_source", 0);
            write_f32("sil", "vbat", 0.0f);
            ivl_cf_link(vehicle, true);
            write_param("sil", "reset", &on, 1);
            run_ms(20);
            uint8_t                  bytes[IVL_WIRE_SIZE_MAX];
            const ivl_wire_command_t hover = {1, IVL_REQUEST_HOVER, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f};
            const ivl_wire_command_t go = {2, IVL_REQUEST_APPROACH, 0.0f, 0.0f, 1.0f, 2.5f, 1.5f};
            (void)ivl_cf_app_receive(vehicle, bytes, ivl_wire_put_command(bytes, &hover));
            run_ms(10);
            (void)ivl_cf_app_receive(vehicle, bytes, ivl_wire_put_command(bytes, &go));
            run_ms((int)dice(1000));
        }
        const char *const names[] = {"m1", "m2", "m3", "m4"};
        for (int k = 0; k < 4; k++)
        {
            TEST_ASSERT_TRUE(read_log("motor", names[k]) >= 0.0 && read_log("motor", names[k]) <= 65535.0);
        }
        n_landings = (uint32_t)read_log("sil", "episode");
    }
    TEST_ASSERT_TRUE(n_landings > 10);
    ivl_cf_close(vehicle);
}

/// What a listener can tell one run from another by.
static uint64_t run_and_hash(const ivl_sim_model_t *model, uint64_t seed)
{
    uint64_t hash = 14695981039346656037u;
    draws = (draws_t){seed};
    begin(model);
    for (int i = 0; i < N_REPEATED; i++)
    {
        call_any();
        size_t              n;
        const ivl_cf_log_t *l = ivl_cf_logs(vehicle, &n);
        ivl_cf_logs_refresh(vehicle);
        for (size_t k = 0; k < n; k++)
        {
            const size_t size = (l[k].type == IVL_CF_LOG_U8 || l[k].type == IVL_CF_LOG_I8) ? 1 : ((l[k].type == IVL_CF_LOG_U16) ? 2 : 4);
            for (size_t b = 0; b < size; b++)
            {
                hash = (hash ^ ((const uint8_t *)l[k].address)[b]) * 1099511628211u;
            }
        }
    }
    ivl_cf_close(vehicle);
    return hash;
}

static void test_the_same_calls_give_the_same_run(void)
{
    const ivl_sim_model_t model = noisy_model();
    for (uint64_t seed = 1; seed <= 3; seed++)
    {
        const uint64_t first = run_and_hash(&model, seed), other = run_and_hash(&model, seed + 100), again = run_and_hash(&model, seed);
        TEST_ASSERT_TRUE(first == again);
        TEST_ASSERT_TRUE(first != other);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motors_stay_within_their_limits_whatever_is_called);
    RUN_TEST(test_the_same_calls_give_the_same_run);
    return UNITY_END();
}
