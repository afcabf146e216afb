#include "cf_room.h"

// between vehicles at the start
static const double SPACING_M = 1.0;

static void write_moment(ivl_cf_moment_t *to, const ivl_cf_place_t *from)
{
    atomic_store_explicit(&to->t_us, from->t_us, memory_order_relaxed);
    atomic_store_explicit(&to->is_there, from->is_there, memory_order_relaxed);
    for (int i = 0; i < 3; i++)
    {
        atomic_store_explicit(&to->p_W_m[i], from->p_W_m[i], memory_order_relaxed);
        atomic_store_explicit(&to->v_W_mps[i], from->v_W_mps[i], memory_order_relaxed);
    }
}

static void read_moment(const ivl_cf_moment_t *from, ivl_cf_place_t *to)
{
    to->t_us = atomic_load_explicit(&from->t_us, memory_order_relaxed);
    to->is_there = atomic_load_explicit(&from->is_there, memory_order_relaxed);
    for (int i = 0; i < 3; i++)
    {
        to->p_W_m[i] = atomic_load_explicit(&from->p_W_m[i], memory_order_relaxed);
        to->v_W_mps[i] = atomic_load_explicit(&from->v_W_mps[i], memory_order_relaxed);
    }
}

void ivl_cf_room_tell(ivl_cf_room_t *room, size_t vehicle, const ivl_cf_place_t *place)
{
    ivl_cf_track_t *track = &room->track[vehicle];
    const uint64_t  n = atomic_load_explicit(&track->n_told, memory_order_relaxed);
    atomic_store_explicit(&track->n_begun, n + 1u, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    write_moment(&track->moment[n % IVL_CF_ROOM_MOMENTS], place);
    atomic_store_explicit(&track->n_told, n + 1u, memory_order_release);
}

/// Walks back from the last moment: vehicles that run together are a few moments apart.  One less than all is remembered, since the oldest is
/// where the next is being written.
/// @return number of the moment
static uint64_t find(const ivl_cf_track_t *track, uint64_t n_told, uint64_t t_us, ivl_cf_place_t *place)
{
    const uint64_t oldest = (n_told < IVL_CF_ROOM_MOMENTS) ? 0u : n_told + 1u - IVL_CF_ROOM_MOMENTS;
    uint64_t       i = n_told;
    do
    {
        i--;
        read_moment(&track->moment[i % IVL_CF_ROOM_MOMENTS], place);
    } while (i > oldest && place->t_us > t_us);
    return i;
}

/// Whether that moment has not been written over since.
static bool is_whole(const ivl_cf_track_t *track, uint64_t i)
{
    atomic_thread_fence(memory_order_acquire);
    return atomic_load_explicit(&track->n_begun, memory_order_relaxed) <= i + IVL_CF_ROOM_MOMENTS;
}

bool ivl_cf_room_look(const ivl_cf_room_t *room, size_t vehicle, uint64_t t_us, ivl_cf_place_t *place)
{
    const ivl_cf_track_t *track = &room->track[vehicle];
    uint64_t              i;
    do
    {
        const uint64_t n_told = atomic_load_explicit(&track->n_told, memory_order_acquire);
        if (n_told == 0u)
        {
            return false;
        }
        i = find(track, n_told, t_us, place);
    } while (!is_whole(track, i));
    return place->is_there;
}

void ivl_cf_room_spot(size_t n, size_t n_vehicles, double p_W_m[2])
{
    size_t side = 1;
    while (side * side < n_vehicles)
    {
        side++;
    }
    p_W_m[0] = SPACING_M * (double)(n / side);
    p_W_m[1] = SPACING_M * (double)(n % side);
}
