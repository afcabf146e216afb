/// @file world_hover.h
/// Flights without a landing: the core hovers from set-point to set-point, and the flight is recorded.
#ifndef IVL_WORLD_HOVER_H
#define IVL_WORLD_HOVER_H

#include "world_rollout.h"

typedef struct
{
    double t_s;       ///< time from which it holds
    double p_W_m[3];  ///< position to hold
} ivl_sim_setpoint_t;

/// One flight: it starts level and at rest at its first set-point, with rotors at hover.
typedef struct
{
    ivl_sim_rng_t             rng;
    const ivl_sim_setpoint_t *setpoint;  ///< in the order of their times; the first one holds from the start
    size_t                    n_setpoint;
    ivl_sim_trace_t          *rows;  ///< receives n_rows rows, one each period from time 0 on; the flight ends with the last
} ivl_sim_hover_t;

/// Flies n flights, several at a time.  Each one's rows depend on it alone.  When a motion ceases to be one, t_s of the rows that are left is NaN.
void ivl_sim_hover(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n, double period_s, size_t n_rows);
void IVL_SIM_OF_WIDTH(ivl_sim_hover)(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n, double period_s,
                                     size_t n_rows);

#endif  // IVL_WORLD_HOVER_H
