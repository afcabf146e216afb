/// @file world_reading_rows.h
/// The sensors of one number, one row each.  Beside its row a sensor is a file, world_reading_<name>.c, that says what the truth is and
/// which of the world's parameters are the sensor's.
#ifndef IVL_WORLD_READING_ROWS_H
#define IVL_WORLD_READING_ROWS_H

#include "world_reading.h"

/// X(name, unit, member of ivl_in_t that is told)
#define IVL_SIM_READING_ROWS(X)                                                                                                            \
    X(rrev, "1/s", rrev)                                                                                                                   \
    X(range, "m", range)                                                                                                                   \
    X(flow, "rad/s", flow)

#define IVL_SIM_READING_FUNCTIONS(name, unit, into)                                                                                        \
    double           ivl_sim_truth_##name(const ivl_sim_scene_t *scene, double age_s);                                                     \
    ivl_sim_sensor_t ivl_sim_sensor_##name(const ivl_sim_params_t *raw);
IVL_SIM_READING_ROWS(IVL_SIM_READING_FUNCTIONS)
#undef IVL_SIM_READING_FUNCTIONS

#endif  // IVL_WORLD_READING_ROWS_H
