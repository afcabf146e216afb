/// @file test_cf_supervisor.c
/// The supervisor's states: the scenarios that were run on the stock firmware's own state machine, as known answers.
#include "cf_supervisor.h"

#include <string.h>

#include "unity.h"

extern uint8_t tumbleCheckEnabled;

static ivl_cf_supervisor_t    sup;
static ivl_cf_supervisor_in_t in;
static char                   seen[200];  ///< initials of the states passed through

/// One letter a state.
static const char LETTERS[] = "-npARFLrWXKC";
_Static_assert(sizeof LETTERS == IVL_CF_STATE_COUNT + 1, "one letter a state");

static void run(uint32_t ms)
{
    for (uint32_t t = 0; t < ms; t += 40)
    {
        in.now_ms += 40;
        if (ivl_cf_supervisor_update(&sup, &in) && strlen(seen) < sizeof seen - 1)
        {
            const size_t n = strlen(seen);
            seen[n] = LETTERS[sup.state];
            seen[n + 1] = '\0';
        }
    }
}

void setUp(void)
{
    ivl_cf_supervisor_init(&sup);
    memset(&in, 0, sizeof in);
    memset(seen, 0, sizeof seen);
    in.now_ms = 1000;
    in.acc_g[2] = 1.0f;
}

void tearDown(void)
{
}

static void fly(void)
{
    run(400);
    in.motors_run = true;
    run(400);
    TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_FLYING, sup.state);
    memset(seen, 0, sizeof seen);
}

static void hang(void)
{
    in.acc_g[2] = -1.0f;
}

static void test_boot_arms_by_itself_or_waits_to_be_armed(void)
{
    run(400);
    TEST_ASSERT_EQUAL_STRING("npAR", seen);
    TEST_ASSERT_TRUE(sup.armed && ivl_cf_supervisor_motors_allowed(&sup));
    setUp();
    sup.auto_arm = 0;
    run(400);
    TEST_ASSERT_EQUAL_STRING("np", seen);
    TEST_ASSERT_EQUAL_HEX16(0x0001, ivl_cf_supervisor_bits(&sup));
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, true));
    run(80);
    TEST_ASSERT_EQUAL_STRING("npAR", seen);
    TEST_ASSERT_EQUAL_HEX16(0x000A, ivl_cf_supervisor_bits(&sup));
}

static void test_arming_is_refused_while_tumbled_crashed_or_locked(void)
{
    sup.auto_arm = 0;
    hang();
    run(400);
    TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_CHECKS_FAILED, sup.state);
    TEST_ASSERT_FALSE(ivl_cf_supervisor_arm(&sup, true));
    in.acc_g[2] = 1.0f;
    sup.stop = 1;
    run(400);
    TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_LOCKED, sup.state);
    TEST_ASSERT_FALSE(ivl_cf_supervisor_arm(&sup, true));
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, false));
}

static void test_flying_and_an_emergency_stop_of_any_kind_locks(void)
{
    for (int kind = 0; kind < 4; kind++)
    {
        setUp();
        fly();
        sup.estop = kind == 0;
        sup.stop = kind == 1;
        in.setpoint_age_ms = (kind == 2) ? 2001 : 0;
        if (kind == 3)
        {
            ivl_cf_supervisor_watchdog(&sup, in.now_ms);
            run(960);
            TEST_ASSERT_EQUAL_STRING("", seen);
        }
        run(200);
        TEST_ASSERT_EQUAL_STRING("XK", seen);
        TEST_ASSERT_FALSE(ivl_cf_supervisor_motors_allowed(&sup) || sup.armed);
        // for good
        memset(&in.acc_g, 0, sizeof in.acc_g);
        in.acc_g[2] = 1.0f;
        sup.estop = false;
        sup.stop = 0;
        in.setpoint_age_ms = 0;
        (void)ivl_cf_supervisor_recover(&sup);
        run(10000);
        TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_LOCKED, sup.state);
        TEST_ASSERT_EQUAL_HEX16(0x0040, ivl_cf_supervisor_bits(&sup) & 0x00ff & ~0x0004);
    }
}

static void test_a_watchdog_that_is_fed_stops_nothing(void)
{
    fly();
    for (int i = 0; i < 20; i++)
    {
        ivl_cf_supervisor_watchdog(&sup, in.now_ms);
        run(800);
    }
    TEST_ASSERT_EQUAL_STRING("", seen);
}

