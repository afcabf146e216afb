/// @file ivl_history.h
/// What the accelerometer told over the last ticks, as integrals: the change of speed and of position up to any recent instant.
#ifndef IVL_HISTORY_H
#define IVL_HISTORY_H
#include <stdbool.h>
#include <stdint.h>

#define IVL_HISTORY_TICKS 128u  ///< a power of two: 126 ms at 1 kHz, so that no delay that is allowed is forgotten

/// Integrals of the acceleration since the start.
typedef struct
{
    float v_mps;
    float p_m;
} ivl_motion_t;

typedef struct
{
    uint32_t     n;                      ///< last tick, 0 at the start
    float        a_mps2;                 ///< of the last tick
    ivl_motion_t at[IVL_HISTORY_TICKS];  ///< tick n in at[n modulo its size]; last, so that offsets of the others stay short
} ivl_history_t;

/// Both integrals are 0 now.
void ivl_history_start(ivl_history_t *history);

/// One tick: a constant acceleration since the last one.                                                           [MODEL eq. 13.4]
void ivl_history_push(ivl_history_t *history, float a_mps2, float dt_s);

/// Integrals a time after the last tick, if the acceleration stays as it is.
ivl_motion_t ivl_history_after(const ivl_history_t *history, float t_s);

/// Integrals a time before the last tick, between ticks by interpolation; a negative time is one after it.
/// @param[in]  ago_ticks  the same time in ticks
/// @param[out] motion     unchanged if the result is false
/// @return false if that is before the start or longer ago than is remembered
bool ivl_history_at(const ivl_history_t *history, float ago_s, float ago_ticks, ivl_motion_t *motion);
#endif  // IVL_HISTORY_H
