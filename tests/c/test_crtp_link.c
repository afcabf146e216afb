/// @file test_crtp_link.c
/// What stands between socket and server: faults, who the client is, and how vehicle time follows wall-clock time.
#include <string.h>

#include "crtp/crtp_faults.h"
#include "crtp/crtp_session.h"
#include "crtp/crtp_time.h"
#include "unity.h"

static ivl_crtp_faults_t  faults;
static ivl_crtp_session_t session;

#define LATE_US 3600000000u

void setUp(void)
{
    ivl_crtp_faults_init(&faults);
    memset(&session, 0, sizeof session);
}

void tearDown(void)
{
    ivl_crtp_faults_free(&faults);
}

// ---- faults

static ivl_crtp_datagram_t datagram(unsigned number)
{
    return (ivl_crtp_datagram_t){
        .direction = IVL_CRTP_TO_VEHICLE, .peer = 5, .size = 2, .bytes = {(uint8_t)number, (uint8_t)(number >> 8)}};
}

enum
{
    N = 4000
};

typedef struct
{
    unsigned n;
    uint16_t number[2 * N];
    uint64_t us[2 * N];
} arrivals_t;
static arrivals_t first, second;

// a packet a millisecond; arrivals are looked for every 100 us
static void run(arrivals_t *arrivals)
{
    memset(arrivals, 0, sizeof *arrivals);
    for (unsigned tick = 0; tick < 10u * (N + 300u); tick++)
    {
        const uint64_t      now_us = 100u * (uint64_t)tick;
        ivl_crtp_datagram_t d = datagram(tick / 10u);
        if ((tick % 10u == 0u) && (tick / 10u < N))
        {
            ivl_crtp_faults_put(&faults, now_us, &d);
        }
        while (ivl_crtp_faults_take(&faults, now_us, &d))
        {
            TEST_ASSERT_TRUE(arrivals->n < 2u * N);
            TEST_ASSERT_EQUAL_UINT64(5, d.peer);
            arrivals->number[arrivals->n] = (uint16_t)(d.bytes[0] | (d.bytes[1] << 8));
            arrivals->us[arrivals->n++] = now_us;
        }
    }
    TEST_ASSERT_EQUAL_UINT64(0, faults.n);
}

static unsigned n_overtaken(const arrivals_t *a)
{
    unsigned n = 0;
    for (unsigned i = 1; i < a->n; i++)
    {
        n += (a->number[i] < a->number[i - 1u]) ? 1u : 0u;
    }
    return n;
}

static void test_without_faults_the_layer_is_idle(void)
{
    TEST_ASSERT_TRUE(ivl_crtp_faults_idle(&faults, 0));
    faults.cfg.delay_ms = 1.0f;
    TEST_ASSERT_FALSE(ivl_crtp_faults_idle(&faults, 0));
    faults.cfg.delay_ms = 0.0f;
    faults.cut_until_us = 10;
    TEST_ASSERT_FALSE(ivl_crtp_faults_idle(&faults, 9));
    TEST_ASSERT_TRUE(ivl_crtp_faults_idle(&faults, 10));
}

static void test_loss_takes_its_share(void)
{
    faults.cfg.loss = 0.2f;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(N, first.n + faults.n_lost);
    // 800 +- 4 sigma
    TEST_ASSERT_UINT_WITHIN(102, 800, faults.n_lost);
    TEST_ASSERT_EQUAL_UINT(0, n_overtaken(&first));
}

static void test_all_or_nothing(void)
{
    faults.cfg.loss = 1.0f;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(0, first.n);
}

static void test_delay_and_jitter_keep_the_order(void)
{
    faults.cfg.delay_ms = 20.0f;
    faults.cfg.jitter_ms = 50.0f;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(N, first.n);
    TEST_ASSERT_EQUAL_UINT(0, n_overtaken(&first));
    uint64_t least = UINT64_MAX, most = 0;
    for (unsigned i = 0; i < first.n; i++)
    {
        const uint64_t delay_us = first.us[i] - 1000u * (uint64_t)first.number[i];
        least = (delay_us < least) ? delay_us : least;
        most = (delay_us > most) ? delay_us : most;
    }
    TEST_ASSERT_TRUE((least >= 20000u) && (most > 65000u) && (most <= 70100u));
}

static void test_reordering_holds_packets_back(void)
{
    faults.cfg.reorder = 0.1f;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(N, first.n);
    TEST_ASSERT_UINT_WITHIN(80, 400, faults.n_reordered);
    TEST_ASSERT_TRUE(n_overtaken(&first) > 200u);
}

