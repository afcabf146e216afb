/// @file world_reading.h
/// Sensors of one number beside the state estimate, each at its own rate, late, noisy, coarse, limited, now and then silent:
/// RREV as a camera tells it, range along b_z, lateral flow.
#ifndef IVL_WORLD_READING_H
#define IVL_WORLD_READING_H

#include "phys_state.h"
#include "sim_rng.h"

typedef enum
{
    IVL_SIM_READING_RREV,
    IVL_SIM_READING_RANGE,
    IVL_SIM_READING_FLOW,
    IVL_SIM_READINGS
} ivl_sim_reading_kind_t;

enum
{
    IVL_SIM_READING_QUEUE = 32  ///< samples under way: more than delay_max * rate_max
};

typedef struct
{
    double   due_s[IVL_SIM_READING_QUEUE];  ///< instant of arrival
    double   value[IVL_SIM_READING_QUEUE];
    bool     valid[IVL_SIM_READING_QUEUE];
    double   next_s;  ///< next sampling instant
    double   bias;    ///< of this rollout
    uint32_t n_taken, n_delivered;
} ivl_sim_reading_t;

/// Sensors that start before the rollout, each with a clock of its own.
void ivl_sim_readings_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, ivl_sim_reading_t readings[IVL_SIM_READINGS]);

/// Takes the samples that fell due, from the present state (exact for constant acceleration), and hands over what has arrived.
void ivl_sim_readings_read(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, const double a_W_mps2[3],
                           double t_s, ivl_sim_reading_t readings[IVL_SIM_READINGS], ivl_in_t *in);

#endif  // IVL_WORLD_READING_H
