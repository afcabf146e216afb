/// @file fuzz_crtp.c
/// libFuzzer on the packet entry of the software vehicle: each input is a sequence of datagrams, waits and link events, played to a vehicle
/// that has just booted.
///
/// A record begins with one byte: 0x00..0x3F a datagram of so many bytes, which follow; 0x40..0x7F a line of 0..63 bytes for the control
/// channel; 0x80..0xBF 1..64 ms of the vehicle; 0xC0..0xFF the link goes down (even) or comes up (odd).
/// The environment variable IVL_FUZZ_MODEL names the file of the vehicle's parameters.
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app_ivl.h"
#include "cf/cf_vehicle.h"
#include "crtp/crtp_control.h"
#include "crtp/crtp_dispatch.h"
#include "crtp/crtp_model_file.h"
#include "crtp/crtp_power.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum
{
    STEPS_MAX = 200
};

extern uint8_t tumbleCheckEnabled;

static ivl_sim_model_t *model;
static ivl_crtp_t       server;
static unsigned         n_sent;
static uint64_t         n_inputs, n_datagrams, n_steps;
static uint64_t         answers, all_answers;

// the bytes of all answers to an input (FNV-1a), and over all inputs a sum that does not depend on their order
static void look_at(void *context, const ivl_crtp_packet_t *packet)
{
    uint8_t      bytes[IVL_CRTP_BYTES_MAX];
    const size_t n = ivl_crtp_bytes(packet, bytes);
    (void)context;
    assert((n >= 1u) && (n <= sizeof bytes));
    for (size_t i = 0; i < n; i++)
    {
        answers = (answers ^ bytes[i]) * 0x100000001b3u;
    }
    n_sent++;
}

static void check_blocks(void)
{
    unsigned n = 0;
    for (int i = 0; i < IVL_CRTP_BLOCKS; i++)
    {
        const ivl_crtp_block_t *b = &server.logs.block[i];
        n += b->used ? b->n : 0u;
        assert(!b->used || (b->n_bytes <= IVL_CRTP_LOG_BYTES));
    }
    assert((n == server.logs.n_variables) && (n <= IVL_CRTP_LOG_VARIABLES));
}

// Those to the radio's processor go past the server, as they do behind a socket.
// a request has at most two answers: its own, and one that had been held back; or those that a log block adds
static void play_datagram(const uint8_t *bytes, size_t size)
{
    // on the heap and no longer than it is, so that a read beyond its end is seen
    uint8_t *copy = malloc(size + (size == 0u));
    assert(copy != NULL);
    for (size_t i = 0; i < size; i++)
    {
        copy[i] = bytes[i];
    }
    n_sent = 0;
    n_datagrams++;
    if (ivl_crtp_is_power(copy, size))
    {
        ivl_crtp_packet_t reply;
        ivl_crtp_power(&server, copy, size, &reply);
        look_at(NULL, &reply);
    }
    else
    {
        ivl_crtp_receive(&server, copy, size);
    }
    assert(n_sent <= 3u);
    free(copy);
}

static unsigned play_steps(unsigned wanted, unsigned left)
{
    const unsigned n = (wanted < left) ? wanted : left;
    const uint64_t before_ms = ivl_crtp_time_ms(&server);
    for (unsigned i = 0; i < n; i++)
    {
        ivl_crtp_step(&server);
    }
    assert(ivl_crtp_time_ms(&server) == before_ms + n);
    n_steps += n;
    return left - n;
}

static void play(const uint8_t *data, size_t size)
{
    unsigned steps_left = STEPS_MAX;
    for (size_t at = 0; at < size;)
    {
        const uint8_t op = data[at++];
        const size_t  wanted = (op < 0x80u) ? op & 0x3fu : 0u;
        const size_t  n = (wanted < size - at) ? wanted : size - at;
        char          reply[IVL_CRTP_CONTROL_BYTES];
        if (op < 0x40u)
        {
            play_datagram(data + at, n);
        }
        else if (op < 0x80u)
        {
            ivl_crtp_control(&server, (const char *)data + at, n, reply);
        }
        else if (op < 0xc0u)
        {
            steps_left = play_steps((op & 0x3fu) + 1u, steps_left);
        }
        else
        {
            ivl_crtp_link(&server, (op & 1u) != 0u);
        }
        at += n;
        check_blocks();
    }
}

static void fail(const char *error)
{
    fprintf(stderr, "fuzz_crtp: %s\n", error);
    exit(2);
}

static void tell_counts(void)
{
    fprintf(stderr, "fuzz_crtp: %llu inputs, %llu datagrams, %llu ms of the vehicle, answers %016llx\n", (unsigned long long)n_inputs,
            (unsigned long long)n_datagrams, (unsigned long long)n_steps, (unsigned long long)all_answers);
}

// ---- a vehicle that has just booted

static struct
{
    ivl_cf_t                cf;
    app_t                   app;
    ivl_crtp_t              server;
    ivl_crtp_param_state_t *params;
} booted;

static void open_all(void)
{
    static const ivl_crtp_host_t HOST = {.send = look_at};
    char                         error[200];
    ivl_cf_t *const              cf = ivl_cf_open(model, 1, error, sizeof error);
    if ((cf == NULL) || !ivl_crtp_open(&server, cf, &HOST, error, sizeof error))
    {
        fail(error);
    }
}

static void keep_booted(void)
{
    const size_t n = server.params.toc.n;
    booted.cf = ivl_cf_the;
    booted.app = ivl_app;
    booted.server = server;
    booted.params = calloc(n, sizeof *booted.params);
    assert(booted.params != NULL);
    memcpy(booted.params, server.params.state, n * sizeof *booted.params);
}

/// The start of the vehicle takes longer than most inputs: it is made once, and all that an input can change is copied back.
static void boot_again(void)
{
    app_task_start();
    tumbleCheckEnabled = 1;
    ivl_cf_the = booted.cf;
    ivl_app = booted.app;
    server = booted.server;
    memcpy(server.params.state, booted.params, server.params.toc.n * sizeof *booted.params);
    ivl_cf_logs_refresh(&ivl_cf_the);
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    char        error[400];
    const char *path = getenv("IVL_FUZZ_MODEL");
    (void)argc;
    (void)argv;
    if (path == NULL)
    {
        fail("IVL_FUZZ_MODEL must name a model file (ivl sil --write-model FILE)");
    }
    model = ivl_crtp_model_read(path, error, sizeof error);
    if (model == NULL)
    {
        fail(error);
    }
    open_all();
    keep_booted();
    atexit(tell_counts);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    boot_again();
    answers = 0xcbf29ce484222325u;
    ivl_crtp_link(&server, true);
    play(data, size);
    all_answers += answers;
    n_inputs++;
    return 0;
}