static void test_duplicates_are_the_same_packet(void)
{
    faults.cfg.duplicate = 0.1f;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(N + faults.n_duplicated, first.n);
    TEST_ASSERT_UINT_WITHIN(80, 400, faults.n_duplicated);
}

static void test_what_finds_no_room_under_way_is_lost(void)
{
    enum
    {
        TOO_MANY = 10
    };
    faults.cfg.delay_ms = 1.0f;
    for (unsigned i = 0; i < IVL_CRTP_UNDER_WAY_MAX + TOO_MANY; i++)
    {
        const ivl_crtp_datagram_t d = datagram(i);
        ivl_crtp_faults_put(&faults, 0, &d);
    }
    TEST_ASSERT_EQUAL_UINT(TOO_MANY, faults.n_lost);
    ivl_crtp_datagram_t d;
    for (unsigned i = 0; i < IVL_CRTP_UNDER_WAY_MAX; i++)
    {
        TEST_ASSERT_TRUE(ivl_crtp_faults_take(&faults, 1000, &d));
        TEST_ASSERT_EQUAL_UINT((uint16_t)i, d.bytes[0] | (d.bytes[1] << 8));
    }
    TEST_ASSERT_FALSE(ivl_crtp_faults_take(&faults, 1000, &d));
}

static void test_the_same_seed_gives_the_same_faults_another_gives_others(void)
{
    faults.cfg = (ivl_crtp_fault_cfg_t){.loss = 0.1f, .jitter_ms = 20.0f, .reorder = 0.1f, .duplicate = 0.1f, .seed = 3};
    run(&first);
    const ivl_crtp_fault_cfg_t cfg = faults.cfg;
    ivl_crtp_faults_free(&faults);
    faults.cfg = cfg;
    run(&second);
    TEST_ASSERT_EQUAL_MEMORY(&first, &second, sizeof first);
    ivl_crtp_faults_free(&faults);
    faults.cfg = cfg;
    faults.cfg.seed = 4;
    run(&second);
    TEST_ASSERT_TRUE(memcmp(&first, &second, sizeof first) != 0);
}

static void test_a_cut_loses_all_until_it_ends(void)
{
    faults.cut_until_us = 1000000u;
    run(&first);
    TEST_ASSERT_EQUAL_UINT(N - 1000, first.n);
    TEST_ASSERT_EQUAL_UINT16(1000, first.number[0]);
}

// ---- who the client is

static ivl_crtp_who_t hear(uint64_t peer, uint8_t header, uint64_t now_us)
{
    const ivl_crtp_datagram_t d = {.peer = peer, .size = 1, .bytes = {header}};
    return ivl_crtp_session_hear(&session, now_us, &d);
}

static void test_the_first_has_the_vehicle_until_he_is_silent(void)
{
    ivl_crtp_datagram_t d;
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_NEW, hear(1, 0xfd, 0));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_CLIENT, hear(1, 0x2c, 900000));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0x3c, 1000000));
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 1900000, false));
    TEST_ASSERT_TRUE(ivl_crtp_session_expire(&session, 1900001, false));
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 9900001, false));
    // what was no request to connect is not done later
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_NEW, hear(2, 0x3c, 2000000));
}

static void test_who_is_there_keeps_it_in_silence_until_another_comes(void)
{
    ivl_crtp_datagram_t d;
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_NEW, hear(1, 0xfd, 0));
    TEST_ASSERT_FALSE(ivl_crtp_session_is_silent(&session, 1000000));
    TEST_ASSERT_TRUE(ivl_crtp_session_is_silent(&session, 1000001));
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 9000000, true));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_CLIENT, hear(1, 0x2c, 9000000));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0x2c, 10000000));
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 10000001, true));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0x2c, 10000001));
    TEST_ASSERT_TRUE(ivl_crtp_session_expire(&session, 10000002, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_EQUAL_UINT64(2, d.peer);
}

// a vehicle that was stopped for long hears all that has come before it judges
static void test_nobody_takes_it_from_one_who_spoke_while_nobody_listened(void)
{
    ivl_crtp_datagram_t d;
    (void)hear(1, 0xfd, 0);
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0x3c, 5000000));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_CLIENT, hear(1, 0x2c, 5000000));
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 5000000, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, LATE_US, &d));
}

