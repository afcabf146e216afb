/// RREV as a camera tells it.
#include "world_reading_rows.h"

double ivl_sim_truth_rrev(const ivl_sim_scene_t *scene, double age_s)
{
    return ivl_sim_scene_closing_mps(scene, age_s) / ivl_sim_scene_distance_m(scene, age_s);
}

ivl_sim_sensor_t ivl_sim_sensor_rrev(const ivl_sim_params_t *raw)
{
    return (ivl_sim_sensor_t){.rate_hz = raw->rrev_rate_hz,
                              .delay_s = raw->rrev_delay_s,
                              .noise = raw->rrev_noise_per_s,
                              .noise_norm = raw->rrev_noise_rel_norm,
                              .bias_norm = raw->rrev_bias_rel_norm,
                              .mean_norm = raw->rrev_mean_rel_norm,
                              .correlation = raw->rrev_correlation_norm,
                              .outlier = raw->rrev_outlier_norm,
                              .outlier_norm = raw->rrev_outlier_rel_norm,
                              .resolution = raw->rrev_resolution_per_s,
                              .lo = -raw->rrev_max_per_s,
                              .hi = raw->rrev_max_per_s,
                              .drop_norm = raw->rrev_drop_norm,
                              .draw_noise = IVL_SIM_DRAW_RREV,
                              .draw_drop = IVL_SIM_DRAW_RREV_DROP,
                              .draw_outlier = IVL_SIM_DRAW_RREV_OUTLIER};
}
