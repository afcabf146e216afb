/// @file test_sim_drive.c
/// The flight core side by side: what it computes for several vehicles at once is, bit for bit, what it computes for one.
#include "world_drive.h"

#include "ivl.h"
#include "sim_fixture.h"

/// Mostly what a flight has, now and then what none has: limits are met, and numbers that are none.
static float any(draws_t *draws, double size)
{
    static const float ODD[] = {0.0f, -0.0f, 1.0e-30f, -1.0e30f, 3.0e38f, INFINITY, -INFINITY, NAN};
    const uint64_t     kind = draw_u64(draws) % 40u;
    if (kind == 0)
    {
        return ODD[draw_u64(draws) % (sizeof ODD / sizeof ODD[0])];
    }
    return (float)draw(draws, -size, size) * ((kind < 4) ? 100.0f : 1.0f);
}

static ivl_vec3_t any3(draws_t *draws, double size)
{
    return (ivl_vec3_t){any(draws, size), any(draws, size), any(draws, size)};
}

static ivl_quat_t any_attitude(draws_t *draws)
{
    const ivl_quat_t q = {any(draws, 1.0), any(draws, 1.0), any(draws, 1.0), any(draws, 1.0)};
    const float      scale = 1.0f / sqrtf(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return (ivl_quat_t){q.x * scale, q.y * scale, q.z * scale, q.w * scale};
}

static void put(ivl_vec3_t a, int lane, ivl_s3_t *to)
{
    to->x[lane] = a.x;
    to->y[lane] = a.y;
    to->z[lane] = a.z;
}

static void test_each_lane_has_the_thrusts_of_the_vehicle_alone(void)
{
    draws_t draws = {81};
    for (int n = 0; n < 20000; n++)
    {
        ivl_cfg_t cfg;
        ivl_cfg_defaults(&cfg);
        cfg.mass_kg = (float)draw(&draws, 0.02, 0.06);
        cfg.motor_thrust_N_max = (float)draw(&draws, 0.08, 0.3);
        cfg.kp_att_xy_Nmprad = (float)draw(&draws, 0.0, 0.02);
        cfg.kd_rate_z_Nmsprad = (float)draw(&draws, 0.0, 0.01);
        const float     tan_tilt_max = (float)draw(&draws, 0.1, 2.0);
        ivl_sim_drive_t drive = {.tan_tilt_max = tan_tilt_max};
        float           expected[IVL_SIM_LANES][4];
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            const ivl_sample_t sample = {
                .p_WB_m = any3(&draws, 3.0), .v_WB_mps = any3(&draws, 4.0), .q_WB = any_attitude(&draws), .w_B_radps = any3(&draws, 20.0)};
            const ivl_reference_t ref = {any3(&draws, 3.0), any3(&draws, 4.0), any3(&draws, 10.0)};
            const ivl_wrench_t    wrench = ivl_controller_compute(&cfg, &sample, &ref, tan_tilt_max);
            ivl_mixer_thrusts(&cfg, &wrench, expected[lane]);
            put(sample.p_WB_m, lane, &drive.p_WB_m);
            put(sample.v_WB_mps, lane, &drive.v_WB_mps);
            put(sample.w_B_radps, lane, &drive.w_B_radps);
            put(ref.p_W_m, lane, &drive.p_ref_W_m);
            put(ref.v_W_mps, lane, &drive.v_ref_W_mps);
            put(ref.a_W_mps2, lane, &drive.a_ref_W_mps2);
            drive.q_WB[0][lane] = sample.q_WB.x;
            drive.q_WB[1][lane] = sample.q_WB.y;
            drive.q_WB[2][lane] = sample.q_WB.z;
            drive.q_WB[3][lane] = sample.q_WB.w;
        }
        ivl_sim_drive(&cfg, &drive);
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            for (int i = 0; i < 4; i++)
            {
                const float found = drive.thrust_N[i][lane];
                TEST_ASSERT_EQUAL_MEMORY(&expected[lane][i], &found, sizeof found);
            }
        }
    }
}