static void test_who_is_silent_gives_way_to_one_who_has_asked(void)
{
    ivl_crtp_datagram_t d;
    (void)hear(1, 0xfd, 0);
    (void)hear(2, 0xfd, 500000);
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 1000000, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_expire(&session, 1000001, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_EQUAL_UINT64(2, d.peer);
}

static ivl_crtp_datagram_t power_packet(uint64_t peer)
{
    return (ivl_crtp_datagram_t){.peer = peer, .size = 3, .bytes = {0xff, 0xfe, 0x02}};
}

static void test_the_power_is_the_clients_or_nobodys(void)
{
    const ivl_crtp_datagram_t own = power_packet(1), other = power_packet(2);
    ivl_crtp_datagram_t       d;
    TEST_ASSERT_TRUE(ivl_crtp_session_may(&session, 0, &other));
    TEST_ASSERT_FALSE(session.live);
    (void)hear(1, 0xfd, 0);
    TEST_ASSERT_TRUE(ivl_crtp_session_may(&session, 10, &own));
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 10, &other));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, 10, &d));
    // who speaks has not gone
    (void)hear(1, 0x2c, 20);
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, 20, &d));
}

static void test_a_refused_switch_waits_for_a_moment_only(void)
{
    const ivl_crtp_datagram_t other = power_packet(2), third = power_packet(3);
    ivl_crtp_datagram_t       d;
    (void)hear(1, 0xfd, 0);
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 10, &other));
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 11, &third));
    TEST_ASSERT_TRUE(ivl_crtp_session_is_pressed(&session, 10 + IVL_CRTP_SWITCH_US));
    TEST_ASSERT_FALSE(ivl_crtp_session_is_pressed(&session, 11 + IVL_CRTP_SWITCH_US));
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, 10 + IVL_CRTP_SWITCH_US, &d));
    TEST_ASSERT_EQUAL_UINT64(2, d.peer);

    (void)hear(1, 0xfd, 100000);
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 100000, &other));
    // it is no reason to take the vehicle from one who is silent later
    TEST_ASSERT_FALSE(ivl_crtp_session_expire(&session, 1200000, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, 100001 + IVL_CRTP_SWITCH_US, &d));
}

static void test_one_who_is_silent_keeps_nobody_from_the_switch(void)
{
    const ivl_crtp_datagram_t other = power_packet(2);
    ivl_crtp_datagram_t       d;
    (void)hear(1, 0xfd, 0);
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 1000001, &other));
    TEST_ASSERT_TRUE(ivl_crtp_session_expire(&session, 1000001, true));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, LATE_US, &d));
    // but who wants to connect goes first
    (void)hear(1, 0xfd, 2000000);
    (void)hear(3, 0xfd, 2000001);
    TEST_ASSERT_FALSE(ivl_crtp_session_is_pressed(&session, 2000002));
    TEST_ASSERT_FALSE(ivl_crtp_session_may(&session, 3000001, &other));
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_EQUAL_UINT64(3, d.peer);
}

static void test_who_asks_to_connect_is_next(void)
{
    ivl_crtp_datagram_t d;
    (void)hear(1, 0xfd, 0);
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0xfd, 1));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(3, 0xf1, 2));
    TEST_ASSERT_EQUAL_INT(IVL_CRTP_FOREIGN, hear(2, 0x2c, 3));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_FALSE(ivl_crtp_session_gone(&session, 9));
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_TRUE(ivl_crtp_session_next(&session, LATE_US, &d));
    TEST_ASSERT_EQUAL_UINT64(3, d.peer);
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, LATE_US, &d));
}

static void test_who_has_gone_meanwhile_is_not_next(void)
{
    ivl_crtp_datagram_t d;
    (void)hear(1, 0xfd, 0);
    (void)hear(2, 0xfd, 1);
    TEST_ASSERT_FALSE(ivl_crtp_session_gone(&session, 2));
    TEST_ASSERT_TRUE(session.live);
    TEST_ASSERT_TRUE(ivl_crtp_session_gone(&session, 1));
    TEST_ASSERT_FALSE(ivl_crtp_session_next(&session, LATE_US, &d));
}

// ---- time

static void test_paced_time_does_not_drift(void)
{
    ivl_crtp_time_t time = {.speed_factor = 3.0f};
    uint64_t        vehicle_us = 5000;
    uint64_t        wall_us = 1000000;
    // a day in steps of a prime number of microseconds
    TEST_ASSERT_EQUAL_UINT64(5000, ivl_crtp_time_target_us(&time, wall_us, vehicle_us));
    while (wall_us < 86401000000u)
    {
        wall_us += 7919u;
        const uint64_t target_us = ivl_crtp_time_target_us(&time, wall_us, vehicle_us);
        vehicle_us += (target_us - vehicle_us) / 1000u * 1000u;
        TEST_ASSERT_TRUE(target_us - vehicle_us < 1000u);
    }
    TEST_ASSERT_EQUAL_UINT32(0, time.n_slipped);
    TEST_ASSERT_UINT64_WITHIN(1000, 5000 + 3 * (wall_us - 1000000), vehicle_us);
}

