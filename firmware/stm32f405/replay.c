/// @file replay.c
/// Reads recorded requests in blocks and writes the replies: the same as the tick server, without waiting for each tick.
/// With the word "count" on its command line it also counts the instructions of each tick and prints a table at the end:
///     phase after the tick, ticks, fewest, sum, most
/// Counting needs an emulator whose clock advances by one nanosecond per instruction (-icount shift=0): TIM2 then counts instructions.
#include <string.h>

#include "semihost.h"
#include "serve.h"

enum
{
    BLOCK = 16  // requests
};

// reference manual RM0090, sections 7.3.13 and 18.4
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define RCC_APB1ENR       REGISTER(0x40023840u)
#define TIM2_CR1          REGISTER(0x40000000u)
#define TIM2_EGR          REGISTER(0x40000014u)
#define TIM2_CNT          REGISTER(0x40000024u)
#define TIM2_PSC          REGISTER(0x40000028u)
#define TIM2_ARR          REGISTER(0x4000002cu)

typedef struct
{
    uint32_t n, min, max;
    uint64_t sum;
} tally_t;

static serve_core_t       cores[IVL_PORT_SLOTS];
static ivl_port_request_t requests[BLOCK];
static ivl_port_reply_t   replies[BLOCK];
static tally_t            tallies[IVL_PHASE_COUNT];
static uint32_t           n_overhead;

static void start_clock(void)
{
    RCC_APB1ENR |= 1u;
    TIM2_PSC = 0;
    TIM2_ARR = UINT32_MAX;
    TIM2_CR1 = 1u;
    TIM2_EGR = 1u;
    const uint32_t before = TIM2_CNT;
    n_overhead = TIM2_CNT - before;
}

// what runs between the two readings: the call, its arguments and the tick
static void counted_step(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    const uint32_t before = TIM2_CNT;
    ivl_step(cfg, state, in, out);
    const uint32_t n = TIM2_CNT - before - n_overhead;
    tally_t       *tally = &tallies[out->phase];
    tally->min = ((tally->n == 0u) || (n < tally->min)) ? n : tally->min;
    tally->max = (n > tally->max) ? n : tally->max;
    tally->sum += n;
    tally->n++;
}

static void print_number(uint64_t value, const char *after)
{
    char  text[24];
    char *at = &text[sizeof text - 1u];
    *at = '\0';
    do
    {
        *--at = (char)('0' + (char)(value % 10u));
        value /= 10u;
    } while (value != 0u);
    semihost_print(at);
    semihost_print(after);
}

static void print_tallies(void)
{
    for (int i = 0; i < (int)IVL_PHASE_COUNT; i++)
    {
        const tally_t *tally = &tallies[i];
        print_number((uint64_t)i, ",");
        print_number(tally->n, ",");
        print_number(tally->min, ",");
        print_number(tally->sum, ",");
        print_number(tally->max, "\n");
    }
}

int main(void)
{
    const bool             counts = strstr(semihost_command_line(), "count") != NULL;
    const int              in = semihost_open_stdin();
    const int              out = semihost_open_stdout();
    const ivl_port_hello_t hello = ivl_port_hello();
    if (counts)
    {
        start_clock();
    }
    semihost_write(out, &hello, sizeof hello);
    size_t kept = 0;  // bytes of a request that has arrived in part
    for (size_t n; (n = semihost_read(in, (char *)requests + kept, sizeof requests - kept)) != 0u;)
    {
        const size_t n_whole = (kept + n) / sizeof requests[0];
        for (size_t i = 0; i < n_whole; i++)
        {
            serve_request(cores, counts ? counted_step : ivl_step, &requests[i], &replies[i]);
        }
        semihost_write(out, replies, n_whole * sizeof replies[0]);
        kept = kept + n - n_whole * sizeof requests[0];
        memmove(requests, &requests[n_whole], kept);
    }
    if (counts)
    {
        print_tallies();
    }
    return (kept == 0u) ? 0 : EXIT_TRANSPORT;
}
