/// Lateral flow as a sensor that faces up tells it.
#include "world_reading_rows.h"

double ivl_sim_truth_flow(const ivl_sim_scene_t *scene, double age_s)
{
    return -ivl_sim_scene_forward_mps(scene, age_s) / ivl_sim_scene_distance_m(scene, age_s);
}

ivl_sim_sensor_t ivl_sim_sensor_flow(const ivl_sim_params_t *raw)
{
    return (ivl_sim_sensor_t){.rate_hz = raw->flow_rate_hz,
                              .delay_s = raw->flow_delay_s,
                              .noise = raw->flow_noise_radps,
                              .bias = raw->flow_bias_radps,
                              .correlation = raw->flow_correlation_norm,
                              .outlier = raw->flow_outlier_norm,
                              .outlier_size = raw->flow_outlier_size_radps,
                              .resolution = raw->flow_resolution_radps,
                              .lo = -raw->flow_max_radps,
                              .hi = raw->flow_max_radps,
                              .drop_norm = raw->flow_drop_norm,
                              .draw_noise = IVL_SIM_DRAW_FLOW,
                              .draw_drop = IVL_SIM_DRAW_FLOW_DROP,
                              .draw_outlier = IVL_SIM_DRAW_FLOW_OUTLIER};
}
