/// @file ivl_trigger.h
/// Stage 4: the trigger.  Fires once per arm cycle and latches everything known at that tick.
#ifndef IVL_TRIGGER_H
#define IVL_TRIGGER_H
#include "ivl_policy.h"

/// The world as it was at the trigger tick; all zero before.
typedef struct
{
    ivl_sample_t    sample;  ///< the sensed state
    float           d_ceil_m;
    float           d_sigma_m;
    float           rrev_per_s;
    float           of_y_radps;
    ivl_action_t    action;  ///< what the policy decided
    ivl_policy_id_t policy;  ///< which one it was
} ivl_snapshot_t;

/// Latch the trigger tick.
void ivl_trigger_snapshot(ivl_snapshot_t *snapshot, const ivl_sample_t *sample, const ivl_seen_t *seen, const ivl_policy_id_t *policy,
                          const ivl_action_t *action);
#endif  // IVL_TRIGGER_H
