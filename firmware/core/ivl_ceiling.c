/// @file ivl_ceiling.c
#include "ivl_ceiling.h"

ivl_ceiling_t ivl_ceiling_compute(const ivl_cfg_t *cfg, const ivl_sense_t *sense)
{
    const float v_mps = sense->rel.close_mps;
    const float sampled_m = cfg->h_ceil_m - sense->rel.height_m;
    // the port tells when a position arrived; how old it was by then is a measured constant
    const float d_ceil_m = (cfg->d_predict != 0u) ? sampled_m - v_mps * (sense->age_s + cfg->pose_latency_s) : sampled_m;
    if (sense->pose_fresh && (d_ceil_m >= cfg->d_ceil_m_min) && (d_ceil_m <= cfg->d_ceil_m_max) &&
        (cfg->height_sigma_m <= cfg->d_sigma_norm_max * d_ceil_m))
    {
        return (ivl_ceiling_t){
            .d_ceil_m = d_ceil_m,
            .v_close_mps = v_mps,
            .d_sigma_m = cfg->height_sigma_m,
            .age_s = sense->age_s,
            .valid = true,
        };
    }
    return (ivl_ceiling_t){.age_s = sense->age_s};
}
