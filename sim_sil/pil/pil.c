#define _GNU_SOURCE  // pipe2
#include "pil.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ivl_port.h"
#include "sim_model.h"

enum
{
    ANSWER_MS = 10000,  // a tick takes 0.02 ms, the start of the emulator 40 ms
    ERROR_SIZE = 256,
    ENDS_MS = 2000,  // patience with a chip whose input was closed
};

_Static_assert(IVL_PORT_SLOTS >= 8, "a slot for each lane of a group of worlds");

typedef struct pool pool_t;

typedef struct chip
{
    pool_t      *pool;
    struct chip *next;
    pid_t        pid;
    int          to, from;  ///< pipes; -1 once the chip has failed
    bool         busy;
    uint32_t     n_request[IVL_PORT_SLOTS];  ///< since the slot's INIT
    uint64_t     n_tick;
} chip_t;

struct pool
{
    char               **command;
    pthread_mutex_t      lock;  ///< of chips and error
    chip_t              *chips;
    char                 error[ERROR_SIZE];
    atomic_uint_fast64_t n_tick;
};

// ---- a process and its pipes --------------------------------------------------------------------------------------------

/// The first failure is kept: those that follow are its consequences.
static void fail(pool_t *pool, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    pthread_mutex_lock(&pool->lock);
    if (pool->error[0] == '\0')
    {
        vsnprintf(pool->error, sizeof pool->error, format, arguments);
    }
    pthread_mutex_unlock(&pool->lock);
    va_end(arguments);
}

static void close_pipes(chip_t *chip)
{
    if (chip->to >= 0)
    {
        close(chip->to);
        close(chip->from);
    }
    chip->to = -1;
    chip->from = -1;
}

/// Closes the chip's input, which ends it, and waits; one that does not end is killed.
/// @return wait status; -1 if there was no process
static int end_chip(chip_t *chip)
{
    int status = -1;
    close_pipes(chip);
    for (int ms = 0; chip->pid > 0; ms++)
    {
        const pid_t ended = waitpid(chip->pid, &status, WNOHANG);
        if (ended == chip->pid || (ended < 0 && errno != EINTR))
        {
            chip->pid = -1;
        }
        else if (ms == ENDS_MS)
        {
            kill(chip->pid, SIGKILL);
        }
        else
        {
            usleep(1000);
        }
    }
    return status;
}

static void fail_chip(chip_t *chip, const char *what)
{
    const int status = end_chip(chip);
    if (status >= 0 && WIFEXITED(status))
    {
        fail(chip->pool, "%s: %s; its exit code is %d", chip->pool->command[0], what, WEXITSTATUS(status));
    }
    else if (status >= 0 && WIFSIGNALED(status))
    {
        fail(chip->pool, "%s: %s; signal %d ended it", chip->pool->command[0], what, WTERMSIG(status));
    }
    else
    {
        fail(chip->pool, "%s: %s", chip->pool->command[0], what);
    }
}

static bool send_all(chip_t *chip, const void *bytes, size_t size)
{
    const char *at = bytes;
    while (size > 0)
    {
        const ssize_t n = write(chip->to, at, size);
        if (n < 0 && errno == EINTR)
        {
            continue;
        }
        if (n <= 0)
        {
            fail_chip(chip, "the emulated chip has ended");  // its end is seen by the write or by the next read, whichever is first
            return false;
        }
        at += n;
        size -= (size_t)n;
    }
    return true;
}

static bool receive_all(chip_t *chip, void *bytes, size_t size)
{
    char *at = bytes;
    while (size > 0)
    {
        struct pollfd ready = {.fd = chip->from, .events = POLLIN};
        const int     n_ready = poll(&ready, 1, ANSWER_MS);
        if (n_ready < 0 && errno == EINTR)
        {
            continue;
        }
        const ssize_t n = (n_ready > 0) ? read(chip->from, at, size) : 0;
        if (n <= 0)
        {
            kill(chip->pid, (n_ready == 0) ? SIGKILL : 0);
            fail_chip(chip, (n_ready == 0) ? "the emulated chip does not answer" : "the emulated chip has ended");
            return false;
        }
        at += n;
        size -= (size_t)n;
    }
    return true;
}

