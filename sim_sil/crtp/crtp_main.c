/// @file crtp_main.c
/// The program ivl_sil: one process a vehicle.  Exit codes: 0 stopped by SIGINT or SIGTERM, 1 it could not run, 2 wrong usage.
#define _GNU_SOURCE
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

#include "cf/cf_room.h"
#include "crtp_list.h"
#include "crtp_loop.h"
#include "crtp_model_file.h"
#include "crtp_options.h"
#include "crtp_udp.h"
#include "sil.h"

enum
{
    VEHICLES_MAX = IVL_CF_ROOM_VEHICLES
};

typedef struct
{
    int      fd, control_fd;
    uint16_t port, control_port;
} endpoint_t;

/// Shared by the processes of several vehicles; NULL: there is one, alone.
static ivl_cf_room_t *room;

static const unsigned RADIO_ADDRESS = 0xE7;  // last byte of the first vehicle's
static const char     USUAL_DECK[] = "bcFlow2";

static volatile sig_atomic_t stop;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

static void on_child(int number)
{
    (void)number;  // caught so that it ends a wait
}

static void catch_signals(void)
{
    struct sigaction action = {.sa_handler = on_signal};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    action.sa_handler = on_child;
    sigaction(SIGCHLD, &action, NULL);
}

static void ignore(void *context, const ivl_crtp_packet_t *packet)
{
    (void)context, (void)packet;
}

static bool fail(const char *error)
{
    fprintf(stderr, "ivl_sil: %s\n", error);
    return false;
}

static bool open_endpoint(const ivl_crtp_options_t *o, unsigned n, endpoint_t *e)
{
    char error[200];
    *e = (endpoint_t){.fd = -1, .control_fd = -1};
    e->port = (o->port != 0u) ? (uint16_t)(o->port + n) : 0u;
    e->fd = ivl_crtp_udp_open(o->bind, &e->port, error, sizeof error);
    if (e->fd < 0)
    {
        return fail(error);
    }
    if (o->has_control)
    {
        e->control_port = (o->control_port != 0u) ? (uint16_t)(o->control_port + n) : 0u;
        e->control_fd = ivl_crtp_udp_open("127.0.0.1", &e->control_port, error, sizeof error);
        if (e->control_fd < 0)
        {
            return fail(error);
        }
    }
    return true;
}

// one line a vehicle, which programs read to learn the ports
static void announce(const ivl_crtp_options_t *o, unsigned n, const endpoint_t *e)
{
    printf("vehicle %u: udp://%s:%u", n, o->bind, e->port);
    if (e->control_fd >= 0)
    {
        printf(" control 127.0.0.1:%u", e->control_port);
    }
    printf("\n");
    fflush(stdout);
}

/// A vehicle with its address, and with the decks that were asked for, or the one that most programs need.
static ivl_cf_t *make_vehicle(const ivl_crtp_options_t *o, const ivl_sim_model_t *model, unsigned n)
{
    char            error[200];
    ivl_cf_t *const cf = ivl_cf_open(model, o->seed + n, error, sizeof error);
    if (cf == NULL)
    {
        fail(error);
        return NULL;
    }
    ivl_cf_set_address(cf, (uint8_t)(RADIO_ADDRESS + n));
    if (room != NULL)
    {
        ivl_cf_enter(cf, room, n);
    }
    for (unsigned i = 0; i < o->n_decks; i++)
    {
        (void)ivl_cf_attach(cf, o->deck[i]);  // "none" is no deck
    }
    if (o->n_decks == 0u)
    {
        (void)ivl_cf_attach(cf, USUAL_DECK);
    }
    return cf;
}

static int show_tables(const ivl_crtp_options_t *o, const ivl_sim_model_t *model)
{
    static ivl_crtp_t            server;
    static const ivl_crtp_host_t HOST = {.send = ignore};
    char                         error[200];
    ivl_cf_t *const              cf = make_vehicle(o, model, 0);
    if (cf == NULL)
    {
        return 1;
    }
    const bool good = ivl_crtp_open(&server, cf, &HOST, error, sizeof error);
    if (good)
    {
        ivl_crtp_list(&server);
        ivl_crtp_close(&server);
    }
    else
    {
        fail(error);
    }
    ivl_cf_close(cf);
    return good ? 0 : 1;
}

static int fly(const ivl_crtp_options_t *o, const ivl_sim_model_t *model, unsigned n, const endpoint_t *e)
{
    static ivl_crtp_loop_t    loop;
    char                      error[200];
    const ivl_crtp_loop_cfg_t cfg = {
        .fd = e->fd,
        .control_fd = e->control_fd,
        .address = (uint8_t)(RADIO_ADDRESS + n),
        .speed_factor = o->speed_factor,
        .lockstep = o->lockstep,
        .packets_per_s = o->packets_per_s,
        .fault = o->fault,
    };
    ivl_cf_t *const cf = make_vehicle(o, model, n);
    if (cf == NULL)
    {
        return 1;
    }
    if (!ivl_crtp_loop_open(&loop, cf, &cfg, error, sizeof error))
    {
        fail(error);
        ivl_cf_close(cf);
        return 1;
    }
    announce(o, n, e);
    ivl_crtp_loop_run(&loop, &stop);
    ivl_crtp_loop_close(&loop);
    ivl_cf_close(cf);
    return 0;
}

