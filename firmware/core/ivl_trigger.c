/// @file ivl_trigger.c
#include "ivl_trigger.h"

void ivl_trigger_snapshot(ivl_snapshot_t *snapshot, const ivl_sample_t *sample, const ivl_seen_t *seen, const ivl_policy_id_t *policy,
                          const ivl_action_t *action)
{
    snapshot->sample = *sample;
    snapshot->d_ceil_m = seen->ceiling.d_ceil_m;
    snapshot->d_sigma_m = seen->ceiling.d_sigma_m;
    snapshot->rrev_per_s = seen->cues.rrev_per_s;
    snapshot->of_y_radps = seen->cues.of_y_radps;
    snapshot->action = *action;
    snapshot->policy = *policy;
}