static void test_a_process_that_slept_does_not_race_to_catch_up(void)
{
    ivl_crtp_time_t time = {.speed_factor = 1.0f};
    TEST_ASSERT_EQUAL_UINT64(0, ivl_crtp_time_target_us(&time, 1000, 0));
    TEST_ASSERT_EQUAL_UINT64(250000, ivl_crtp_time_target_us(&time, 251000, 0));
    TEST_ASSERT_EQUAL_UINT64(0, ivl_crtp_time_target_us(&time, 10000000, 0));
    TEST_ASSERT_EQUAL_UINT32(1, time.n_slipped);
    TEST_ASSERT_EQUAL_UINT64(1000, ivl_crtp_time_target_us(&time, 10001000, 0));
}

static void test_wake_is_when_the_next_millisecond_is_due(void)
{
    ivl_crtp_time_t time = {.speed_factor = 0.5f};
    (void)ivl_crtp_time_target_us(&time, 1000, 0);
    const uint64_t wake_us = ivl_crtp_time_wake_us(&time, 0);
    TEST_ASSERT_EQUAL_UINT64(3001, wake_us);
    TEST_ASSERT_TRUE(ivl_crtp_time_target_us(&time, wake_us, 0) >= 1000u);
    time.speed_factor = 0.0f;
    TEST_ASSERT_EQUAL_UINT64(0, ivl_crtp_time_wake_us(&time, 0));
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, ivl_crtp_time_target_us(&time, wake_us, 0));
    time.lockstep = 1;
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, ivl_crtp_time_wake_us(&time, 0));
    TEST_ASSERT_EQUAL_UINT64(7, ivl_crtp_time_target_us(&time, wake_us, 7));
}

static void test_lockstep_runs_to_what_is_asked_and_only_once(void)
{
    ivl_crtp_time_t time = {.lockstep = 1};
    time.run_to_ms = 5;
    TEST_ASSERT_TRUE(ivl_crtp_time_ask(&time, 1000));
    TEST_ASSERT_EQUAL_UINT64(5000, ivl_crtp_time_target_us(&time, 0, 1000));
    ivl_crtp_time_stop(&time, 3000);
    TEST_ASSERT_EQUAL_UINT32(3, time.run_to_ms);
    time.run_to_ms = 5;
    TEST_ASSERT_FALSE(ivl_crtp_time_ask(&time, 3000));
    time.run_to_ms = 6;
    TEST_ASSERT_TRUE(ivl_crtp_time_ask(&time, 3000));
    time.run_to_ms = 2;
    TEST_ASSERT_FALSE(ivl_crtp_time_ask(&time, 3000));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_without_faults_the_layer_is_idle);
    RUN_TEST(test_loss_takes_its_share);
    RUN_TEST(test_all_or_nothing);
    RUN_TEST(test_delay_and_jitter_keep_the_order);
    RUN_TEST(test_reordering_holds_packets_back);
    RUN_TEST(test_duplicates_are_the_same_packet);
    RUN_TEST(test_what_finds_no_room_under_way_is_lost);
    RUN_TEST(test_the_same_seed_gives_the_same_faults_another_gives_others);
    RUN_TEST(test_a_cut_loses_all_until_it_ends);
    RUN_TEST(test_the_first_has_the_vehicle_until_he_is_silent);
    RUN_TEST(test_who_is_there_keeps_it_in_silence_until_another_comes);
    RUN_TEST(test_who_is_silent_gives_way_to_one_who_has_asked);
    RUN_TEST(test_nobody_takes_it_from_one_who_spoke_while_nobody_listened);
    RUN_TEST(test_the_power_is_the_clients_or_nobodys);
    RUN_TEST(test_a_refused_switch_waits_for_a_moment_only);
    RUN_TEST(test_one_who_is_silent_keeps_nobody_from_the_switch);
    RUN_TEST(test_who_asks_to_connect_is_next);
    RUN_TEST(test_who_has_gone_meanwhile_is_not_next);
    RUN_TEST(test_paced_time_does_not_drift);
    RUN_TEST(test_a_process_that_slept_does_not_race_to_catch_up);
    RUN_TEST(test_wake_is_when_the_next_millisecond_is_due);
    RUN_TEST(test_lockstep_runs_to_what_is_asked_and_only_once);
    return UNITY_END();
}
