/// @file test_ivl_sense.c
/// What is accepted as a sensed state and a command, and what happens to what is not.
#include "test_ivl_support.h"

static const float DT_S = 0.002f;
static ivl_cfg_t   cfg;
static ivl_sense_t sense;
static ivl_in_t    in;

void setUp(void);
void setUp(void)
{
    ivl_cfg_defaults(&cfg);
    ivl_sense_reset(&sense);
    in = good_input();
}

static void update(void)
{
    ivl_sense_update(&cfg, &sense, &in, DT_S);
}

static bool pose_refused(void)
{
    update();
    return !sense.pose_fresh;
}

static void advance(void)
{
    in.t_us += 2000u;
    in.t_pose_us += 2000u;
}

static void test_nothing_is_usable_before_the_first_good_input(void)
{
    TEST_ASSERT_FALSE(sense.pose_usable || sense.cmd_usable);
    in.p_WB_m.x = NAN;
    in.cmd.request = IVL_REQUEST_COUNT;
    update();
    TEST_ASSERT_FALSE(sense.pose_usable || sense.cmd_usable);
    TEST_ASSERT_FALSE(sense.pose_fresh || sense.cmd_fresh);
}

static void test_first_input_is_accepted_when_the_clock_starts_at_zero(void)
{
    update();
    TEST_ASSERT_TRUE(sense.pose_fresh && sense.pose_usable);
    TEST_ASSERT_TRUE(sense.cmd_fresh && sense.cmd_usable);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, sense.age_s);
    TEST_ASSERT_EQUAL_FLOAT(1.0f, sense.up_z);
}

static void test_every_spoiled_input_is_refused_and_leaves_what_was_kept_alone(void)
{
    for (uint32_t kind = 0; kind < SPOIL_COUNT; kind++)
    {
        // Given a good input
        setUp();
        in.t_us = 5000000u;
        in.t_pose_us = 5000000u;
        update();
        const ivl_sense_t before = sense;

        // When the next one is spoiled
        advance();
        spoil(&in, kind);
        update();

        // Then that half is kept, and the other half taken
        const bool is_command = spoils_command(kind);
        TEST_ASSERT_EQUAL_INT(is_command, sense.pose_fresh);
        TEST_ASSERT_EQUAL_INT(!is_command, sense.cmd_fresh);
        TEST_ASSERT_TRUE(sense.pose_usable && sense.cmd_usable);
        TEST_ASSERT_EQUAL_INT(before.cmd.request, sense.cmd.request);
        TEST_ASSERT_EQUAL_MEMORY(&before.sample.p_WB_m, &sense.sample.p_WB_m, sizeof before.sample.p_WB_m);
        TEST_ASSERT_EQUAL_UINT64(is_command ? 5002000u : 5000000u, sense.sample.t_us);
        TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, is_command ? 0.002f : 0.0f, sense.cmd_age_s);
    }
}

static void test_values_at_the_limit_are_accepted_and_just_beyond_refused(void)
{
    const float limits[SPOIL_FLOATS] = {IVL_SENSE_P_M_MAX,
                                        IVL_SENSE_P_M_MAX,
                                        IVL_SENSE_P_M_MAX,
                                        IVL_SENSE_V_MPS_MAX,
                                        IVL_SENSE_V_MPS_MAX,
                                        IVL_SENSE_V_MPS_MAX,
                                        0.0f,
                                        0.0f,
                                        0.0f,
                                        0.0f,
                                        IVL_SENSE_W_RADPS_MAX,
                                        IVL_SENSE_W_RADPS_MAX,
                                        IVL_SENSE_W_RADPS_MAX,
                                        IVL_SENSE_F_MPS2_MAX,
                                        IVL_SENSE_F_MPS2_MAX,
                                        IVL_SENSE_F_MPS2_MAX};
    for (uint32_t i = 0; i < SPOIL_FLOATS; i++)
    {
        if (limits[i] > 0.0f)
        {
            setUp();
            *spoil_float(&in, i) = -limits[i];
            TEST_ASSERT_FALSE(pose_refused());
            advance();
            *spoil_float(&in, i) = 1.001f * limits[i];
            TEST_ASSERT_TRUE(pose_refused());
        }
    }
}

static void test_sample_ages_tick_by_tick_and_becomes_unusable_when_inputs_stay_bad(void)
{
    in.t_pose_us = in.t_us = 10000u;
    in.t_pose_us -= 4000u;  // 4 ms old
    update();
    TEST_ASSERT_FLOAT_WITHIN(1.0e-7f, 0.004f, sense.age_s);
    in.q_WB.w = NAN;
    // 48 ticks of 2 ms: 4 ms + 96 ms is the limit of 100 ms; allow for rounding by stopping one short
    for (int i = 0; i < 47; i++)
    {
        advance();
        update();
        TEST_ASSERT_TRUE(sense.pose_usable);
    }
    advance();
    advance();
    update();
    update();
    TEST_ASSERT_FALSE(sense.pose_usable);
    // and it recovers at once
    in.q_WB.w = 1.0f;
    advance();
    update();
    TEST_ASSERT_TRUE(sense.pose_usable && sense.pose_fresh);
}

