/// @file test_crtp_packet.c
/// Bytes, half precision, compressed quaternions.
#include <math.h>
#include <string.h>

#include "crtp/crtp_number.h"
#include "crtp/crtp_packet.h"
#include "test_ivl_support.h"

static void test_header_is_port_and_channel_whatever_its_middle_bits(void)
{
    const uint8_t     bytes[] = {0x5D, 1, 2};
    const uint8_t     without[] = {0x51, 1, 2};
    ivl_crtp_packet_t a, b;
    TEST_ASSERT_TRUE(ivl_crtp_parse(&a, bytes, sizeof bytes));
    TEST_ASSERT_TRUE(ivl_crtp_parse(&b, without, sizeof without));
    TEST_ASSERT_EQUAL_UINT8(5, a.port);
    TEST_ASSERT_EQUAL_UINT8(1, a.channel);
    TEST_ASSERT_EQUAL_UINT8(2, a.size);
    TEST_ASSERT_EQUAL_MEMORY(&a, &b, sizeof a);
    uint8_t again[IVL_CRTP_BYTES_MAX];
    TEST_ASSERT_EQUAL_UINT64(sizeof bytes, ivl_crtp_bytes(&a, again));
    TEST_ASSERT_EQUAL_MEMORY(bytes, again, sizeof bytes);
}

static void test_only_1_to_31_bytes_are_a_packet(void)
{
    const uint8_t     bytes[40] = {0};
    ivl_crtp_packet_t packet;
    for (size_t size = 0; size <= sizeof bytes; size++)
    {
        TEST_ASSERT_EQUAL_INT((size >= 1) && (size <= 31), ivl_crtp_parse(&packet, bytes, size));
    }
}

static void test_reader_gives_zeros_past_the_end_and_says_so(void)
{
    const uint8_t     bytes[] = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05};
    ivl_crtp_packet_t packet;
    TEST_ASSERT_TRUE(ivl_crtp_parse(&packet, bytes, sizeof bytes));
    ivl_crtp_reader_t r = ivl_crtp_read(&packet);
    TEST_ASSERT_EQUAL_HEX32(0x04030201, ivl_crtp_u32(&r));
    TEST_ASSERT_FALSE(ivl_crtp_exact(&r));
    TEST_ASSERT_EQUAL_UINT16(0, ivl_crtp_u16(&r));
    TEST_ASSERT_FALSE(r.good);
    TEST_ASSERT_EQUAL_UINT8(0, ivl_crtp_u8(&r));
    TEST_ASSERT_FALSE(ivl_crtp_exact(&r));
}

static void test_text_without_zero_is_no_text(void)
{
    const uint8_t     bytes[] = {0x00, 'a', 'b', 0, 'c'};
    ivl_crtp_packet_t packet;
    TEST_ASSERT_TRUE(ivl_crtp_parse(&packet, bytes, sizeof bytes));
    ivl_crtp_reader_t r = ivl_crtp_read(&packet);
    TEST_ASSERT_EQUAL_STRING("ab", ivl_crtp_text(&r));
    TEST_ASSERT_NULL(ivl_crtp_text(&r));
    TEST_ASSERT_FALSE(r.good);
}

// every number that has half the bits, and the points half way between two of them
static double half_to_double(uint16_t half)
{
    const int    exponent = (half >> 10) & 0x1f;
    const double fraction = (double)(half & 0x3ff);
    const double magnitude = (exponent == 0) ? ldexp(fraction, -24) : ldexp(1024.0 + fraction, exponent - 25);
    return ((half & 0x8000u) != 0u) ? -magnitude : magnitude;
}

static void test_half_precision_returns_each_of_its_numbers(void)
{
    for (uint32_t half = 0; half < 0x10000u; half++)
    {
        if (((half >> 10) & 0x1fu) != 0x1fu)
        {
            TEST_ASSERT_EQUAL_HEX16(half, ivl_crtp_half((float)half_to_double((uint16_t)half)));
        }
    }
}

