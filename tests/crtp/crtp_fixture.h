/// @file crtp_fixture.h
/// A server on a vehicle that writes down what it was told, and what the server has sent, as text.
#ifndef CRTP_FIXTURE_H
#define CRTP_FIXTURE_H
#include <stdio.h>
#include <string.h>

#include "crtp/crtp_dispatch.h"
#include "fake_cf.h"
#include "unity.h"

static ivl_crtp_t server;
static char       sent[8192];  ///< packets as hexadecimal, header first, one space between packets
static unsigned   n_sent;

static inline void note_packet(void *context, const ivl_crtp_packet_t *packet)
{
    uint8_t      bytes[IVL_CRTP_BYTES_MAX];
    const size_t n = ivl_crtp_bytes(packet, bytes);
    size_t       at = strlen(sent);
    (void)context;
    n_sent++;
    if ((at > 0u) && (at + 1u < sizeof sent))
    {
        sent[at++] = ' ';
        sent[at] = '\0';
    }
    for (size_t i = 0; (i < n) && (at + 3u < sizeof sent); i++)
    {
        at += (size_t)snprintf(sent + at, sizeof sent - at, "%02x", bytes[i]);
    }
}

static inline void forget(void)
{
    sent[0] = '\0';
    n_sent = 0;
    fake_clear();
}

static inline void open_server(void)
{
    const ivl_crtp_host_t host = {.send = note_packet};
    char                  error[200];
    fake_reset();
    TEST_ASSERT_TRUE_MESSAGE(ivl_crtp_open(&server, ivl_cf_open(NULL, 0, error, sizeof error), &host, error, sizeof error), error);
    forget();
}

static inline size_t from_hex(const char *hex, uint8_t *bytes, size_t capacity)
{
    size_t n = 0;
    for (; *hex != '\0'; hex += 2)
    {
        unsigned value;
        while (*hex == ' ')
        {
            hex++;
        }
        TEST_ASSERT_EQUAL_INT(1, sscanf(hex, "%2x", &value));
        TEST_ASSERT_TRUE(n < capacity);
        bytes[n++] = (uint8_t)value;
    }
    return n;
}

/// Give the server a packet, written as hexadecimal with the header first.
static inline void hear(const char *hex)
{
    uint8_t bytes[64];
    ivl_crtp_receive(&server, bytes, from_hex(hex, bytes, sizeof bytes));
}

/// What the server says to a packet, as hexadecimal; "" if it says nothing.
static inline void expect_answer(const char *request, const char *answer)
{
    forget();
    hear(request);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(answer, sent, request);
}

/// What the vehicle is told by a packet.
static inline void expect_said(const char *request, const char *said)
{
    forget();
    hear(request);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(said, fake_said, request);
}

/// A packet that is counted as malformed, and of which neither vehicle nor client hears.
static inline void expect_bad(const char *request)
{
    const uint32_t n_bad = server.own.n_bad;
    forget();
    hear(request);
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", fake_said, request);
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", sent, request);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(n_bad + 1u, server.own.n_bad, request);
}
#endif  // CRTP_FIXTURE_H
