/// @file cf_trajectory.h
/// Uploaded trajectories: the memory that holds them, which of it is which trajectory, and how their pieces are read.
///
/// Two forms lie in the memory.  A plain one is a row of ivl_cf_piece_t.  A compressed one begins with x, y, z in mm and the yaw in tenths of a
/// degree (i16 each); its pieces are a byte of four kinds (two bits each: x, y, z, yaw), a duration in ms (u16) and the control points of Bezier
/// curves without the first, which is where the piece before ended: 0, 1, 3 or 7 of i16.  A piece of 0 ms ends it.
#ifndef IVL_CF_TRAJECTORY_H
#define IVL_CF_TRAJECTORY_H
#include "cf_poly.h"

enum
{
    IVL_CF_TRAJECTORY_BYTES = 4096,
    IVL_CF_TRAJECTORIES = 31,
    IVL_CF_TRAJECTORY_IN_MEMORY = 1,  ///< the only place that exists
    IVL_CF_TRAJECTORY_PLAIN = 0,
    IVL_CF_TRAJECTORY_COMPRESSED = 1
};

typedef struct
{
    uint8_t  location;  ///< 0: not defined
    uint8_t  type;
    uint32_t offset;  ///< in the memory
    uint8_t  n_pieces;
} ivl_cf_definition_t;

typedef struct
{
    uint8_t             bytes[IVL_CF_TRAJECTORY_BYTES];
    ivl_cf_definition_t defined[IVL_CF_TRAJECTORIES];
} ivl_cf_trajectories_t;

/// Piece number i of a plain trajectory.  @return false if it is not in the memory whole, or its duration makes no sense
bool ivl_cf_trajectory_piece(const ivl_cf_trajectories_t *t, uint32_t offset, uint32_t i, ivl_cf_piece_t *piece);

/// Where a compressed trajectory is being read.
typedef struct
{
    uint32_t       at;     ///< of the next piece
    bool           ended;  ///< there is none: `piece` stands where the last one ended
    float          begin_s;
    ivl_cf_piece_t piece;
} ivl_cf_playhead_t;

/// To its first piece.  @return false if it does not begin in the memory
bool ivl_cf_compressed_begin(const ivl_cf_trajectories_t *t, uint32_t offset, ivl_cf_playhead_t *head);

/// To the piece of this time, which does not go back.
void ivl_cf_compressed_seek(const ivl_cf_trajectories_t *t, ivl_cf_playhead_t *head, float t_s);

/// Duration of all its pieces, s.
float ivl_cf_compressed_duration_s(const ivl_cf_trajectories_t *t, uint32_t offset);
#endif  // IVL_CF_TRAJECTORY_H
