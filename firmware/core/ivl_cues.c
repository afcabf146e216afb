/// @file ivl_cues.c
#include "ivl_cues.h"

ivl_cues_t ivl_cues_compute(ivl_ceiling_t ceiling, float along_mps)
{
    if (ceiling.valid && (ceiling.d_ceil_m > 0.0f))
    {
        return (ivl_cues_t){
            .rrev_per_s = ceiling.v_close_mps / ceiling.d_ceil_m,
            .of_y_radps = -along_mps / ceiling.d_ceil_m,
            .valid = true,
        };
    }
    return (ivl_cues_t){0};
}

// beyond this the sensor's value is no flow
static const float FLOW_RADPS_MAX = 100.0f;

// as old as cfg->d_old_s_max may be
static const uint64_t AGE_US_MAX = 1000000u;

void ivl_cues_take_flow(const ivl_cfg_t *cfg, const ivl_in_t *in, ivl_cues_t *cues)
{
    const uint64_t age_us = in->t_us - in->flow.t_us;
    if ((cfg->of_source != 0u) && cues->valid && (in->flow.valid != 0u) && (age_us <= AGE_US_MAX) &&
        ((float)(uint32_t)age_us * 1.0e-6f <= cfg->d_old_s_max) && (in->flow.value >= -FLOW_RADPS_MAX) &&
        (in->flow.value <= FLOW_RADPS_MAX))
    {
        cues->of_y_radps = in->flow.value;
    }
}
