#define _GNU_SOURCE
#include "crtp_options.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cf/cf.h"

static const char HELP[] =
    "usage: ivl_sil --model FILE [options]\n"
    "\n"
    "One simulated Crazyflie with the inverted-landing app, as a CRTP server on UDP.  cflib, cfclient and other CRTP tools connect to\n"
    "udp://ADDRESS:PORT.  Started most easily by `ivl sil`, which makes the model file from a vehicle and a landing gear.\n"
    "\n"
    "  --model FILE      parameters of vehicle, gear and world, as `ivl sil --write-model` writes them; - is the standard input\n"
    "  --port N          UDP port of the first vehicle (19850; tools scan 19850 .. 19859); 0 takes a free one\n"
    "  --bind ADDRESS    address to listen on (127.0.0.1: this machine only; 0.0.0.0: everybody who can reach it may fly)\n"
    "  --vehicles N      so many vehicles in one room, on consecutive ports, a process each (1 .. 64)\n"
    "  --seed N          of the sensors' noise (0); vehicle n has seed N + n\n"
    "  --deck NAME       a deck on board, bcFlow2 or bcMultiranger; may be given several times; none: no deck (bcFlow2)\n"
    "  --tables          print all parameters and log variables, one a line, and stop\n"
    "\n"
    "time\n"
    "  --speed N         N times real time (1)\n"
    "  --speed max       as fast as this machine and the client's buffer allow\n"
    "  --lockstep        time stands still until the client writes the parameter sil.run_to_ms\n"
    "  --packets N       largest number of packets a second to the client when time is not paced (8000)\n"
    "\n"
    "a bad link, in both directions, seeded: the same packets meet the same faults\n"
    "  --fault NAME=VALUE   may be given several times:\n"
#define LINE(type, name, unit, lo, hi, doc) "      " #name " [" unit "] " #lo " .. " #hi ": " doc "\n"
    IVL_CRTP_FAULTS(LINE)
#undef LINE
        "  --control PORT    a second UDP port, on 127.0.0.1, that no fault touches; 0 takes a free one.  A datagram `fault.loss=0.2` sets "
        "a\n"
        "                    parameter, `fault.loss` reads it; fault.freeze_ms=3000 freezes the server, fault.cut_ms=500 cuts the link\n"
        "\n"
        "example\n"
        "  ivl sil --vehicle crazyflie21 --speed 10 --fault loss=0.05 --control 20850\n"
        "  echo fault.freeze_ms=3000 | nc -u -w1 127.0.0.1 20850\n";

static bool complain(const char *option, const char *value, const char *allowed)
{
    fprintf(stderr, "ivl_sil: --%s: value '%s' is not allowed (%s); see ivl_sil --help\n", option, value, allowed);
    return false;
}

static bool get_u64(const char *option, const char *text, uint64_t lo, uint64_t hi, uint64_t *value)
{
    char  allowed[64];
    char *end;
    errno = 0;
    *value = strtoull(text, &end, 10);
    if ((errno == 0) && (text[0] >= '0') && (text[0] <= '9') && (*end == '\0') && (*value >= lo) && (*value <= hi))
    {
        return true;
    }
    snprintf(allowed, sizeof allowed, "a whole number from %llu to %llu", (unsigned long long)lo, (unsigned long long)hi);
    return complain(option, text, allowed);
}

static bool get_number(const char *text, double lo, double hi, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return (end != text) && (*end == '\0') && (*value >= lo) && (*value <= hi);
}

static bool get_speed(const char *text, float *factor)
{
    double value = 0.0;
    if ((strcmp(text, "max") != 0) && !get_number(text, 0.01, 1000.0, &value))
    {
        return complain("speed", text, "a number from 0.01 to 1000, or max");
    }
    *factor = (float)value;
    return true;
}

