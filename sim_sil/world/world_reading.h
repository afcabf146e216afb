/// @file world_reading.h
/// Sensors of one number beside the state estimate, each at its own rate, late, noisy, coarse, limited, now and then silent.
/// Which ones there are is a table of the model: see world_reading_rows.h.
#ifndef IVL_WORLD_READING_H
#define IVL_WORLD_READING_H

#include "sim_rng.h"
#include "world_scene.h"

enum
{
    IVL_SIM_READING_QUEUE = 64,  ///< samples under way: more than delay_max * rate_max
    IVL_SIM_READINGS_MAX = 8     ///< rows of a table
};

/// A sensor's numbers, in its own unit.
typedef struct
{
    double         rate_hz;                     ///< 0: there is none
    double         delay_s;                     ///< from the sampling instant to the arrival
    double         noise;                       ///< standard deviation: constant part
    double         noise_norm;                  ///< and part of the value
    double         bias;                        ///< standard deviation of the offset, drawn once a rollout
    double         bias_norm;                   ///< of an error that is a part of the value, drawn likewise
    double         mean_norm;                   ///< mean error, part of the value
    double         correlation;                 ///< of the noise of two samples in a row
    double         outlier;                     ///< chance of a further error,
    double         outlier_size, outlier_norm;  ///< whose standard deviation is the one, and the other part of the value
    double         resolution;                  ///< values are multiples of this; 0: not rounded
    double         lo, hi;                      ///< a value outside is told as invalid
    double         drop_norm;                   ///< chance that a sample is told as invalid
    ivl_sim_draw_t draw_noise, draw_drop, draw_outlier;
} ivl_sim_sensor_t;

/// A row: a sensor's name and unit, what it measures, its numbers, and the member of the core's input that it is told in.
typedef struct
{
    const char *name, *unit;
    double (*truth)(const ivl_sim_scene_t *scene, double age_s);  ///< value `age_s` ago
    ivl_sim_sensor_t (*sensor)(const ivl_sim_params_t *raw);
    ivl_reading_t *(*into)(ivl_in_t *in);
} ivl_sim_reading_row_t;

struct ivl_sim_reading_table
{
    const ivl_sim_reading_row_t *row;
    size_t                       n;
};

/// The rows that a model has unless it is given others.
extern const ivl_sim_reading_table_t ivl_sim_readings;

typedef struct
{
    double   due_s[IVL_SIM_READING_QUEUE];  ///< instant of arrival
    double   value[IVL_SIM_READING_QUEUE];
    bool     valid[IVL_SIM_READING_QUEUE];
    double   next_s;    ///< next sampling instant
    double   bias;      ///< of this rollout
    double   scale;     ///< likewise: error over value
    double   noise[2];  ///< of the last sample, over its standard deviation: constant part, and part of the value
    uint32_t n_taken, n_delivered;
} ivl_sim_reading_t;

/// True if the parameters switch any of the model's sensors on.
bool ivl_sim_readings_any(const ivl_sim_model_t *model);

/// Sensors that start before the rollout, each with a clock of its own.
void ivl_sim_readings_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, ivl_sim_reading_t readings[IVL_SIM_READINGS_MAX]);

/// Takes the samples that fell due, from the present scene (exact for constant acceleration), and hands over what has arrived.
void ivl_sim_readings_read(const ivl_sim_scene_t *scene, const ivl_sim_rng_t *rng, double t_s,
                           ivl_sim_reading_t readings[IVL_SIM_READINGS_MAX], ivl_in_t *in);

#endif  // IVL_WORLD_READING_H
