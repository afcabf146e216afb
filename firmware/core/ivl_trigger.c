/// @file ivl_trigger.c
#include "ivl_trigger.h"

ivl_snapshot_t ivl_trigger_snapshot(const ivl_sample_t *sample, const ivl_seen_t *seen, ivl_policy_id_t policy, ivl_action_t action)
{
    return (ivl_snapshot_t){
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
        .action = action,
        .policy = policy,
    };
}