/// A group of its own: an interrupt from the keyboard ends the landing loop, not the chip in the middle of a tick.
static int spawn(char *const command[], int in, int out, pid_t *pid)
{
    posix_spawn_file_actions_t files;
    posix_spawnattr_t          how;
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&how);
    posix_spawn_file_actions_adddup2(&files, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawnattr_setpgroup(&how, 0);
    posix_spawnattr_setflags(&how, POSIX_SPAWN_SETPGROUP);
    const int error = posix_spawnp(pid, command[0], &files, &how, command, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&how);
    return error;
}

static bool same_hello(const ivl_port_hello_t *a, const ivl_port_hello_t *b)
{
    return a->magic == b->magic && a->n_slots == b->n_slots && a->request_size == b->request_size && a->reply_size == b->reply_size &&
           a->cfg_size == b->cfg_size && a->state_size == b->state_size && a->in_size == b->in_size && a->out_size == b->out_size;
}

static void start_chip(chip_t *chip)
{
    int to[2] = {-1, -1}, from[2] = {-1, -1};
    if (pipe2(to, O_CLOEXEC) != 0 || pipe2(from, O_CLOEXEC) != 0)
    {
        fail(chip->pool, "%s: no pipe: %s", chip->pool->command[0], strerror(errno));
        if (to[0] >= 0)
        {
            close(to[0]);
            close(to[1]);
        }
        return;
    }
    const int error = spawn(chip->pool->command, to[0], from[1], &chip->pid);
    close(to[0]);
    close(from[1]);
    chip->to = to[1];
    chip->from = from[0];
    if (error != 0)
    {
        chip->pid = -1;
        fail(chip->pool, "%s: cannot be started: %s", chip->pool->command[0], strerror(error));
        close_pipes(chip);
        return;
    }
    ivl_port_hello_t       hello;
    const ivl_port_hello_t mine = ivl_port_hello();
    if (receive_all(chip, &hello, sizeof hello) && !same_hello(&hello, &mine))
    {
        fail_chip(chip, "the program on the chip is of another version; run `make firmware build`");
    }
}

// ---- the core's place ---------------------------------------------------------------------------------------------------

static chip_t *idle_chip(pool_t *pool)
{
    pthread_mutex_lock(&pool->lock);
    chip_t *chip = pool->chips;
    while (chip != NULL && (chip->busy || chip->to < 0))
    {
        chip = chip->next;
    }
    if (chip != NULL)
    {
        chip->busy = true;
    }
    pthread_mutex_unlock(&pool->lock);
    return chip;
}

/// @return NULL if there is no memory, or a chip, which may have failed
static chip_t *new_chip(pool_t *pool)
{
    chip_t *chip = calloc(1, sizeof *chip);
    if (chip == NULL)
    {
        fail(pool, "out of memory");
        return NULL;
    }
    *chip = (chip_t){.pool = pool, .pid = -1, .to = -1, .from = -1, .busy = true};
    start_chip(chip);
    pthread_mutex_lock(&pool->lock);
    chip->next = pool->chips;
    pool->chips = chip;
    pthread_mutex_unlock(&pool->lock);
    return chip;
}

static void *open_port(void *context)
{
    chip_t *chip = idle_chip(context);
    return (chip != NULL) ? chip : new_chip(context);
}

static void close_port(void *port)
{
    chip_t *chip = port;
    if (chip != NULL)
    {
        atomic_fetch_add(&chip->pool->n_tick, chip->n_tick);
        chip->n_tick = 0;
        pthread_mutex_lock(&chip->pool->lock);
        chip->busy = false;
        pthread_mutex_unlock(&chip->pool->lock);
    }
}

/// @return false if the chip has failed
static bool exchange(chip_t *chip, const ivl_port_request_t *request, ivl_port_reply_t *reply)
{
    if (chip == NULL || chip->to < 0 || !send_all(chip, request, sizeof *request) || !receive_all(chip, reply, sizeof *reply))
    {
        return false;
    }
    if (reply->n_request != chip->n_request[request->slot]++)
    {
        fail_chip(chip, "the emulated chip lost a request");
        return false;
    }
    return true;
}

