/// @file player.h
/// Plays random sequences of events, makes the first that breaks something shorter until nothing can be left out of it, and prints it.
/// In a header, since each program that includes it has a world of its own.
#ifndef PLAYER_H
#define PLAYER_H
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    EVENTS_MAX = 60
};

typedef struct
{
    uint8_t kind, a, b;
} event_t;

typedef struct
{
    event_t event[EVENTS_MAX];
    int     n;
} sequence_t;

typedef struct
{
    const char        *program;
    const char *const *names;                   ///< of the kinds of events
    sequence_t (*make)(uint32_t seed);          ///< a random sequence
    const char *(*play)(const sequence_t *s);   ///< what it breaks; NULL: nothing
    void (*tell)(unsigned long number);         ///< prints what was played, on one line
    bool (*visited_all)(unsigned long number);  ///< whether each event came up, and whatever else must
} player_t;

static uint32_t next_random(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

static uint32_t random_of(uint32_t seed)
{
    const uint32_t state = seed * 2654435761u + 0x9e3779b9u;
    return (state == 0u) ? 1u : state;
}

static void add(sequence_t *s, event_t e)
{
    if (s->n < EVENTS_MAX)
    {
        s->event[s->n++] = e;
    }
}

static sequence_t without(const sequence_t *s, int from, int n)
{
    sequence_t shorter = {.n = s->n - n};
    memcpy(shorter.event, s->event, (size_t)from * sizeof s->event[0]);
    memcpy(shorter.event + from, s->event + from + n, (size_t)(s->n - from - n) * sizeof s->event[0]);
    return shorter;
}

/// Leave out what can be left out, the largest pieces first, as long as the same thing breaks.
static sequence_t shortest(const player_t *player, sequence_t s, const char *what)
{
    for (int n = s.n / 2; n >= 1; n /= 2)
    {
        for (int from = 0; from + n <= s.n;)
        {
            const sequence_t  shorter = without(&s, from, n);
            const char *const breaks_now = player->play(&shorter);
            if ((breaks_now != NULL) && (strcmp(breaks_now, what) == 0))
            {
                s = shorter;
            }
            else
            {
                from++;
            }
        }
    }
    return s;
}

static void print(const player_t *player, const sequence_t *s)
{
    for (int i = 0; i < s->n; i++)
    {
        printf("    %2d  %-13s %3u %3u\n", i + 1, player->names[s->event[i].kind], s->event[i].a, s->event[i].b);
    }
}

/// @return exit code of the program
static int play_all(const player_t *player, unsigned long number, unsigned long seed)
{
    for (unsigned long i = 0; i < number; i++)
    {
        const sequence_t  s = player->make((uint32_t)(seed * 1000003u + i));
        const char *const what = player->play(&s);
        if (what != NULL)
        {
            const sequence_t least = shortest(player, s, what);
            printf("%s: number %lu of seed %lu: %s\n", player->program, i, seed, what);
            print(player, &least);
            return 1;
        }
    }
    player->tell(number);
    if ((number >= 1000u) && !player->visited_all(number))
    {
        printf("%s: some event or phase never came up\n", player->program);
        return 1;
    }
    return 0;
}

/// Command line: NUMBER [SEED] [--traitor].
static int play_as_asked(const player_t *player, int argc, char **argv, bool *has_traitor)
{
    *has_traitor = (argc > 1) && (strcmp(argv[argc - 1], "--traitor") == 0);
    const int           n_numbers = argc - 1 - (*has_traitor ? 1 : 0);
    const unsigned long number = (n_numbers > 0) ? strtoul(argv[1], NULL, 10) : 0;
    const unsigned long seed = (n_numbers > 1) ? strtoul(argv[2], NULL, 10) : 1;
    if ((number == 0u) || (n_numbers > 2))
    {
        fprintf(stderr, "usage: %s NUMBER [SEED] [--traitor]\n", player->program);
        return 2;
    }
    return play_all(player, number, seed);
}
#endif  // PLAYER_H