static void test_flying_and_tumbled_is_crashed_until_recovered_upright(void)
{
    fly();
    hang();
    run(2000);
    TEST_ASSERT_EQUAL_STRING("C", seen);
    TEST_ASSERT_TRUE(sup.crashed && !sup.armed);
    TEST_ASSERT_FALSE(ivl_cf_supervisor_recover(&sup));
    in.acc_g[2] = 1.0f;
    in.motors_run = false;
    run(2200);
    TEST_ASSERT_EQUAL_STRING("C", seen);
    TEST_ASSERT_TRUE(ivl_cf_supervisor_recover(&sup));
    run(400);
    TEST_ASSERT_EQUAL_STRING("CnpAR", seen);
}

static void test_hanging_upside_down_is_noticed_within_140_ms_and_a_tilt_within_a_second(void)
{
    const float limits[2][3] = {{-1.0f, 100.0f, 160.0f}, {0.3f, 1000.0f, 1080.0f}};
    for (int i = 0; i < 2; i++)
    {
        setUp();
        fly();
        in.acc_g[2] = limits[i][0];
        const uint32_t from_ms = in.now_ms;
        while (sup.state == IVL_CF_STATE_FLYING)
        {
            run(40);
        }
        // the clock starts at the first of these samples
        TEST_ASSERT_TRUE((float)(in.now_ms - from_ms - 40) > limits[i][1] && (float)(in.now_ms - from_ms) <= limits[i][2] + 40.0f);
    }
}

static void test_free_fall_and_a_switched_off_check_are_no_tumble(void)
{
    fly();
    in.acc_g[2] = 0.05f;
    run(3000);
    TEST_ASSERT_EQUAL_STRING("", seen);
    // out of the fall into a hang: the clock starts now
    hang();
    run(80);
    TEST_ASSERT_EQUAL_STRING("", seen);
    tumbleCheckEnabled = 0;
    run(5000);
    TEST_ASSERT_EQUAL_STRING("", seen);
    tumbleCheckEnabled = 1;
    run(40);
    TEST_ASSERT_EQUAL_STRING("C", seen);
}

static void test_a_disarm_in_flight_of_a_vehicle_that_arms_itself_flies_again(void)
{
    fly();
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, false));
    run(400);
    TEST_ASSERT_EQUAL_STRING("rnpARF", seen);
}

static void test_a_disarm_in_flight_of_a_vehicle_that_then_tumbles_is_neither_crashed_nor_locked(void)
{
    fly();
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, false));
    hang();
    sup.has_tumble = true;
    sup.t_tumble_ms = in.now_ms - 200;
    // the tumble comes between the ticks of disarm and check
    in.acc_g[2] = 1.0f;
    run(40);
    hang();
    sup.has_tumble = true;
    sup.t_tumble_ms = in.now_ms - 200;
    in.motors_run = false;
    run(4000);
    TEST_ASSERT_EQUAL_STRING("rn", seen);
    TEST_ASSERT_FALSE(sup.crashed);
}

static void test_an_old_set_point_levels_out_and_a_tumble_then_locks(void)
{
    fly();
    in.setpoint_age_ms = 501;
    run(200);
    TEST_ASSERT_EQUAL_STRING("W", seen);
    TEST_ASSERT_TRUE(ivl_cf_supervisor_motors_allowed(&sup));
    in.setpoint_age_ms = 10;
    run(200);
    TEST_ASSERT_EQUAL_STRING("WF", seen);
    in.setpoint_age_ms = 501;
    hang();
    run(400);
    TEST_ASSERT_EQUAL_STRING("WFWXK", seen);
}

static void test_motors_at_rest_for_two_seconds_have_landed_and_three_more_reset(void)
{
    fly();
    in.motors_run = false;
    run(1920);
    TEST_ASSERT_EQUAL_STRING("", seen);
    run(120);
    TEST_ASSERT_EQUAL_STRING("L", seen);
    run(2960);
    TEST_ASSERT_EQUAL_STRING("L", seen);
    run(400);
    TEST_ASSERT_EQUAL_STRING("LrnpAR", seen);
}