// a child ends with its parent, whatever happens to that one
static void die_with_parent(pid_t parent)
{
#ifdef __linux__
    prctl(PR_SET_PDEATHSIG, SIGTERM);
#endif
    if (getppid() != parent)
    {
        exit(1);
    }
}

static bool start(const ivl_crtp_options_t *o, const ivl_sim_model_t *model, unsigned n, const endpoint_t *e, const sigset_t *mask,
                  pid_t *child)
{
    const pid_t parent = getpid();
    *child = fork();
    if (*child == 0)
    {
        sigprocmask(SIG_SETMASK, mask, NULL);
        die_with_parent(parent);
        _exit(fly(o, model, n, &e[n]));
    }
    return (*child > 0) || fail(strerror(errno));
}

static void stop_all(const pid_t *children, unsigned n)
{
    for (unsigned i = 0; i < n; i++)
    {
        if (children[i] > 0)
        {
            kill(children[i], SIGTERM);
        }
    }
}

// Ends when it is told to, or when one vehicle has ended by itself: then with all.  Signals are blocked but in sigsuspend, so that none
// comes between a look and the wait.
static int watch(pid_t *children, unsigned n, const sigset_t *mask)
{
    int      code = 0;
    unsigned n_left = n;
    while (n_left > 0u)
    {
        int         status;
        const pid_t ended = waitpid(-1, &status, WNOHANG);
        if (ended < 0)
        {
            break;
        }
        if (ended == 0)
        {
            sigsuspend(mask);
        }
        for (unsigned i = 0; (ended > 0) && (i < n); i++)
        {
            if (children[i] == ended)
            {
                children[i] = 0;
                n_left--;
            }
        }
        const bool failed = (ended > 0) && !(WIFEXITED(status) && (WEXITSTATUS(status) == 0));
        if (failed && (code == 0))
        {
            fprintf(stderr, "ivl_sil: a vehicle ended unexpectedly; the others are stopped\n");
            code = 1;
        }
        if (failed || (stop != 0))
        {
            stop_all(children, n);
        }
    }
    return code;
}

static bool open_room(unsigned n)
{
    void *memory = mmap(NULL, sizeof *room, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
    {
        return fail(strerror(errno));
    }
    room = memory;
    room->n = n;
    return true;
}

static int fly_all(const ivl_crtp_options_t *o, const ivl_sim_model_t *model, const endpoint_t *endpoints)
{
    pid_t    children[VEHICLES_MAX] = {0};
    sigset_t held, mask;
    if (o->vehicles == 1u)
    {
        return fly(o, model, 0, endpoints);
    }
    if (!open_room(o->vehicles))
    {
        return 1;
    }
    sigemptyset(&held);
    sigaddset(&held, SIGINT);
    sigaddset(&held, SIGTERM);
    sigaddset(&held, SIGCHLD);
    sigprocmask(SIG_BLOCK, &held, &mask);
    for (unsigned i = 0; i < o->vehicles; i++)
    {
        if (!start(o, model, i, endpoints, &mask, &children[i]))
        {
            stop = 1;
            stop_all(children, i);
            return 1;
        }
    }
    return watch(children, o->vehicles, &mask);
}

int main(int argc, char **argv)
{
    static endpoint_t               endpoints[VEHICLES_MAX];
    ivl_crtp_options_t              options;
    const ivl_crtp_options_result_t result = ivl_crtp_options_parse(argc, argv, &options);
    if (result != IVL_CRTP_OPTIONS_RUN)
    {
        return (result == IVL_CRTP_OPTIONS_HELP) ? 0 : 2;
    }
    catch_signals();
    char             error[400];
    ivl_sim_model_t *model = ivl_crtp_model_read(options.model, error, sizeof error);
    if (model == NULL)
    {
        fail(error);
        return 2;
    }
    if (options.shows_tables)
    {
        const int code = show_tables(&options, model);
        ivl_sil_model_free(model);
        return code;
    }
    // all ports are taken before the first vehicle starts: all or none
    bool good = true;
    for (unsigned i = 0; good && (i < options.vehicles); i++)
    {
        good = open_endpoint(&options, i, &endpoints[i]);
    }
    const int code = good ? fly_all(&options, model, endpoints) : 1;
    for (unsigned i = 0; i < VEHICLES_MAX; i++)
    {
        if (endpoints[i].fd > 0)
        {
            ivl_crtp_udp_close(endpoints[i].fd);
        }
        if (endpoints[i].control_fd > 0)
        {
            ivl_crtp_udp_close(endpoints[i].control_fd);
        }
    }
    ivl_sil_model_free(model);
    return code;
}
