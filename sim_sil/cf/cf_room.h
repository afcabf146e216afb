/// @file cf_room.h
/// A room with several vehicles: each tells where it is, and sees where the others are.
///
/// The vehicles are processes; the room is memory that they share.  Each vehicle alone writes its own track, and anybody reads it.  A track
/// remembers the last second or so, so that a vehicle sees where another one was at a time of its own, whichever of the two was stepped first.
/// Times are those of the vehicles, which begin together.  Never waits: a vehicle that is behind is seen where it was last.
#ifndef IVL_CF_ROOM_H
#define IVL_CF_ROOM_H
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum
{
    IVL_CF_ROOM_VEHICLES = 64,  ///< at most
    IVL_CF_ROOM_MOMENTS = 1024  ///< of a track that are remembered
};

/// Where a vehicle was at a time.
typedef struct
{
    uint64_t t_us;
    bool     is_there;  ///< false: it flies a landing of its own, for which it was taken out of the room
    double   p_W_m[3], v_W_mps[3];
} ivl_cf_place_t;

typedef struct
{
    _Atomic uint64_t t_us;
    atomic_bool      is_there;
    _Atomic double   p_W_m[3], v_W_mps[3];
} ivl_cf_moment_t;

typedef struct
{
    _Atomic uint64_t n_begun, n_told;  ///< moments, since the start; the first one runs ahead while a moment is being written
    ivl_cf_moment_t  moment[IVL_CF_ROOM_MOMENTS];
} ivl_cf_track_t;

/// All zeros: an empty room for so many vehicles.
typedef struct ivl_cf_room_t
{
    size_t         n;  ///< vehicles
    ivl_cf_track_t track[IVL_CF_ROOM_VEHICLES];
} ivl_cf_room_t;

/// A vehicle tells where it is.
/// @param[in] place  at a later time than the one before
void ivl_cf_room_tell(ivl_cf_room_t *room, size_t vehicle, const ivl_cf_place_t *place);

/// Where a vehicle was at a time; at its last time, if that is earlier, or at the first that is remembered, if that is later.
/// @return false if it is not in the room
bool ivl_cf_room_look(const ivl_cf_room_t *room, size_t vehicle, uint64_t t_us, ivl_cf_place_t *place);

/// Where vehicle number n begins: on a grid around which there is room to fly; the first one at (0, 0).
void ivl_cf_room_spot(size_t n, size_t n_vehicles, double p_W_m[2]);

#endif  // IVL_CF_ROOM_H