static void test_landed_and_tumbled_stays_landed_until_its_time_is_over_and_an_emergency_stop_is_no_trigger_there(void)
{
    fly();
    in.motors_run = false;
    run(2200);
    hang();
    sup.estop = true;
    run(2000);
    TEST_ASSERT_EQUAL_STRING("L", seen);
    run(1200);
    TEST_ASSERT_EQUAL_STRING("LrnXK", seen);
}

static void test_landed_and_motors_that_run_again_fly(void)
{
    fly();
    in.motors_run = false;
    run(2200);
    in.motors_run = true;
    run(200);
    TEST_ASSERT_EQUAL_STRING("LF", seen);
}

static void test_an_armed_vehicle_that_does_not_take_off_is_disarmed(void)
{
    sup.auto_arm = 0;
    run(200);
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, true));
    run(29900);
    TEST_ASSERT_TRUE(sup.armed);
    run(400);
    TEST_ASSERT_EQUAL_STRING("npARnp", seen);
    TEST_ASSERT_FALSE(sup.armed);
}

static void test_a_crashed_vehicle_that_is_stopped_locks(void)
{
    fly();
    hang();
    run(400);
    sup.stop = 1;
    run(80);
    TEST_ASSERT_EQUAL_STRING("CK", seen);
}

static void test_recovery_asked_for_in_flight_is_granted_and_changes_nothing(void)
{
    fly();
    TEST_ASSERT_TRUE(ivl_cf_supervisor_recover(&sup));
    run(400);
    TEST_ASSERT_EQUAL_STRING("", seen);
}

// ---- the machine of the stock firmware of August 2026, row by row: state, conditions, next state

/// One letter a condition, from the lowest bit on: armed, flying, tumbled, warned of an old set-point, dead set-point, emergency stop, crashed,
/// pre-flight time over, landed time over.
static const char CONDITIONS[] = "aftwdecpl";
_Static_assert(sizeof CONDITIONS == IVL_CF_COND_COUNT + 1, "one letter a condition");

static const char *const ROWS[] = {
    "- >n",    "n >p",   "nt>n",     "ne>X",    "nte>X",    "na>p",   "p >p",  "pa>A",  "pt>n",    "pat>n",   "pe>X",    "pate>X", "pf>p",
    "A >n",    "Aa>R",   "Aat>n",    "Aae>X",   "Aafwd>R",  "R >n",   "Ra>R",  "Raf>F", "Rat>n",   "Raft>n",  "Rap>n",   "Rafp>n", "Rf>n",
    "Rae>X",   "Rate>X", "Raw>R",    "Raf>F",   "F >r",     "Fa>L",   "Faf>F", "Ff>r",  "Faft>C",  "Fft>C",   "Fafw>W",  "Faw>W",  "Fw>r",
    "Fafwd>X", "Fd>X",   "Fafe>X",   "Fafte>X", "Faftwd>X", "L >r",   "La>L",  "Lf>r",  "Laf>F",   "Lal>r",   "Lafl>r",  "Lae>L",  "Lat>L",
    "Lawd>L",  "r >n",   "rafte>n",  "W >F",    "Waf>F",    "Wafw>W", "Ww>W",  "Wfw>W", "Wafwd>X", "Wafwt>X", "Wafwe>X", "Wafd>X", "X >K",
    "Xaf>K",   "K >K",   "Kaftec>K", "C >n",    "Cc>C",     "Ct>C",   "Cct>C", "Cce>K", "Ce>n",    "Cte>K",   "Cctwd>C",
};

static int number_of(const char *letters, char letter)
{
    const char *at = strchr(letters, letter);
    TEST_ASSERT_NOT_NULL(at);
    return (int)(at - letters);
}

static void test_every_transition_is_that_of_the_stock_firmware(void)
{
    for (size_t i = 0; i < sizeof ROWS / sizeof ROWS[0]; i++)
    {
        const char *row = ROWS[i];
        uint32_t    conditions = 0;
        const char *at = row + 1;
        for (; *at != '>'; at++)
        {
            conditions |= (*at == ' ') ? 0u : 1u << number_of(CONDITIONS, *at);
        }
        const ivl_cf_state_t from = (ivl_cf_state_t)number_of(LETTERS, row[0]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(number_of(LETTERS, at[1]), ivl_cf_supervisor_next(from, conditions), row);
    }
}

static void test_a_landed_vehicle_that_is_disarmed_cannot_fly_at_once(void)
{
    sup.auto_arm = 0;
    run(200);
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, true));
    run(80);
    in.motors_run = true;
    run(80);
    in.motors_run = false;
    run(2200);
    TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_LANDED, sup.state);
    TEST_ASSERT_TRUE(ivl_cf_supervisor_can_fly(&sup));
    TEST_ASSERT_TRUE(ivl_cf_supervisor_arm(&sup, false));
    run(40);
    TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_RESET, sup.state);
    TEST_ASSERT_FALSE(ivl_cf_supervisor_can_fly(&sup) || ivl_cf_supervisor_motors_allowed(&sup));
}

