/// @file sim_rng.h
/// Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror, Shaw, SC 2011, DOI 10.1145/2063384.2063405).
///
/// A draw is a pure function of (seed, rollout, purpose, counter): no state to carry, so the result of a rollout does not
/// depend on which thread runs it, nor on what ran before.
#ifndef IVL_SIM_RNG_H
#define IVL_SIM_RNG_H

#include <stdint.h>

/// What a draw is for; each purpose has its own, independent sequence.
typedef enum
{
    IVL_SIM_DRAW_SENSOR_PHASE,  ///< offset of the pose sensor's clock
    IVL_SIM_DRAW_POSITION,      ///< pose sensor, position noise
    IVL_SIM_DRAW_VELOCITY,      ///< pose sensor, velocity noise
    IVL_SIM_DRAW_ATTITUDE,      ///< attitude noise
    IVL_SIM_DRAW_GYRO,          ///< gyro noise
    IVL_SIM_DRAW_ACCEL,         ///< accelerometer noise
    IVL_SIM_DRAW_THRUST,        ///< per-motor scatter of the thrust constant
    IVL_SIM_DRAW_POSE_DROP,     ///< pose samples that are lost
    IVL_SIM_DRAW_GYRO_BIAS,     ///< offsets of a rollout
    IVL_SIM_DRAW_ACCEL_BIAS,
    IVL_SIM_DRAW_START_POSITION,  ///< what dead reckoning starts with
    IVL_SIM_DRAW_START_VELOCITY,
    IVL_SIM_DRAW_START_ATTITUDE,
    IVL_SIM_DRAW_RREV,  ///< noise of the sensors of one number; their offset is the last index
    IVL_SIM_DRAW_RANGE,
    IVL_SIM_DRAW_FLOW,
    IVL_SIM_DRAW_RREV_DROP,
    IVL_SIM_DRAW_RANGE_DROP,
    IVL_SIM_DRAW_FLOW_DROP,
    IVL_SIM_DRAW_BATTERY,       ///< open-circuit voltage of a rollout
    IVL_SIM_DRAW_SIGHT_PLACE,   ///< where on its surface a rendered camera begins
    IVL_SIM_DRAW_SIGHT_DROP,    ///< its readings that are lost
    IVL_SIM_DRAW_RREV_OUTLIER,  ///< readings of the sensors of one number that have little to do with the truth
    IVL_SIM_DRAW_FLOW_OUTLIER,
    IVL_SIM_DRAW_FURTHER = 32,  ///< the first of those that are left for further sensors, two each
} ivl_sim_draw_t;

typedef struct
{
    uint64_t seed;    ///< of the batch
    uint64_t stream;  ///< of the rollout in the batch
} ivl_sim_rng_t;

/// The Philox4x32-10 block function, as published.
void ivl_sim_philox(const uint32_t counter[4], const uint32_t key[2], uint32_t out[4]);

/// Uniform in (0, 1), `index` counting within the purpose.
double ivl_sim_uniform(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index);

/// Four standard normal numbers (two Box-Muller pairs).
void ivl_sim_normal4(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index, double out[4]);

#endif  // IVL_SIM_RNG_H