/// A tick of a vehicle somewhere about its reference, with what a host may ask of it.
static ivl_in_t any_input(draws_t *draws, uint64_t t_us)
{
    ivl_in_t in = {.t_us = t_us, .t_pose_us = t_us, .q_WB = {0.0f, 0.0f, 0.0f, 1.0f}};
    in.p_WB_m = (ivl_vec3_t){(float)draw(draws, -0.2, 0.2), (float)draw(draws, -0.2, 0.2), (float)draw(draws, 0.3, 2.0)};
    in.v_WB_mps = (ivl_vec3_t){(float)draw(draws, -1.0, 2.0), (float)draw(draws, -0.5, 0.5), (float)draw(draws, -1.0, 4.0)};
    in.w_B_radps = (ivl_vec3_t){(float)draw(draws, -3.0, 3.0), (float)draw(draws, -3.0, 3.0), (float)draw(draws, -1.0, 1.0)};
    in.f_B_mps2 = (ivl_vec3_t){0.0f, 0.0f, (draw_u64(draws) % 200u == 0) ? 60.0f : 9.81f};
    in.cmd = (ivl_command_t){.request = IVL_REQUEST_APPROACH, .p_hover_W_m = {0.0f, 0.0f, 1.0f}, .speed_mps = 2.0f, .angle_rad = 1.2f};
    if (draw_u64(draws) % 50u == 0)
    {
        in.cmd.request = (ivl_request_t)(draw_u64(draws) % IVL_REQUEST_COUNT);
    }
    return in;
}

static void test_a_tick_in_halves_is_the_whole_tick(void)
{
    draws_t  draws = {82};
    uint32_t seen[IVL_PHASE_COUNT] = {0};
    for (int n = 0; n < 200; n++)
    {
        ivl_cfg_t    cfg;
        ivl_policy_t policy = {.n = 2, .theta = {(float)draw(&draws, 0.5, 8.0), 0.007f}, .id = {.seq = 1}};
        ivl_state_t  whole, halves;
        ivl_cfg_defaults(&cfg);
        policy.id.crc = ivl_policy_crc(&policy);
        ivl_init(&cfg, &whole);
        ivl_init(&cfg, &halves);
        TEST_ASSERT_EQUAL(IVL_OK, ivl_policy_commit(&cfg, &whole, &policy));
        TEST_ASSERT_EQUAL(IVL_OK, ivl_policy_commit(&cfg, &halves, &policy));
        for (uint64_t tick = 1; tick < 200; tick++)
        {
            const ivl_in_t  in = any_input(&draws, 2000u * tick);
            ivl_out_t       expected, out;
            ivl_reference_t ref;
            ivl_step(&cfg, &whole, &in, &expected);
            if (ivl_step_decide(&cfg, &halves, &in, &out, &ref))
            {
                const ivl_wrench_t wrench = ivl_controller_compute(&cfg, &halves.sense.sample, &ref, halves.derived.tan_tilt_cmd_max);
                ivl_mixer_thrusts(&cfg, &wrench, out.thrust_N);
            }
            TEST_ASSERT_EQUAL_MEMORY(expected.thrust_N, out.thrust_N, sizeof out.thrust_N);
            TEST_ASSERT_EQUAL(expected.phase, out.phase);
            TEST_ASSERT_EQUAL(expected.motors_on, out.motors_on);
            TEST_ASSERT_EQUAL_MEMORY(&whole.approach.p_W_m, &halves.approach.p_W_m, sizeof whole.approach.p_W_m);
            TEST_ASSERT_EQUAL_MEMORY(&whole.diag, &halves.diag, sizeof whole.diag);
            seen[out.phase]++;
        }
    }
    const ivl_phase_t phases[] = {IVL_PHASE_READY, IVL_PHASE_APPROACH, IVL_PHASE_FLIP, IVL_PHASE_ABORTED};
    for (size_t i = 0; i < sizeof phases / sizeof phases[0]; i++)
    {
        TEST_ASSERT_GREATER_THAN_UINT32(20, seen[phases[i]]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_lane_has_the_thrusts_of_the_vehicle_alone);
    RUN_TEST(test_a_tick_in_halves_is_the_whole_tick);
    return UNITY_END();
}