static void test_a_blow_is_a_crash_if_that_check_is_on(void)
{
    fly();
    in.acc_g[0] = 3.0f;
    run(200);
    TEST_ASSERT_EQUAL_STRING("", seen);
    sup.crash_g = 2.0f;
    run(40);
    TEST_ASSERT_EQUAL_STRING("C", seen);
}

static void test_from_every_state_and_all_conditions_the_next_one_exists_and_motors_stop_with_the_armed_bit(void)
{
    for (int state = 0; state < IVL_CF_STATE_COUNT; state++)
    {
        for (uint32_t conditions = 0; conditions < 1u << IVL_CF_COND_COUNT; conditions++)
        {
            const ivl_cf_state_t next = ivl_cf_supervisor_next((ivl_cf_state_t)state, conditions);
            TEST_ASSERT_TRUE((int)next >= 0 && (int)next < IVL_CF_STATE_COUNT);
            TEST_ASSERT_TRUE(state != IVL_CF_STATE_LOCKED || next == IVL_CF_STATE_LOCKED);
            // only from the state before it, and armed, does a vehicle become ready
            if (next == IVL_CF_STATE_READY && state != IVL_CF_STATE_READY)
            {
                TEST_ASSERT_EQUAL_INT(IVL_CF_STATE_ARMING, state);
                TEST_ASSERT_TRUE((conditions & IVL_CF_COND_ARMED) != 0u && (conditions & IVL_CF_COND_TUMBLED) == 0u);
            }
        }
    }
    TEST_ASSERT_EQUAL_STRING("?", ivl_cf_supervisor_name(IVL_CF_STATE_COUNT));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_boot_arms_by_itself_or_waits_to_be_armed);
    RUN_TEST(test_arming_is_refused_while_tumbled_crashed_or_locked);
    RUN_TEST(test_flying_and_an_emergency_stop_of_any_kind_locks);
    RUN_TEST(test_a_watchdog_that_is_fed_stops_nothing);
    RUN_TEST(test_flying_and_tumbled_is_crashed_until_recovered_upright);
    RUN_TEST(test_hanging_upside_down_is_noticed_within_140_ms_and_a_tilt_within_a_second);
    RUN_TEST(test_free_fall_and_a_switched_off_check_are_no_tumble);
    RUN_TEST(test_a_disarm_in_flight_of_a_vehicle_that_arms_itself_flies_again);
    RUN_TEST(test_a_disarm_in_flight_of_a_vehicle_that_then_tumbles_is_neither_crashed_nor_locked);
    RUN_TEST(test_an_old_set_point_levels_out_and_a_tumble_then_locks);
    RUN_TEST(test_motors_at_rest_for_two_seconds_have_landed_and_three_more_reset);
    RUN_TEST(test_landed_and_tumbled_stays_landed_until_its_time_is_over_and_an_emergency_stop_is_no_trigger_there);
    RUN_TEST(test_landed_and_motors_that_run_again_fly);
    RUN_TEST(test_an_armed_vehicle_that_does_not_take_off_is_disarmed);
    RUN_TEST(test_a_crashed_vehicle_that_is_stopped_locks);
    RUN_TEST(test_recovery_asked_for_in_flight_is_granted_and_changes_nothing);
    RUN_TEST(test_every_transition_is_that_of_the_stock_firmware);
    RUN_TEST(test_a_landed_vehicle_that_is_disarmed_cannot_fly_at_once);
    RUN_TEST(test_a_blow_is_a_crash_if_that_check_is_on);
    RUN_TEST(test_from_every_state_and_all_conditions_the_next_one_exists_and_motors_stop_with_the_armed_bit);
    return UNITY_END();
}