static void test_pose_is_refused_when_older_than_allowed(void)
{
    in.t_us = 1000000u;
    in.t_pose_us = in.t_us - 100000u;
    TEST_ASSERT_FALSE(pose_refused());
    in.t_us += 2000u;
    TEST_ASSERT_TRUE(pose_refused());
}

static void test_input_is_refused_when_the_clock_stands_still_or_goes_back(void)
{
    in.t_us = in.t_pose_us = 1000000u;
    TEST_ASSERT_FALSE(pose_refused());
    TEST_ASSERT_TRUE(pose_refused());
    in.t_us = in.t_pose_us = 900000u;
    TEST_ASSERT_TRUE(pose_refused());
    // the clock goes on from there
    advance();
    TEST_ASSERT_FALSE(pose_refused());
}

static void test_quaternion_is_normalised_when_its_length_is_slightly_off(void)
{
    in.q_WB = (ivl_quat_t){0.0f, 1.02f, 0.0f, 0.0f};
    update();
    TEST_ASSERT_TRUE(sense.pose_fresh);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, 1.0f, sense.sample.q_WB.y);
    TEST_ASSERT_FLOAT_WITHIN(1.0e-6f, -1.0f, sense.up_z);
    advance();
    in.q_WB.y = 1.03f;
    TEST_ASSERT_TRUE(pose_refused());
}

static void test_abort_and_idle_are_obeyed_when_the_state_is_bad(void)
{
    const ivl_request_t requests[] = {IVL_REQUEST_ABORT, IVL_REQUEST_IDLE};
    for (int i = 0; i < 2; i++)
    {
        setUp();
        in.cmd.request = IVL_REQUEST_HOVER;
        update();
        advance();
        in.p_WB_m.z = NAN;
        in.cmd = (ivl_command_t){.request = requests[i], .p_hover_W_m = {NAN, NAN, NAN}, .speed_mps = NAN, .angle_rad = NAN};
        TEST_ASSERT_TRUE(pose_refused());
        TEST_ASSERT_TRUE(sense.cmd_fresh);
        TEST_ASSERT_EQUAL_INT(requests[i], sense.cmd.request);
    }
}

static bool command_refused(ivl_command_t cmd)
{
    setUp();
    in.cmd = cmd;
    update();
    return !sense.cmd_fresh;
}

static void test_only_the_arguments_that_a_request_uses_are_checked(void)
{
    const ivl_vec3_t bad = {0.0f, NAN, 0.0f};
    const ivl_vec3_t good = {0.0f, 0.0f, 1.0f};
    TEST_ASSERT_FALSE(command_refused((ivl_command_t){IVL_REQUEST_IDLE, bad, NAN, NAN}));
    TEST_ASSERT_FALSE(command_refused((ivl_command_t){IVL_REQUEST_ABORT, bad, NAN, NAN}));
    TEST_ASSERT_FALSE(command_refused((ivl_command_t){IVL_REQUEST_HOVER, good, NAN, NAN}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_HOVER, bad, 1.0f, 1.0f}));
    TEST_ASSERT_FALSE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, bad, 1.0f, 1.0f}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, NAN, 1.0f}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 1.0f, NAN}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 0.05f, 1.0f}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 6.1f, 1.0f}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 1.0f, -0.01f}));
    TEST_ASSERT_TRUE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 1.0f, 3.15f}));
    TEST_ASSERT_FALSE(command_refused((ivl_command_t){IVL_REQUEST_APPROACH, good, 1.0f, (float)3.14159265358979323846}));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_usable_before_the_first_good_input);
    RUN_TEST(test_first_input_is_accepted_when_the_clock_starts_at_zero);
    RUN_TEST(test_every_spoiled_input_is_refused_and_leaves_what_was_kept_alone);
    RUN_TEST(test_values_at_the_limit_are_accepted_and_just_beyond_refused);
    RUN_TEST(test_sample_ages_tick_by_tick_and_becomes_unusable_when_inputs_stay_bad);
    RUN_TEST(test_pose_is_refused_when_older_than_allowed);
    RUN_TEST(test_input_is_refused_when_the_clock_stands_still_or_goes_back);
    RUN_TEST(test_quaternion_is_normalised_when_its_length_is_slightly_off);
    RUN_TEST(test_abort_and_idle_are_obeyed_when_the_state_is_bad);
    RUN_TEST(test_only_the_arguments_that_a_request_uses_are_checked);
    return UNITY_END();
}
