/// @file ivl_trigger.c
#include "ivl_trigger.h"

bool ivl_trigger_due(const ivl_policy_t *policy, ivl_cues_t cues)
{
    return cues.valid && (cues.rrev_per_s > 0.0f) && (cues.rrev_per_s >= policy->rrev_c_per_s);
}

void ivl_trigger_latch(ivl_snapshot_t *snapshot, const ivl_sample_t *sample, const ivl_seen_t *seen, const ivl_policy_t *policy)
{
    *snapshot = (ivl_snapshot_t){
        .t_us = sample->t_us,
        .t_pose_us = sample->t_pose_us,
        .p_WB_m = sample->p_WB_m,
        .v_WB_mps = sample->v_WB_mps,
        .q_WB = sample->q_WB,
        .w_B_radps = sample->w_B_radps,
        .f_B_mps2 = sample->f_B_mps2,
        .d_ceil_m = seen->ceiling.d_ceil_m,
        .d_sigma_m = seen->ceiling.d_sigma_m,
        .rrev_per_s = seen->cues.rrev_per_s,
        .of_y_radps = seen->cues.of_y_radps,
        .policy = *policy,
    };
}