static void test_half_precision_rounds_to_the_nearest_and_ties_to_even(void)
{
    for (uint16_t half = 0; half < 0x7bffu; half++)
    {
        const float lo = (float)half_to_double(half);
        const float hi = (float)half_to_double((uint16_t)(half + 1u));
        const float middle = lo + 0.5f * (hi - lo);
        TEST_ASSERT_EQUAL_HEX16(((half & 1u) == 0u) ? half : half + 1u, ivl_crtp_half(middle));
        TEST_ASSERT_EQUAL_HEX16(half, ivl_crtp_half(nextafterf(middle, 0.0f)));
        TEST_ASSERT_EQUAL_HEX16(half + 1u, ivl_crtp_half(nextafterf(middle, 1e9f)));
    }
}

static void test_half_precision_has_infinity_and_nan(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x7bff, ivl_crtp_half(65519.0f));
    TEST_ASSERT_EQUAL_HEX16(0x7c00, ivl_crtp_half(65520.0f));
    TEST_ASSERT_EQUAL_HEX16(0xfc00, ivl_crtp_half(-INFINITY));
    TEST_ASSERT_EQUAL_HEX16(0x7e00, ivl_crtp_half(NAN) & 0x7fff);
    TEST_ASSERT_EQUAL_HEX16(0x8000, ivl_crtp_half(-0.0f));
    TEST_ASSERT_EQUAL_HEX16(0x0000, ivl_crtp_half(1e-30f));
}

// the way of a client, in double
static uint32_t compress(const ivl_quat_t *quat)
{
    const double q[4] = {(double)quat->x, (double)quat->y, (double)quat->z, (double)quat->w};
    unsigned     largest = 0;
    for (unsigned i = 1; i < 4; i++)
    {
        largest = (fabs(q[i]) > fabs(q[largest])) ? i : largest;
    }
    uint32_t bits = largest;
    for (unsigned i = 0; i < 4; i++)
    {
        if (i != largest)
        {
            const bool     negative = (q[i] < 0.0) != (q[largest] < 0.0);
            const uint32_t magnitude = (uint32_t)(511.0 * fabs(q[i]) * sqrt(2.0) + 0.5);
            bits = (bits << 10) | (negative ? 0x200u : 0u) | magnitude;
        }
    }
    return bits;
}

static void test_quaternion_survives_the_way_within_its_resolution(void)
{
    rng_t rng = {11};
    for (int i = 0; i < 20000; i++)
    {
        const ivl_quat_t q = rng_quat(&rng);
        float            got[4];
        TEST_ASSERT_TRUE(ivl_crtp_quat(compress(&q), got));
        const float dot = got[0] * q.x + got[1] * q.y + got[2] * q.z + got[3] * q.w;
        const float n2 = got[0] * got[0] + got[1] * got[1] + got[2] * got[2] + got[3] * got[3];
        TEST_ASSERT_FLOAT_WITHIN(1e-6f, 1.0f, n2);
        // |dot| = cos(angle / 2): within 0.3 degrees
        TEST_ASSERT_TRUE(fabsf(dot) > 1.0f - 3e-6f);
    }
}

static void test_bits_that_are_no_rotation_are_refused(void)
{
    float       q[4] = {5, 6, 7, 8};
    const float unchanged[4] = {5, 6, 7, 8};
    TEST_ASSERT_FALSE(ivl_crtp_quat(0xFFFFFFFFu, q));
    TEST_ASSERT_EQUAL_MEMORY(unchanged, q, sizeof q);
    rng_t rng = {3};
    for (int i = 0; i < 100000; i++)
    {
        if (ivl_crtp_quat((uint32_t)rng_u64(&rng), q))
        {
            TEST_ASSERT_FLOAT_WITHIN(1e-6f, 1.0f, q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        }
    }
}

void setUp(void)
{
}

void tearDown(void)
{
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_header_is_port_and_channel_whatever_its_middle_bits);
    RUN_TEST(test_only_1_to_31_bytes_are_a_packet);
    RUN_TEST(test_reader_gives_zeros_past_the_end_and_says_so);
    RUN_TEST(test_text_without_zero_is_no_text);
    RUN_TEST(test_half_precision_returns_each_of_its_numbers);
    RUN_TEST(test_half_precision_rounds_to_the_nearest_and_ties_to_even);
    RUN_TEST(test_half_precision_has_infinity_and_nan);
    RUN_TEST(test_quaternion_survives_the_way_within_its_resolution);
    RUN_TEST(test_bits_that_are_no_rotation_are_refused);
    return UNITY_END();
}