/// Without a chip nothing is flown: motors off until the end of the landing, whose outcome is void.
static void rest(ivl_state_t *state)
{
    memset(state, 0, sizeof *state);
    state->phase = IVL_PHASE_DONE;
}

static void init(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state)
{
    chip_t                  *chip = port;
    ivl_port_reply_t         reply;
    const ivl_port_request_t request = {.operation = IVL_PORT_INIT, .slot = (uint32_t)lane, .with.cfg = *cfg};
    if (chip != NULL)
    {
        chip->n_request[lane] = 0;
    }
    if (exchange(chip, &request, &reply))
    {
        *state = reply.state;
        return;
    }
    rest(state);
}

static ivl_status_t commit(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)cfg;
    ivl_port_reply_t         reply;
    const ivl_port_request_t request = {.operation = IVL_PORT_COMMIT, .slot = (uint32_t)lane, .with.policy = *policy};
    if (exchange(port, &request, &reply))
    {
        *state = reply.state;
        return (ivl_status_t)reply.status;
    }
    rest(state);
    return IVL_OK;
}

static void step(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    (void)cfg;
    ivl_port_reply_t         reply;
    const ivl_port_request_t request = {.operation = IVL_PORT_STEP, .slot = (uint32_t)lane, .with.in = *in};
    if (exchange(port, &request, &reply))
    {
        ((chip_t *)port)->n_tick++;
        *state = reply.state;
        *out = reply.out;
        return;
    }
    rest(state);
    *out = (ivl_out_t){.phase = IVL_PHASE_DONE};
}

// ---- the pool -----------------------------------------------------------------------------------------------------------

static char **copy_command(const char *const command[])
{
    size_t n = 0;
    while (command[n] != NULL)
    {
        n++;
    }
    char **copy = calloc(n + 1, sizeof *copy);
    for (size_t i = 0; copy != NULL && i < n; i++)
    {
        copy[i] = strdup(command[i]);
        if (copy[i] == NULL)
        {
            return NULL;  // a few bytes are lost, by a program that has no memory left
        }
    }
    return copy;
}

void *ivl_pil_create(const char *const command[], char *error, size_t error_size)
{
    pool_t *pool = calloc(1, sizeof *pool);
    if (pool == NULL || (pool->command = copy_command(command)) == NULL)
    {
        snprintf(error, error_size, "out of memory");
        free(pool);
        return NULL;
    }
    pthread_mutex_init(&pool->lock, NULL);
    atomic_init(&pool->n_tick, 0);
    // a chip that has ended is an error to report, not a reason to die
    struct sigaction old;
    if (sigaction(SIGPIPE, NULL, &old) == 0 && old.sa_handler == SIG_DFL)
    {
        signal(SIGPIPE, SIG_IGN);
    }
    close_port(open_port(pool));
    if (pool->error[0] != '\0')
    {
        snprintf(error, error_size, "%s", pool->error);
        ivl_pil_free(pool);
        return NULL;
    }
    return pool;
}

void ivl_pil_attach(void *pil, void *model)
{
    ((ivl_sim_model_t *)model)->core =
        (ivl_sim_core_t){.context = pil, .open = open_port, .close = close_port, .init = init, .commit = commit, .step = step};
}

uint64_t ivl_pil_ticks(void *pil)
{
    return atomic_load(&((pool_t *)pil)->n_tick);
}

uint32_t ivl_pil_chips(void *pil)
{
    pool_t  *pool = pil;
    uint32_t n = 0;
    pthread_mutex_lock(&pool->lock);
    for (const chip_t *chip = pool->chips; chip != NULL; chip = chip->next)
    {
        n++;
    }
    pthread_mutex_unlock(&pool->lock);
    return n;
}

const char *ivl_pil_error(void *pil)
{
    return ((pool_t *)pil)->error;
}

void ivl_pil_free(void *pil)
{
    pool_t *pool = pil;
    for (chip_t *chip = pool->chips, *next; chip != NULL; chip = next)
    {
        next = chip->next;
        (void)end_chip(chip);
        free(chip);
    }
    for (char **word = pool->command; *word != NULL; word++)
    {
        free(*word);
    }
    free(pool->command);
    pthread_mutex_destroy(&pool->lock);
    free(pool);
}