static bool get_fault(const char *text, ivl_crtp_fault_cfg_t *fault)
{
    const char  *equals = strchr(text, '=');
    const size_t n = (equals != NULL) ? (size_t)(equals - text) : 0u;
    double       value;
#define TRY(type, name, unit, lo, hi, doc)                                                                                                 \
    if ((n == strlen(#name)) && (strncmp(text, #name, n) == 0))                                                                            \
    {                                                                                                                                      \
        const bool good = get_number(equals + 1, lo, hi, &value);                                                                          \
        fault->name = good ? (type)value : fault->name;                                                                                    \
        return good || complain("fault", text, #name " from " #lo " to " #hi);                                                             \
    }
    IVL_CRTP_FAULTS(TRY)
#undef TRY
#define NAME(type, name, unit, lo, hi, doc) #name "=.. "
    return complain("fault", text, IVL_CRTP_FAULTS(NAME));
#undef NAME
}

typedef enum
{
    MODEL = 1000,
    PORT,
    BIND,
    VEHICLES,
    SEED,
    SPEED,
    LOCKSTEP,
    PACKETS,
    FAULT,
    CONTROL,
    DECK,
    TABLES,
    OPTION_HELP
} option_t;

static const struct option OPTIONS[] = {
    {"model", required_argument, NULL, MODEL}, {"port", required_argument, NULL, PORT},
    {"bind", required_argument, NULL, BIND},   {"vehicles", required_argument, NULL, VEHICLES},
    {"seed", required_argument, NULL, SEED},   {"speed", required_argument, NULL, SPEED},
    {"lockstep", no_argument, NULL, LOCKSTEP}, {"packets", required_argument, NULL, PACKETS},
    {"fault", required_argument, NULL, FAULT}, {"control", required_argument, NULL, CONTROL},
    {"deck", required_argument, NULL, DECK},   {"tables", no_argument, NULL, TABLES},
    {"help", no_argument, NULL, OPTION_HELP},  {NULL, 0, NULL, 0},
};

static bool take_number(int option, const char *text, ivl_crtp_options_t *o)
{
    uint64_t value = 0;
    switch (option)
    {
    case PORT:
        return get_u64("port", text, 0, UINT16_MAX, &value) && ((o->port = (uint16_t)value), true);
    case VEHICLES:
        return get_u64("vehicles", text, 1, 64, &value) && ((o->vehicles = (unsigned)value), true);
    case SEED:
        return get_u64("seed", text, 0, UINT64_MAX, &o->seed);
    case PACKETS:
        return get_u64("packets", text, 100, 1000000, &value) && ((o->packets_per_s = (uint32_t)value), true);
    case CONTROL:
        o->has_control = true;
        return get_u64("control", text, 0, UINT16_MAX, &value) && ((o->control_port = (uint16_t)value), true);
    default:
        return false;  // getopt has said why
    }
}

static bool get_deck(const char *name, ivl_crtp_options_t *o)
{
    if (!ivl_cf_is_deck(name) && (strcmp(name, "none") != 0))
    {
        return complain("deck", name, "bcFlow2, bcMultiranger or none");
    }
    if (o->n_decks == IVL_CRTP_DECKS_MAX)
    {
        return complain("deck", name, "8 decks at most");
    }
    o->deck[o->n_decks++] = name;
    return true;
}

static bool take(int option, ivl_crtp_options_t *o)
{
    switch (option)
    {
    case MODEL:
        o->model = optarg;
        return true;
    case BIND:
        o->bind = optarg;
        return true;
    case LOCKSTEP:
        o->lockstep = true;
        return true;
    case SPEED:
        return get_speed(optarg, &o->speed_factor);
    case FAULT:
        return get_fault(optarg, &o->fault);
    case DECK:
        return get_deck(optarg, o);
    case TABLES:
        o->shows_tables = true;
        return true;
    default:
        return take_number(option, optarg, o);
    }
}

static bool is_consistent(const ivl_crtp_options_t *o)
{
    if (o->model == NULL)
    {
        fputs("ivl_sil: --model FILE is missing (`ivl sil` makes it); see ivl_sil --help\n", stderr);
        return false;
    }
    const unsigned last = o->vehicles - 1u;
    if (((o->port != 0u) && (o->port + last > UINT16_MAX)) || ((o->control_port != 0u) && (o->control_port + last > UINT16_MAX)))
    {
        fprintf(stderr, "ivl_sil: --vehicles %u: the last port would be beyond 65535\n", o->vehicles);
        return false;
    }
    return true;
}

ivl_crtp_options_result_t ivl_crtp_options_parse(int argc, char **argv, ivl_crtp_options_t *options)
{
    *options = (ivl_crtp_options_t){.bind = "127.0.0.1", .port = 19850, .vehicles = 1, .speed_factor = 1.0f, .packets_per_s = 8000};
    int option;
    optind = 1;
    while ((option = getopt_long(argc, argv, "h", OPTIONS, NULL)) != -1)
    {
        if ((option == OPTION_HELP) || (option == 'h'))
        {
            fputs(HELP, stdout);
            return IVL_CRTP_OPTIONS_HELP;
        }
        if (!take(option, options))
        {
            return IVL_CRTP_OPTIONS_WRONG;
        }
    }
    if (optind < argc)
    {
        fprintf(stderr, "ivl_sil: '%s' is not expected; see ivl_sil --help\n", argv[optind]);
        return IVL_CRTP_OPTIONS_WRONG;
    }
    return is_consistent(options) ? IVL_CRTP_OPTIONS_RUN : IVL_CRTP_OPTIONS_WRONG;
}
