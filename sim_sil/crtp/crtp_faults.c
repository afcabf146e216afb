#include "crtp_faults.h"

#include <stdlib.h>
#include <string.h>

#include "sim_rng.h"

enum
{
    DRAW_LOSS,
    DRAW_JITTER,
    DRAW_REORDER,
    DRAW_DUPLICATE,
    DRAWS,
    CAPACITY_FIRST = 256
};

void ivl_crtp_faults_init(ivl_crtp_faults_t *faults)
{
    memset(faults, 0, sizeof *faults);
}

void ivl_crtp_faults_free(ivl_crtp_faults_t *faults)
{
    free(faults->queue);
    ivl_crtp_faults_init(faults);
}

bool ivl_crtp_faults_idle(const ivl_crtp_faults_t *faults, uint64_t now_us)
{
    const ivl_crtp_fault_cfg_t *c = &faults->cfg;
    const bool any = (c->loss > 0.0f) || (c->delay_ms > 0.0f) || (c->jitter_ms > 0.0f) || (c->reorder > 0.0f) || (c->duplicate > 0.0f);
    return !any && (faults->n == 0u) && (now_us >= faults->cut_until_us);
}

// ---- heap

static bool before(const ivl_crtp_datagram_t *a, const ivl_crtp_datagram_t *b)
{
    return (a->due_us != b->due_us) ? (a->due_us < b->due_us) : (a->order < b->order);
}

static void swap(ivl_crtp_datagram_t *a, ivl_crtp_datagram_t *b)
{
    const ivl_crtp_datagram_t t = *a;
    *a = *b;
    *b = t;
}

static bool has_room(ivl_crtp_faults_t *faults)
{
    if (faults->n < faults->capacity)
    {
        return true;
    }
    const size_t         wanted = (faults->capacity == 0u) ? CAPACITY_FIRST : 2u * faults->capacity;
    ivl_crtp_datagram_t *queue = (wanted <= IVL_CRTP_UNDER_WAY_MAX) ? realloc(faults->queue, wanted * sizeof *queue) : NULL;
    if (queue == NULL)
    {
        return false;
    }
    faults->queue = queue;
    faults->capacity = wanted;
    return true;
}

// a packet for which there is no room is lost, as in a router whose buffer is full
static bool push(ivl_crtp_faults_t *faults, const ivl_crtp_datagram_t *datagram, uint64_t due_us)
{
    if (!has_room(faults))
    {
        return false;
    }
    size_t i = faults->n++;
    faults->queue[i] = *datagram;
    faults->queue[i].due_us = due_us;
    faults->queue[i].order = faults->order++;
    for (; (i > 0u) && before(&faults->queue[i], &faults->queue[(i - 1u) / 2u]); i = (i - 1u) / 2u)
    {
        swap(&faults->queue[i], &faults->queue[(i - 1u) / 2u]);
    }
    return true;
}

static void pop(ivl_crtp_faults_t *faults)
{
    ivl_crtp_datagram_t *q = faults->queue;
    q[0] = q[--faults->n];
    for (size_t i = 0;;)
    {
        size_t first = i;
        for (size_t child = 2u * i + 1u; child <= 2u * i + 2u; child++)
        {
            if ((child < faults->n) && before(&q[child], &q[first]))
            {
                first = child;
            }
        }
        if (first == i)
        {
            return;
        }
        swap(&q[i], &q[first]);
        i = first;
    }
}

// ---- faults

// uniform in [0, 1), one each
static void draw(const ivl_crtp_faults_t *faults, ivl_crtp_direction_t direction, double u[DRAWS])
{
    const uint32_t counter[4] = {faults->n_seen[direction], (uint32_t)direction, 0x4c494e4bu, 0u};
    const uint32_t key[2] = {faults->cfg.seed, 0u};
    uint32_t       bits[4];
    ivl_sim_philox(counter, key, bits);
    for (int i = 0; i < DRAWS; i++)
    {
        u[i] = (double)bits[i] / 4294967296.0;
    }
}

void ivl_crtp_faults_put(ivl_crtp_faults_t *faults, uint64_t now_us, const ivl_crtp_datagram_t *datagram)
{
    const ivl_crtp_fault_cfg_t *c = &faults->cfg;
    const ivl_crtp_direction_t  direction = datagram->direction;
    double                      u[DRAWS];
    draw(faults, direction, u);
    faults->n_seen[direction]++;
    if ((now_us < faults->cut_until_us) || (u[DRAW_LOSS] < (double)c->loss))
    {
        faults->n_lost++;
        return;
    }
    uint64_t due_us = now_us + (uint64_t)(1000.0 * ((double)c->delay_ms + u[DRAW_JITTER] * (double)c->jitter_ms));
    if (due_us < faults->last_due_us[direction])
    {
        due_us = faults->last_due_us[direction];
    }
    if (u[DRAW_REORDER] < (double)c->reorder)
    {
        due_us += IVL_CRTP_REORDER_HOLD_US;
        faults->n_reordered++;
    }
    else
    {
        faults->last_due_us[direction] = due_us;
    }
    if (!push(faults, datagram, due_us))
    {
        faults->n_lost++;
    }
    else if ((u[DRAW_DUPLICATE] < (double)c->duplicate) && push(faults, datagram, due_us))
    {
        faults->n_duplicated++;
    }
}

bool ivl_crtp_faults_take(ivl_crtp_faults_t *faults, uint64_t now_us, ivl_crtp_datagram_t *datagram)
{
    if ((faults->n == 0u) || (faults->queue[0].due_us > now_us))
    {
        return false;
    }
    *datagram = faults->queue[0];
    pop(faults);
    return true;
}

uint64_t ivl_crtp_faults_next_us(const ivl_crtp_faults_t *faults)
{
    return (faults->n > 0u) ? faults->queue[0].due_us : UINT64_MAX;
}
