#include "cf_trajectory.h"

#include <string.h>

#include "ivl_math.h"

static const float    DURATION_S_MAX = 3600.0f;
static const float    M_PER_MM = 1.0e-3f, S_PER_MS = 1.0e-3f;
static const float    RAD_PER_TENTH = 3.14159265f / 1800.0f;
static const uint32_t N_POINTS[4] = {0, 1, 3, 7};

enum
{
    HEAD_BYTES = 8,   // where a compressed trajectory begins
    PIECE_BYTES = 3,  // kinds and duration
    POINT_BYTES = 2
};

static bool is_inside(uint32_t offset, uint32_t size)
{
    return offset <= IVL_CF_TRAJECTORY_BYTES && size <= IVL_CF_TRAJECTORY_BYTES - offset;
}

bool ivl_cf_trajectory_piece(const ivl_cf_trajectories_t *t, uint32_t offset, uint32_t i, ivl_cf_piece_t *piece)
{
    const uint32_t size = (uint32_t)sizeof *piece;
    if (i >= IVL_CF_TRAJECTORY_BYTES / size || !is_inside(offset, (i + 1u) * size))
    {
        return false;
    }
    memcpy(piece, t->bytes + offset + i * size, size);
    return piece->duration_s >= 0.0f && piece->duration_s <= DURATION_S_MAX;
}

// ---- compressed

static uint32_t u16_at(const ivl_cf_trajectories_t *t, uint32_t at)
{
    return (uint32_t)t->bytes[at] | (uint32_t)t->bytes[at + 1u] << 8;
}

static float i16_at(const ivl_cf_trajectories_t *t, uint32_t at)
{
    return (float)(int16_t)u16_at(t, at);
}

/// Bytes of the piece at a place; 0 if it is the last, which has no duration, or not whole.
static uint32_t size_of_piece(const ivl_cf_trajectories_t *t, uint32_t at)
{
    if (!is_inside(at, PIECE_BYTES) || u16_at(t, at + 1u) == 0u)
    {
        return 0;
    }
    uint32_t size = PIECE_BYTES;
    for (uint32_t axis = 0; axis < IVL_CF_POLY_AXES; axis++)
    {
        size += POINT_BYTES * N_POINTS[t->bytes[at] >> (2u * axis) & 3u];
    }
    return is_inside(at, size) ? size : 0u;
}

static float duration_s_at(const ivl_cf_trajectories_t *t, uint32_t at)
{
    return (float)u16_at(t, at + 1u) * S_PER_MS;
}

/// The piece at the playhead, from where the one before has ended; behind the last, that place.
static void read_piece(const ivl_cf_trajectories_t *t, ivl_cf_playhead_t *head, const float from[IVL_CF_POLY_AXES])
{
    const uint32_t size = size_of_piece(t, head->at);
    const uint8_t  kinds = (size > 0u) ? t->bytes[head->at] : 0u;
    uint32_t       point = head->at + PIECE_BYTES;
    head->ended = size == 0u;
    head->piece.duration_s = head->ended ? 0.0f : duration_s_at(t, head->at);
    for (uint32_t axis = 0; axis < IVL_CF_POLY_AXES; axis++)
    {
        const uint32_t n = N_POINTS[kinds >> (2u * axis) & 3u];
        float          points[IVL_CF_POLY_N] = {from[axis]};
        for (uint32_t i = 0; i < n; i++, point += POINT_BYTES)
        {
            points[i + 1u] = i16_at(t, point) * ((axis < 3u) ? M_PER_MM : RAD_PER_TENTH);
        }
        ivl_cf_piece_bezier(head->piece.c[axis], points, (int)n + 1, head->piece.duration_s);
    }
    head->at += size;
}

bool ivl_cf_compressed_begin(const ivl_cf_trajectories_t *t, uint32_t offset, ivl_cf_playhead_t *head)
{
    if (!is_inside(offset, HEAD_BYTES))
    {
        return false;
    }
    const float from[IVL_CF_POLY_AXES] = {i16_at(t, offset) * M_PER_MM, i16_at(t, offset + 2u) * M_PER_MM,
                                          i16_at(t, offset + 4u) * M_PER_MM, i16_at(t, offset + 6u) * RAD_PER_TENTH};
    *head = (ivl_cf_playhead_t){.at = offset + HEAD_BYTES};
    read_piece(t, head, from);
    return true;
}

void ivl_cf_compressed_seek(const ivl_cf_trajectories_t *t, ivl_cf_playhead_t *head, float t_s)
{
    while (!head->ended && t_s >= head->begin_s + head->piece.duration_s)
    {
        const ivl_cf_goal_t end = ivl_cf_piece_at(&head->piece, head->piece.duration_s);
        const float         from[IVL_CF_POLY_AXES] = {end.p_W_m.x, end.p_W_m.y, end.p_W_m.z, end.yaw_rad};
        head->begin_s += head->piece.duration_s;
        read_piece(t, head, from);
    }
}

float ivl_cf_compressed_duration_s(const ivl_cf_trajectories_t *t, uint32_t offset)
{
    float    duration_s = 0.0f;
    uint32_t size;
    for (uint32_t at = offset + HEAD_BYTES; (size = size_of_piece(t, at)) > 0u; at += size)
    {
        duration_s += duration_s_at(t, at);
    }
    return duration_s;
}
