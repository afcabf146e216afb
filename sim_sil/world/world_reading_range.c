/// Range along b_z.
#include "world_reading_rows.h"

/// Infinite where the surface is out of the sensor's sight.
double ivl_sim_truth_range(const ivl_sim_scene_t *scene, double age_s)
{
    const double facing = ivl_sim_scene_facing(scene);
    return (facing > 0.0) ? ivl_sim_scene_distance_m(scene, age_s) / facing : (double)INFINITY;
}

ivl_sim_sensor_t ivl_sim_sensor_range(const ivl_sim_params_t *raw)
{
    return (ivl_sim_sensor_t){.rate_hz = raw->range_rate_hz,
                              .delay_s = raw->range_delay_s,
                              .noise = raw->range_noise_m,
                              .bias = raw->range_bias_m,
                              .resolution = raw->range_resolution_m,
                              .lo = raw->range_min_m,
                              .hi = raw->range_max_m,
                              .drop_norm = raw->range_drop_norm,
                              .draw_noise = IVL_SIM_DRAW_RANGE,
                              .draw_drop = IVL_SIM_DRAW_RANGE_DROP};
}
