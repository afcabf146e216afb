/// @file test_ivl_contact.c
#include "test_ivl_support.h"

static const float   DT_S = 0.002f;
static ivl_cfg_t     cfg;
static ivl_contact_t contact;
static ivl_sense_t   sense;

void setUp(void);
void setUp(void)
{
    ivl_cfg_defaults(&cfg);
    memset(&contact, 0, sizeof contact);
    ivl_sense_reset(&sense);
    sense.pose_fresh = true;
}

static void feel(float x, float y, float z)
{
    sense.sample.f_B_mps2 = ivl_vec3(x, y, z);
    see(&cfg, &sense);
    ivl_contact_update(&cfg, &contact, &sense, DT_S);
}

static void test_contact_is_sensed_from_the_threshold_on_in_any_direction(void)
{
    feel(24.9f, 0.0f, 0.0f);
    TEST_ASSERT_FALSE(contact.contact);
    feel(0.0f, -25.1f, 0.0f);
    TEST_ASSERT_TRUE(contact.contact);
    feel(15.0f, 15.0f, -15.0f);  // 25.98
    TEST_ASSERT_TRUE(contact.contact);
    feel(0.0f, 0.0f, 0.0f);
    TEST_ASSERT_FALSE(contact.contact);
}

static void test_limits_belong_to_contact_and_to_hanging(void)
{
    cfg.gravity_mps2 = 10.0f;
    feel(cfg.contact_accel_mps2, 0.0f, 0.0f);
    TEST_ASSERT_TRUE(contact.contact);
    feel(0.0f, 0.0f, -5.0f);
    TEST_ASSERT_TRUE(contact.hang_s > 0.0f);
    feel(0.0f, 0.0f, nextafterf(-5.0f, 0.0f));
    TEST_ASSERT_FALSE(contact.hang_s > 0.0f);
}

static void test_full_thrust_of_a_flip_is_no_contact(void)
{
    feel(0.0f, 0.0f, 2.0f * cfg.motor_thrust_N_max / cfg.mass_kg);
    TEST_ASSERT_FALSE(contact.contact);
}

static void test_contact_is_not_sensed_when_the_sample_is_not_fresh(void)
{
    sense.pose_fresh = false;
    feel(100.0f, 0.0f, 0.0f);
    TEST_ASSERT_FALSE(contact.contact);
}

static void test_hanging_needs_reversed_gravity_for_the_stated_duration(void)
{
    // 0.2 s are 100 ticks; one more absorbs the rounding of the sum
    for (int i = 0; i < 98; i++)
    {
        feel(0.0f, 0.0f, -9.81f);
        TEST_ASSERT_FALSE(contact.hanging);
    }
    for (int i = 0; i < 3; i++)
    {
        feel(0.0f, 0.0f, -9.81f);
    }
    TEST_ASSERT_TRUE(contact.hanging);
    TEST_ASSERT_FALSE(contact.contact);
}

static void test_hang_clock_restarts_when_interrupted_or_blind(void)
{
    for (int i = 0; i < 1000; i++)
    {
        // every 50th tick is weightless, every 75th without a sample
        sense.pose_fresh = i % 75 != 0;
        feel(0.0f, 0.0f, (i % 50 == 0) ? 0.0f : -9.81f);
        TEST_ASSERT_FALSE(contact.hanging);
    }
}

static void test_standing_or_falling_is_not_hanging(void)
{
    for (int i = 0; i < 1000; i++)
    {
        feel(0.0f, 0.0f, 9.81f);
        TEST_ASSERT_FALSE(contact.hanging);
        feel(0.0f, 0.0f, -0.49f * 9.81f);
        TEST_ASSERT_FALSE(contact.hanging);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_contact_is_sensed_from_the_threshold_on_in_any_direction);
    RUN_TEST(test_limits_belong_to_contact_and_to_hanging);
    RUN_TEST(test_full_thrust_of_a_flip_is_no_contact);
    RUN_TEST(test_contact_is_not_sensed_when_the_sample_is_not_fresh);
    RUN_TEST(test_hanging_needs_reversed_gravity_for_the_stated_duration);
    RUN_TEST(test_hang_clock_restarts_when_interrupted_or_blind);
    RUN_TEST(test_standing_or_falling_is_not_hanging);
    return UNITY_END();
}
